# SPDX-License-Identifier: Apache-2.0
"""Initial curves on a general space: descent on the discretised cost.

With nodes `g_k` at times `t_k`, `X_k = log(g_k^-1 g_(k+1))` and Z_k the same geodesic in the frame
of `g_(k+1)`, the covariant acceleration at `g_k` is `(X_k / h_k - Z_(k-1) / h_(k-1)) / c_k`, with
`c_k` half of both intervals. The cost is a sum of squares, also of the potentials (their square
roots, softened near an obstacle), and is minimised by Levenberg and Marquardt's method with exact
derivatives. Being descent, it finds minima, where Newton's method on the equations finds any
extremal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import ArpackError, eigsh, splu

from riem_planner.manifolds.matrices import Array, Real
from riem_planner.manifolds.problem import GeneralProblem
from riem_planner.manifolds.repulsion import Repulsion

_MARGINS = (0.5, 0.15, 0.05, 0.015, 0.005, 0.0015)
_MOST_ITERATIONS = 40
_ROUGH, _FINE = 1e-4, 1e-9
_DIFFERENCE = 1e-5
_LEAP = 0.7  # of the distance to an obstacle, that one step may take
_CLEAR = 0.1  # distance to the obstacles from which a first guess is taken to be past them
_BEAM = 500.6  # least eigenvalue of a clamped beam of length 1
_SADDLE = 1e-3  # of that: as far below zero an eigenvalue is not for want of convergence


class CoarseCost:
    """The discretised cost in normalised time, as residuals by node.

    Parameters
    ----------
    problem
        The problem.
    repulsion
        Its obstacles in normalised time.
    times : (N + 1,)
        Normalised times of the nodes, those of the waypoints among them.
    """

    def __init__(self, problem: GeneralProblem, repulsion: Repulsion, times: Real) -> None:
        self.problem, self.repulsion, self.times = problem, repulsion, times
        self.space = problem.space
        T, n = problem.duration, self.space.dimension
        self.sigma = problem.tension * T**2
        start, goal = problem.start.rate, problem.goal.rate
        self.start_rate = None if start is None else start * T
        self.goal_rate = None if goal is None else goal * T
        self.h = np.diff(times)
        self.weights = 0.5 * np.concatenate([self.h[:1], self.h[1:] + self.h[:-1], self.h[-1:]])
        # Which steps of which nodes are free; the last node's are along the goal's directions.
        free = np.ones((times.size, n), dtype=bool)
        free[[0, -1]] = False
        for waypoint in problem.waypoints:
            free[np.argmin(np.abs(times - waypoint.time / T))] = False
        along = problem.goal.along
        self.end_basis = np.eye(n)
        if len(along):
            free[-1, : len(along)] = True
            self.end_basis = np.linalg.svd(along)[2].T
            self.end_basis[:, : len(along)] = along.T
        self.free = free.ravel()

    def residuals(self, g: Array, margin: float) -> tuple[Real, Real]:
        """Residuals (..., N + 1, k) of curves (..., N + 1, size, size), and gaps (..., N + 1).

        Half the square sum of the residuals is the cost. The gaps are the nodes' least distances
        to the balls of the obstacles.
        """
        parts, gap, _ = self._parts(g, margin)
        return np.concatenate([values for values, _ in parts], axis=-1), gap

    def linearised(self, g: Array, margin: float) -> tuple[Real, Real]:
        """Residuals (..., N + 1, k), and their derivatives (..., N + 1, k, 3, n).

        Those of a node by steps of the node before, its own and the one after.
        """
        parts, _, (X, turn) = self._parts(g, margin)
        own, other, arriving_own, arriving_other = self.space.between_variation(X)
        if turn is not None:
            back = np.swapaxes(turn, -1, -2)
            other = other @ turn
            arriving_own, arriving_other = back @ arriving_own, back @ arriving_other @ turn
        h = self.h[:, None, None]
        n = self.space.dimension
        steps = np.zeros((*g.shape[:-2], n, 3, n))  # of the accelerations
        scale = 1.0 / np.sqrt(self.weights)[:, None, None]
        steps[..., :-1, :, 1, :] = own / h * scale[:-1]
        steps[..., :-1, :, 2, :] = other / h * scale[:-1]
        steps[..., 1:, :, 0, :] -= arriving_own / h * scale[1:]
        steps[..., 1:, :, 1, :] -= arriving_other / h * scale[1:]
        if self.start_rate is None:
            steps[..., 0, :, :, :] = 0.0
        if self.goal_rate is None:
            steps[..., -1, :, :, :] = 0.0
        derivatives = [steps]
        if self.sigma > 0.0:
            stretch = np.zeros_like(steps)
            stretch[..., :-1, :, 1, :] = np.sqrt(self.sigma / h) * own
            stretch[..., :-1, :, 2, :] = np.sqrt(self.sigma / h) * other
            derivatives.append(stretch)
        if self.repulsion:
            pushes = np.zeros((*g.shape[:-2], len(self.repulsion.shapes), 3, n))
            pushes[..., 1, :] = parts[-1][1]
            derivatives.append(pushes)
        r = np.concatenate([values for values, _ in parts], axis=-1)
        return r, np.concatenate(derivatives, axis=-3)

    def _parts(
        self, g: Array, margin: float
    ) -> tuple[list[tuple[Real, Real]], Real, tuple[Real, Real | None]]:
        """Residuals by kind (those of the potentials with slopes), gaps, geodesics and turns."""
        space, h = self.space, self.h[:, None]
        step = space.inverse(g[..., :-1, :, :]) @ g[..., 1:, :, :]
        X = space.log_unchecked(step)[0]
        turn = space.frame_turn(space.exp(-X) @ step)
        Z = X if turn is None else (X[..., None, :] @ turn)[..., 0, :]
        acceleration = np.zeros((*g.shape[:-2], space.dimension))
        acceleration[..., :-1, :] += X / h
        acceleration[..., 1:, :] -= Z / h
        for end, rate in ((0, self.start_rate), (-1, self.goal_rate)):
            if rate is None:
                acceleration[..., end, :] = 0.0
            else:
                acceleration[..., end, :] += rate if end else -rate
        acceleration /= np.sqrt(self.weights)[:, None]
        parts = [(acceleration, acceleration)]
        if self.sigma > 0.0:
            stretch = np.zeros_like(acceleration)
            stretch[..., :-1, :] = np.sqrt(self.sigma / h) * X
            parts.append((stretch, stretch))
        gap = np.full(g.shape[:-2], np.inf)
        if self.repulsion:
            roots, slopes, d = self.repulsion.softened_roots(g, self.times, margin)
            weights = np.sqrt(self.weights)[:, None]
            parts.append((weights * roots, weights[..., None] * slopes))
            gap = np.min(d - self.repulsion.radii, axis=-1)
        return parts, gap, (X, turn)

    def gradient(self, r: Real, J: Real) -> Real:
        """Derivative (..., (N + 1) n) of the cost by the steps of all nodes."""
        pieces = np.einsum("...kp,...kpaq->...akq", r, J)
        result = pieces[..., 1, :, :].copy()
        result[..., :-1, :] += pieces[..., 0, 1:, :]
        result[..., 1:, :] += pieces[..., 2, :-1, :]
        result[..., -1, :] = result[..., -1, :] @ self.end_basis
        return np.asarray(result.reshape(*r.shape[:-2], -1))

    def normal_matrix(self, J: Real) -> Any:
        """`J^T J` of the free steps, sparse, for the derivatives of `linearised`."""
        N, n = self.h.size, self.space.dimension
        flat = J.reshape(N + 1, J.shape[1], 3 * n)
        local = (np.swapaxes(flat, 1, 2) @ flat).reshape(N + 1, 3, n, 3, n)
        total = np.zeros((N + 1, n, N + 1, n))
        for a in range(3):
            for b in range(3):
                least = max(0, 1 - a, 1 - b)
                nodes = np.arange(least, N + 1 - max(0, a - 1, b - 1))
                total[nodes + a - 1, :, nodes + b - 1, :] += local[nodes, a, :, b, :]
        if len(self.problem.goal.along):
            total[-1] = np.einsum("pq,pkr->qkr", self.end_basis, total[-1])
            total[:, :, -1] = total[:, :, -1] @ self.end_basis
        return self._free_part(total.reshape((N + 1) * n, (N + 1) * n))

    def _free_part(self, matrix: Real) -> Any:
        return csc_matrix(matrix[np.ix_(self.free, self.free)])

    def moved(self, g: Array, step: Real) -> Array:
        """The curve (N + 1, size, size) after steps (free,) of what is free in it."""
        full = np.zeros(self.free.size)
        full[self.free] = step
        xi = full.reshape(self.times.size, -1)
        xi[-1] = self.end_basis @ xi[-1]
        return np.asarray(g @ self.space.exp(xi))

    def limited(self, step: Real, gap: Real, margin: float) -> Real:
        """A step (free,), cut where a curve that is clear of the obstacles would leap over one.

        Parameters
        ----------
        step
            What is to be done.
        gap : (N + 1,)
            Distances of the nodes to the obstacles' balls.
        margin
            Gap from which a node is clear.
        """
        if not np.min(gap) >= margin:
            return step
        full = np.zeros(self.free.size)
        full[self.free] = step
        length = np.linalg.norm(full.reshape(self.times.size, -1), axis=1)
        return np.asarray(min(1.0, float(np.min(_LEAP * gap / np.maximum(length, 1e-300)))) * step)

    def hessian(self, g: Array, margin: float) -> Any:
        """Second derivative of the cost by the free steps, sparse, by differences.

        Every fifth node is moved at once: a gradient depends on the two nodes on either side.
        """
        N, n = self.h.size, self.space.dimension
        nodes = np.arange(N + 1)
        turns = self.space.exp(_DIFFERENCE * np.concatenate([np.eye(n), -np.eye(n)]))
        bases = np.broadcast_to(np.eye(n), (N + 1, n, n)).copy()
        bases[-1] = self.end_basis.T
        H = np.zeros((N + 1, n, N + 1, n))
        for colour in range(5):
            own = nodes[nodes % 5 == colour]
            curves = np.broadcast_to(g, (2 * n, *g.shape)).copy()
            curves[:, own] = g[own] @ turns[:, None]
            if own[-1] == N:
                ends = self.space.exp(_DIFFERENCE * np.concatenate([bases[-1], -bases[-1]]))
                curves[:, N] = g[N] @ ends
            gradients = self.gradient(*self.linearised(curves, margin)).reshape(2 * n, N + 1, n)
            change = (gradients[:n] - gradients[n:]) / (2.0 * _DIFFERENCE)
            for offset in range(-2, 3):
                ours = own[(own + offset >= 0) & (own + offset <= N)]
                H[ours, :, ours + offset, :] = np.moveaxis(change[:, ours + offset], 0, 1)
        flat = H.reshape((N + 1) * n, (N + 1) * n)
        return self._free_part(0.5 * (flat + flat.T))

    def is_convex(self, g: Array, margin: float, least: float = 0.0) -> bool:
        """Whether all eigenvalues of the Hessian are above `least` of the free problem's least.

        The latter is that of a clamped beam, `4.73^4` times the mean interval.
        """
        H = self.hessian(g, margin)
        H.setdiag(H.diagonal() - least * _BEAM * float(np.mean(self.h)))
        factors = _factors(H)
        return factors is not None and bool(np.all(factors.U.diagonal() > 0.0))

    def falling_direction(self, g: Array, margin: float) -> Real | None:
        """The direction (free,) in which the curve is least convex; None if it was not found."""
        H = self.hessian(g, margin)
        try:
            first = np.cos(np.arange(1.0, H.shape[0] + 1.0))
            return np.asarray(eigsh(H, 1, which="SA", v0=first, tol=1e-3)[1][:, 0])
        except (ArpackError, ValueError):  # no convergence, or not finite
            return None


def _factors(matrix: Any) -> Any:
    """LU factors of a symmetric matrix without exchanges, with the inertia in U; None if singular.

    Sparse, although it is a band: the threads of the dense library would wait for each other.
    """
    if not np.isfinite(matrix.data).all():
        return None
    try:
        return splu(
            matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # exactly singular
        return None


def descend(
    cost: CoarseCost, g: Array, check: Callable[[], None], margins: tuple[float, ...] = _MARGINS
) -> tuple[Array, float, float]:
    """A curve (N + 1, size, size) of locally least cost, its cost, and the last margin.

    Parameters
    ----------
    cost
        What to minimise.
    g : (N + 1, size, size)
        Initial curve; what is fixed in it stays.
    check
        Called once an iteration; may raise to stop.
    margins
        Distances to the obstacles within which their potentials are softened, one after the
        other until the curve keeps farther off than that.
    """
    gap = float(cost.residuals(g, margins[0])[1].min())
    if np.isfinite(gap) and gap > _CLEAR:
        # It is clear of the obstacles, and softer ones would let it slip to the other side.
        margins = tuple(m for m in margins if m < 0.1 * gap) or margins[-1:]
    value = np.inf
    margin = margins[-1]
    for margin in margins:
        g, value, gap = _minimised(cost, g, margin, _ROUGH, check)
        if gap >= margin:
            break
    g, value, _ = _minimised(cost, g, margin, _FINE, check)
    return g, value, margin


def _minimised(
    cost: CoarseCost, g: Array, margin: float, tolerance: float, check: Callable[[], None]
) -> tuple[Array, float, float]:
    """Levenberg and Marquardt's method: the curve, its cost, and its least gap."""
    damping = 1e-3
    r, J = cost.linearised(g, margin)
    value = 0.5 * float(np.sum(r * r))
    gap = cost.residuals(g, margin)[1]
    for _ in range(_MOST_ITERATIONS):
        check()
        normal = cost.normal_matrix(J)
        gradient = cost.gradient(r, J)[cost.free]
        size = normal.diagonal() + 1e-12
        before = value
        for _ in range(12):
            normal.setdiag(size * (1.0 + damping))
            factors = _factors(normal)
            if factors is None:
                return g, np.nan, 0.0
            step = cost.limited(-factors.solve(gradient), gap, margin)
            trial = cost.moved(g, step)
            trial_r, trial_gap = cost.residuals(trial, margin)
            trial_value = 0.5 * float(np.sum(trial_r * trial_r))
            if trial_value < value:
                g, value, gap = trial, trial_value, trial_gap
                damping = max(0.1 * damping, 1e-12)
                break
            damping = max(10.0 * damping, 1e-9)
        if not before - value > tolerance * before:
            break
        r, J = cost.linearised(g, margin)
    return g, value, float(np.min(gap))


def off_saddle(cost: CoarseCost, g: Array, margin: float) -> tuple[Array, Array] | None:
    """The curve moved both ways along a direction in which its cost falls; None at a minimum."""
    if cost.is_convex(g, margin, -_SADDLE):
        return None
    direction = cost.falling_direction(g, margin)
    if direction is None:
        return None
    step = 0.05 / float(np.max(np.abs(direction))) * direction
    return cost.moved(g, step), cost.moved(g, -step)
