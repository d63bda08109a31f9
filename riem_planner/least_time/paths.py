# SPDX-License-Identifier: Apache-2.0
"""Paths to start from: one of each class that may hold the least duration."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.least_time.transcription import Frame
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_POINTS = 101  # of the straight slew

BEND = 0.6
"""How far a bent path is from the straight one [rad]."""


LONG_WAY_FROM = math.radians(100.0)
"""Turn from which on the long way round may be the quicker one without zones."""


def smooth_times(intervals: int) -> Array:
    """Way (n + 1,) from 0 to 1 of a slew from rest to rest at even times."""
    s = np.linspace(0.0, 1.0, intervals + 1)
    return s * s * (3.0 - 2.0 * s)


def straight(frame: Frame, intervals: int, *, long: bool = False) -> Array:
    """Quaternions (n + 1, 4) of the turn about one axis, or of the long way round."""
    way = smooth_times(intervals)[:, None]
    return so3.quaternion_multiply(frame.start, so3.quaternion_exp(way * _turn(frame, long)))


def straight_slew(frame: Frame) -> Trajectory:
    """The turn about one axis from rest to rest in 1 s, in the user's axes."""
    s = np.linspace(0.0, 1.0, _POINTS)[:, None]
    turn = frame.axes @ _turn(frame)
    way = s * s * (3.0 - 2.0 * s)
    start = frame.problem.start.quaternion_xyzw
    q = so3.quaternion_multiply(start, so3.quaternion_exp(way * turn))
    return Trajectory(s[:, 0], q, 6.0 * s * (1.0 - s) * turn, (6.0 - 12.0 * s) * turn)


def slew_along(frame: Frame, path: Array) -> Trajectory:
    """A motion along a path (n + 1, 4) in 1 s, in the user's axes; rates are roughly its own."""
    V, A = motion(path)
    q = so3.quaternion_multiply(path, so3.quaternion_conjugate(frame.turn))
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    q[1:] *= np.cumprod(flips)[:, None]
    C = frame.axes.T
    return Trajectory(np.linspace(0.0, 1.0, len(path)), q, V @ C, A @ C)


def _turn(frame: Frame, long: bool = False) -> Array:
    turn = so3.quaternion_log(
        so3.quaternion_multiply(so3.quaternion_conjugate(frame.start), frame.goal)
    )
    angle = float(np.linalg.norm(turn))
    if not long:
        return turn
    axis = turn / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
    return (angle - 2.0 * math.pi) * axis


def sides(frame: Frame) -> Array:
    """Unit vectors (m, 3) across the straight turn: four, two where no roll is allowed."""
    turn = _turn(frame)
    angle = float(np.linalg.norm(turn))
    axis = turn / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
    if not frame.rolling:
        across = np.cross(axis, [1.0, 0.0, 0.0])
        return np.array([across, -across])
    least = np.eye(3)[np.argmin(np.abs(axis))]
    across = np.cross(axis, least)
    across /= np.linalg.norm(across)
    other = np.cross(axis, across)
    # Half-way between the body's axes, along which a symmetric case may be stationary.
    one, two = (across + other) / math.sqrt(2.0), (across - other) / math.sqrt(2.0)
    return np.array([one, -one, two, -two])


def bent(path: Array, bend: Array) -> Array:
    """A path (n + 1, 4) turned by a bend (3,) [rad] half-way, less towards its ends."""
    way = smooth_times(len(path) - 1)[:, None]
    return so3.quaternion_multiply(path, so3.quaternion_exp(4.0 * way * (1.0 - way) * bend))


def along(frame: Frame, trajectory: Trajectory, intervals: int) -> Array:
    """Quaternions (n + 1, 4) of a trajectory at even times."""
    times = np.linspace(0.0, trajectory.duration, intervals + 1)
    q = trajectory.evaluate_quaternion(times)[0]
    return so3.quaternion_multiply(q, frame.turn)


def motion(path: Array) -> tuple[Array, Array]:
    """Rates and accelerations (n + 1, 3) near those along a path in normalised time.

    The rates follow from the accelerations exactly, as the transcription asks for.
    """
    n = len(path) - 1
    rates = n * so3.quaternion_log(
        so3.quaternion_multiply(so3.quaternion_conjugate(path[:-1]), path[1:])
    )
    A = np.zeros((n + 1, 3))
    A[1:-1] = n * np.diff(rates, axis=0)
    A[0], A[-1] = A[1], A[-2]
    return integrated(np.zeros(3), A), A


def integrated(first: Array, A: Array) -> Array:
    """Rates (n + 1, 3) of accelerations that are linear between the nodes."""
    steps = 0.5 * (A[1:] + A[:-1]) / (len(A) - 1)
    return np.concatenate([first[None], first + np.cumsum(steps, axis=0)])


def angle(frame: Frame) -> float:
    """Of the straight turn [rad]."""
    return float(np.linalg.norm(_turn(frame)))
