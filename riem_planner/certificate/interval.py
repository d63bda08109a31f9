# SPDX-License-Identifier: Apache-2.0
"""The published quintics on an interval of time: their values, and bounds that hold throughout.

Within interval k the attitude is `R_k exp(hat(xi(s)))` with a quintic xi. The right Jacobian of
the exponential is the mean of `exp(-hat(u xi))` over u in [0, 1], whose norm is at most 1 and
whose rate of change is at most `|xi'| / 2`. So everywhere

    |v| <= |xi'|,    |a| <= |xi''| + |xi'|^2 / 2,

and a polynomial on an interval lies in the convex hull of its Bernstein coefficients, so its
norm is at most the largest of theirs.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.geometry.vectors import cross, plus
from riem_planner.kernels import inlined


@inlined
def quaternion_times(p, q):
    """Hamilton product of two quaternions x, y, z, w."""
    return (
        p[3] * q[0] + q[3] * p[0] + p[1] * q[2] - p[2] * q[1],
        p[3] * q[1] + q[3] * p[1] + p[2] * q[0] - p[0] * q[2],
        p[3] * q[2] + q[3] * p[2] + p[0] * q[1] - p[1] * q[0],
        p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2],
    )


@inlined
def quaternion_of(xi):
    """Unit quaternion of a rotation vector [rad]."""
    x, y, z = xi
    square = x * x + y * y + z * z
    if square < 1e-8:
        factor = 0.5 - square / 48.0
        return factor * x, factor * y, factor * z, 1.0 - square / 8.0 + square * square / 384.0
    angle = np.sqrt(square)
    factor = np.sin(0.5 * angle) / angle
    return factor * x, factor * y, factor * z, np.cos(0.5 * angle)


@inlined
def rotated(q, b):
    """Vector b turned by a quaternion, times the quaternion's squared norm."""
    tx = q[1] * b[2] - q[2] * b[1] + q[3] * b[0]
    ty = q[2] * b[0] - q[0] * b[2] + q[3] * b[1]
    tz = q[0] * b[1] - q[1] * b[0] + q[3] * b[2]
    tw = q[0] * b[0] + q[1] * b[1] + q[2] * b[2]
    return (
        tw * q[0] + q[3] * tx + q[1] * tz - q[2] * ty,
        tw * q[1] + q[3] * ty + q[2] * tx - q[0] * tz,
        tw * q[2] + q[3] * tz + q[0] * ty - q[1] * tx,
    )


@inlined
def quintic(c, k, s):
    """The rotation vector xi at time s after sample k."""
    a = b = d = 0.0
    for i in range(5, 0, -1):
        a, b, d = s * (a + c[k, i, 0]), s * (b + c[k, i, 1]), s * (d + c[k, i, 2])
    return a, b, d


@inlined
def sample(quaternions, k):
    """Quaternion of sample k."""
    return quaternions[k, 0], quaternions[k, 1], quaternions[k, 2], quaternions[k, 3]


@inlined
def attitude(quaternions, c, k, s):
    """Quaternion of the trajectory at time s after sample k."""
    p = sample(quaternions, k)
    if s == 0.0:
        return p
    return quaternion_times(p, quaternion_of(quintic(c, k, s)))


@inlined
def motion_bounds(c, k, s, h):
    """Upper bounds of |v| and |a| on [s, s + h] of one interval."""
    V0 = V1 = V2 = V3 = V4 = A0 = A1 = A2 = A3 = 0.0
    for i in range(3):
        c1, c2, c3, c4, c5 = c[k, 1, i], c[k, 2, i], c[k, 3, i], c[k, 4, i], c[k, 5, i]
        # Taylor coefficients of xi' at s, times powers of h, and their Bernstein form.
        p0 = c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))
        p1 = h * (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5)))
        p2 = h * h * (3 * c3 + s * (12 * c4 + s * 30 * c5))
        p3 = h * h * h * (4 * c4 + s * 20 * c5)
        p4 = h * h * h * h * 5 * c5
        V0 += p0**2
        V1 += (p0 + p1 / 4) ** 2
        V2 += (p0 + p1 / 2 + p2 / 6) ** 2
        V3 += (p0 + 3 * p1 / 4 + p2 / 2 + p3 / 4) ** 2
        V4 += (p0 + p1 + p2 + p3 + p4) ** 2
        A0 += p1**2
        A1 += (p1 + 2 * p2 / 3) ** 2
        A2 += (p1 + 4 * p2 / 3 + p3) ** 2
        A3 += (p1 + 2 * p2 + 3 * p3 + 4 * p4) ** 2
    V = np.sqrt(max(V0, V1, V2, V3, V4))
    return V, np.sqrt(max(A0, A1, A2, A3)) / h + 0.5 * V * V


