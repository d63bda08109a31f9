# SPDX-License-Identifier: Apache-2.0
"""Small vectors as tuples, and blocks of matrices, for compiled code."""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

from riem_planner.kernels import inlined


@inlined
def row(X, k):
    """Row k of an array (n, 3)."""
    return X[k, 0], X[k, 1], X[k, 2]


@inlined
def plus(a, b, scale):
    """`a + scale b`."""
    return a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]


@inlined
def times(J, x):
    """Matrix (3, 3) times a vector."""
    return (
        J[0, 0] * x[0] + J[0, 1] * x[1] + J[0, 2] * x[2],
        J[1, 0] * x[0] + J[1, 1] * x[1] + J[1, 2] * x[2],
        J[2, 0] * x[0] + J[2, 1] * x[1] + J[2, 2] * x[2],
    )


@inlined
def seen(q, k, s):
    """The vector s of the reference frame in the body axes of attitude k, `R^T s`."""
    x, y, z, w = -q[k, 0], -q[k, 1], -q[k, 2], q[k, 3]
    t = (y * s[2] - z * s[1], z * s[0] - x * s[2], x * s[1] - y * s[0])
    return (
        s[0] + 2 * (w * t[0] + y * t[2] - z * t[1]),
        s[1] + 2 * (w * t[1] + z * t[0] - x * t[2]),
        s[2] + 2 * (w * t[2] + x * t[1] - y * t[0]),
    )


@inlined
def add_matrix(out, column, J, scale):
    """Add `scale J` to three columns."""
    for i in range(3):
        for j in range(3):
            out[i, column + j] += scale * J[i, j]


@inlined
def add_diagonal(out, column, scale):
    """Add `scale I` to three columns."""
    for i in range(3):
        out[i, column + i] += scale


@inlined
def add_hat(out, column, x, scale):
    """Add `scale hat(x)` to three columns."""
    out[0, column + 1] -= scale * x[2]
    out[0, column + 2] += scale * x[1]
    out[1, column] += scale * x[2]
    out[1, column + 2] -= scale * x[0]
    out[2, column] -= scale * x[1]
    out[2, column + 1] += scale * x[0]


@inlined
def add_hat_times(out, column, x, J, scale):
    """Add `scale hat(x) J` to three columns."""
    for j in range(3):
        out[0, column + j] += scale * (x[1] * J[2, j] - x[2] * J[1, j])
        out[1, column + j] += scale * (x[2] * J[0, j] - x[0] * J[2, j])
        out[2, column + j] += scale * (x[0] * J[1, j] - x[1] * J[0, j])
