# SPDX-License-Identifier: Apache-2.0
"""Multiple shooting on the first-order conditions of a general space, in normalised time.

Unknown at each node: the point and v, v', v''. On a symmetric space a node's lift is free, so
the ends of two intervals are compared after turning one lift into the other by the element of
K between them. At a waypoint the place is given and v'' may jump. Where the rate of an end is
free, v' is zero there; where an end is free along a subgroup, `sigma v - v''` is orthogonal to it.

Newton's matrix comes from the linearised field, integrated by Simpson's weights (the rule of four
stages on states that the integration has passed): it is good to the fourth order of the interval,
and the solution is as exact as the residuals. Where solutions form a family, as those round an
obstacle on the axis of a rotation do, the matrix is singular; steps along the family are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from riem_planner.manifolds.extremal import extremal_field, runge_kutta_step
from riem_planner.manifolds.matrices import Array, Real
from riem_planner.manifolds.problem import GeneralProblem
from riem_planner.manifolds.repulsion import Repulsion

Index = NDArray[np.int64]

_MOST_ITERATIONS = 60
_LONGEST = 0.1  # that one step may move a node
_VALLEY = 1e-3  # relative residuals of a curve that is a solution but for a valley of the cost
_MOST_LEAPS = 12
_MOST_INTERVALS = 512
_RULE_GAIN = 255.0  # 2^8 - 1: two half steps of an eighth-order rule against one whole
_SHARE = 0.3  # of the residuals, the singular value below which a step is left out
_FAMILY = 1e-8  # singular value below which a step is one along a family of solutions


@dataclass(eq=False)
class Nodes:
    """Nodes of multiple shooting: times (m + 1,), lifts (m, N, N) and v, v', v'' (m, 3, n)."""

    times: Real
    g: Array
    w: Real


@dataclass(eq=False)
class Arrivals:
    """Where the intervals arrive, and what they pass half-way."""

    g: Array
    w: Real
    half_g: Array
    half_w: Real


@dataclass(frozen=True, eq=False)
class Shot:
    """A solution of the boundary-value problem.

    Parameters
    ----------
    nodes
        On a mesh refined where it had to be.
    error
        Estimated largest error of an interval.
    iterations
        Newton steps.
    family
        Number of directions in which there are other solutions next to it.
    """

    nodes: Nodes
    error: float
    iterations: int
    family: int