@inlined
def derivatives(c, k, s):
    """xi, xi' and xi'' at time s after sample k."""
    u = v = w = u_1 = v_1 = w_1 = 0.0
    for i in range(5, 0, -1):
        u_1, v_1, w_1 = s * u_1 + i * c[k, i, 0], s * v_1 + i * c[k, i, 1], s * w_1 + i * c[k, i, 2]
    for i in range(5, 1, -1):
        factor = i * (i - 1)
        u = s * u + factor * c[k, i, 0]
        v = s * v + factor * c[k, i, 1]
        w = s * w + factor * c[k, i, 2]
    return quintic(c, k, s), (u_1, v_1, w_1), (u, v, w)


@inlined
def motion(xi, xi_1, xi_2):
    """Body rate and acceleration of `exp(hat(xi))` from xi and its derivatives.

    `v = xi' - A c + B xi x c` with `c = xi x xi'`, `A = (1 - cos x) / x^2`,
    `B = (x - sin x) / x^3`, `x = |xi|`, and a is its derivative.
    """
    z = xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2
    inner = xi[0] * xi_1[0] + xi[1] * xi_1[1] + xi[2] * xi_1[2]
    if z < 0.04:
        A = 0.5 - z / 24 * (1 - z / 30 * (1 - z / 56 * (1 - z / 90)))
        B = 1 / 6 - z / 120 * (1 - z / 42 * (1 - z / 72 * (1 - z / 110)))
        A_1 = -inner / 12 * (1 - z / 15 * (1 - z * 3 / 112 * (1 - z * 2 / 135)))
        B_1 = -inner / 60 * (1 - z / 21 * (1 - z / 48 * (1 - z * 2 / 165)))
    else:
        x = np.sqrt(z)
        A = (1 - np.cos(x)) / z
        B = (x - np.sin(x)) / (x * z)
        A_1 = inner * (1 - z * B - 2 * A) / z
        B_1 = inner * (A - 3 * B) / z
    c = cross(xi, xi_1)
    d = cross(xi, c)
    e = cross(xi, xi_2)
    f = cross(xi_1, c)
    g = cross(xi, e)
    v = (
        xi_1[0] - A * c[0] + B * d[0],
        xi_1[1] - A * c[1] + B * d[1],
        xi_1[2] - A * c[2] + B * d[2],
    )
    a = (
        xi_2[0] - A * e[0] - A_1 * c[0] + B_1 * d[0] + B * (f[0] + g[0]),
        xi_2[1] - A * e[1] - A_1 * c[1] + B_1 * d[1] + B * (f[1] + g[1]),
        xi_2[2] - A * e[2] - A_1 * c[2] + B_1 * d[2] + B * (f[2] + g[2]),
    )
    return v, a


@inlined
def _curvatures(z):
    """A, B of `motion` as functions of `z = |xi|^2`, and their two derivatives by z."""
    if z < 0.25:
        A = B = A_1 = B_1 = A_2 = B_2 = 0.0
        term = 1.0  # (-1)^k / (2 k + 1)!
        powers = (1.0, 0.0, 0.0)  # z^k and its derivatives
        for k in range(10):
            a, b = term / (2 * k + 2), term / ((2 * k + 2) * (2 * k + 3))
            A, A_1, A_2 = A + a * powers[0], A_1 + a * powers[1], A_2 + a * powers[2]
            B, B_1, B_2 = B + b * powers[0], B_1 + b * powers[1], B_2 + b * powers[2]
            powers = (z * powers[0], (k + 1) * powers[0], (k + 1) * powers[1])
            term = -b
        return A, B, A_1, B_1, A_2, B_2
    x = np.sqrt(z)
    A, B = (1 - np.cos(x)) / z, (x - np.sin(x)) / (x * z)
    A_1, B_1 = (1 - z * B - 2 * A) / (2 * z), (A - 3 * B) / (2 * z)
    return A, B, A_1, B_1, -(B + z * B_1 + 4 * A_1) / (2 * z), (A_1 - 5 * B_1) / (2 * z)


