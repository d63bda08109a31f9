# SPDX-License-Identifier: Apache-2.0
"""The judge of many pairs: straight, detour, sealed, or an end in a zone."""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import quaternion_times, rotated
from riem_planner.geometry.vectors import norm
from riem_planner.kernels import inlined, kernel
from riem_planner.surveys.arcs import (
    COARSE,
    FINE,
    axis_of,
    frame_of,
    place_zones,
    quickest_arc,
)
from riem_planner.surveys.profiles import (
    FASTEST,
    constrain,
    constrained_time,
    fastest_time,
    smooth_time,
)
from riem_planner.surveys.screen import outside, turn_clear
from riem_planner.surveys.walls import OPEN, WALLED, walled

STRAIGHT, DETOUR, SEALED, NOT_FOUND, START_IN_ZONE, GOAL_IN_ZONE, INVALID = range(7)
"""As `SlewVerdict`; NOT_FOUND leaves a pair to the general planner."""

_HALF_TURN = 1e-12  # scalar part of a turn whose axis may as well point the other way


@inlined
def _conjugate(q):
    return -q[0], -q[1], -q[2], q[3]


@inlined
def _vector(rows, i):
    return rows[i, 0], rows[i, 1], rows[i, 2]


@inlined
def _unit_quaternion(rows, i):
    x, y, z, w = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]
    size = np.sqrt(x * x + y * y + z * z + w * w)
    return x / size, y / size, z / size, w / size


@kernel
def _end_clear(q, boresights, zones):
    """Whether an attitude is outside every zone."""
    for k in range(zones.shape[0]):
        x = rotated(q, _vector(boresights, k))
        if not outside(x, _vector(zones, k), zones[k, 3], zones[k, 4]):
            return False
    return True


@kernel
def _slew_clear(q, axis, angle, boresights, zones):
    """Whether the slew about an axis of the reference frame keeps clear of every zone."""
    turn = (angle, np.cos(angle), np.sin(angle))
    for k in range(zones.shape[0]):
        b = rotated(q, _vector(boresights, k))
        if not turn_clear(b, axis, turn, _vector(zones, k), zones[k, 3], zones[k, 4]):
            return False
    return True


@inlined
def _eigenaxis(between):
    """Axis and angle in [0, pi] of a quaternion."""
    size = norm((between[0], between[1], between[2]))
    if size == 0.0:
        return (1.0, 0.0, 0.0), 0.0
    sign = 1.0 if between[3] >= 0.0 else -1.0
    axis = (sign * between[0] / size, sign * between[1] / size, sign * between[2] / size)
    return axis, 2.0 * np.arctan2(size, abs(between[3]))


@kernel
def _axis_time(capacity, profile, turn, rows):
    """Least time of a slew about a fixed axis; `turn` is its rotation vector in the body."""
    if capacity.plain:
        angle = norm(turn)
        if profile == FASTEST:
            return fastest_time(angle, 0.0, capacity.rate, capacity.acceleration)
        return smooth_time(angle, 0.0, capacity.rate, capacity.acceleration)
    if turn[0] == 0.0 and turn[1] == 0.0 and turn[2] == 0.0:
        return 0.0
    S = constrain(capacity, turn, 0.0, (1.0, 0.0, 0.0), rows)
    return constrained_time(profile, rows, S)


@kernel
def _any_wall(q_0, q_1, boresights, zones, work):
    """WALLED if the zones of some boresight part its ends, OPEN if none do."""
    groups = work[2]
    verdict = OPEN
    for k in range(zones.shape[0]):
        if groups[k] == k:  # the first zone of its boresight
            b = _vector(boresights, k)
            found = walled(rotated(q_0, b), rotated(q_1, b), zones, k, work)
            if found == WALLED:
                return WALLED
            verdict = min(verdict, found)
    return verdict


