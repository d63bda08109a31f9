"""Checks of the curve itself: it joins, does not jump, meets its end states, and how fast it is."""

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import (
    attitude,
    cross,
    derivatives,
    motion,
    motion_bounds,
    quaternion_times,
    rotated,
)
from riem_planner.compiled import inlined, kernel

# Entries of the result of `examine_curve`.
FINITE, NORM, JOIN, TURN, TURN_TIME, JUMP, JUMP_TIME, RATE = range(8)
START, START_RATE, GOAL, GOAL_RATE, ROLL, ROLL_BETWEEN = range(8, 14)

_PIECES = 128  # of the whole trajectory, at least, on which its rate is bounded


@inlined
def _matrix_times_quaternion_columns(R, q):
    """Angle of `R^T R(q)`, by the sine and cosine of its skew part and trace."""
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
def _norm(x):
    return np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)


@inlined
def _attitude_error(q, v, R, u):
    """Distance [rad] of an attitude and its rate v to a state R, u."""
    return (
        _matrix_times_quaternion_columns(R, q),
        _norm((v[0] - u[0], v[1] - u[1], v[2] - u[2])),
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
    sine = _norm(cross(x, y))
    return (
        np.arctan2(sine, x[0] * y[0] + x[1] * y[1] + x[2] * y[2]),
        _norm((x_1[0] - y_1[0], x_1[1] - y_1[1], x_1[2] - y_1[2])),
    )


@inlined
def _join_error(c, p, q, v, a, h):
    """Mismatch of an interval's end and the next sample [rad]; of v times h, of a times h^2."""
    xi, xi_1, xi_2 = derivatives(c, h)
    end_v, end_a = motion(xi, xi_1, xi_2)
    end = attitude((p[0], p[1], p[2], p[3]), c, h)
    r = quaternion_times((-q[0], -q[1], -q[2], q[3]), end)
    error = 2.0 * np.arctan2(_norm(r), abs(r[3]))
    for i in range(3):
        error = max(error, h * abs(end_v[i] - v[i]), h * h * abs(end_a[i] - a[i]))
    return error, _norm(xi)


@kernel
def examine_curve(times, quaternions, rates, accelerations, coefficients, ends, boresight, sphere):
    """Largest violations along a curve; the entries are named at the top of this file.

    `ends` are the start's attitude and rate and the goal's: (3, 3), (3,), (3, 3), (3,).
    """
    result = np.zeros(14)
    last = times.size - 1
    total = np.sum(coefficients) + np.sum(quaternions) + np.sum(rates) + np.sum(accelerations)
    if not np.isfinite(total):
        return result
    result[FINITE] = 1.0
    fastest = 0.0
    for k in range(last + 1):
        q, v = quaternions[k], rates[k]
        norm = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
        result[NORM] = max(result[NORM], abs(norm - 1.0))
        fastest = max(fastest, _norm(v))
        if sphere:
            roll = abs(v[0] * boresight[0] + v[1] * boresight[1] + v[2] * boresight[2])
            result[ROLL] = max(result[ROLL], roll)
    pieces = 1 + _PIECES // last
    for k in range(last):
        c = coefficients[k]
        h = times[k + 1] - times[k]
        p, q = quaternions[k], quaternions[k + 1]
        error, turn = _join_error(c, p, q, rates[k + 1], accelerations[k + 1], h)
        result[JOIN] = max(result[JOIN], error)
        if p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0.0:
            turn = 2.0 * np.pi - turn
        if turn > result[TURN]:
            result[TURN], result[TURN_TIME] = turn, times[k]
        jump = 0.0
        for i in range(3):
            # The turn that rates and accelerations at both ends account for.
            explained = 0.5 * h * (rates[k, i] + rates[k + 1, i]) + h * h / 12 * (
                accelerations[k, i] - accelerations[k + 1, i]
            )
            jump += (h * (c[1, i] + h * (c[2, i] + h * (c[3, i] + h * (c[4, i] + h * c[5, i])))) - explained) ** 2
        jump = np.sqrt(jump) / (h * fastest + 1e-6)
        if last > 1 and jump > result[JUMP]:
            result[JUMP], result[JUMP_TIME] = jump, times[k]
        for piece in range(pieces):
            V, _ = motion_bounds(c, piece * h / pieces, h / pieces)
            result[RATE] = max(result[RATE], V)
        if sphere:
            xi, xi_1, xi_2 = derivatives(c, 0.5 * h)
            v, _ = motion(xi, xi_1, xi_2)
            roll = abs(v[0] * boresight[0] + v[1] * boresight[1] + v[2] * boresight[2])
            result[ROLL_BETWEEN] = max(result[ROLL_BETWEEN], roll)
    first, goal = quaternions[0], quaternions[last]
    q_0 = (first[0], first[1], first[2], first[3])
    q_1 = (goal[0], goal[1], goal[2], goal[3])
    if sphere:
        result[START], result[START_RATE] = _direction_error(
            q_0, rates[0], ends[0], ends[1], boresight
        )
        result[GOAL], result[GOAL_RATE] = _direction_error(
            q_1, rates[last], ends[2], ends[3], boresight
        )
    else:
        result[START], result[START_RATE] = _attitude_error(q_0, rates[0], ends[0], ends[1])
        result[GOAL], result[GOAL_RATE] = _attitude_error(q_1, rates[last], ends[2], ends[3])
    return result
