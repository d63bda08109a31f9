# SPDX-License-Identifier: Apache-2.0
"""Lower bounds, in continuous time, of the distance between a trajectory and what is forbidden.

The margin of an obstacle is `d - r` (kept out) or `r - d` (kept in), that of a forbidden set the
largest over its members of the least over the obstacles of the member that exist. Between two
times h apart, with margins m_0 and m_1, it is at least

- `(m_0 + m_1 - L h) / 2`: it changes no faster than `L = max|v| + |s'| + |r'|`;
- `min(m_0, m_1) - M h^2 / 8`, where M bounds its second derivative from above: the graph of m
  lies no deeper than that below its chord. Of the distance to a direction
  `d'' <= |w'| + w^2 / 2 + w^2 max(0, cot d)`, of that to an attitude
  `d'' <= |w'| + w^2 max(0, cot(d/2)) / 2`, with the rate `w` relative to the obstacle,
  `|w| <= L`, `|w'| <= |a| + |v| |s'| + |s''|`. (The Hessian of the distance is `cot d` and
  `cot(d/2) / 2` across the gradient and 0 along it; `w^2 / 2` bounds the product of roll and
  pointing rate.) For a margin kept in, `-d''` takes the place of `d''`; `|r''|` adds to M.

The frame that moves with an obstacle turns at `|s'|`, its constant rate where it has one. On a
path `s = p / |p|` with a cubic p, `|s'| <= |p'| / |p|`, and the covariant acceleration, which is
what that turning changes by, `|s''| <= |p''| / |p| + 2 |p'|^2 / |p|^2`. A polynomial lies in the
convex hull of its Bernstein coefficients, which gives all of these on an interval.

Intervals are halved until the better of the two is within `TIGHTNESS` of the least margin found.
The first ones end where an obstacle begins or ceases to exist, and where pieces of paths meet.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import (
    all_finite,
    attitude,
    motion_bounds,
    quaternion_of,
    quaternion_times,
    rotated,
    rows_finite,
)
from riem_planner.geometry.vectors import cross, dot, norm
from riem_planner.kernels import inlined, kernel
from riem_planner.obstacles.table import (
    BEGIN,
    BORESIGHT,
    COUNT,
    CUBICS,
    FROM,
    KEEP_IN,
    KIND,
    MEMBER,
    ORIENTATION,
    PATH,
    PIECES,
    PLACE,
    RADIUS,
    RATE,
    SET,
    SPEED,
    UNTIL,
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
def _piece(rows, i, t):
    """Row of the piece of obstacle i's path at time t."""
    first, last = int(rows[i, PATH]), int(rows[i, PATH] + rows[i, PIECES]) - 1
    while first < last:
        middle = (first + last + 1) // 2
        if t < rows[middle, BEGIN]:
            last = middle - 1
        else:
            first = middle
    return first


@inlined
def _taylor(rows, k, first, x):
    """Taylor coefficients of the cubic at column `first` of piece k, x after its beginning."""
    c = (rows[k, first], rows[k, first + 1], rows[k, first + 2], rows[k, first + 3])
    return (
        c[0] + x * (c[1] + x * (c[2] + x * c[3])),
        c[1] + x * (2.0 * c[2] + x * 3.0 * c[3]),
        c[2] + x * 3.0 * c[3],
        c[3],
    )


@inlined
def _radius(rows, i, t):
    """Radius of obstacle i at time t."""
    if rows[i, PATH] < 0.0:
        return rows[i, RADIUS]
    k = _piece(rows, i, t)
    return _taylor(rows, k, CUBICS + 12, t - rows[k, BEGIN])[0]


@inlined
def _distance(rows, i, q, t):
    """Distance of the attitude q at time t to obstacle i."""
    place = (rows[i, PLACE], rows[i, PLACE + 1], rows[i, PLACE + 2])
    x, y, z = rows[i, RATE], rows[i, RATE + 1], rows[i, RATE + 2]
    if x != 0.0 or y != 0.0 or z != 0.0:
        # The frame that turns with the obstacle, in which it is fixed.
        q = quaternion_times(quaternion_of((-x * t, -y * t, -z * t)), q)
    elif rows[i, PATH] >= 0.0:
        k = _piece(rows, i, t)
        s = t - rows[k, BEGIN]
        place = (
            _taylor(rows, k, CUBICS, s)[0],
            _taylor(rows, k, CUBICS + 4, s)[0],
            _taylor(rows, k, CUBICS + 8, s)[0],
        )
    if rows[i, KIND] == ORIENTATION:
        p = quaternion_times((-place[0], -place[1], -place[2], rows[i, PLACE + 3]), q)
        return 2.0 * np.arctan2(norm((p[0], p[1], p[2])), abs(p[3]))
    b = (rows[i, BORESIGHT], rows[i, BORESIGHT + 1], rows[i, BORESIGHT + 2])
    x = rotated(q, b)
    cosine = x[0] * place[0] + x[1] * place[1] + x[2] * place[2]
    return np.arctan2(norm(cross(x, place)), cosine)


