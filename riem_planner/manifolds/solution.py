# SPDX-License-Identifier: Apache-2.0
"""What a solve on a general space returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riem_planner.manifolds.extremal import extremal_field, runge_kutta_step
from riem_planner.manifolds.matrices import Array, Real
from riem_planner.manifolds.problem import GeneralProblem
from riem_planner.manifolds.repulsion import Repulsion
from riem_planner.solution import Status


@dataclass(frozen=True, eq=False)
class GeneralTrajectory:
    """An extremal by its values at nodes; between them it is integrated.

    Parameters
    ----------
    problem
        Whose extremal it is.
    times : (m,)
        Normalised times s = t / T of the nodes, from 0 to 1.
    elements : (m, N, N)
        Lifts; on a symmetric space along one horizontal curve.
    states : (m, 3, n)
        v, v', v'' by normalised time.
    """

    problem: GeneralProblem
    times: Real
    elements: Array
    states: Real

    @property
    def duration(self) -> float:
        """T [s]."""
        return self.problem.duration

    def evaluate(self, t: ArrayLike) -> tuple[Array, Real, Real]:
        """Lifts (..., N, N), rates and accelerations (..., n) at times (...) [s].

        Raises
        ------
        ValueError
            A time is outside [0, duration].
        """
        return self.evaluate_state(t)[:3]

    def evaluate_state(self, t: ArrayLike) -> tuple[Array, Real, Real, Real]:
        """As `evaluate`, and the jerks v'' (..., n)."""
        times = np.asarray(t, dtype=float)
        T, space = self.duration, self.problem.space
        if not np.all((times >= 0.0) & (times <= T)):
            raise ValueError(f"t must lie in [0, {T:.9g}] s, got {times}")
        s = times.ravel() / T
        k = np.clip(np.searchsorted(self.times, s, side="right") - 1, 0, len(self.times) - 2)
        repulsion = Repulsion(space, self.problem.obstacles, T**4, T)
        field = extremal_field(space, self.problem.tension * T**2, repulsion)
        g, w = self.elements[k], self.states[k]
        half = 0.5 * (s - self.times[k])
        for begin in (self.times[k], self.times[k] + half):
            g, w = runge_kutta_step(field, begin, g, w, half)
        v, a, j = (w[:, i].reshape(*times.shape, -1) / T ** (i + 1) for i in range(3))
        return g.reshape(*times.shape, *g.shape[-2:]), v, a, j


@dataclass(frozen=True, eq=False)
class GeneralSolution:
    """Outcome of `solve` on a general space.

    Parameters
    ----------
    status, message
        What happened; `status.advice` says what to do about it.
    trajectory
        The cheapest extremal found; None unless solved.
    cost
        `1/2 int (|Dv/dt|^2 + sigma |v|^2 + sum V_i) dt`.
    clearance
        Lower bound of the distance to each obstacle's ball, by name; of a potential that excludes
        nothing, of the distance to the point.
    clearance_proven
        Whether it holds in continuous time. Otherwise it is the least sampled distance.
    boundary_error
        Difference between the matrices of the end and of the goal (`space.gap`), and of the rates
        [1/s]; where the rate is free, of the acceleration from 0 [1/s^2].
    trajectory_error
        Estimated error of one interval's integration, relative to 1.
    alternatives
        Costlier extremals, cheapest first, with their costs.
    iterations
        Newton iterations over all initial curves.
    solve_time
        By a steady clock [s].
    notes
        Remarks a user should read, such as which lifts are the same point of the space.
    local_minimum
        Whether the second variation is positive definite, by the discretised cost near the
        trajectory; not so for one of a family of equal cost. None where it was not computed.
    converged
        Whether the error is within the tolerance and every initial curve was looked at: false
        where a deadline cut the search short, or with a search that is local.
    """

    status: Status
    message: str
    trajectory: GeneralTrajectory | None = None
    cost: float = float("nan")
    clearance: dict[str, float] | None = None
    boundary_error: tuple[float, float] = (float("nan"), float("nan"))
    trajectory_error: float = float("nan")
    alternatives: tuple[tuple[float, GeneralTrajectory], ...] = ()
    iterations: int = 0
    solve_time: float = 0.0
    notes: tuple[str, ...] = ()
    local_minimum: bool | None = None
    converged: bool = False
    clearance_proven: bool = False

    @property
    def solved(self) -> bool:
        """Whether there is a trajectory."""
        return self.status is Status.SOLVED
