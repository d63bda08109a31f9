# SPDX-License-Identifier: Apache-2.0
"""SciPy's `solve_bvp` on the first-order conditions, with analytic Jacobians.

The state is `y = (q, u, w, z)`: the quaternion and the coordinates of rate, acceleration and
jerk in the horizontal basis B, 13 numbers on SO(3) and 10 on S^2. The equations are those of
`v''' = v'' x v + sigma v' - F` and `v''' = (v' x v) x v + sigma v' - F`.

Every obstacle gives a vector n(q) and a number c(q) with the distance
`d = factor atan2(|n|, c)` and the body gradient `n / |n|`: for an orientation Q the vector and
scalar part of `conj(Q) q` and the factor 2, for a direction s the vector `(R^T s) x b`, the
number `(R^T s) . b` and the factor 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

from benchmark.peers import PeerResult, hermite_guess, horizontal_basis
from riem_planner import Problem
from riem_planner.geometry import so3
from riem_planner.obstacles import OrientationObstacle

Array = NDArray[np.float64]

MESH = 20  # nodes of the first mesh
MOST_NODES = 3000


def _left(q: Array) -> Array:
    """Matrix (4, 4) with `p q = _left(p) @ q`."""
    x, y, z, w = q
    return np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]])


def _left_vectors(q: Array) -> Array:
    """First three columns (m, 4, 3) of the left matrices of quaternions (4, m)."""
    x, y, z, w = q
    columns = [[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]
    return np.stack([np.stack(c, axis=-1) for c in columns], axis=-1)


def _right(v: Array) -> Array:
    """Matrices (m, 4, 4) with `q (v, 0) = _right(v) @ q`."""
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    rows = [[o, z, -y, x], [-z, o, x, y], [y, -x, o, z], [-x, -y, -z, o]]
    return np.stack([np.stack(r, axis=-1) for r in rows], axis=-2)


def _inverse_rotation_forms(s: Array) -> Array:
    """Symmetric matrices (3, 4, 4) with `(R^T s)_i = q^T M_i q`."""
    forms = np.zeros((3, 4, 4))
    for i in range(4):
        for j in range(4):
            plus, single_i, single_j = (np.zeros(4) for _ in range(3))
            single_i[i] = single_j[j] = 1.0
            plus += single_i + single_j
            both = so3.quaternion_to_matrix(np.stack([plus, single_i, single_j]))
            forms[:, i, j] = 0.5 * (both[0] - both[1] - both[2]).T @ s
    return forms


@dataclass(frozen=True)
class Collocation:
    """One problem in the form that `solve_bvp` takes."""

    problem: Problem

    @cached_property
    def basis(self) -> Array:
        """B (3, k)."""
        return horizontal_basis(self.problem)

    @cached_property
    def _skew_boresights(self) -> list[Array | None]:
        return [
            None if isinstance(o, OrientationObstacle) else -so3.hat(np.asarray(o.boresight))
            for o in self.problem.obstacles
        ]

    @cached_property
    def _forms(self) -> list[Array]:
        return [
            _left(so3.quaternion_conjugate(so3.matrix_to_quaternion(o.orientation)))
            if isinstance(o, OrientationObstacle)
            else _inverse_rotation_forms(o.direction)
            for o in self.problem.obstacles
        ]

    def _force(self, q: Array) -> tuple[Array, Array]:
        """F (m, 3) and its derivative by q (m, 3, 4)."""
        total, slope = np.zeros((q.shape[1], 3)), np.zeros((q.shape[1], 3, 4))
        for obstacle, form, skew in zip(
            self.problem.obstacles, self._forms, self._skew_boresights, strict=True
        ):
            if skew is None:
                p = (form @ q).T
                sign = np.where(p[:, 3] < 0.0, -1.0, 1.0)
                n, c, factor = sign[:, None] * p[:, :3], sign * p[:, 3], 2.0
                n_q = sign[:, None, None] * form[None, :3]
                c_q = sign[:, None] * form[3]
            else:
                g_q = 2.0 * np.einsum("iab,bm->mia", form, q)
                g = 0.5 * np.einsum("mia,am->mi", g_q, q)
                b, factor = np.asarray(obstacle.boresight), 1.0
                n, c, n_q, c_q = g @ skew.T, g @ b, skew @ g_q, np.einsum("i,mia->ma", b, g_q)
            tau = self.problem.strength_of(obstacle)
            length = np.maximum(np.linalg.norm(n, axis=1), 1e-12)
            unit = n / length[:, None]
            gap = factor * np.arctan2(length, c) - obstacle.radius
            length_q = np.einsum("mi,mia->ma", unit, n_q)
            gap_q = factor * (c[:, None] * length_q - length[:, None] * c_q)
            gap_q /= (length**2 + c**2)[:, None]
            unit_q = (n_q - unit[:, :, None] * length_q[:, None, :]) / length[:, None, None]
            total -= (tau / gap**3)[:, None] * unit
            slope += (3.0 * tau / gap**4)[:, None, None] * unit[:, :, None] * gap_q[:, None, :]
            slope -= (tau / gap**3)[:, None, None] * unit_q
        return total, slope

    def _split(self, y: Array) -> tuple[Array, Array, Array, Array]:
        k = self.basis.shape[1]
        vectors = [self.basis @ y[4 + i * k : 4 + (i + 1) * k] for i in range(3)]
        return y[:4], vectors[0].T, vectors[1].T, vectors[2].T

    def right_side(self, _: Array, y: Array) -> Array:
        """Rates (n, m) at states (n, m)."""
        q, v, a, j = self._split(y)
        if self.basis.shape[1] == 3:
            curvature = np.cross(j, v)
        else:
            curvature = v * np.sum(a * v, axis=1)[:, None] - a * np.sum(v * v, axis=1)[:, None]
        snap = curvature + self.problem.sigma * a - self._force(q)[0]
        q_rate = 0.5 * np.einsum("mij,jm->im", _right(v), q)
        return np.vstack([q_rate, y[4 + self._k :], (snap @ self.basis).T])

    @property
    def _k(self) -> int:
        return int(self.basis.shape[1])

    def right_side_slope(self, _: Array, y: Array) -> Array:
        """Derivative (n, n, m) of `right_side` by the state."""
        q, v, a, j = self._split(y)
        k, B = self._k, self.basis
        m = y.shape[1]
        slope = np.zeros((m, 4 + 3 * k, 4 + 3 * k))
        rate, acceleration, jerk = (slice(4 + i * k, 4 + (i + 1) * k) for i in range(3))
        slope[:, :4, :4] = 0.5 * _right(v)
        slope[:, :4, rate] = 0.5 * _left_vectors(q) @ B
        slope[:, rate, acceleration] = slope[:, acceleration, jerk] = np.eye(k)
        slope[:, jerk, :4] = -B.T @ self._force(q)[1]
        slope[:, jerk, acceleration] = self.problem.sigma * np.eye(k)
        if k == 3:
            slope[:, jerk, rate] = so3.hat(j)
            slope[:, jerk, jerk] = -so3.hat(v)
        else:
            av, vv = np.sum(a * v, axis=1)[:, None, None], np.sum(v * v, axis=1)[:, None, None]
            by_v = av * np.eye(3) + v[:, :, None] * a[:, None, :]
            by_v -= 2.0 * a[:, :, None] * v[:, None, :]
            by_a = v[:, :, None] * v[:, None, :] - vv * np.eye(3)
            slope[:, jerk, rate] = B.T @ by_v @ B
            slope[:, jerk, acceleration] += B.T @ by_a @ B
        return np.moveaxis(slope, 0, -1)

    @cached_property
    def _goal(self) -> tuple[Array, Array, Array]:
        """Of the goal: conj(q1) or the forms of a tangent basis, the rate, the tangent basis."""
        goal, b = self.problem.goal, self.problem.boresight
        if self._k == 3:
            left = _left(so3.quaternion_conjugate(goal.quaternion_xyzw))
            return left[:3], goal.angular_velocity, np.eye(3)
        tangents = np.linalg.svd((goal.orientation @ b)[None, :])[2][1:]
        forms = np.stack([_inverse_rotation_forms(s) for s in tangents])
        velocity = goal.orientation @ np.cross(goal.angular_velocity, b)
        return forms, tangents @ velocity, tangents

    def ends(self, y0: Array, y1: Array) -> Array:
        """Residual (n,) of the boundary conditions."""
        start, B = self.problem.start, self.basis
        at_start = [
            y0[:4] - start.quaternion_xyzw,
            y0[4 : 4 + self._k] - B.T @ start.angular_velocity,
        ]
        form, rate, _ = self._goal
        if self._k == 3:
            return np.concatenate([*at_start, form @ y1[:4], y1[4:7] - rate])
        b, q, v = self.problem.boresight, y1[:4], B @ y1[4:6]
        tangents = np.einsum("tiab,a,b->ti", form, q, q)
        return np.concatenate([*at_start, tangents @ b, tangents @ np.cross(v, b) - rate])

    def ends_slope(self, y0: Array, y1: Array) -> tuple[Array, Array]:
        """Derivatives (n, n) of `ends` by both arguments."""
        n, k, B = y0.size, self._k, self.basis
        first, last = np.zeros((n, n)), np.zeros((n, n))
        first[: 4 + k, : 4 + k] = np.eye(4 + k)
        form = self._goal[0]
        goal, rate = slice(4 + k, 4 + 2 * k), slice(4 + 2 * k, n)
        if k == 3:
            last[goal, :4] = form
            last[rate, 4:7] = np.eye(3)
            return first, last
        b, q, v = self.problem.boresight, y1[:4], B @ y1[4:6]
        by_q = 2.0 * np.einsum("tiab,b->tia", form, q)
        tangents = 0.5 * by_q @ q
        last[goal, :4] = np.einsum("tia,i->ta", by_q, b)
        last[rate, :4] = np.einsum("tia,i->ta", by_q, np.cross(v, b))
        last[rate, 4:6] = tangents @ -so3.hat(b) @ B
        return first, last

    def solve(self, tolerance: float) -> PeerResult:
        """Solve from the Hermite guess."""
        times = np.linspace(0.0, self.problem.duration, MESH)
        q, v, a, j = hermite_guess(self.problem, times)
        guess = np.vstack([q.T, *(self.basis.T @ x.T for x in (v, a, j))])
        with np.errstate(all="ignore"):
            result = solve_bvp(
                self.right_side,
                self.ends,
                times,
                guess,
                fun_jac=self.right_side_slope,
                bc_jac=self.ends_slope,
                tol=tolerance,
                max_nodes=MOST_NODES,
            )

        def curve(t: Array) -> tuple[Array, Array, Array]:
            q, v, a, _ = self._split(result.sol(t))
            return q.T, v, a

        return PeerResult(bool(result.success), curve, result.x)
