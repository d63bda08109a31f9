# SPDX-License-Identifier: Apache-2.0
"""Descended curves as trajectories: quintic splines through their nodes.

Where Newton's method finds no extremal, a curve that the certificate accepts is an answer all the
same. The spline goes through quaternions (on S^2 directions), is normalised, and has the rates of
the problem at both ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.solver.setup import Setup

Array = NDArray[np.float64]

_MAGNUS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)


def splined(setup: Setup, times: Array, q: Array, parts: int = 2) -> tuple[Array, Array]:
    """Samples of the quintic spline through a discretised curve.

    Parameters
    ----------
    times : (N + 1,)
        Normalised.
    q : (N + 1, 4)
        Attitudes.
    parts
        Samples an interval.

    Returns
    -------
    times : (M,)
    states : (M, 13)
        Quaternion, body rate, its derivative, and zeros.
    """
    share = np.arange(parts) / parts
    at = np.append((times[:-1, None] + np.diff(times)[:, None] * share).ravel(), times[-1])
    states = np.zeros((at.size, 13))
    if setup.pointing:
        x = _through(times, _directions(q), _direction_rates(setup))
        states[:, :4], states[:, 4:7], states[:, 7:10] = _lifted(setup, x, at)
    else:
        goal = setup.goal_at(q[-1])
        turned = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
        q = np.concatenate([q[:1], turned[:, None] * q[1:]])
        ends = [0.5 * so3.quaternion_multiply(q[k], [*end[4:7], 0.0])
                for k, end in ((0, setup.start), (-1, goal))]  # fmt: skip
        u, u_1, u_2 = _normalised(_through(times, q, ends), at)
        back = so3.quaternion_conjugate(u)
        states[:, :4] = u
        states[:, 4:7] = 2.0 * so3.quaternion_multiply(back, u_1)[:, :3]
        states[:, 7:10] = 2.0 * so3.quaternion_multiply(back, u_2)[:, :3]
        states[[0, -1], 4:7] = setup.start[4:7], goal[4:7]
    return at, states


def _through(times: Array, points: Array, ends: list[Array]):  # type: ignore[no-untyped-def]
    """Quintic spline through points (N + 1, d), with its derivatives at both ends."""
    from scipy.interpolate import make_interp_spline  # slow to load, and seldom needed

    still = np.zeros(points.shape[1])
    conditions = tuple([(1, rate), (4, still)] for rate in ends)
    return make_interp_spline(times, points, k=5, bc_type=conditions)


def _normalised(spline, at: Array) -> tuple[Array, Array, Array]:  # type: ignore[no-untyped-def]
    """Unit vectors along a spline, and their first two derivatives, (m, d) each."""
    y, y_1, y_2 = (spline(at, k) for k in range(3))
    n = np.linalg.norm(y, axis=1, keepdims=True)
    u = y / n
    n_1 = np.sum(u * y_1, axis=1, keepdims=True)
    u_1 = (y_1 - n_1 * u) / n
    n_2 = np.sum(u * y_2, axis=1, keepdims=True) + n * np.sum(u_1 * u_1, axis=1, keepdims=True)
    return u, u_1, (y_2 - n_2 * u - 2.0 * n_1 * u_1) / n


def _directions(q: Array) -> Array:
    """Directions R e3 (n, 3)."""
    return np.asarray(so3.quaternion_to_matrix(q)[..., :, 2])


def _direction_rates(setup: Setup) -> list[Array]:
    """Velocities of the direction at both ends: R (v x e3)."""
    return [
        so3.quaternion_to_matrix(end[:4]) @ np.cross(end[4:7], [0.0, 0.0, 1.0])
        for end in (setup.start, setup.goal)
    ]


def _lifted(setup: Setup, spline, at: Array) -> tuple[Array, Array, Array]:  # type: ignore[no-untyped-def]
    """Roll-free attitudes (m, 4) along a spline of directions, with rates and accelerations."""
    h = np.diff(at)
    first, second = (np.cross(*_normalised(spline, at[:-1] + share * h)[:2]) for share in _MAGNUS)
    # One step of the fourth-order Magnus method for R' = hat(x cross x') R.
    turns = 0.5 * h[:, None] * (first + second) - (np.sqrt(3.0) / 12.0) * (
        h[:, None] ** 2 * np.cross(first, second)
    )
    steps = so3.quaternion_exp(turns)
    x, x_1, x_2 = _normalised(spline, at)
    q = np.empty((at.size, 4))
    q[0] = setup.start[:4]
    for k in range(h.size):
        step = so3.quaternion_multiply(steps[k], q[k])
        seen = so3.quaternion_to_matrix(step)[:, 2]
        q[k + 1] = so3.quaternion_multiply(so3.minimal_rotation(seen, x[k + 1]), step)
    back = np.swapaxes(so3.quaternion_to_matrix(q), 1, 2)
    rates = (np.einsum("nij,nj->ni", back, np.cross(x, y)) for y in (x_1, x_2))
    v, a = (np.column_stack([w[:, :2], np.zeros(len(w))]) for w in rates)
    return q, v, a
