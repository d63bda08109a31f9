# SPDX-License-Identifier: Apache-2.0
"""Quaternions and the curve between the samples of a reference, in plain numbers.

Written anew on purpose: what judges the planner shares no formula with it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class State(NamedTuple):
    """Attitude (x, y, z, w), body rate [rad/s] and body acceleration [rad/s^2] at a stamp [ns]."""

    stamp_ns: int
    q: Quaternion
    v: Vector
    a: Vector


def norm(x: Vector | Quaternion) -> float:
    """Euclidean norm."""
    return math.hypot(*x)


def dot(x: Vector | Quaternion, y: Vector | Quaternion) -> float:
    """Inner product."""
    return sum(a * b for a, b in zip(x, y, strict=True))


def cross(x: Vector, y: Vector) -> Vector:
    """Vector product."""
    return (
        x[1] * y[2] - x[2] * y[1],
        x[2] * y[0] - x[0] * y[2],
        x[0] * y[1] - x[1] * y[0],
    )


def combined(*terms: tuple[float, Vector]) -> Vector:
    """Sum of vectors, each times a number."""
    x, y, z = (sum(c * vector[i] for c, vector in terms) for i in range(3))
    return x, y, z


def turned(q: Quaternion, x: Vector) -> Vector:
    """A body vector in the reference frame."""
    u = (q[0], q[1], q[2])
    c = cross(u, x)
    return combined((1.0, x), (2.0 * q[3], c), (2.0, cross(u, c)))


def about(rotation: Vector, x: Vector) -> Vector:
    """A vector turned by a rotation vector [rad]."""
    angle = norm(rotation)
    share = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    u = combined((share, rotation))
    return turned((*u, math.cos(0.5 * angle)), x)


def angle_between(x: Vector, y: Vector) -> float:
    """Angle of two directions [rad]."""
    return math.atan2(norm(cross(x, y)), dot(x, y))


def turn_between(p: Quaternion, q: Quaternion) -> Vector:
    """Rotation vector [rad] from one attitude to another, in body axes; the shorter way."""
    u, w = (p[0], p[1], p[2]), p[3]
    x = (q[0], q[1], q[2])
    part = combined((w, x), (-q[3], u), (-1.0, cross(u, x)))
    real = w * q[3] + dot(u, x)
    if real < 0.0:
        part, real = combined((-1.0, part)), -real
    sine = norm(part)
    return combined((2.0 * math.atan2(sine, real) / sine if sine > 0.0 else 2.0, part))


def between(before: State, after: State, stamp_ns: int) -> Quaternion:
    """Attitude between two samples: the rotation vector is the quintic that meets both.

    Rates and accelerations at the far end are carried back to first order in the turn, which the
    samples of a reference keep small enough (error below a hundredth of the turn cubed).
    """
    h = 1e-9 * (after.stamp_ns - before.stamp_ns)
    s = 1e-9 * (stamp_ns - before.stamp_ns) / h
    D = turn_between(before.q, after.q)
    v0, a0 = combined((h, before.v)), combined((h * h, before.a))
    v1 = _carried(D, combined((h, after.v)))
    w = combined((h, after.v))
    # Of xi' = w + xi x w / 2 + xi x (xi x w) / 12 the second derivative at the end.
    first = combined((0.5, cross(v1, w)))
    second = combined((1.0 / 12.0, cross(v1, cross(D, w))), (1.0 / 12.0, cross(D, cross(v1, w))))
    a1 = combined((1.0, _carried(D, combined((h * h, after.a)))), (1.0, first), (1.0, second))
    c3 = combined((10.0, D), (-6.0, v0), (-4.0, v1), (-1.5, a0), (0.5, a1))
    c4 = combined((-15.0, D), (8.0, v0), (7.0, v1), (1.5, a0), (-1.0, a1))
    c5 = combined((6.0, D), (-3.0, v0), (-3.0, v1), (-0.5, a0), (0.5, a1))
    xi = combined((s, v0), (0.5 * s**2, a0), (s**3, c3), (s**4, c4), (s**5, c5))
    return _after(before.q, xi)


def _carried(D: Vector, w: Vector) -> Vector:
    """Derivative of the rotation vector D along a body rate w: the inverse right Jacobian.

    Its series; what is left out is below `|D|^4 |w| / 700`.
    """
    c = cross(D, w)
    return combined((1.0, w), (0.5, c), (1.0 / 12.0, cross(D, c)))


def _after(q: Quaternion, xi: Vector) -> Quaternion:
    angle = norm(xi)
    share = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    x, w = combined((share, xi)), math.cos(0.5 * angle)
    u = (q[0], q[1], q[2])
    part = combined((q[3], x), (w, u), (1.0, cross(u, x)))
    return (*part, q[3] * w - dot(u, x))
