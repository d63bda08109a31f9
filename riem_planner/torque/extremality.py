# SPDX-License-Identifier: Apache-2.0
"""How nearly a trajectory satisfies the first-order conditions of the torque's cost.

`m' = m x v + F` says that `R m` gains `R F`; with `m = L_v - p'` and integrated twice it needs no
derivative that a trajectory does not have:

    p = integral( L_v - R^T integral(R F) ) + p_0 - integral(R^T) c

with two constant vectors. `F` is from the formulas in NumPy of the potential as stated, and
the integrals are by another rule than the descent's: they share nothing with it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.geometry.sphere import cross
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_POINTS = 5


def _rule() -> tuple[Array, Array]:
    """Chebyshev points of [0, 1], ends included, and the integrals (points, points) up to each."""
    nodes = 0.5 * (1.0 - np.cos(np.pi * np.arange(_POINTS) / (_POINTS - 1)))
    degree = np.arange(_POINTS)
    powers = np.vander(nodes, increasing=True)
    upto = (nodes[:, None] ** (degree + 1) / (degree + 1)) @ np.linalg.inv(powers)
    return nodes, upto


_NODES, _UPTO = _rule()


def _integrated(values: Array, h: Array) -> Array:
    """Integral (n, points, ...) from 0 of values (n, points, ...) on intervals of lengths (n,)."""
    within = np.einsum("ij,nj...->ni...", _UPTO, values)
    within = within * h.reshape(-1, *([1] * (values.ndim - 1)))
    before = np.cumsum(within[:, -1], axis=0) - within[:, -1]
    return np.asarray(before[:, None] + within)


def torque_extremality(trajectory: Trajectory, problem: Problem, inertia: ArrayLike) -> float:
    """Residual of the first-order conditions integrated twice, relative to the largest |J u|.

    0 for an exact extremal; NaN where the trajectory enters a zone.

    Parameters
    ----------
    trajectory
        On SO(3).
    problem
        Tension and obstacles; its duration is the trajectory's.
    inertia : (3, 3)
        J [kg m^2].
    """
    J = np.asarray(inertia, dtype=float)
    J = J / (np.trace(J) / 3.0)
    h = np.diff(trajectory.times)
    t = np.minimum(trajectory.times[:-1, None] + h[:, None] * _NODES, trajectory.duration)
    R, v, a = trajectory.evaluate(t)
    attitudes = R.reshape(-1, 3, 3)
    F = problem.forbidden.repulsion(attitudes, t.ravel(), problem.duration)[1].reshape(v.shape)
    if not np.all(np.isfinite(F)):
        return float("nan")
    momentum = v @ J
    u = a @ J + cross(v, momentum)
    p = u @ J
    L_v = problem.sigma * v + cross(momentum, u) + cross(u, v) @ J
    gained = _integrated(np.einsum("nkij,nkj->nki", R, F), h)
    expected = _integrated(L_v - np.einsum("nkji,nkj->nki", R, gained), h)
    back = _integrated(np.swapaxes(R, 2, 3), h) / trajectory.duration
    identity = np.broadcast_to(np.eye(3), back.shape)
    constants = np.concatenate([identity, back], axis=3).reshape(-1, 6)
    rest = (p - expected).ravel()
    fit, *_ = np.linalg.lstsq(constants, rest, rcond=None)
    residual = np.linalg.norm((rest - constants @ fit).reshape(-1, 3), axis=1).max()
    return float(residual / np.linalg.norm(p, axis=2).max()) if residual > 0.0 else 0.0
