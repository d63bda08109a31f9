# SPDX-License-Identifier: Apache-2.0
"""Forbidden sets as constraints on the attitude, with two derivatives.

With `y = R^T s` the axis of a cone in body axes, a boresight b and an attitude Q with
`x = R^T Q`'s quaternion, under `R exp(hat(d))` to second order

    u = y . b,     du = b x y,           d2u = -u I + (y b^T + b y^T) / 2;
    u = x_w^2,     du = x_w x_xyz,       d2u = (x_xyz x_xyz^T - x_w^2 I) / 2.

Kept out is `u - level <= 0`. Kept in at least one of several is the mean of `u - level >= 0` with
weights `exp(beta (u - level))`: never above the greatest, and equal to it where one is far ahead
or all are the same.
"""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.geometry.vectors import cross
from riem_planner.kernels import inlined, part
from riem_planner.least_time.model import ATTITUDE, KIND, MEMBER, MEMBERS, OUT
from riem_planner.least_time.vectors import seen

_SHARPNESS = 60.0  # beta


@inlined
def _about_attitude(i, k, q, dt, model, by_d, by_dd):
    p, e = model.place[i, k], model.drift[i, k]
    Q = (p[0] + dt * e[0], p[1] + dt * e[1], p[2] + dt * e[2], p[3] + dt * e[3])
    x, y, z, w = -q[k, 0], -q[k, 1], -q[k, 2], q[k, 3]
    r = (
        w * Q[0] + Q[3] * x + y * Q[2] - z * Q[1],
        w * Q[1] + Q[3] * y + z * Q[0] - x * Q[2],
        w * Q[2] + Q[3] * z + x * Q[1] - y * Q[0],
    )
    c = w * Q[3] - x * Q[0] - y * Q[1] - z * Q[2]
    for a in range(3):
        by_d[a] = c * r[a]
        for b in range(3):
            by_dd[a, b] = 0.5 * r[a] * r[b]
        by_dd[a, a] -= 0.5 * c * c
    by_tau = 2 * c * (q[k, 0] * e[0] + q[k, 1] * e[1] + q[k, 2] * e[2] + q[k, 3] * e[3])
    return c * c - model.level[i, k], by_tau


@inlined
def _in_cone(i, k, q, dt, model, by_d, by_dd):
    p, e, axis = model.place[i, k], model.drift[i, k], model.boresight[i]
    b = (axis[0], axis[1], axis[2])
    y = seen(q, k, (p[0] + dt * e[0], p[1] + dt * e[1], p[2] + dt * e[2]))
    u = y[0] * b[0] + y[1] * b[1] + y[2] * b[2]
    g = cross(b, y)
    for r in range(3):
        by_d[r] = g[r]
        for c in range(3):
            by_dd[r, c] = 0.5 * (y[r] * b[c] + b[r] * y[c])
        by_dd[r, r] -= u
    y = seen(q, k, (e[0], e[1], e[2]))
    return u - model.level[i, k], y[0] * b[0] + y[1] * b[1] + y[2] * b[2]


@part
def _united(first, count, k, q, dt, model, by_d, by_dd):
    """The weighted mean of several cones, and its derivatives; of second ones the members' own."""
    g, H = np.empty(3), np.empty((3, 3))
    best, total, mean, by_tau = -np.inf, 0.0, 0.0, 0.0
    for i in range(first, first + count):
        best = max(best, _in_cone(i, k, q, dt, model, g, H)[0])
    for i in range(first, first + count):
        u = _in_cone(i, k, q, dt, model, g, H)[0]
        weight = np.exp(_SHARPNESS * (u - best))
        total += weight
        mean += weight * u
    mean /= total
    by_d[:] = 0.0
    by_dd[:] = 0.0
    for i in range(first, first + count):
        u, t = _in_cone(i, k, q, dt, model, g, H)
        weight = np.exp(_SHARPNESS * (u - best)) / total * (1.0 + _SHARPNESS * (u - mean))
        by_tau += weight * t
        for a in range(3):
            by_d[a] += weight * g[a]
            for b in range(3):
                by_dd[a, b] += weight * H[a, b]
    return mean, by_tau


@part
def forbidden(j, k, q, dt, model, by_d, by_dd):
    """Constraint of set j at node k, at most 0 where it is kept, and its derivative by T/T_0.

    Derivatives by d go into `by_d` (3,) and `by_dd` (3, 3); `dt` is `T/T_0 - 1`.
    """
    kind, first, count = model.sets[j, KIND], model.sets[j, MEMBER], model.sets[j, MEMBERS]
    if kind == ATTITUDE:
        return _about_attitude(first, k, q, dt, model, by_d, by_dd)
    if kind == OUT:
        return _in_cone(first, k, q, dt, model, by_d, by_dd)
    if count == 1:
        u, by_tau = _in_cone(first, k, q, dt, model, by_d, by_dd)
    else:
        u, by_tau = _united(first, count, k, q, dt, model, by_d, by_dd)
    for a in range(3):
        by_d[a] = -by_d[a]
        for b in range(3):
            by_dd[a, b] = -by_dd[a, b]
    return -u, -by_tau
