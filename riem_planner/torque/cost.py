# SPDX-License-Identifier: Apache-2.0
"""The cost of a curve at quadrature points, with its exact first and second variation.

Everything is in normalised time `s = t / T` and with inertia `J / J_m`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.geometry.sphere import cross
from riem_planner.obstacles.potential import potential
from riem_planner.problem import Problem

Array = NDArray[np.float64]

# Taylor coefficients by z = x^2 of (1 - cos x) / x^2 and (x - sin x) / x^3: exact up to 1 rad.
_FIRST = np.polynomial.Polynomial(
    [1 / 2, -1 / 24, 1 / 720, -1 / 40320, 1 / 3628800, -1 / 479001600, 1 / 87178291200,
     -1 / 20922789888000]
)  # fmt: skip
_SECOND = np.polynomial.Polynomial(
    [1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800, 1 / 1307674368000,
     -1 / 355687428096000]
)  # fmt: skip


class Motion(NamedTuple):
    """A curve at m points of normalised time.

    Attributes
    ----------
    q : (m, 4)
        Quaternions x, y, z, w, continuous in sign.
    v, a : (m, 3)
        Body rates and accelerations by normalised time [rad].
    """

    q: Array
    v: Array
    a: Array

    def moved(self, xi: Array, xi_1: Array, xi_2: Array) -> Motion:
        """The curve `R exp(hat(xi))`, by a rotation vector (m, 3) of at most 1 rad.

        Parameters
        ----------
        xi, xi_1, xi_2 : (m, 3)
            Rotation vectors and their first and second derivatives.
        """
        # w = J_r(xi) xi' is the rate of exp(hat(xi)) alone.
        z, z_1 = np.sum(xi * xi, axis=1)[:, None], 2.0 * np.sum(xi * xi_1, axis=1)[:, None]
        A, B = _FIRST(z), _SECOND(z)
        A_1, B_1 = z_1 * _FIRST.deriv()(z), z_1 * _SECOND.deriv()(z)
        c, c_1 = cross(xi, xi_1), cross(xi, xi_2)
        cc, cc_1 = cross(xi, c), cross(xi_1, c) + cross(xi, c_1)
        w = xi_1 - A * c + B * cc
        w_1 = xi_2 - A_1 * c - A * c_1 + B_1 * cc + B * cc_1
        turn = so3.quaternion_exp(xi)
        back = np.swapaxes(so3.quaternion_to_matrix(turn), 1, 2)
        seen = np.einsum("mij,mj->mi", back, self.v)
        q = so3.quaternion_multiply(self.q, turn)
        return Motion(
            q / np.linalg.norm(q, axis=1, keepdims=True),
            seen + w,
            np.einsum("mij,mj->mi", back, self.a) - cross(w, seen) + w_1,
        )


class TorqueCost:
    """`1/2 int (|u|^2 + sigma |v|^2 + sum V_i) ds` by quadrature.

    Parameters
    ----------
    problem
        On SO(3), with a duration.
    inertia : (3, 3)
        J [kg m^2].
    points, weights : (m,)
        Normalised times and weights of the quadrature; a point of weight 0 is only looked at.
    """

    def __init__(self, problem: Problem, inertia: Array, points: Array, weights: Array) -> None:
        self.inertia = inertia / (np.trace(inertia) / 3.0)
        self.sigma = problem.sigma * problem.duration**2
        self.points, self.weights = points, weights
        self._table = problem.forbidden.normalised_table(problem.duration)

    def torque(self, motion: Motion) -> Array:
        """`u = J a + v x J v` (m, 3)."""
        momentum = motion.v @ self.inertia
        return np.asarray(motion.a @ self.inertia + cross(motion.v, momentum))

    def effort(self, motion: Motion) -> float:
        """`int |u|^2 ds`."""
        return float(self.weights @ np.sum(self.torque(motion) ** 2, axis=1))

    def value(self, motion: Motion) -> float:
        """The cost; infinite where a point is in a forbidden set."""
        V = self._potentials(motion)[0]
        if not np.isfinite(V).all():
            return float("inf")
        tension = self.sigma * np.sum(motion.v**2, axis=1)
        return 0.5 * (self.effort(motion) + float(self.weights @ (tension + V)))

    def _potentials(self, motion: Motion) -> tuple[Array, Array, Array]:
        """V (m,), body gradients (m, 3) and covariant Hessians (m, 3, 3)."""
        rows = np.zeros((self.points.size, 10))
        if self._table.size:
            for k, (s, q) in enumerate(zip(self.points.tolist(), motion.q.tolist(), strict=True)):
                rows[k] = potential(self._table, s, *q, 0.0)
        H = rows[:, [4, 7, 8, 7, 5, 9, 8, 9, 6]].reshape(-1, 3, 3)
        return rows[:, 0], rows[:, 1:4], H

    def variations(self, motion: Motion) -> tuple[Array, Array, Array]:
        """First and second variation of the integrand by (xi, xi', xi'') at xi = 0.

        Returns
        -------
        gradient : (m, 9)
        hessian : (m, 9, 9)
        model : (m, 9, 9)
            The part of the Hessian that is positive semidefinite: torque and tension to first
            order in xi.
        """
        m, J = self.points.size, self.inertia
        v, a = motion.v, motion.a
        u, momentum = self.torque(motion), motion.v @ J
        identity = np.broadcast_to(np.eye(3), (m, 3, 3))
        zero = np.zeros((m, 3, 3))
        Dv = np.concatenate([so3.hat(v), identity, zero], axis=2)
        Da = np.concatenate([so3.hat(a), so3.hat(v), identity], axis=2)
        Du = J @ Da + (so3.hat(v) @ J - so3.hat(momentum)) @ Dv
        _, G, H = self._potentials(motion)
        gradient = np.einsum("mi,mij->mj", u, Du) + self.sigma * np.einsum("mi,mij->mj", v, Dv)
        gradient[:, :3] += 0.5 * G
        Dv_T, Du_T = np.swapaxes(Dv, 1, 2), np.swapaxes(Du, 1, 2)
        model = Du_T @ Du + self.sigma * (Dv_T @ Dv)
        # u . d2u with d2v = w x xi, d2a = w' x xi + w x xi':  c . (w x xi) = -w . hat(c) xi.
        p = u @ J
        k = cross(momentum, u) + cross(u, v) @ J + self.sigma * v
        second = -2.0 * (Dv_T @ so3.hat(u) @ J @ Dv)
        second[:, :, :3] -= np.swapaxes(Da, 1, 2) @ so3.hat(p) + Dv_T @ so3.hat(k)
        second[:, :, 3:6] -= Dv_T @ so3.hat(p)
        hessian = model + 0.5 * (second + np.swapaxes(second, 1, 2))
        hessian[:, :3, :3] += 0.5 * H
        return gradient, hessian, model