@inlined
def jerk(xi, xi_1, xi_2, xi_3):
    """Second derivative of the body rate of `exp(hat(xi))`; see `motion`."""
    z = xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2
    z_1 = 2 * (xi[0] * xi_1[0] + xi[1] * xi_1[1] + xi[2] * xi_1[2])
    z_2 = 2 * (xi_1[0] ** 2 + xi_1[1] ** 2 + xi_1[2] ** 2)
    z_2 += 2 * (xi[0] * xi_2[0] + xi[1] * xi_2[1] + xi[2] * xi_2[2])
    A, B, A_z, B_z, A_zz, B_zz = _curvatures(z)
    A_1, A_2 = A_z * z_1, A_zz * z_1 * z_1 + A_z * z_2
    B_1, B_2 = B_z * z_1, B_zz * z_1 * z_1 + B_z * z_2
    c, c_1 = cross(xi, xi_1), cross(xi, xi_2)
    c_2 = plus(cross(xi_1, xi_2), cross(xi, xi_3))
    d, d_1 = cross(xi, c), plus(cross(xi_1, c), cross(xi, c_1))
    e, f = cross(xi_1, c_1), plus(cross(xi_2, c), cross(xi, c_2))
    return (
        xi_3[0] - A * c_2[0] - 2 * A_1 * c_1[0] - A_2 * c[0]
        + B * (2 * e[0] + f[0]) + 2 * B_1 * d_1[0] + B_2 * d[0],
        xi_3[1] - A * c_2[1] - 2 * A_1 * c_1[1] - A_2 * c[1]
        + B * (2 * e[1] + f[1]) + 2 * B_1 * d_1[1] + B_2 * d[1],
        xi_3[2] - A * c_2[2] - 2 * A_1 * c_1[2] - A_2 * c[2]
        + B * (2 * e[2] + f[2]) + 2 * B_1 * d_1[2] + B_2 * d[2],
    )  # fmt: skip


@inlined
def third_derivative(c, k, s):
    """Third derivative of xi at time s after sample k."""
    return (
        6 * c[k, 3, 0] + s * (24 * c[k, 4, 0] + s * 60 * c[k, 5, 0]),
        6 * c[k, 3, 1] + s * (24 * c[k, 4, 1] + s * 60 * c[k, 5, 1]),
        6 * c[k, 3, 2] + s * (24 * c[k, 4, 2] + s * 60 * c[k, 5, 2]),
    )


@inlined
def rate_bend(c, k, s, h):
    """Upper bound of the rate's second derivative on [s, s + h] of one interval.

    The rate is the mean of E(u) xi' over u in [0, 1], with `E(u) = exp(-hat(u xi))`, whose
    derivatives are at most `u |xi'|` and `u |xi''| + 3 u^2 |xi'|^2 / 2`. So
    `|v''| <= |xi^(3)| + 3 |xi'| |xi''| / 2 + |xi'|^3 / 2`.
    """
    P0 = P1 = P2 = 0.0
    for i in range(3):
        c3, c4, c5 = c[k, 3, i], c[k, 4, i], c[k, 5, i]
        p0 = 6 * c3 + s * (24 * c4 + s * 60 * c5)
        p1 = h * (24 * c4 + s * 120 * c5)
        p2 = h * h * 60 * c5
        P0 += p0**2
        P1 += (p0 + p1 / 2) ** 2
        P2 += (p0 + p1 + p2) ** 2
    V, A = motion_bounds(c, k, s, h)
    return np.sqrt(max(P0, P1, P2)) + 1.5 * V * (A - 0.5 * V * V) + 0.5 * V**3


@inlined
def all_finite(c):
    """Whether an array of three dimensions holds no NaN and no infinity."""
    total = 0.0
    for k in range(c.shape[0]):
        for i in range(c.shape[1]):
            for j in range(c.shape[2]):
                total += abs(c[k, i, j])
    # Not isfinite: it subtracts, and reassociation may turn the difference of sums into zero.
    return total < np.inf


@inlined
def rows_finite(a):
    """Whether an array of two dimensions holds no NaN and no infinity."""
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += abs(a[i, j])
    return total < np.inf
