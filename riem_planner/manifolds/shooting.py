"""Multiple shooting on the first-order conditions of a general space, in normalised time.

Unknown at each node: the point and v, v', v''. On a symmetric space a node's lift is free, so
the ends of two intervals are compared after turning one lift into the other by the element of
K between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from riem_planner.manifolds.extremal import Field, runge_kutta_step
from riem_planner.manifolds.matrices import Real
from riem_planner.manifolds.matrix_space import MatrixSpace
from riem_planner.manifolds.problem import Array

_DIFFERENCE = 1e-5
_MOST_ITERATIONS = 30
_MOST_INTERVALS = 512
_RULE_GAIN = 255.0  # 2^8 - 1: two half steps of an eighth-order rule against one whole


@dataclass(eq=False)
class Shooting:
    """Boundary-value problem in normalised time.

    Parameters
    ----------
    space, field
        Where, and the first-order conditions.
    goal : (N, N)
        Lift of the end.
    goal_rate : (n,)
        v at the end in the goal's frame.
    """

    space: MatrixSpace
    field: Field
    goal: Array
    goal_rate: Real

    def ends(self, g: Array, w: Real, h: Array, steps: int = 2) -> tuple[Array, Real]:
        """Where intervals of lengths h that start at (g, w) end."""
        for _ in range(steps):
            g, w = runge_kutta_step(self.field, g, w, h / steps)
        return g, w

    def mismatch(self, g: Array, w: Real, onto: Array, target: Real) -> Real:
        """Difference (..., 4, n) between an end (g, w) and a node (onto, target)."""
        h = self.space.inverse(onto) @ g
        place = self.space.log_unchecked(h)[0]
        turned = self.space.in_frame(h[..., None, :, :], w)
        return np.concatenate([place[..., None, :], turned - target], axis=-2)

    def residuals(self, g: Array, w: Real, end_g: Array, end_w: Real) -> Real:
        """Mismatches (m, 4, n) at the ends of all intervals; the last two rows of all are 0."""
        onto = np.concatenate([g[1:], self.goal[None]])
        last = np.stack([self.goal_rate, *np.zeros((2, self.space.dimension))])
        target = np.concatenate([w[1:], last[None]])
        result = self.mismatch(end_g, end_w, onto, target)
        result[-1, 2:] = 0.0
        return result


def _perturbed(shooting: Shooting, g: Array, w: Real) -> tuple[Array, Real]:
    """Nodes (8 n, m, ...) moved forwards and backwards along each of their 4 n unknowns."""
    n = shooting.space.dimension
    moves = _DIFFERENCE * np.concatenate([np.eye(4 * n), -np.eye(4 * n)])
    turns = shooting.space.exp(moves[:, :n])
    states = w[None] + moves[:, n:].reshape(8 * n, 1, 3, n)
    return g[None] @ turns[:, None], states


def newton_step(
    shooting: Shooting, g: Array, w: Real, h: Array, r: Real, ends: tuple[Array, Real]
) -> Real:
    """Newton step (m, 4, n) of the nodes; that of the first node's place and rate is 0."""
    m, n = len(h), shooting.space.dimension
    size = 4 * n
    moved_g, moved_w = _perturbed(shooting, g, w)
    moved_ends = shooting.ends(moved_g, moved_w, np.broadcast_to(h, moved_g.shape[:2]))
    onto = np.concatenate([g[1:], shooting.goal[None]])
    target = np.zeros((m, 3, n))
    change = shooting.mismatch(*moved_ends, onto, target).reshape(8 * n, m, size)
    own = np.moveaxis(change[:size] - change[size:], 0, -1) / (2.0 * _DIFFERENCE)
    change = shooting.mismatch(ends[0][:-1], ends[1][:-1], moved_g[:, 1:], moved_w[:, 1:])
    change = change.reshape(8 * n, m - 1, size)
    following = np.moveaxis(change[:size] - change[size:], 0, -1) / (2.0 * _DIFFERENCE)
    # The two free rows at the end and the two fixed columns at the start drop out.
    rows, columns = np.arange(m * size).reshape(m, size), np.arange(m * size).reshape(m, size)
    blocks = [(own, rows, columns), (following, rows[:-1], columns[1:])]
    i = np.concatenate([np.repeat(r_, size, axis=1).ravel() for _, r_, _ in blocks])
    j = np.concatenate([np.tile(c_, (1, size)).ravel() for _, _, c_ in blocks])
    values = np.concatenate([block.ravel() for block, _, _ in blocks])
    matrix = coo_matrix((values, (i, j)), shape=(m * size, m * size)).tocsc()
    kept_rows, kept_columns = np.arange(m * size - 2 * n), np.arange(2 * n, m * size)
    step = np.zeros(m * size)
    step[kept_columns] = spsolve(matrix[kept_rows][:, kept_columns], -r.ravel()[kept_rows])
    return step.reshape(m, 4, n)