@kernel
def _detour(task, q_0, q_1, between, zones, room, choice):
    """Time of the quickest arc; its axis, turn and roll into `choice`."""
    capacity, profile, boresights = task
    rows, places = room
    b = _vector(boresights, 0)
    first, last = rotated(q_0, b), rotated(q_1, b)
    if norm((last[0] - first[0], last[1] - first[1], last[2] - first[2])) < 1e-7:
        return np.inf
    basis, frame = frame_of(first, last, between)
    place_zones(basis, zones, places)
    back = _conjugate(q_0)
    n, m, d = basis
    body = (rotated(back, n), rotated(back, m), rotated(back, d))
    pace = (capacity, profile, body, b, rows)
    time, tau, phi, psi = quickest_arc(pace, frame, places, COARSE)
    if time == np.inf:
        time, tau, phi, psi = quickest_arc(pace, frame, places, FINE)
    choice[0], choice[1], choice[2] = axis_of(basis, tau)
    choice[3], choice[4] = phi, psi
    return time


@kernel
def _judge(task, q_0, q_1, zones, room, choice):
    """Verdict, time and straight time of one pair; the path into `choice`."""
    capacity, profile, boresights = task
    rows, places, work = room
    between = quaternion_times(q_1, _conjugate(q_0))
    axis, angle = _eigenaxis(between)
    inside = rotated(_conjugate(q_0), axis)
    turn = (angle * inside[0], angle * inside[1], angle * inside[2])
    straight = _axis_time(capacity, profile, turn, rows)
    choice[0], choice[1], choice[2], choice[3], choice[4] = axis[0], axis[1], axis[2], angle, 0.0
    if not _end_clear(q_0, boresights, zones):
        return START_IN_ZONE, np.inf, straight
    if not _end_clear(q_1, boresights, zones):
        return GOAL_IN_ZONE, np.inf, straight
    if _slew_clear(q_0, axis, angle, boresights, zones):
        return STRAIGHT, straight, straight
    if abs(between[3]) < _HALF_TURN:
        other = (-axis[0], -axis[1], -axis[2])
        if _slew_clear(q_0, other, angle, boresights, zones):
            choice[0], choice[1], choice[2] = other
            return STRAIGHT, straight, straight
    if _any_wall(q_0, q_1, boresights, zones, work) == WALLED:
        return SEALED, np.inf, straight
    for k in range(zones.shape[0]):
        if work[2][k] != 0:
            return NOT_FOUND, np.inf, straight  # several boresights
    time = _detour(task, q_0, q_1, between, zones, (rows, places), choice)
    return (DETOUR if time < np.inf else NOT_FOUND), time, straight


@kernel
def judge_pairs(task, groups, tables, rows, results, choices):
    """Judge pairs, each given by rows of tables.

    Parameters
    ----------
    task
        Capacity, profile, boresights (k, 3).
    groups : (k,)
        Per zone the first zone of its boresight.
    tables
        Starts and goals (..., 4), zones (..., k, 5), and whether each is finite (...).
    rows : (n,) three times
        Of the start, the goal and the zones of each pair.
    results : (n,) three times
        Verdict, time, straight time [s].
    choices : (n, 5)
        Axis, turn and roll of the path.
    """
    starts, goals, zones, start_finite, goal_finite, zones_finite = tables
    start_rows, goal_rows, zone_rows = rows
    verdicts, times, straights = results
    k = zones.shape[1]
    work = (np.empty(k, np.int64), np.empty(k, np.int64), groups)
    room = (np.empty((8, 3)), np.empty((k, 5)), work)
    for i in range(verdicts.size):
        a, b, c = start_rows[i], goal_rows[i], zone_rows[i]
        if not (start_finite[a] and goal_finite[b] and zones_finite[c]):
            verdicts[i], times[i], straights[i] = INVALID, np.nan, np.nan
            continue
        q_0, q_1 = _unit_quaternion(starts, a), _unit_quaternion(goals, b)
        verdicts[i], times[i], straights[i] = _judge(task, q_0, q_1, zones[c], room, choices[i])
