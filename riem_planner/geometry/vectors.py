# SPDX-License-Identifier: Apache-2.0
"""Vectors of three numbers as tuples, for compiled code: no memory, and read like formulas."""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.kernels import inlined


@inlined
def dot(a, b):
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inlined
def norm(a):
    """Length."""
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@inlined
def scaled(factor, a):
    """A number times a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def plus(a, b):
    """Sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def turned_back(q, s):
    """`R^T s`, a vector turned by the inverse of a unit quaternion x, y, z, w."""
    n = (q[0], q[1], q[2])
    c = cross(n, s)
    d = cross(n, c)
    return (
        s[0] - 2.0 * (q[3] * c[0] - d[0]),
        s[1] - 2.0 * (q[3] * c[1] - d[1]),
        s[2] - 2.0 * (q[3] * c[2] - d[2]),
    )