def shoot(
    shooting: Shooting, times: Real, g: Array, w: Real, tolerance: float, check: Callable[[], None]
) -> tuple[Real, Array, Real, float, int] | None:
    """Solve from nodes at times; None where Newton's method fails.

    Parameters
    ----------
    times : (m + 1,)
        From 0 to 1.
    g : (m, N, N)
        Lifts at all times but the last.
    w : (m, 3, n)
        v, v', v'' there.
    tolerance
        Error allowed in the integration of an interval.
    check
        Called once an iteration; may raise to stop.

    Returns
    -------
    times, g, w
        As given, on a mesh refined where it had to be.
    error
        Estimated largest error of an interval.
    iterations
        Newton steps.
    """
    iterations = 0
    while True:
        h = np.diff(times)
        solved, used = _newton(shooting, g, w, h, check)
        iterations += used
        if solved is None:
            return None
        g, w, (end_g, end_w) = solved
        whole_g, whole_w = shooting.ends(g, w, h, steps=1)
        scale = 1.0 + np.max(np.abs(w), axis=(1, 2))
        error = (
            np.maximum(
                np.max(np.abs(end_g - whole_g), axis=(1, 2)),
                np.max(np.abs(end_w - whole_w), axis=(1, 2)) / scale,
            )
            / _RULE_GAIN
        )
        coarse = np.flatnonzero(error > tolerance)
        if coarse.size == 0:
            return times, g, w, float(error.max()), iterations
        if h.size + coarse.size > _MOST_INTERVALS:
            return None
        half = runge_kutta_step(shooting.field, g[coarse], w[coarse], 0.5 * h[coarse])
        times = np.insert(times, coarse + 1, times[coarse] + 0.5 * h[coarse])
        g, w = np.insert(g, coarse + 1, half[0], axis=0), np.insert(w, coarse + 1, half[1], axis=0)


def _newton(
    shooting: Shooting, g: Array, w: Real, h: Array, check: Callable[[], None]
) -> tuple[tuple[Array, Real, tuple[Array, Real]] | None, int]:
    """Damped Newton iteration at a fixed mesh, and its number of steps."""

    def evaluate(g: Array, w: Real) -> tuple[tuple[Array, Real], Real, float]:
        ends = shooting.ends(g, w, h)
        r = shooting.residuals(g, w, *ends)
        return ends, r, float(np.max(np.abs(r) / scale))

    with np.errstate(all="ignore"):  # a trial step may leave every bound; it is then refused
        # Compared with the sizes of v, v', v'' themselves, which grow with each derivative.
        sizes = 1.0 + np.max(np.abs(w), axis=(0, 2))
        scale = np.concatenate([[1.0], sizes])[None, :, None]
        ends, r, size = evaluate(g, w)
        for iteration in range(_MOST_ITERATIONS):
            check()
            if not np.isfinite(size):
                return None, iteration
            step = newton_step(shooting, g, w, h, r, ends)
            fraction = 1.0
            while True:
                trial_g = g @ shooting.space.exp(fraction * step[:, 0])
                trial_w = w + fraction * step[:, 1:]
                trial = evaluate(trial_g, trial_w)
                if trial[2] < size or trial[2] < 1e-13:
                    break
                fraction *= 0.5
                if fraction < 1e-3:
                    # At the limit of rounding nothing decreases any more.
                    return ((g, w, ends) if size < 1e-10 else None), iteration
            stalled = trial[2] > 0.3 * size and size < 1e-11
            g, w, (ends, r, size) = trial_g, trial_w, trial
            if size < 1e-13 or stalled:
                return (g, w, ends), iteration + 1
    return ((g, w, ends) if size < 1e-10 else None), _MOST_ITERATIONS
