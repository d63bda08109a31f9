"""Lower bounds, in continuous time, of the distance between a trajectory and what is forbidden.

The margin of a forbidden set is `d - r` (kept out) or the largest `r - d` of its members (kept
in). Between two times h apart, with margins m_0 and m_1, it is at least

- `(m_0 + m_1 - L h) / 2`: a distance changes no faster than `L = max|v| + |rate|`;
- `min(m_0, m_1) - M h^2 / 8`, where M bounds its second derivative from above: the graph of m
  lies no deeper than that below its chord. Of the distance to a direction
  `d'' <= |w'| + w^2 / 2 + w^2 max(0, cot d)`, of that to an attitude
  `d'' <= |w'| + w^2 max(0, cot(d/2)) / 2`, with the rate `w` relative to the obstacle,
  `|w| <= L`, `|w'| <= |a| + |v| |rate|`. (The Hessian of the distance is `cot d` and
  `cot(d/2) / 2` across the gradient and 0 along it; `w^2 / 2` bounds the product of roll and
  pointing rate.) For a margin kept in, `-d''` takes the place of `d''`.

Intervals are halved until the better of the two is within `TIGHTNESS` of the least margin found.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import (
    all_finite,
    attitude,
    cross,
    motion_bounds,
    norm,
    quaternion_of,
    quaternion_times,
    rotated,
    rows_finite,
)
from riem_planner.kernels import inlined, kernel
from riem_planner.obstacles.table import (
    BORESIGHT,
    GROUP,
    KEEP_IN,
    KIND,
    ORIENTATION,
    PLACE,
    RADIUS,
    RATE,
)

TIGHTNESS = 1e-4
"""A reported clearance is less than the true one by at most this [rad], ..."""
RELATIVE_TIGHTNESS = 0.01
"""... or by this part of it, whichever is smaller, ..."""
LEAST_TIGHTNESS = 1e-9
"""... but no tighter than this [rad]: what is closer counts as touched."""
ROUNDING = 1e-12
"""Subtracted from every clearance [rad]; rounding of a distance is a hundred times smaller."""

_STEEP = 1e30  # stands for infinity, but gives 0 times 0
_DEPTH = 48  # halvings of one interval
_EVALUATIONS = 200_000  # per forbidden set; a hundredth suffices wherever the margin is above 1e-6


@inlined
def _distance(rows, i, q, t):
    """Distance of the attitude q at time t to obstacle i."""
    x, y, z = rows[i, RATE], rows[i, RATE + 1], rows[i, RATE + 2]
    if x != 0.0 or y != 0.0 or z != 0.0:
        # The frame that turns with the obstacle, in which it is fixed.
        q = quaternion_times(quaternion_of((-x * t, -y * t, -z * t)), q)
    place = (rows[i, PLACE], rows[i, PLACE + 1], rows[i, PLACE + 2])
    if rows[i, KIND] == ORIENTATION:
        p = quaternion_times((-place[0], -place[1], -place[2], rows[i, PLACE + 3]), q)
        return 2.0 * np.arctan2(norm((p[0], p[1], p[2])), abs(p[3]))
    b = (rows[i, BORESIGHT], rows[i, BORESIGHT + 1], rows[i, BORESIGHT + 2])
    x = rotated(q, b)
    cosine = x[0] * place[0] + x[1] * place[1] + x[2] * place[2]
    return np.arctan2(norm(cross(x, place)), cosine)


@inlined
def _curvature(kind, low, high):
    """Largest factor of w^2 in the second derivative of the margin, for low <= d <= high."""
    if kind == ORIENTATION:
        return 0.5 / np.tan(0.5 * low) if low > 0.0 else _STEEP
    if kind == KEEP_IN:
        low = np.pi - high  # the margin of the opposite cone, kept out
    return 0.5 + max(0.0, 1.0 / np.tan(low)) if low > 0.0 else _STEEP


@inlined
def _own_margin(rows, i, distance):
    """Margin of obstacle i at a distance."""
    outside = distance - rows[i, RADIUS]
    return -outside if rows[i, KIND] == KEEP_IN else outside


@inlined
def _speed(rows, i):
    """Angular speed of obstacle i."""
    return np.sqrt(rows[i, RATE] ** 2 + rows[i, RATE + 1] ** 2 + rows[i, RATE + 2] ** 2)


@inlined
def _first_bound(first, end, rows, left, right, depth, V, h):
    """Lower bound of a set's margin between distances left and right, by its rate of change."""
    m_0 = m_1 = -np.inf
    L = 0.0
    for i in range(first, end):
        L = max(L, V + _speed(rows, i))
        m_0 = max(m_0, _own_margin(rows, i, left[i]))
        m_1 = max(m_1, _own_margin(rows, i, right[depth, i]))
    return 0.5 * (m_0 + m_1 - L * h)


