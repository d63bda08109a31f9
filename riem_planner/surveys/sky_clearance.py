# SPDX-License-Identifier: Apache-2.0
"""Clearance of a trajectory from a zone that moves with the sky, in continuous time.

Between two rows of the sky a body moves on a great circle at a constant rate, and the half-angle
of its zone changes linearly. Between two times h apart the margin, distance less half-angle, is
at least `(m_0 + m_1 - L h) / 2`, with `L = max|v| + |rate| + |change of the half-angle|`.
Intervals are halved until that is within the tolerance of the least margin found.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import attitude, motion_bounds, rotated
from riem_planner.kernels import inlined, kernel
from riem_planner.surveys.screen import angle_between

TIGHTNESS = 1e-4
"""A clearance told is less than the true one by at most this [rad], ..."""
RELATIVE_TIGHTNESS = 0.01
"""... or by this part of it, whichever is smaller, ..."""
LEAST_TIGHTNESS = 1e-9
"""... but no tighter than this [rad]: what is closer counts as touched."""
ROUNDING = 1e-12
"""Subtracted from every clearance [rad]."""

_DEPTH = 48  # halvings of one interval
_EVALUATIONS = 1_000_000


@inlined
def _axis(sky, j, t):
    """Direction and half-angle of a zone at time t between the rows j and j + 1."""
    times, directions, half_angles = sky
    u = (t - times[j]) / (times[j + 1] - times[j])
    a = (directions[j, 0], directions[j, 1], directions[j, 2])
    b = (directions[j + 1, 0], directions[j + 1, 1], directions[j + 1, 2])
    angle = angle_between(a, b)
    first, second = 1.0 - u, u
    if angle > 1e-6:
        first, second = np.sin((1.0 - u) * angle), np.sin(u * angle)
    z = (
        first * a[0] + second * b[0],
        first * a[1] + second * b[1],
        first * a[2] + second * b[2],
    )
    return z, (1.0 - u) * half_angles[j] + u * half_angles[j + 1]


@inlined
def _rates(sky, j):
    """How fast the margin to a zone at rest may change by the zone's motion [rad/s]."""
    times, directions, half_angles = sky
    a = (directions[j, 0], directions[j, 1], directions[j, 2])
    b = (directions[j + 1, 0], directions[j + 1, 1], directions[j + 1, 2])
    turn = angle_between(a, b) + abs(half_angles[j + 1] - half_angles[j])
    return turn / (times[j + 1] - times[j])


@inlined
def _margin(curve, k, t, sky, j, boresight):
    """Distance less half-angle at time t of the sky."""
    times, quaternions, coefficients, begin = curve
    q = attitude(quaternions, coefficients, k, t - begin - times[k])
    b = (boresight[0], boresight[1], boresight[2])
    z, half_angle = _axis(sky, j, t)
    return angle_between(rotated(q, b), z) - half_angle


@inlined
def _tolerance(least):
    return max(LEAST_TIGHTNESS, min(TIGHTNESS, RELATIVE_TIGHTNESS * least))


@kernel
def sky_clearance(times, quaternions, coefficients, begin, sky, boresight):
    """Certified lower bound of the margin, the least margin found, and its time.

    Parameters
    ----------
    times, quaternions, coefficients
        Of the trajectory.
    begin
        Time of the sky at which it begins [s].
    sky
        Row times (n,), unit directions (n, 3) and half-angles (n,) of the zone; they cover the
        trajectory.
    boresight : (3,)
        Unit vector in the body.

    Returns
    -------
    tuple
        Where the trajectory enters the zone, the bound is the margin found there.
    """
    curve = (times, quaternions, coefficients, begin)
    rows = sky[0]
    last, last_row = times.size - 2, rows.size - 2
    k = 0
    j = min(max(np.searchsorted(rows, begin, side="right") - 1, 0), last_row)
    right_t, right_m = np.empty(_DEPTH + 1), np.empty(_DEPTH + 1)
    t = begin
    left = _margin(curve, k, t, sky, j, boresight)
    least, worst, certified = left, t, left
    evaluations = 0
    while least > 0.0:
        end = begin + times[k + 1]
        if j < last_row and rows[j + 1] < end:
            end = rows[j + 1]
        depth = 0
        right_t[0], right_m[0] = end, _margin(curve, k, end, sky, j, boresight)
        drift = _rates(sky, j)
        while depth >= 0:
            h, right = right_t[depth] - t, right_m[depth]
            if right < least:
                least, worst = right, right_t[depth]
            V, _ = motion_bounds(coefficients, k, t - begin - times[k], h)
            bound = 0.5 * (left + right - (V + drift) * h)
            enough = bound >= least - _tolerance(least)
            if enough or least <= 0.0 or depth == _DEPTH or evaluations == _EVALUATIONS:
                certified = min(certified, bound)
                left, t = right, right_t[depth]
                depth -= 1
                continue
            evaluations += 1
            depth += 1
            right_t[depth] = t + 0.5 * h
            right_m[depth] = _margin(curve, k, right_t[depth], sky, j, boresight)
        if end >= begin + times[k + 1]:
            if k == last:
                break
            k += 1
        if j < last_row and end >= rows[j + 1]:
            j += 1
    if least <= 0.0:
        return least, least, worst
    return certified - ROUNDING, least, worst