class Shooting:
    """The boundary-value problem in normalised time.

    Parameters
    ----------
    problem
        The problem.
    repulsion
        Its obstacles in normalised time.
    """

    def __init__(self, problem: GeneralProblem, repulsion: Repulsion) -> None:
        T = problem.duration
        self.problem, self.repulsion, self.space = problem, repulsion, problem.space
        self.sigma = problem.tension * T**2
        self.field = extremal_field(problem.space, self.sigma, repulsion)
        rate = problem.goal.rate
        self.goal_rate = None if rate is None else rate * T
        self.waypoints = np.array([waypoint.time / T for waypoint in problem.waypoints])

    def at_waypoints(self, times: Real) -> Index:
        """Which inner nodes, of times (m + 1,), are waypoints: their indices."""
        return np.asarray(np.argmin(np.abs(times[:, None] - self.waypoints), axis=0))

    def arrivals(self, nodes: Nodes) -> Arrivals:
        """Integrate all intervals, in two steps each."""
        half = 0.5 * np.diff(nodes.times)
        s = nodes.times[:-1]
        half_g, half_w = runge_kutta_step(self.field, s, nodes.g, nodes.w, half)
        g, w = runge_kutta_step(self.field, s + half, half_g, half_w, half)
        return Arrivals(g, w, half_g, half_w)

    def goal(self, end: Array) -> Array:
        """The goal (N, N); where it may slide, the one of its elements that is next to an end."""
        element, along = self.problem.goal.element, self.problem.goal.along
        if not len(along):
            return element
        away = self.space.between(element, end)
        return np.asarray(element @ self.space.exp(away @ along.T @ along))

    def residuals(self, nodes: Nodes, arrivals: Arrivals) -> Real:
        """Mismatches (m, 4, n) of place and v, v', v'' where the intervals arrive.

        Those of the last interval are the conditions at the end, in the same rows: place, rate
        (or v' where the rate is free), and nothing, but for the natural conditions of a goal that
        slides, which take the rows of the places that are free.
        """
        onto = np.concatenate([nodes.g[1:], self.goal(arrivals.g[-1])[None]])
        target = np.concatenate([nodes.w[1:], np.zeros((1, 3, self.space.dimension))])
        h = self.space.inverse(onto) @ arrivals.g
        place = self.space.log_unchecked(h)[0]
        turned = self.space.in_frame(h[..., None, :, :], arrivals.w)
        result = np.concatenate([place[..., None, :], turned - target], axis=-2)
        v, a, j = turned[-1]
        result[-1, 1] = a if self.goal_rate is None else v - self.goal_rate
        result[-1, 2:] = 0.0
        result[self.at_waypoints(nodes.times) - 1, 3] = 0.0  # there v'' may jump
        along = self.problem.goal.along
        if len(along):
            result[-1, 0] += ((self.sigma * v - j - place[-1]) @ along.T) @ along
        return result

    def transitions(self, nodes: Nodes, arrivals: Arrivals) -> Real:
        """Derivatives (m, 4 n, 4 n) of what arrives by the nodes, turned into the next frames."""
        s, h = nodes.times[:-1], np.diff(nodes.times)
        g = np.stack([nodes.g, arrivals.half_g, arrivals.g])
        w = np.stack([nodes.w, arrivals.half_w, arrivals.w])
        force, bend = self.repulsion.force_and_bend(g, np.stack([s, s + 0.5 * h, s + h]))
        first, middle, last = self.space.variation(w, self.sigma, force, bend)
        identity = np.eye(first.shape[-1])
        H = h[:, None, None]
        k2 = middle @ (identity + 0.5 * H * first)
        k3 = middle @ (identity + 0.5 * H * k2)
        k4 = last @ (identity + H * k3)
        result = identity + H / 6.0 * (first + 2.0 * (k2 + k3) + k4)
        onto = np.concatenate([nodes.g[1:], self.goal(arrivals.g[-1])[None]])
        turn = self.space.frame_turn(self.space.inverse(onto) @ arrivals.g)
        if turn is not None:
            n = self.space.dimension
            blocks = result.reshape(-1, 4, n, 4 * n)
            result = (turn[:, None] @ blocks).reshape(result.shape)
        return np.asarray(result)

    def newton_step(
        self, nodes: Nodes, arrivals: Arrivals, r: Real, size: float
    ) -> tuple[Real, int]:
        """Newton step (m, 4, n) of the nodes, and the number of directions of a family.

        The residuals r (m, 4, n) are of the given relative size.
        """
        m, n = len(nodes.g), self.space.dimension
        block = 4 * n
        own = self.transitions(nodes, arrivals)
        self._end_conditions(own[-1])
        number = np.arange(m * block).reshape(m, block)
        rows = np.repeat(number, block, axis=1).ravel()
        columns = np.tile(number, (1, block)).ravel()
        following = np.arange((m - 1) * block)
        values = np.concatenate([own.ravel(), np.full(following.size, -1.0)])
        matrix = coo_matrix(
            (values, (np.append(rows, following), np.append(columns, following + block))),
            shape=(m * block, m * block),
        ).tocsc()
        rows_kept, columns_kept = self._kept(number, nodes.times)
        matrix = matrix[rows_kept][:, columns_kept]
        step = np.zeros(m * block)
        step[columns_kept], family = _regular_solution(
            matrix, -r.ravel()[rows_kept], n, max(_FAMILY, _SHARE * size)
        )
        return step.reshape(m, 4, n), family

    def _end_conditions(self, last: Real) -> None:
        """Turn the last transition (4 n, 4 n) into the derivative of the end conditions."""
        n = self.space.dimension
        along = self.problem.goal.along
        if len(along):
            onto = along.T @ along
            natural = self.sigma * last[n : 2 * n] - last[3 * n :]
            last[:n] += onto @ (natural - last[:n])
        if self.goal_rate is None:
            last[n : 2 * n] = last[2 * n : 3 * n]

    def _kept(self, number: Index, times: Real) -> tuple[Index, Index]:
        """Rows and columns of Newton's matrix that are equations and unknowns."""
        n = self.space.dimension
        row, column = np.ones(number.shape, dtype=bool), np.ones(number.shape, dtype=bool)
        row[-1, 2 * n :] = False
        column[0, :n] = False
        # With a given rate v is no unknown at the start; with a free one v' is zero.
        known = slice(2 * n, 3 * n) if self.problem.start.rate is None else slice(n, 2 * n)
        column[0, known] = False
        for k in self.at_waypoints(times):
            row[k - 1, 3 * n :] = False
            column[k, :n] = False
        return number[row], number[column]


