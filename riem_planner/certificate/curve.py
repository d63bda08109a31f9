# SPDX-License-Identifier: Apache-2.0
"""Checks of the curve itself: it joins, does not jump, meets its end states, and how fast it is."""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import (
    all_finite,
    attitude,
    derivatives,
    motion,
    motion_bounds,
    quaternion_times,
    quintic,
    rate_bend,
    rotated,
    rows_finite,
    sample,
)
from riem_planner.certificate.tolerances import LEAST_ROLL, ROLL_TOLERANCE
from riem_planner.geometry.vectors import cross, norm
from riem_planner.kernels import inlined, kernel

# Entries of the result of `examine_curve`.
FINITE, NORM, JOIN, TURN, TURN_TIME, JUMP, JUMP_TIME, RATE = range(8)
START, START_RATE, GOAL, GOAL_RATE, ROLL, ROLL_TIME, MOST_ROLL = range(8, 15)

_ROLL_PIECES = 1 << 20  # of an interval, below which roll counts as found where it can't be bounded
_PIECES = 128  # of the whole trajectory, at least, on which its rate is bounded


@inlined
def _angle_between(R, q):
    """Angle [rad] of `R^T R(q)`, by its skew part (the sine) and trace (the cosine)."""
    X = rotated(q, (1.0, 0.0, 0.0))
    Y = rotated(q, (0.0, 1.0, 0.0))
    Z = rotated(q, (0.0, 0.0, 1.0))
    x = y = z = trace = 0.0
    for i in range(3):
        x += R[i, 2] * Y[i] - R[i, 1] * Z[i]
        y += R[i, 0] * Z[i] - R[i, 2] * X[i]
        z += R[i, 1] * X[i] - R[i, 0] * Y[i]
        trace += R[i, 0] * X[i] + R[i, 1] * Y[i] + R[i, 2] * Z[i]
    return np.arctan2(np.sqrt(x * x + y * y + z * z), trace - 1.0)


@inlined
def _dot(x, y):
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@inlined
def _vector(a):
    """The numbers of an array (3,)."""
    return a[0], a[1], a[2]


@inlined
def _attitude_error(q, v, R, u):
    """Distance [rad] of an attitude and its rate v to a state R, u."""
    return (
        _angle_between(R, q),
        norm((v[0] - u[0], v[1] - u[1], v[2] - u[2])),
    )


@inlined
def _turned(R, b):
    return (
        R[0, 0] * b[0] + R[0, 1] * b[1] + R[0, 2] * b[2],
        R[1, 0] * b[0] + R[1, 1] * b[1] + R[1, 2] * b[2],
        R[2, 0] * b[0] + R[2, 1] * b[1] + R[2, 2] * b[2],
    )


@inlined
def _direction_error(q, v, R, u, b):
    """Distance [rad] of a pointing direction and its velocity to those of a state R, u."""
    x, y = rotated(q, b), _turned(R, b)
    x_1, y_1 = rotated(q, cross(v, b)), _turned(R, cross(u, b))
    sine = norm(cross(x, y))
    return (
        np.arctan2(sine, _dot(x, y)),
        norm((x_1[0] - y_1[0], x_1[1] - y_1[1], x_1[2] - y_1[2])),
    )


@inlined
def _join_error(c, quaternions, rates, accelerations, k, h):
    """Mismatch of interval k's end and the next sample [rad]; of v times h, of a times h^2."""
    xi, xi_1, xi_2 = derivatives(c, k, h)
    v, a = motion(xi, xi_1, xi_2)
    q = sample(quaternions, k + 1)
    end = attitude(quaternions, c, k, h)
    r = quaternion_times((-q[0], -q[1], -q[2], q[3]), end)
    error = 2.0 * np.arctan2(norm(r), abs(r[3]))
    for i in range(3):
        error = max(
            error,
            h * abs(v[i] - rates[k + 1, i]),
            h * h * abs(a[i] - accelerations[k + 1, i]),
        )
    return error


@inlined
def _unexplained(c, rates, accelerations, k, h):
    """Turn [rad] from sample k to the next less that which rates and accelerations explain."""
    turn = quintic(c, k, h)
    square = 0.0
    for i in range(3):
        explained = 0.5 * h * (rates[k, i] + rates[k + 1, i]) + h * h / 12 * (
            accelerations[k, i] - accelerations[k + 1, i]
        )
        square += (turn[i] - explained) ** 2
    return np.sqrt(square)