@inlined
def _motion(rows, i, t, h):
    """Bounds of |s'|, |s''|, |r'| and |r''| of obstacle i from time t to t + h."""
    if rows[i, PATH] < 0.0:
        return rows[i, SPEED], 0.0, 0.0, 0.0
    k = _piece(rows, i, t + 0.5 * h)
    x = t - rows[k, BEGIN]
    p = _taylor(rows, k, CUBICS, x)
    q = _taylor(rows, k, CUBICS + 4, x)
    w = _taylor(rows, k, CUBICS + 8, x)
    r = _taylor(rows, k, CUBICS + 12, x)
    speed = acceleration = 0.0
    for m in range(3):  # Bernstein coefficients of p', of degree 2
        a, b = (0.0, 0.5, 1.0)[m] * 2.0 * h, (0.0, 0.0, 1.0)[m] * 3.0 * h * h
        slope = (
            p[1] + a * p[2] + b * p[3],
            q[1] + a * q[2] + b * q[3],
            w[1] + a * w[2] + b * w[3],
        )
        speed = max(speed, norm(slope))
    for m in range(2):  # of p'', of degree 1
        a = 6.0 * m * h
        bend = (2.0 * p[2] + a * p[3], 2.0 * q[2] + a * q[3], 2.0 * w[2] + a * w[3])
        acceleration = max(acceleration, norm(bend))
    size = _least_length(p, q, w, h)
    growth = max(abs(r[1]), abs(r[1] + h * r[2]), abs(r[1] + h * (2.0 * r[2] + 3.0 * h * r[3])))
    swing = max(abs(2.0 * r[2]), abs(2.0 * r[2] + 6.0 * h * r[3]))
    if not size > 0.0:
        return _STEEP, _STEEP, growth, swing
    turning = speed / size
    return turning, acceleration / size + 2.0 * turning * turning, growth, swing


@inlined
def _least_length(p, q, w, h):
    """Lower bound of |(p, q, w)| over a length h: of its component along the middle."""
    x = 0.5 * h
    n = (
        p[0] + x * (p[1] + x * (p[2] + x * p[3])),
        q[0] + x * (q[1] + x * (q[2] + x * q[3])),
        w[0] + x * (w[1] + x * (w[2] + x * w[3])),
    )
    c = (dot(n, (p[0], q[0], w[0])), dot(n, (p[1], q[1], w[1])), dot(n, (p[2], q[2], w[2])),
         dot(n, (p[3], q[3], w[3])))  # fmt: skip
    least = min(
        c[0],
        c[0] + h * c[1] / 3.0,
        c[0] + h * (2.0 * c[1] + h * c[2]) / 3.0,
        c[0] + h * (c[1] + h * (c[2] + h * c[3])),
    )
    size = norm(n)
    return least / size if size > 0.0 else 0.0


@inlined
def _curvature(kind, low, high):
    """Largest factor of w^2 in the second derivative of the margin, for low <= d <= high."""
    if kind == ORIENTATION:
        return 0.5 / np.tan(0.5 * low) if low > 0.0 else _STEEP
    if kind == KEEP_IN:
        low = np.pi - high  # the margin of the opposite cone, kept out
    return 0.5 + max(0.0, 1.0 / np.tan(low)) if low > 0.0 else _STEEP


@inlined
def _own_margin(rows, i, distance, t):
    """Margin of obstacle i at a distance and a time."""
    outside = distance - _radius(rows, i, t)
    return -outside if rows[i, KIND] == KEEP_IN else outside


@inlined
def _last_of_member(rows, i, end):
    """Whether the next row, if any before `end`, belongs to another member."""
    return i + 1 == end or rows[i + 1, MEMBER] != rows[i, MEMBER]


@inlined
def _first_bound(rows, first, end, left, right, depth, t, h, V):
    """Lower bound of a set's margin between distances left and right, by its rate of change."""
    m_0 = m_1 = -np.inf
    own_0 = own_1 = np.pi
    L = 0.0
    for i in range(first, end):
        if rows[i, FROM] < t + 0.5 * h < rows[i, UNTIL]:
            speed, _, growth, _ = _motion(rows, i, t, h)
            L = max(L, V + speed + growth)
            own_0 = min(own_0, _own_margin(rows, i, left[i], t))
            own_1 = min(own_1, _own_margin(rows, i, right[depth, i], t + h))
        if _last_of_member(rows, i, end):
            m_0, m_1 = max(m_0, own_0), max(m_1, own_1)
            own_0 = own_1 = np.pi
    return 0.5 * (m_0 + m_1 - L * h)


@inlined
def _second_bound(rows, first, end, left, right, depth, t, h, V, A):
    """Lower bound of a set's margin between distances left and right, by its curvature."""
    bound = -np.inf
    own = np.pi
    for i in range(first, end):
        if rows[i, FROM] < t + 0.5 * h < rows[i, UNTIL]:
            d_0, d_1 = left[i], right[depth, i]
            speed, turning, _, swing = _motion(rows, i, t, h)
            w = V + speed
            mean, half = 0.5 * (d_0 + d_1), 0.5 * w * h
            M = A + V * speed + turning + swing
            M += w * w * _curvature(rows[i, KIND], mean - half, mean + half)
            m_0, m_1 = _own_margin(rows, i, d_0, t), _own_margin(rows, i, d_1, t + h)
            own = min(own, min(m_0, m_1) - 0.125 * M * h * h)
        if _last_of_member(rows, i, end):
            bound, own = max(bound, own), np.pi
    return bound


