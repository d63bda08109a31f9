# SPDX-License-Identifier: Apache-2.0
"""The way out of a zone that has come over the spacecraft, or is about to.

It brakes as hard as the limits allow, and then turns by an angle about a fixed body axis, from rest
to rest at the limits (`riem_planner.ramps`). Among many axes and angles, the one whose least margin
falls least beyond what braking needs is taken (from rest outside of all others: not at all), and of
those the soonest to be clear.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner import ramps
from riem_planner.geometry import so3
from riem_planner.limit_rows import ACCELERATION, KEYS, POWERS, TORQUE, WHEEL_TORQUE
from riem_planner.limits import Limits
from riem_planner.obstacles import Forbidden
from riem_planner.stop import SHORTEST, trajectory_of_turns
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

FINE = 1e-6
"""A fall of the margin that is rounding [rad]."""
HARDEST = 16.0
"""The acceleration of a way out where no limit tells one, relative to the gentle one."""
UNLIMITED = "no limit"
"""What binds a way out where no limit does."""
_STEP = 1e-5  # of the finite differences of margins [rad]
_LONGER = (1.0, 1.15, 1.5, 2.0, 3.0, 5.0, 9.0)  # turns, relative to the margin that is missing
_EFFORTS = (1 / 16, 1 / 4, 1.0)  # of the acceleration there is, where it is still outside
_NEARLY = 1.15  # times the soonest crossing: a shorter turn is preferred
_ROUNDS = 6  # of stretching a motion until it keeps the limits
_REST = 1e-9  # rad/s
_POWERS = np.array([*POWERS, 2.0])  # of 1/T, of the parts below; the last is the free acceleration


def uphill(forbidden: Forbidden, attitude: Array, time: float = 0.0) -> list[Array]:
    """Body axes (3,) about which a turn raises the margins: each violated set's, and their mean."""
    turns = so3.exp(_STEP * np.vstack([np.eye(3), -np.eye(3)]))
    around = forbidden.margins(attitude @ turns, time)
    here = forbidden.margins(attitude, time)
    gradients = []
    for name, margin in here.items():
        gradient = (around[name][:3] - around[name][3:]) / (2 * _STEP)
        norm = float(np.linalg.norm(gradient))
        if float(margin) <= 0.2 and norm > 1e-3:
            gradients.append((float(margin), gradient / norm))
    gradients.sort(key=lambda item: item[0])
    axes = [axis for _, axis in gradients]
    if len(axes) > 1:
        axes.append(np.sum(axes, axis=0))
        axes.append(axes[0] + axes[1])
    return axes


def _axes(forbidden: Forbidden, attitude: Array, time: float) -> Array:
    """Unit body axes (m, 3) that are tried."""
    grid = [np.array(corner, dtype=float) for corner in itertools.product((-1, 0, 1), repeat=3)]
    axes = uphill(forbidden, attitude, time) + [axis for axis in grid if np.any(axis)]
    if forbidden.pointing:
        b = forbidden.boresight  # without roll: about axes across it
        axes = [axis - (axis @ b) * b for axis in axes]
    kept = [axis / np.linalg.norm(axis) for axis in axes if np.linalg.norm(axis) > 1e-6]
    return np.array(kept).reshape(-1, 3)


def fall_before_exit(margins: Array) -> Array:
    """How far margins (..., n) fall below what they were, before they are positive for good.

    Outside from the start: how far inside it ever gets, plus a turn if it ends inside.
    """
    inside = margins <= 0.0
    last = np.where(
        inside.any(axis=-1),
        margins.shape[-1] - 1 - np.argmax(inside[..., ::-1], axis=-1),
        -1,
    )
    index = np.arange(margins.shape[-1])
    before = index <= last[..., None] + 1
    highest = np.maximum.accumulate(margins, axis=-1)
    fall = np.max(np.where(before, highest - margins, 0.0), axis=-1)
    return np.asarray(np.where(last == margins.shape[-1] - 1, fall + 2 * math.pi, fall))


class WayOut(NamedTuple):
    """A way out.

    Attributes
    ----------
    trajectory
        It is not certified: to be judged by the certificate.
    binds
        The limit that it is at, `limits.rate` or such, or `no limit`.
    """

    trajectory: Trajectory
    binds: str