@inlined
def _turn(quaternions, k):
    """Angle [rad] from sample k to the next, past pi if the sign flips."""
    p, q = sample(quaternions, k), sample(quaternions, k + 1)
    r = quaternion_times((-p[0], -p[1], -p[2], p[3]), q)
    return 2.0 * np.arctan2(norm(r), r[3])


@inlined
def _check_samples(result, quaternions, rates):
    """Unit norms; returns the greatest rate."""
    fastest = 0.0
    for k in range(rates.shape[0]):
        square = 0.0
        for i in range(4):
            square += quaternions[k, i] ** 2
        result[NORM] = max(result[NORM], abs(np.sqrt(square) - 1.0))
        v = (rates[k, 0], rates[k, 1], rates[k, 2])
        fastest = max(fastest, norm(v))
    return fastest


@inlined
def _roll_rate(c, k, s, b):
    """Rate about the boresight [rad/s] at time s after sample k."""
    xi, xi_1, xi_2 = derivatives(c, k, s)
    v, _ = motion(xi, xi_1, xi_2)
    return abs(_dot(v, b))


@inlined
def _check_roll(result, times, c, b, k):
    """Bound the roll throughout interval k, as far as it is within the most that is allowed.

    Between two times h apart it is at most the greater of both plus `M h^2 / 8`, where M bounds
    the rate's second derivative.
    """
    h = times[k + 1] - times[k]
    s, step = 0.0, h
    before = _roll_rate(c, k, 0.0, b)
    while s < h:
        end = min(s + step, h)
        after = _roll_rate(c, k, end, b)
        found = max(before, after)
        bound = found + 0.125 * (end - s) ** 2 * rate_bend(c, k, s, end - s)
        if bound > result[MOST_ROLL] and found <= result[MOST_ROLL] and step > h / _ROLL_PIECES:
            step *= 0.5
            continue
        if bound > result[ROLL]:
            result[ROLL], result[ROLL_TIME] = bound, times[k] + s
        if found > result[MOST_ROLL]:
            break
        s, before, step = end, after, 2.0 * step


@inlined
def _check_intervals(result, times, quaternions, rates, accelerations, c, boresight, sphere):
    """Joins, turns, jumps, the bound of the rate and, on S^2, of roll."""
    fastest = _check_samples(result, quaternions, rates)
    last = times.size - 1
    b = _vector(boresight)
    result[MOST_ROLL] = ROLL_TOLERANCE * fastest + LEAST_ROLL / times[last]
    pieces = 1 + _PIECES // last
    for k in range(last):
        h = times[k + 1] - times[k]
        result[JOIN] = max(result[JOIN], _join_error(c, quaternions, rates, accelerations, k, h))
        turn = _turn(quaternions, k)
        if turn > result[TURN]:
            result[TURN], result[TURN_TIME] = turn, times[k]
        # One interval alone, from rest to rest, may well be a slew.
        jump = _unexplained(c, rates, accelerations, k, h) / (h * fastest + 1e-6)
        if last > 1 and jump > result[JUMP]:
            result[JUMP], result[JUMP_TIME] = jump, times[k]
        for piece in range(pieces):
            V, _ = motion_bounds(c, k, piece * h / pieces, h / pieces)
            result[RATE] = max(result[RATE], V)
        if sphere:
            _check_roll(result, times, c, b, k)


@kernel
def examine_curve(times, quaternions, rates, accelerations, coefficients, ends, boresight, sphere):
    """Largest violations along a curve; the entries are named at the top of this file.

    `ends` are the start's attitude and rate and the goal's: (3, 3), (3,), (3, 3), (3,).
    """
    result = np.zeros(15)
    finite = rows_finite(quaternions) and rows_finite(rates) and rows_finite(accelerations)
    if not (finite and all_finite(coefficients)):
        return result
    result[FINITE] = 1.0
    _check_intervals(
        result, times, quaternions, rates, accelerations, coefficients, boresight, sphere
    )
    last = times.size - 1
    b = _vector(boresight)
    for end in range(2):
        q = sample(quaternions, end * last)
        v = (rates[end * last, 0], rates[end * last, 1], rates[end * last, 2])
        R, u = (ends[0], _vector(ends[1])) if end == 0 else (ends[2], _vector(ends[3]))
        if sphere:
            error, rate_error = _direction_error(q, v, R, u, b)
        else:
            error, rate_error = _attitude_error(q, v, R, u)
        result[START + 2 * end], result[START_RATE + 2 * end] = error, rate_error
    return result