@inlined
def _second_bound(first, end, rows, left, right, depth, V, A, h):
    """Lower bound of a set's margin between distances left and right, by its curvature."""
    bound = -np.inf
    for i in range(first, end):
        d_0, d_1, rate = left[i], right[depth, i], _speed(rows, i)
        w = V + rate
        mean, half = 0.5 * (d_0 + d_1), 0.5 * w * h
        M = A + V * rate + w * w * _curvature(rows[i, KIND], mean - half, mean + half)
        lower = min(_own_margin(rows, i, d_0), _own_margin(rows, i, d_1))
        bound = max(bound, lower - 0.125 * M * h * h)
    return bound


@inlined
def _margin(first, end, rows, q, t, distances, m):
    """Margin of the set first to end at attitude q and time t; row m gets the distances."""
    margin = -np.inf
    for i in range(first, end):
        distance = _distance(rows, i, q, t)
        distances[m, i] = distance
        margin = max(margin, _own_margin(rows, i, distance))
    return margin


@inlined
def _slack(margin):
    """How far below the least margin found a lower bound may stay."""
    if margin <= 0.0:
        return TIGHTNESS
    return max(LEAST_TIGHTNESS, min(TIGHTNESS, RELATIVE_TIGHTNESS * margin))


@inlined
def _bound_set(first, end, rows, times, quaternions, coefficients, k_0, from_time, bounds, work):
    """Certified lower bound, least margin found, and its time, of one forbidden set."""
    sampled, right, right_s, left = work
    count = times.size - k_0
    least, worst = np.inf, from_time
    for m in range(count):
        k = k_0 + m
        t = times[k] if m > 0 else from_time
        q = attitude(quaternions, coefficients, k, t - times[k])
        margin = _margin(first, end, rows, q, t - from_time, sampled, m)
        if margin < least:
            least, worst = margin, t
    certified = np.inf
    evaluations = 0
    for m in range(count - 1):
        k = k_0 + m
        s = from_time - times[k] if m == 0 else 0.0
        # Intervals from left to right: `right` is a stack of the ends still ahead.
        depth = 0
        right_s[0] = times[k + 1] - times[k]
        for i in range(first, end):
            left[i], right[0, i] = sampled[m, i], sampled[m + 1, i]
        while depth >= 0:
            h = right_s[depth] - s
            V, A = bounds[m, 0], bounds[m, 1]
            if depth > 0:
                V, A = motion_bounds(coefficients, k, s, h)
            goal = least - _slack(least)
            bound = _first_bound(first, end, rows, left, right, depth, V, h)
            if bound < goal:
                second = _second_bound(first, end, rows, left, right, depth, V, A, h)
                bound = max(bound, second)
            if bound >= goal or depth == _DEPTH or evaluations == _EVALUATIONS:
                certified = min(certified, bound)
                for i in range(first, end):
                    left[i] = right[depth, i]
                s = right_s[depth]
                depth -= 1
                continue
            evaluations += 1
            depth += 1
            right_s[depth] = s + 0.5 * h
            t = times[k] + right_s[depth]
            q = attitude(quaternions, coefficients, k, right_s[depth])
            margin = _margin(first, end, rows, q, t - from_time, right, depth)
            if margin < least:
                least, worst = margin, t
    return min(certified, least), least, worst


@kernel
def bound_clearance(times, quaternions, coefficients, from_time, rows):
    """Certified bound, least margin found and its time (sets, 3), in the order of the rows.

    All NaN if the trajectory is not finite.
    """
    n = rows.shape[0]
    k_0 = 0
    while k_0 < times.size - 2 and times[k_0 + 1] <= from_time:
        k_0 += 1
    count = times.size - k_0
    bounds = np.empty((count - 1, 2))
    for m in range(count - 1):
        s = from_time - times[k_0] if m == 0 else 0.0
        h = times[k_0 + m + 1] - times[k_0 + m] - s
        bounds[m, 0], bounds[m, 1] = motion_bounds(coefficients, k_0 + m, s, h)
    work = (np.empty((count, n)), np.empty((_DEPTH + 1, n)), np.empty(_DEPTH + 1), np.empty(n))
    finite = all_finite(coefficients) and rows_finite(quaternions)
    result = np.empty((n, 3))
    sets = 0
    end = 0
    for first in range(n):
        if first < end:
            continue
        end = first + 1
        while end < n and rows[first, GROUP] >= 0.0 and rows[end, GROUP] == rows[first, GROUP]:
            end += 1
        result[sets, 0] = result[sets, 1] = result[sets, 2] = np.nan
        if finite:
            certified, least, worst = _bound_set(
                first, end, rows, times, quaternions, coefficients, k_0, from_time, bounds, work
            )
            turned = 0.0
            for i in range(first, end):
                turned = max(turned, _speed(rows, i) * (times[-1] - from_time))
            # A moving obstacle's angle is rounded by its size.
            result[sets, 0] = certified - ROUNDING * (1.0 + 1e-3 * turned)
            result[sets, 1] = least
            result[sets, 2] = worst
        sets += 1
    return result[:sets]