class _Reach(NamedTuple):
    """What the spacecraft can do.

    Attributes
    ----------
    limits
        Those that are set.
    free
        The acceleration where no limit tells one [rad/s^2].
    """

    limits: Limits | None
    free: float

    def parts(self, v: Array, a: Array, j: Array | None = None) -> Array:
        """Part of each limit that a motion uses, by row of a table, then of the free one."""
        if self.limits is None:
            parts = np.full(len(POWERS), np.nan)
        else:
            parts = self.limits.parts(v, a, np.zeros(3) if j is None else j)
        free = np.nan
        if np.all(np.isnan(parts[[ACCELERATION, TORQUE, WHEEL_TORQUE]])):
            free = float(np.max(np.linalg.norm(a, axis=-1))) / self.free
        return np.asarray(np.nan_to_num(np.append(parts, free), nan=0.0))

    def slower(self, trajectory: Trajectory, first: int = 0, powers: Array = _POWERS) -> float:
        """By how much a motion has to be slower to keep the limits, from a sample on."""
        v, a = trajectory.angular_velocities[first:], trajectory.angular_accelerations[first:]
        j = np.diff(a, axis=0) / np.diff(trajectory.times[first:])[:, None]
        parts = self.parts(v, a, np.concatenate([j, j[-1:]]))
        return float(np.max(parts ** (1.0 / powers)))

    def fastest(self, axis: Array) -> float:
        """The largest rate about a body axis [rad/s], infinite if none is set."""
        parts = self.parts(axis, np.zeros(3))
        # Torque, too: what it takes to keep on turning grows with the square of the rate.
        most = float(np.max(parts ** np.where(_POWERS == 2.0, 0.5, 1.0)))
        return 1.0 / most if most > 0.0 else math.inf

    def hardest(self, axis: Array) -> float:
        """The largest acceleration about a body axis [rad/s^2], from rest."""
        return 1.0 / float(np.max(self.parts(np.zeros(3), axis)))


class _Turn(NamedTuple):
    """A turn by a length about an axis, once at rest, and how it does."""

    axis: Array
    length: float
    corners: ramps.Corners
    fall: float
    short: float
    clear: float


def _stretched(corners: ramps.Corners, factor: float) -> ramps.Corners:
    """The same way, that much slower."""
    return ramps.Corners(corners.times * factor, corners.accelerations / factor**2)


def _brake(quaternion: Array, rate: Array, acceleration: Array, reach: _Reach) -> Trajectory | None:
    """The soonest stop within the limits; None at rest."""
    speed = float(np.linalg.norm(rate))
    if speed < _REST:
        return None
    duration = speed / (reach.hardest(rate / speed) * (1.0 - ramps.RISE))
    for _ in range(_ROUNDS):
        corners = ramps.brake(rate, acceleration, max(duration, SHORTEST))
        times = ramps.sample_times(corners, speed * duration)
        stop = trajectory_of_turns(quaternion, times, ramps.to_rest(corners, rate, times))
        # What it begins with is given, and is only reduced.
        first = int(np.searchsorted(times, corners.times[1] - 1e-12))
        # A longer brake reduces its acceleration; the rate it begins with is what it is.
        factor = reach.slower(stop, first, np.where(_POWERS == 1.0, math.inf, _POWERS - 1.0))
        if factor <= 1.0 + 1e-6:
            break
        duration = stop.duration * factor
    return stop


def _turns(
    forbidden: Forbidden, attitude: Array, begin: float, before: Array, reach: _Reach, target: float
) -> list[_Turn]:
    """Turns from rest at an attitude at a time [s], after margins (n,) while it was braking."""
    axes = _axes(forbidden, attitude, begin)
    here = float(forbidden.least_margin(attitude, begin))
    needed = max(target - here, 1e-3)
    alike: dict[tuple[float, float], list[Array]] = {}
    for axis in axes:
        able = (float(f"{reach.fastest(axis):.3g}"), float(f"{reach.hardest(axis):.3g}"))
        alike.setdefault(able, []).append(axis)
    brake_fall = float(fall_before_exit(before)) % (2 * math.pi) if before.size else 0.0
    efforts = _EFFORTS if here > 0.0 and not before.size else _EFFORTS[-1:]
    found: list[_Turn] = []
    for effort in efforts:
        for length in np.unique(np.minimum(needed * np.array(_LONGER), math.pi)):
            for (fastest, hardest), group in alike.items():
                corners = ramps.turn(float(length), fastest, effort * hardest)
                times = ramps.sample_times(corners, length)
                place = ramps.evaluate(corners, 0.0, times)[0]
                turns = np.array(group)[:, None, :] * place[:, None]
                margins = forbidden.least_margin(attitude @ so3.exp(turns), begin + times)
                whole = np.hstack([np.tile(before, (len(group), 1)), margins])
                falls = np.maximum(fall_before_exit(whole) - brake_fall - FINE, 0.0)
                clear = begin + _exit_time(margins, times)
                short = np.maximum(0.0, target - margins[:, -1])
                found += [
                    _Turn(axis, float(length), corners, *map(float, row))
                    for axis, *row in zip(group, falls, short, clear, strict=True)
                ]
        if any(each.fall == 0.0 and each.short < 1e-3 for each in found):
            break  # harder is not better
    return found