def _regular_solution(matrix: object, right: Real, most: int, singular: float) -> tuple[Real, int]:
    """Solution of a sparse system without its part along nearly singular directions.

    The latter are found by inverse iteration from fixed vectors, at most `most` of them: those
    with singular values below `singular`. That is taken as large as the residuals, so that steps
    along a family are left out from the start, and none that belongs to an equation in the end.
    """
    try:
        factors = splu(matrix)
    except RuntimeError:  # exactly singular
        return np.full(right.size, np.nan), 0
    step = factors.solve(right)
    trial = np.cos(np.outer(np.arange(1.0, right.size + 1.0), np.arange(1.0, most + 1.0)))
    for _ in range(2):
        trial = factors.solve(factors.solve(trial, "T"))
        if not np.isfinite(trial).all():
            return step, 0
        trial = np.linalg.qr(trial / np.abs(trial).max())[0]
    _, sizes, rows = np.linalg.svd(matrix @ trial, full_matrices=False)
    directions = trial @ rows.T
    share = singular**2 / (singular**2 + sizes**2)
    step = step - directions @ (share * (directions.T @ step))
    return step, int(np.sum(sizes < 10.0 * _FAMILY))


def shoot(
    shooting: Shooting, nodes: Nodes, tolerance: float, check: Callable[[], None]
) -> Shot | None:
    """Solve from nodes near a solution; None where Newton's method fails.

    Parameters
    ----------
    shooting
        The problem.
    nodes
        The first ones.
    tolerance
        Error allowed in the integration of an interval.
    check
        Called once an iteration; may raise to stop.
    """
    iterations = 0
    while True:
        solved, used, family = _newton(shooting, nodes, check)
        iterations += used
        if solved is None:
            return None
        nodes, arrivals = solved
        h, s = np.diff(nodes.times), nodes.times[:-1]
        whole_g, whole_w = runge_kutta_step(shooting.field, s, nodes.g, nodes.w, h)
        scale = 1.0 + np.max(np.abs(nodes.w), axis=(1, 2))
        error = (
            np.maximum(
                np.max(np.abs(arrivals.g - whole_g), axis=(1, 2)),
                np.max(np.abs(arrivals.w - whole_w), axis=(1, 2)) / scale,
            )
            / _RULE_GAIN
        )
        coarse = np.flatnonzero(~(error <= tolerance))
        if coarse.size == 0:
            return Shot(nodes, float(error.max()), iterations, family)
        if h.size + coarse.size > _MOST_INTERVALS:
            return None
        nodes = Nodes(
            np.insert(nodes.times, coarse + 1, s[coarse] + 0.5 * h[coarse]),
            np.insert(nodes.g, coarse + 1, arrivals.half_g[coarse], axis=0),
            np.insert(nodes.w, coarse + 1, arrivals.half_w[coarse], axis=0),
        )


def _newton(
    shooting: Shooting, nodes: Nodes, check: Callable[[], None]
) -> tuple[tuple[Nodes, Arrivals] | None, int, int]:
    """Damped Newton iteration at a fixed mesh, its number of steps, and the family's size."""
    family = leaps = 0

    def evaluate(nodes: Nodes) -> tuple[Arrivals, Real, float]:
        arrivals = shooting.arrivals(nodes)
        r = shooting.residuals(nodes, arrivals)
        return arrivals, r, float(np.max(np.abs(r) / scale))

    with np.errstate(all="ignore"):  # a trial step may leave every bound; it is then refused
        # Compared with the sizes of v, v', v'' themselves, which grow with each derivative.
        scale = np.concatenate([[1.0], 1.0 + np.max(np.abs(nodes.w), axis=(0, 2))])[None, :, None]
        arrivals, r, size = evaluate(nodes)
        for iteration in range(_MOST_ITERATIONS):
            check()
            if not np.isfinite(size):
                return None, iteration, family
            step, family = shooting.newton_step(nodes, arrivals, r, size)
            length = float(np.max(np.abs(step[:, 0])))
            fraction = min(1.0, _LONGEST / length) if length > 0.0 else 1.0
            whole = fraction
            while True:
                moved = shooting.space.exp(fraction * step[:, 0])
                trial = Nodes(nodes.times, nodes.g @ moved, nodes.w + fraction * step[:, 1:])
                result = evaluate(trial)
                if result[2] < size or result[2] < 1e-13:
                    break
                if fraction < 0.2 * whole and size < _VALLEY and leaps < _MOST_LEAPS:
                    # Along a bent valley the residuals grow before the next steps correct them.
                    leaps += 1
                    moved = shooting.space.exp(whole * step[:, 0])
                    trial = Nodes(nodes.times, nodes.g @ moved, nodes.w + whole * step[:, 1:])
                    result = evaluate(trial)
                    break
                fraction *= 0.5
                if fraction < 1e-3:
                    # At the limit of rounding nothing decreases any more.
                    done = (nodes, arrivals) if size < 1e-10 else None
                    return done, iteration, family
            stalled = result[2] > 0.5 * size and size < 1e-12
            nodes, (arrivals, r, size) = trial, result
            if size < 1e-13 or stalled:
                return (nodes, arrivals), iteration + 1, family
    return ((nodes, arrivals) if size < 1e-10 else None), _MOST_ITERATIONS, family
