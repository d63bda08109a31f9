# SPDX-License-Identifier: Apache-2.0
"""A primal-dual interior-point method for the transcribed problem.

Adaptive barrier parameter after Vanderbei and Shanno (1999), steps accepted where the barrier
function or the infeasibility falls, as by a filter of one entry (Waechter and Biegler 2006), and
where the exact Hessian is not convex enough the convex part of it instead.

Iterations are driven from here, their stages compiled one by one: as a single kernel they would
take minutes to compile.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from riem_planner.least_time.ends import end_conditions, join
from riem_planner.least_time.linear import infeasibility, linearise
from riem_planner.least_time.model import Iterate, Linear, Model, Riccati, Step
from riem_planner.least_time.newton import backward, forward
from riem_planner.least_time.steps import accept, dual_steps, longest, move

_TOLERANCE = 1e-6  # of constraints, steps and ends
_LATE = 1e-5  # barrier parameter from which on steps are held to the constraints
_DAMPING = 100.0  # the least, times the weight of changes of acceleration
_HALVINGS = 5
_HOPELESS = 12  # iterations in a row whose steps had to be cut to less than a twentieth


class Outcome(Enum):
    """How the iterations ended."""

    CONVERGED = "to tolerance"
    STALLED = "too many iterations, or steps that hardly moved"
    SINGULAR = "no direction of descent"


class _Solve:
    """One run from an iterate on, which is changed in place."""

    def __init__(self, iterate: Iterate, model: Model, used: NDArray[np.bool_], mu: float) -> None:
        self._iterate, self._model, self._used, self._mu = iterate, model, used, mu
        n, c = used.shape[0] - 1, used.shape[1]
        slots, sets = len(model.slots), len(model.sets)
        self._linear = Linear(
            np.zeros((n + 1, slots, 3)), np.zeros((n + 1, slots, 3)),
            np.zeros((n + 1, slots, 3, 13)), np.zeros((n + 1, c)),
            np.zeros((n + 1, sets, 3)), np.zeros((n + 1, sets, 3, 3)), np.zeros((n + 1, sets)),
            np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3, 9)),
        )  # fmt: skip
        self._step = Step(
            np.zeros((n + 1, 10)), np.zeros((n, 3)), np.zeros((n + 1, c)), np.zeros((n + 1, c)),
            np.zeros((n + 1, 3)),
        )  # fmt: skip
        self._trial = Iterate(
            iterate.q.copy(), iterate.V.copy(), iterate.A.copy(), iterate.p.copy(),
            np.ones((n + 1, c)), iterate.z, iterate.costates,
        )  # fmt: skip
        linearise(iterate, model, self._linear, True)
        np.maximum(iterate.s, -self._linear.c, out=iterate.s)
        iterate.s[~used] = 1.0
        iterate.z[used] = mu / iterate.s[used]
        self._ends = end_conditions(iterate, model)
        conditions = self._ends[1].size
        self._riccati = Riccati(
            np.empty((10, 10)), np.empty((10, 1 + conditions)), np.empty((n, 3, 11 + conditions)),
            np.empty((n + 1, 3, 10)), np.empty((n + 1, 3, 1 + conditions)),
            np.empty((conditions, conditions)), np.empty(conditions),
        )  # fmt: skip
        self._missed, self.worst, self._logarithms = self._infeasibility(iterate)
        self._count = int(np.count_nonzero(used))
        self.mean = mu
        self._damping, self._least_damping = 0.0, _DAMPING * model.weight * n

    def _infeasibility(self, iterate: Iterate) -> tuple[float, float, float]:
        _, goal, _, start = self._ends
        linear, used = self._linear, self._used
        return infeasibility(iterate, linear, used, goal, start)  # type: ignore[no-any-return]

    def advance(self, last: float) -> float | None:
        """One iteration; the length of the step, None without a direction of descent.

        Parameters
        ----------
        last
            The barrier parameter never to fall below.
        """
        iterate, step, mu = self._iterate, self._step, self._mu
        if not self._newton_step():
            return None
        slope = dual_steps(iterate, step, self._used, mu)
        alpha, dual = longest(iterate, step, self._used, mu)
        longest_step = alpha
        alpha = self._searched(alpha, slope)
        total, least = accept(iterate, self._trial, step, self._used, mu, (alpha, dual))
        linearise(iterate, self._model, self._linear, True)
        self.mean = total / self._count
        even = least / self.mean
        part = min(max(0.1 * min(0.05 * (1.0 - even) / even, 2.0) ** 3, 0.05), 0.8)
        if min(alpha, dual) < 0.3:
            part = max(part, 0.5)
        self._mu = max(last, min(part * self.mean, 2.0 * mu))
        if mu <= _LATE and alpha < 0.9 * longest_step:
            self._damping = max(10.0 * self._damping, self._least_damping)
        elif self._damping > self._least_damping:
            self._damping *= 0.3
        return alpha

    def _newton_step(self) -> bool:
        iterate, model, linear, riccati = self._iterate, self._model, self._linear, self._riccati
        self._ends = end_conditions(iterate, model)
        C, c, B, b = self._ends
        for exact in (True, False):
            barrier = (self._mu, exact, self._damping)
            if not backward(iterate, linear, model, self._used, barrier, (C, c), riccati):
                continue
            found, multipliers = join(riccati, B, b, self._step.x[0])
            if found:
                forward(iterate, linear, model, self._used, multipliers, riccati, self._step)
                return True
        return False

    def _allowed(self, missed: float) -> float:
        """What may be missed where the barrier function falls: in the end, no more than before."""
        n = len(self._iterate.q)
        if self._mu > _LATE:
            return max(10.0 * missed, 1e-4 * n)
        return max(missed, 10.0 * self._mu * n)

    def _searched(self, alpha: float, slope: float) -> float:
        """The length of the first step that is accepted, or of the shortest one tried."""
        iterate, trial, mu = self._iterate, self._trial, self._mu
        n = len(iterate.q)
        value, missed = float(iterate.p[0]) - mu * self._logarithms, self._missed
        for _ in range(_HALVINGS):
            length = alpha
            move(iterate, self._step, self._used, alpha, trial)
            linearise(trial, self._model, self._linear, False)
            self._ends = end_conditions(trial, self._model)
            self._missed, self.worst, self._logarithms = self._infeasibility(trial)
            if self._missed <= max((1.0 - 1e-4 * alpha) * missed, 1e-8 * n):
                break
            falls = float(trial.p[0]) - mu * self._logarithms
            falls -= value + 1e-4 * alpha * min(slope, 0.0) + 1e-10
            if falls <= 0.0 and self._missed <= self._allowed(missed):
                break
            alpha *= 0.5
        return length


def interior_point(
    iterate: Iterate,
    model: Model,
    used: NDArray[np.bool_],
    barriers: tuple[float, float],
    most: int,
) -> tuple[Outcome, int, float]:
    """Minimise p from an iterate on, which is changed in place.

    Parameters
    ----------
    iterate
        Attitudes, rates, accelerations and duration; all but rates that follow the accelerations
        need not hold. Slacks hold the least to begin with, multipliers are set here.
    model
        The problem.
    used : (N + 1, c)
        Which constraints there are.
    barriers
        First and last barrier parameter.
    most
        Most iterations.

    Returns
    -------
    outcome, iterations, missed
        How it ended, after how many, and by what constraints, steps or ends are still missed.
    """
    first, last = barriers
    solve = _Solve(iterate, model, used, first)
    short = 0
    for iteration in range(1, most + 1):
        alpha = solve.advance(last)
        if alpha is None:
            return Outcome.SINGULAR, iteration, solve.worst
        if solve.mean < 2.0 * last and solve.worst < _TOLERANCE:
            return Outcome.CONVERGED, iteration, solve.worst
        short = short + 1 if alpha < 0.05 else 0
        if short == _HOPELESS:
            return Outcome.STALLED, iteration, solve.worst
    return Outcome.STALLED, most, solve.worst
