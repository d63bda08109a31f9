# SPDX-License-Identifier: Apache-2.0
"""The quickest motion along a given path: its speed at each point, compiled.

Along a path by arc length with tangent w(s) the rate is `v = w s'`, and with `x = s'^2`, `u = s''`

    a = w u + w' x,    J a + v x J v = J w u + (J w' + w x J w) x,

and what wheels give likewise, plus `w x h sqrt(x)` with the total momentum h. Limits of rate and
momentum bound x; those of acceleration and torque leave an interval of u for each x. From the end
backwards, the largest x is found from which the rest can be kept; from the start on, the largest u
that stays below it (Bobrow, Dubowsky and Gibson 1985; Pham and Pham 2018).
"""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.kernels import kernel, part
from riem_planner.limit_rows import (
    ACCELERATION,
    MOMENTUM,
    RATE,
    TORQUE,
    WHEEL_MOMENTUM,
    WHEEL_TORQUE,
)

_HALVINGS = 25
_SLOW, _FAST = 1e-15, 1e300


@part
def _greatest_square(k, motion, table):
    """The largest x that limits of rate and momentum allow at point k."""
    norms, rows, first = table
    forces, _, _, still = motion
    x = _FAST
    for i in (RATE, MOMENTUM):
        f = forces[k, i]
        square = norms[i] ** 2 * (f[0] ** 2 + f[1] ** 2 + f[2] ** 2)
        if square > 0.0:
            x = min(x, 1.0 / square)
        for j in range(first[i], first[i + 1]):
            y = abs(rows[j, 0] * f[0] + rows[j, 1] * f[1] + rows[j, 2] * f[2])
            if y > 0.0:
                x = min(x, 1.0 / (y * y))
    f, h = forces[k, WHEEL_MOMENTUM], still[k]
    for j in range(first[WHEEL_MOMENTUM], first[WHEEL_MOMENTUM + 1]):
        y = rows[j, 0] * f[0] + rows[j, 1] * f[1] + rows[j, 2] * f[2]
        z = rows[j, 0] * h[0] + rows[j, 1] * h[1] + rows[j, 2] * h[2]
        # |z - y s'| <= 1, s' >= 0
        most = max(0.0, (1.0 + z) / y) if y > 0.0 else (max(0.0, (z - 1.0) / y) if y < 0.0 else 1e9)
        x = min(x, most * most)
    return x


@part
def _interval(k, x, motion, table):
    """Least and largest u that limits of acceleration and torque allow at point k for x."""
    norms, rows, first = table
    forces, bends, drags, _ = motion
    low, high = -_FAST, _FAST
    root = np.sqrt(x)
    for i in (ACCELERATION, TORQUE, WHEEL_TORQUE):
        f, b, c = forces[k, i], bends[k, i], drags[k, i]
        g = (b[0] * x + c[0] * root, b[1] * x + c[1] * root, b[2] * x + c[2] * root)
        if norms[i] > 0.0:
            A = f[0] ** 2 + f[1] ** 2 + f[2] ** 2
            B = f[0] * g[0] + f[1] * g[1] + f[2] * g[2]
            C = g[0] ** 2 + g[1] ** 2 + g[2] ** 2 - 1.0 / norms[i] ** 2
            D = B * B - A * C
            if D < 0.0:
                return 1.0, -1.0
            low, high = max(low, (-B - np.sqrt(D)) / A), min(high, (-B + np.sqrt(D)) / A)
        for j in range(first[i], first[i + 1]):
            y = rows[j, 0] * f[0] + rows[j, 1] * f[1] + rows[j, 2] * f[2]
            z = rows[j, 0] * g[0] + rows[j, 1] * g[1] + rows[j, 2] * g[2]
            if abs(y) > 0.0:
                low, high = max(low, (-z - np.sign(y)) / y), min(high, (-z + np.sign(y)) / y)
            elif abs(z) > 1.0:
                return 1.0, -1.0
    return low, high


@part
def _keeps(k, x, after, step, motion, table):
    """Whether from the square x of the speed at point k that of the next one can be kept."""
    least, most = _interval(k, x, motion, table)
    return least <= most and x + 2.0 * step * least <= after


@part
def _largest(k, after, step, motion, table):
    """The largest x at point k from which `after` can be kept at the next: doubled, then halved."""
    most = _greatest_square(k, motion, table)
    low, high = 0.0, min(most, max(after, _SLOW))
    while _keeps(k, high, after, step, motion, table):
        low = high
        if high >= most:
            return most
        high = min(most, 2.0 * high)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _keeps(k, middle, after, step, motion, table):
            low = middle
        else:
            high = middle
    return low


@kernel
def fastest(steps, motion, table, ends):
    """Squares x (n,) of the greatest speeds along a path; negative at first where there are none.

    Parameters
    ----------
    steps : (n - 1,)
        Between points of the path [rad].
    motion
        Per point and quantity (n, 8, 3): by u (of rate and momentum by s'), by x, by sqrt(x); and
        the total momentum in body axes (n, 3).
    table
        `LimitTable`.
    ends
        x at the start and at the goal.
    """
    n = motion[0].shape[0]
    x = np.empty(n)
    x[n - 1] = ends[1]
    for k in range(n - 2, -1, -1):
        x[k] = _largest(k, x[k + 1], steps[k], motion, table)
    if not ends[0] <= x[0] * (1.0 + 1e-9) + 1e-300:
        x[0] = -1.0
        return x
    x[0] = ends[0]
    for k in range(n - 1):
        least, most = _interval(k, x[k], motion, table)
        u = min(most, (x[k + 1] - x[k]) / (2.0 * steps[k]))
        if not u >= min(least, most) - 1e-6 * abs(least):
            x[0] = -1.0
            return x
        x[k + 1] = max(0.0, min(x[k + 1], x[k] + 2.0 * steps[k] * u))
    return x
