# SPDX-License-Identifier: Apache-2.0
"""Rotations of single attitudes, for compiled code: quaternions x, y, z, w."""

from __future__ import annotations

import numpy as np

from riem_planner.kernels import inlined


@inlined
def turn(q, delta, scale, out):
    """Body rotation q exp(scale delta) of a unit quaternion, renormalised, into `out`."""
    x, y, z = scale * delta[0], scale * delta[1], scale * delta[2]
    angle = np.sqrt(x * x + y * y + z * z)
    f = np.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    x, y, z, w = f * x, f * y, f * z, np.cos(0.5 * angle)
    a, b, c, d = q[0], q[1], q[2], q[3]
    p0 = d * x + w * a + b * z - c * y
    p1 = d * y + w * b + c * x - a * z
    p2 = d * z + w * c + a * y - b * x
    p3 = d * w - a * x - b * y - c * z
    norm = 1.0 / np.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    out[0], out[1], out[2], out[3] = p0 * norm, p1 * norm, p2 * norm, p3 * norm


@inlined
def relative(p, q, out):
    """Rotation vector of p^-1 q, the shorter way, into the first three of `out`."""
    x = p[3] * q[0] - q[3] * p[0] - (p[1] * q[2] - p[2] * q[1])
    y = p[3] * q[1] - q[3] * p[1] - (p[2] * q[0] - p[0] * q[2])
    z = p[3] * q[2] - q[3] * p[2] - (p[0] * q[1] - p[1] * q[0])
    w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    s = np.sqrt(x * x + y * y + z * z)
    f = 2.0 * np.arctan2(s, w) / s if s > 0.0 else 2.0
    out[0], out[1], out[2] = f * x, f * y, f * z


@inlined
def ratio(p, q, out):
    """Quaternion p^-1 q, into `out`."""
    out[0] = p[3] * q[0] - q[3] * p[0] - (p[1] * q[2] - p[2] * q[1])
    out[1] = p[3] * q[1] - q[3] * p[1] - (p[2] * q[0] - p[0] * q[2])
    out[2] = p[3] * q[2] - q[3] * p[2] - (p[0] * q[1] - p[1] * q[0])
    out[3] = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]


@inlined
def tilt(q):
    """Direction of e3 turned by the quaternion q, (x, y), scaled to its angle from e3.

    The rotation vector without roll that turns e3 there is (-y, x, 0).
    """
    a, b, d, w = q[0], q[1], q[2], q[3]
    x, y, z = 2 * (a * d + w * b), 2 * (b * d - w * a), w * w - a * a - b * b + d * d
    size = np.sqrt(x * x + y * y)
    f = np.arctan2(size, z) / size if size > 0.0 else 1.0
    return f * x, f * y


@inlined
def rotated(q, x, y, z):
    """The vector (x, y, z) turned by the quaternion q."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    p, r, s = b * z - c * y, c * x - a * z, a * y - b * x
    return (
        x + 2.0 * (d * p + b * s - c * r),
        y + 2.0 * (d * r + c * p - a * s),
        z + 2.0 * (d * s + a * r - b * p),
    )