def _exit_time(margins: Array, times: Array) -> Array:
    """From when on margins (..., n) at times (n,) [s] are positive for good."""
    inside = margins <= 0.0
    last = margins.shape[-1] - 1 - np.argmax(inside[..., ::-1], axis=-1)
    after = np.minimum(last + 1, margins.shape[-1] - 1)
    low = np.take_along_axis(margins, last[..., None], axis=-1)[..., 0]
    high = np.take_along_axis(margins, after[..., None], axis=-1)[..., 0]
    rise = np.where(high > low, high - low, 1.0)
    crossed = times[last] + np.clip(-low / rise, 0.0, 1.0) * (times[after] - times[last])
    return np.asarray(np.where(inside.any(axis=-1), crossed, 0.0))


def _best(turns: list[_Turn]) -> _Turn:
    """Of those that fall least and get farthest, the shortest that is nearly the soonest."""

    def worth(turn: _Turn) -> tuple[float, float]:
        return round(turn.fall, 4), round(turn.short, 3)

    least = min(map(worth, turns))
    good = [turn for turn in turns if worth(turn) == least]
    soonest = min(turn.clear for turn in good)
    return min(
        (turn for turn in good if turn.clear <= _NEARLY * soonest + 1e-9),
        key=lambda turn: (turn.length, turn.corners.times[-1]),
    )


def way_out(
    quaternion: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    forbidden: Forbidden,
    gentle: float,
    target: float,
    limits: Limits | None = None,
) -> WayOut:
    """The soonest way to where all margins are positive, falling as little as can be.

    Parameters
    ----------
    quaternion : (4,)
        Unit, x, y, z, w, of the attitude it begins at.
    rate, acceleration : (3,)
        Body rate [rad/s] and acceleration [rad/s^2] that it begins with.
    forbidden
        What to come out of, at its places of time 0 and moving from there.
    gentle
        The acceleration of a slew [rad/s^2]; without limits the way out takes 16 times that.
    target
        The margin to reach [rad], if it can be had.
    limits
        What the way out keeps; what its start exceeds is only reduced.
    """
    q = np.asarray(quaternion, dtype=float)
    v, a = np.asarray(rate, dtype=float), np.asarray(acceleration, dtype=float)
    reach = _Reach(limits, HARDEST * gentle)
    stop = _brake(q, v, a, reach)
    begin, before = 0.0, np.empty(0)
    if stop is not None:
        times = np.linspace(0.0, stop.duration, 25)
        attitudes = stop.evaluate(times)[0]
        margins = forbidden.least_margin(attitudes, times)
        if margins[-1] >= target:
            return WayOut(stop, _binding(stop, reach))
        begin, before, q = stop.duration, margins[:-1], stop.quaternions_xyzw[-1]
    attitude = so3.quaternion_to_matrix(q)
    turns = _turns(forbidden, attitude, begin, before, reach, target)
    if not turns:  # on s2 with nothing to tell the axes apart
        still = np.zeros((2, 3))
        times = np.array([0.0, SHORTEST])
        return WayOut(stop or trajectory_of_turns(q, times, (still, still, still)), UNLIMITED)
    trajectory = _turned(q, _best(turns), reach)
    if stop is not None:
        trajectory = _joined(stop, trajectory)
    return WayOut(trajectory, _binding(trajectory, reach))


def _turned(quaternion: Array, turn: _Turn, reach: _Reach) -> Trajectory:
    """The turn as a trajectory, slower where axes work together so that a limit would break."""
    corners = turn.corners
    for _ in range(_ROUNDS):
        times = ramps.sample_times(corners, turn.length)
        place, speed, gain = (part[:, None] for part in ramps.to_rest(corners, 0.0, times))
        turns = turn.axis * place, turn.axis * speed, turn.axis * gain
        way = trajectory_of_turns(quaternion, times, turns)
        factor = reach.slower(way)
        if factor <= 1.0 + 1e-6:
            break
        corners = _stretched(corners, factor)
    return way


def _joined(first: Trajectory, second: Trajectory) -> Trajectory:
    """One trajectory after the other, which begins where that ends, at rest."""
    return Trajectory(
        np.concatenate([first.times, first.duration + second.times[1:]]),
        np.concatenate([first.quaternions_xyzw, second.quaternions_xyzw[1:]]),
        np.concatenate([first.angular_velocities, second.angular_velocities[1:]]),
        np.concatenate([first.angular_accelerations, second.angular_accelerations[1:]]),
    )


def _binding(trajectory: Trajectory, reach: _Reach) -> str:
    """Which limit is used most."""
    if reach.limits is None:
        return UNLIMITED
    v, a = trajectory.angular_velocities, trajectory.angular_accelerations
    row = int(np.argmax(reach.parts(v, a)))
    return f"limits.{KEYS[row]}" if row < len(KEYS) else UNLIMITED
