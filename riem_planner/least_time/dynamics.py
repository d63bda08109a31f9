# SPDX-License-Identifier: Apache-2.0
"""One interval of motion with linear acceleration, and its derivatives.

From node to node over h, in normalised time and with `U = A_+ - A`,

    V_+ = V + h (A + U / 2),
    q_+ = q exp(theta),    theta = h V + h^2/2 A + h^2/6 U + h^3/12 V x (A + U / 2),

the Magnus series to third order. Under changes `q exp(d)` the end of a step changes by
`d_+ = defect + exp(-theta) d + J_r(theta) dtheta` to first order, with the defect
`log(q_+^-1 q exp(theta))`; the second order of `d_+` is `D x y / 2` for its last two terms D, y.
"""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.geometry.vectors import cross
from riem_planner.kernels import inlined, part
from riem_planner.least_time.vectors import plus, row


@inlined
def theta(k, V, A, h):
    """Rotation vector of the interval after node k, and the mean acceleration."""
    v, a = row(V, k), row(A, k)
    u = (A[k + 1, 0] - a[0], A[k + 1, 1] - a[1], A[k + 1, 2] - a[2])
    m = plus(a, u, 0.5)
    c = cross(v, m)
    f = h * h * h / 12
    return (
        h * (v[0] + h * (0.5 * a[0] + u[0] / 6)) + f * c[0],
        h * (v[1] + h * (0.5 * a[1] + u[1] / 6)) + f * c[1],
        h * (v[2] + h * (0.5 * a[2] + u[2] / 6)) + f * c[2],
    ), m


@inlined
def product(p, x):
    """Quaternion p exp(x) for a rotation vector x."""
    angle = np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    f = np.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    a, b, c, w = f * x[0], f * x[1], f * x[2], np.cos(0.5 * angle)
    return (
        p[3] * a + w * p[0] + p[1] * c - p[2] * b,
        p[3] * b + w * p[1] + p[2] * a - p[0] * c,
        p[3] * c + w * p[2] + p[0] * b - p[1] * a,
        p[3] * w - p[0] * a - p[1] * b - p[2] * c,
    )


@inlined
def difference(p, q):
    """Rotation vector log(p^-1 q) of two quaternions, the shorter way."""
    x = p[3] * q[0] - q[3] * p[0] - (p[1] * q[2] - p[2] * q[1])
    y = p[3] * q[1] - q[3] * p[1] - (p[2] * q[0] - p[0] * q[2])
    z = p[3] * q[2] - q[3] * p[2] - (p[0] * q[1] - p[1] * q[0])
    w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    s = np.sqrt(x * x + y * y + z * z)
    f = 2.0 * np.arctan2(s, w) / s if s > 1e-12 else 2.0
    return f * x, f * y, f * z


@inlined
def _skew(x):
    return (0.0, -x[2], x[1]), (x[2], 0.0, -x[0]), (-x[1], x[0], 0.0)


@part
def differentiate_step(k, V, A, back, by_motion):
    """`exp(-theta)` (3, 3) and `J_r(theta) dtheta` (3, 9) by V, A and U, of the interval k."""
    h = 1.0 / (V.shape[0] - 1)
    x, mean = theta(k, V, A, h)
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    angle = np.sqrt(square)
    if angle < 1e-3:
        f, g, c = 1 - square / 6, 0.5 - square / 24, 1 / 6 - square / 120
    else:
        f, g = np.sin(angle) / angle, (1 - np.cos(angle)) / square
        c = (1 - f) / square
    S, by_a, by_v = _skew(x), _skew(row(V, k)), _skew(mean)
    third = h * h * h / 12
    for i in range(3):
        for j in range(3):
            same = 1.0 if i == j else 0.0
            twice = x[i] * x[j] - same * square
            back[i, j] = same - f * S[i][j] + g * twice
            by_motion[i, j] = by_motion[i, 3 + j] = by_motion[i, 6 + j] = 0.0
    for i in range(3):
        for m in range(3):
            same = 1.0 if i == m else 0.0
            Jr = same - g * S[i][m] + c * (x[i] * x[m] - same * square)
            for j in range(3):
                e = 1.0 if m == j else 0.0
                by_motion[i, j] += Jr * (h * e - third * by_v[m][j])
                by_motion[i, 3 + j] += Jr * (0.5 * h * h * e + third * by_a[m][j])
                by_motion[i, 6 + j] += Jr * (h * h / 6 * e + 0.5 * third * by_a[m][j])
