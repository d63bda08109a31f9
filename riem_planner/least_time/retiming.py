# SPDX-License-Identifier: Apache-2.0
"""Level (a): the quickest motion along a given path, on even samples.

The speeds of `profile` switch sharply, and a plan's acceleration is linear between its samples: so
the acceleration along the path becomes its mean over a window about each sample, of one interval,
or as long as limits of jerk ask for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.least_time.profile import fastest
from riem_planner.least_time.transcription import Frame
from riem_planner.limit_rows import (
    ACCELERATION,
    KEYS,
    MOMENTUM,
    RATE,
    TORQUE,
    WHEEL_MOMENTUM,
    WHEEL_TORQUE,
)
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_POINTS = 401
_WINDOWS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5)  # of the sharp duration, tried for limits of jerk
_AT_REST = 1e-9  # of the greatest speed
_SHORTEST = 1e-9  # rad, of a path that is one


@dataclass(frozen=True, eq=False)
class Path:
    """A path by arc length.

    Parameters
    ----------
    curve
        Its `times` are lengths [rad]; rates and accelerations the tangent and its derivative.
    """

    curve: Trajectory

    @property
    def length(self) -> float:
        """[rad]."""
        return self.curve.duration


def path_of(frame: Frame, trajectory: Trajectory) -> Path | None:
    """The path of a trajectory; None where it hardly moves.

    Its points are even in the trajectory's time, so that they are dense where a slew from rest
    bends most. There `w = v / |v|` and `w' = (a - w (w . a)) / |v|^2`; at an end at rest the
    tangent is that of the acceleration.
    """
    times = np.linspace(0.0, trajectory.duration, _POINTS)
    q, v, a = trajectory.evaluate_quaternion(times)
    s = np.concatenate([[0.0], np.cumsum(so3.quaternion_distance(q[:-1], q[1:]))])
    if s[-1] < _SHORTEST or np.any(np.diff(s) <= 0.0):
        return None
    speeds = np.linalg.norm(v, axis=1)
    w, bend = np.zeros_like(v), np.zeros_like(v)
    moving = speeds > _AT_REST * np.max(speeds)
    w[moving] = v[moving] / speeds[moving, None]
    across = a - w * np.sum(w * a, axis=1, keepdims=True)
    bend[moving] = across[moving] / speeds[moving, None] ** 2
    if not np.all(moving[1:-1]):
        return None  # it stands still on the way
    for k, inside, sign in ((0, 1, 1.0), (-1, -2, -1.0)):
        if not moving[k]:
            w[k] = sign * a[k] / np.linalg.norm(a[k]) if np.any(a[k]) else w[inside]
            bend[k] = bend[inside]
    if not frame.rolling:
        b = frame.problem.boresight
        w, bend = w - np.outer(w @ b, b), bend - np.outer(bend @ b, b)
    return Path(Trajectory(s, q, w, bend))


def retimed(frame: Frame, path: Path, samples: int, tightening: float) -> Trajectory | None:
    """A quick motion along a path on even samples, to be certified; None where there is none."""
    speeds = _speeds(frame, path, tightening)
    if speeds is None:
        return None
    limits = frame.problem.limits
    assert limits is not None  # a problem of least time has them
    if not limits.smooth:
        return _sampled(path, speeds, samples, 0.0)
    smooth = [_sampled(path, speeds, samples, window) for window in _WINDOWS]
    return min(smooth, key=lambda each: each.duration * _excess(frame, each))


def _excess(frame: Frame, trajectory: Trajectory) -> float:
    """How many times slower it would keep the limits at its samples."""
    T = trajectory.duration
    C = frame.axes
    V, A = trajectory.angular_velocities @ C * T, trajectory.angular_accelerations @ C * T**2
    return max(1.0, frame.slower(V, A, 1.0) / T)


def _speeds(frame: Frame, path: Path, tightening: float) -> tuple[Array, Array] | None:
    """Times and speeds at the points of a path."""
    problem = frame.problem
    limits = problem.limits
    assert limits is not None  # a problem of least time has them
    curve = path.curve
    w, bend = curve.angular_velocities, curve.angular_accelerations
    J = limits.inertia_matrix
    R = so3.quaternion_to_matrix(curve.quaternions_xyzw)
    h = np.einsum("nij,i->nj", R, problem.total_momentum)
    n = len(w)
    forces, bends, drags = np.zeros((3, n, len(KEYS), 3))
    forces[:, RATE], forces[:, MOMENTUM] = w, w @ J
    forces[:, WHEEL_MOMENTUM] = w @ J
    forces[:, ACCELERATION], bends[:, ACCELERATION] = w, bend
    forces[:, TORQUE], bends[:, TORQUE] = w @ J, bend @ J + np.cross(w, w @ J)
    forces[:, WHEEL_TORQUE], bends[:, WHEEL_TORQUE] = w @ J, bend @ J
    drags[:, WHEEL_TORQUE] = np.cross(w, h)
    norms, rows, first = limits.table
    table = (norms / (1.0 - tightening), rows / (1.0 - tightening), first)
    ends = tuple(
        float(s.angular_velocity @ s.angular_velocity) for s in (problem.start, problem.arrival)
    )
    steps = np.diff(curve.times)
    x = fastest(steps, (forces, bends, drags, np.ascontiguousarray(h)), table, ends)
    speeds = np.sqrt(np.maximum(x, 0.0))
    if x[0] < 0.0 or np.any(speeds[1:] + speeds[:-1] <= 0.0):
        return None
    return np.concatenate([[0.0], np.cumsum(2.0 * steps / (speeds[1:] + speeds[:-1]))]), speeds


def _sampled(path: Path, sharp: tuple[Array, Array], samples: int, window: float) -> Trajectory:
    """The motion on even samples, its acceleration averaged over a window of the duration."""
    times, speeds = sharp
    longer = window * times[-1]
    T = times[-1] + longer
    t = np.linspace(0.0, T, samples)
    h = T / (samples - 1)
    half = max(0.5 * h, 0.5 * longer)
    late, early = t + half - 0.5 * longer, t - half - 0.5 * longer
    if window == 0.0:
        late, early = np.minimum(late, T), np.maximum(early, 0.0)
    change = np.interp(late, times, speeds) - np.interp(early, times, speeds)
    u = change / np.maximum(late - early, 1e-300)
    speed = speeds[0] + np.concatenate([[0.0], np.cumsum(0.5 * h * (u[1:] + u[:-1]))])
    way = np.concatenate([[0.0], np.cumsum(h * speed[:-1] + h * h * (u[:-1] / 3 + u[1:] / 6))])
    # What the samples miss of the way and of the last speed is spread over all of it.
    r = t / T
    slip = speeds[-1] - speed[-1]
    speed += slip * r**2 * (3.0 - 2.0 * r)
    way += slip * T * (r**3 - 0.5 * r**4)
    u += slip / T * 6.0 * r * (1.0 - r)
    missed = path.length - way[-1]
    way += missed * r**3 * (10.0 - r * (15.0 - 6.0 * r))
    speed += missed / T * 30.0 * (r * (1.0 - r)) ** 2
    u += missed / T**2 * 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r)
    way[0], way[-1] = 0.0, path.length
    q, w, bend = path.curve.evaluate_quaternion(np.clip(way, 0.0, path.length))
    return Trajectory(t, q, w * speed[:, None], w * u[:, None] + bend * (speed**2)[:, None])