@inlined
def _margin(rows, first, end, q, t, distances, m):
    """Margin of the set first to end at attitude q and time t; row m gets the distances."""
    margin = -np.inf
    own = np.pi
    for i in range(first, end):
        distance = _distance(rows, i, q, t)
        distances[m, i] = distance
        if rows[i, FROM] <= t <= rows[i, UNTIL]:
            own = min(own, _own_margin(rows, i, distance, t))
        if _last_of_member(rows, i, end):
            margin, own = max(margin, own), np.pi
    return margin


@inlined
def _slack(margin):
    """How far below the least margin found a lower bound may stay."""
    if margin <= 0.0:
        return TIGHTNESS
    return max(LEAST_TIGHTNESS, min(TIGHTNESS, RELATIVE_TIGHTNESS * margin))


@inlined
def _bound_set(rows, first, end, curve, breaks, sample, bounds, work):
    """Certified lower bound, least margin found, and its time, of one forbidden set."""
    times, quaternions, coefficients, from_time = curve
    sampled, right, right_s, left = work
    least, worst = np.inf, from_time
    for m in range(breaks.size):
        k, t = sample[m], breaks[m]
        q = attitude(quaternions, coefficients, k, t - times[k])
        margin = _margin(rows, first, end, q, t - from_time, sampled, m)
        if margin < least:
            least, worst = margin, t
    certified = np.inf
    evaluations = 0
    for m in range(breaks.size - 1):
        k = sample[m]
        s = breaks[m] - times[k]
        # Intervals from left to right: `right` is a stack of the ends still ahead.
        depth = 0
        right_s[0] = breaks[m + 1] - times[k]
        for i in range(first, end):
            left[i], right[0, i] = sampled[m, i], sampled[m + 1, i]
        while depth >= 0:
            h = right_s[depth] - s
            t = times[k] + s - from_time
            V, A = bounds[m, 0], bounds[m, 1]
            if depth > 0:
                V, A = motion_bounds(coefficients, k, s, h)
            goal = least - _slack(least)
            bound = _first_bound(rows, first, end, left, right, depth, t, h, V)
            if bound < goal:
                second = _second_bound(rows, first, end, left, right, depth, t, h, V, A)
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
            margin = _margin(rows, first, end, q, t - from_time, right, depth)
            if margin < least:
                least, worst = margin, t
    return min(certified, least), least, worst


@kernel
def bound_clearance(times, quaternions, coefficients, from_time, rows, breaks):
    """Certified bound, least margin found and its time (sets, 3), in the order of the rows.

    All NaN if the trajectory is not finite.

    Parameters
    ----------
    times, quaternions, coefficients
        The trajectory.
    from_time
        When the obstacles stand at their places of time 0.
    rows : (n, WIDTH)
        What is forbidden, in seconds.
    breaks : (m,)
        Times of the trajectory from `from_time` to its end: its own samples, and those at which an
        obstacle begins or ceases to exist or pieces of paths meet.
    """
    n = int(rows[0, COUNT]) if rows.shape[0] > 0 else 0
    sample = np.empty(breaks.size, dtype=np.int64)
    k = 0
    for m in range(breaks.size):
        while k < times.size - 2 and times[k + 1] <= breaks[m]:
            k += 1
        sample[m] = k
    bounds = np.empty((breaks.size - 1, 2))
    for m in range(breaks.size - 1):
        s = breaks[m] - times[sample[m]]
        h = breaks[m + 1] - breaks[m]
        bounds[m, 0], bounds[m, 1] = motion_bounds(coefficients, sample[m], s, h)
    shape = (breaks.size, n)
    work = (np.empty(shape), np.empty((_DEPTH + 1, n)), np.empty(_DEPTH + 1), np.empty(n))
    finite = all_finite(coefficients) and rows_finite(quaternions)
    curve = (times, quaternions, coefficients, from_time)
    result = np.empty((n, 3))
    sets = 0
    end = 0
    for first in range(n):
        if first < end:
            continue
        end = first + 1
        while end < n and rows[end, SET] == rows[first, SET]:
            end += 1
        result[sets, 0] = result[sets, 1] = result[sets, 2] = np.nan
        if finite:
            certified, least, worst = _bound_set(
                rows, first, end, curve, breaks, sample, bounds, work
            )
            turned = 0.0
            for i in range(first, end):
                turned = max(turned, rows[i, SPEED] * (times[-1] - from_time))
            # A moving obstacle's angle is rounded by its size.
            result[sets, 0] = certified - ROUNDING * (1.0 + 1e-3 * turned)
            result[sets, 1] = least
            result[sets, 2] = worst
        sets += 1
    return result[:sets]
