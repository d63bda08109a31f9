"""Initial curves on a general space: descent on the discretised cost.

With nodes `g_k` a time h apart, `u_k = log(g_k^-1 g_(k+1))` and `w_k = log(g_k^-1 g_(k-1))`,
the covariant acceleration is `(u_k + w_k) / h^2` in the frame of `g_k`. The cost is a sum of
squares, also of the potentials (`sqrt(tau) / (d - r)`, extended by its tangent below a margin so
that it pushes outward everywhere), and is minimised by Levenberg and Marquardt's method. Being
descent, it finds minima, where Newton's method on the equations finds any extremal.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from riem_planner.manifolds.matrices import Real
from riem_planner.manifolds.problem import Array, GeneralProblem, Repulsion

_MARGINS = (0.5, 0.15, 0.05)
_MOST_ITERATIONS = 60
_DIFFERENCE = 1e-7


class CoarseCost:
    """The discretised cost in normalised time, as residuals by node.

    Parameters
    ----------
    problem
        The problem.
    repulsion
        Its obstacles with strengths `tau T^4`.
    intervals
        Number of intervals.
    """

    def __init__(self, problem: GeneralProblem, repulsion: Repulsion, intervals: int) -> None:
        self.problem, self.repulsion, self.intervals = problem, repulsion, intervals
        self.space = problem.space
        T = problem.duration
        self.sigma = problem.tension * T**2
        self.start_rate = np.asarray(problem.start.rate) * T
        self.goal_rate = np.asarray(problem.goal.rate) * T

    def residuals(self, g: Array, margin: float) -> Real:
        """Residuals (..., N + 1, k) of curves (..., N + 1, size, size); half their square sums.

        Those of a node depend on it and on its two neighbours.
        """
        h, space = 1.0 / self.intervals, self.space
        onward = space.between(g[..., :-1, :, :], g[..., 1:, :, :])
        backward = space.between(g[..., 1:, :, :], g[..., :-1, :, :])
        acceleration = np.empty((*g.shape[:-2], space.dimension))
        acceleration[..., 1:-1, :] = (onward[..., 1:, :] + backward[..., :-1, :]) / h**1.5
        first, last = onward[..., 0, :] - h * self.start_rate, backward[..., -1, :]
        acceleration[..., 0, :] = np.sqrt(2.0) * first / h**1.5
        acceleration[..., -1, :] = np.sqrt(2.0) * (last + h * self.goal_rate) / h**1.5
        parts = [acceleration]
        if self.sigma > 0.0:
            stretch = np.zeros_like(acceleration)
            stretch[..., :-1, :] = np.sqrt(self.sigma / h) * onward
            parts.append(stretch)
        if self.repulsion.elements:
            d, _ = self.repulsion.distances(g)
            gap = d - self.repulsion.radii
            near = np.maximum(gap, margin)
            soft = np.where(gap >= margin, 1.0 / near, (2.0 * margin - gap) / margin**2)
            parts.append(np.sqrt(h * self.repulsion.strengths) * soft)
        return np.concatenate(parts, axis=-1)

    def jacobian(self, g: Array, margin: float, base: Real) -> Real:
        """Derivative of all residuals by the interior nodes, ((N + 1) k, (N - 1) n).

        By forward differences, every third node at once.
        """
        n, N = self.space.dimension, self.intervals
        rows = base.shape[-1]
        result = np.zeros((N + 1, rows, N + 1, n))
        turns = self.space.exp(_DIFFERENCE * np.eye(n))
        for colour in range(3):
            nodes = np.arange(1, N)[np.arange(1, N) % 3 == colour]
            moved = np.broadcast_to(g, (n, *g.shape)).copy()
            moved[:, nodes] = g[nodes] @ turns[:, None]
            change = (self.residuals(moved, margin) - base) / _DIFFERENCE
            for offset in (-1, 0, 1):
                affected = nodes + offset
                result[affected, :, nodes, :] = np.moveaxis(change[:, affected], 0, -1)
        return result[:, :, 1:-1].reshape((N + 1) * rows, (N - 1) * n)


def descend(cost: CoarseCost, g: Array, check: Callable[[], None]) -> tuple[Array, float]:
    """A curve (N + 1, size, size) of locally least cost, and its cost.

    Parameters
    ----------
    cost
        What to minimise.
    g : (N + 1, size, size)
        Initial curve; its ends stay.
    check
        Called once an iteration; may raise to stop.
    """
    n = cost.space.dimension
    value = np.inf
    for margin in _MARGINS if cost.repulsion.elements else _MARGINS[-1:]:
        damping = 1e-3
        r = cost.residuals(g, margin)
        value = 0.5 * float(np.sum(r * r))
        for _ in range(_MOST_ITERATIONS):
            check()
            J = cost.jacobian(g, margin, r)
            normal, gradient = J.T @ J, J.T @ r.ravel()
            before = value
            for _ in range(12):
                damped = normal + damping * np.diag(np.diag(normal) + 1e-12)
                step = -np.linalg.solve(damped, gradient).reshape(-1, n)
                trial = g.copy()
                trial[1:-1] = g[1:-1] @ cost.space.exp(step)
                trial_r = cost.residuals(trial, margin)
                trial_value = 0.5 * float(np.sum(trial_r * trial_r))
                if trial_value < value:
                    g, r, value = trial, trial_r, trial_value
                    damping = max(0.1 * damping, 1e-12)
                    break
                damping = max(10.0 * damping, 1e-9)
            if before - value <= 1e-7 * before:
                break
    return g, value
