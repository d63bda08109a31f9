# SPDX-License-Identifier: Apache-2.0
"""What may be streamed: certificates of the timeline from now on, in the world as it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from riem_planner.certificate import certify_clearance
from riem_planner.escape import FINE, fall_before_exit
from riem_planner.geometry import so3
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Segment, Setpoint, Timeline
from riem_planner.mission.zone_tracker import World
from riem_planner.obstacles import Forbidden
from riem_planner.problem import S2
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

CUT_TOLERANCE = 1e-7
"""Clearance asked of a part of a trajectory, which is fitted anew where it is cut [rad]."""
_AT_REST = 1e-9  # rad/s


@dataclass(frozen=True)
class Verdict:
    """Whether a timeline may be flown, and how close it comes.

    Parameters
    ----------
    reasons
        Why not, with names and numbers; empty when it may.
    clearance
        Certified lower bound of the distance to each forbidden set [rad].
    worst_ns
        When each is least [ns].
    """

    reasons: tuple[str, ...]
    clearance: dict[str, float]
    worst_ns: dict[str, int]

    @property
    def certified(self) -> bool:
        """Whether the timeline may be flown."""
        return not self.reasons


def forbidden_at(world: World, settings: Settings, now_ns: int) -> Forbidden:
    """What is forbidden in a world, at its places of a time [ns] and moving on from there."""
    return Forbidden(world.obstacles(now_ns), settings.boresight, settings.space == S2)


def portion(trajectory: Trajectory, begin: float, end: float) -> Trajectory:
    """The part of a trajectory between two times [s], from time 0, through the samples inside."""
    inside = trajectory.times[(trajectory.times > begin + 1e-9) & (trajectory.times < end - 1e-9)]
    times = np.concatenate([[begin], inside, [end]])
    return Trajectory(times - begin, *trajectory.evaluate_quaternion(times))


def hold(setpoint: Setpoint, duration: float) -> Trajectory:
    """Resting at a setpoint's attitude [s]."""
    return Trajectory(
        np.array([0.0, duration]), np.array([setpoint.quaternion] * 2), *np.zeros((2, 2, 3))
    )


def hold_horizon(settings: Settings) -> float:
    """How far ahead a resting attitude is looked at, so that there is time to dodge [s]."""
    return max(2.0, 0.25 * settings.duration)


class Judge:
    """Certifies timelines in one world at one time.

    Parameters
    ----------
    world, settings
        What is forbidden.
    now_ns
        From when on [ns].
    """

    def __init__(self, world: World, settings: Settings, now_ns: int) -> None:
        self.now_ns = now_ns
        self._world = world
        self._settings = settings
        self._forbidden: dict[int, Forbidden] = {}

    def forbidden(self, time_ns: int) -> Forbidden:
        """What is forbidden from a time [ns] on; the same for all times if nothing moves."""
        key = time_ns if self._world.moving else self.now_ns
        if key not in self._forbidden:
            self._forbidden[key] = forbidden_at(self._world, self._settings, key)
        return self._forbidden[key]

    def margins(self, setpoint: Setpoint) -> dict[str, float]:
        """Distance of a setpoint to each forbidden set [rad], negative inside."""
        attitude = so3.quaternion_to_matrix(setpoint.quaternion)
        margins = self.forbidden(setpoint.stamp_ns).margins(attitude)
        return {name: float(margin) for name, margin in margins.items()}

    def inside(self, setpoint: Setpoint) -> tuple[str, ...]:
        """Forbidden sets that a setpoint is in."""
        return tuple(name for name, margin in self.margins(setpoint).items() if margin <= 0.0)

    def timeline(self, timeline: Timeline) -> Verdict:
        """Verdict on everything that is to be streamed from now on.

        Motion is judged to its end; what is held, from now to the hold horizon.
        """
        clearance: dict[str, float] = {}
        worst: dict[str, int] = {}
        reasons: list[str] = []
        horizon_ns = self.now_ns + round(hold_horizon(self._settings) * 1e9)
        starts = [segment.start_ns for segment in timeline.segments[1:]]
        for segment, until in zip(timeline.segments, [*starts, None], strict=True):
            begin = max(segment.start_ns, self.now_ns)
            if until is not None and until <= begin:
                continue
            last = horizon_ns if until is None else until
            for start_ns, motion, from_time, least in _pieces(segment, begin, until, last):
                found = certify_clearance(motion, self.forbidden(start_ns), from_time=from_time)
                reasons += found.reasons
                for name, bound in found.clearance.items():
                    if bound <= least and not found.reasons:
                        reasons.append(f"{name}: no clearance can be proven at a splice")
                    if bound < clearance.get(name, np.inf):
                        clearance[name] = bound
                        since = start_ns + round(
                            (found.least_clearance_times[name] - from_time) * 1e9
                        )
                        worst[name] = since
        return Verdict(tuple(dict.fromkeys(reasons)), clearance, worst)

    def leaves(self, segment: Segment, until_ns: int) -> bool:
        """Whether a way out still does what it is for: the margin never falls, then is positive.

        While the rate that it began with is taken out the margin may have to fall.
        """
        begin = segment.elapsed(max(self.now_ns, segment.start_ns))
        after = max(begin, _first_rest(segment.trajectory))
        rest = np.linspace(after, max(segment.elapsed(until_ns), after), 100)
        attitudes = segment.trajectory.evaluate(rest)[0]
        forbidden = self.forbidden(max(self.now_ns, segment.start_ns))
        margins = forbidden.least_margin(attitudes, rest - begin)
        return bool(fall_before_exit(margins) <= FINE and margins[-1] > 0.0)


def _first_rest(trajectory: Trajectory) -> float:
    """When a way out has taken out the rate that it began with [s]."""
    resting = np.linalg.norm(trajectory.angular_velocities, axis=1) < _AT_REST
    return float(trajectory.times[int(np.argmax(resting))]) if resting.any() else 0.0


def _pieces(
    segment: Segment, begin_ns: int, until: int | None, last_ns: int
) -> list[tuple[int, Trajectory, float, float]]:
    """(start [ns], trajectory, from when in it [s], clearance asked for) of what is flown of it."""
    pieces: list[tuple[int, Trajectory, float, float]] = []
    if begin_ns < segment.end_ns:
        elapsed = segment.elapsed(begin_ns)
        if until is None or until >= segment.end_ns:
            pieces.append((begin_ns, segment.trajectory, elapsed, 0.0))
        else:
            part = portion(segment.trajectory, elapsed, segment.elapsed(until))
            pieces.append((begin_ns, part, 0.0, CUT_TOLERANCE))
    held_ns = max(begin_ns, segment.end_ns)
    if held_ns < last_ns:
        resting = hold(segment.at(held_ns), (last_ns - held_ns) * 1e-9)
        pieces.append((held_ns, resting, 0.0, 0.0))
    return pieces


def without_roll(setpoint: Setpoint, settings: Settings) -> Setpoint:
    """On s2 a setpoint whose motion has no roll about the boresight, as the space demands.

    What is removed is rounding, or, of a measured rate, a motion that the space leaves free.
    """
    if settings.space != S2:
        return setpoint
    b = settings.boresight
    rate, acceleration = setpoint.rate, setpoint.acceleration
    speed = float(np.linalg.norm(rate))
    rate = rate - (rate @ b) * b
    # Only along its own motion does a deceleration stay free of roll.
    along = rate / speed if speed > 1e-12 else np.zeros(3)
    return setpoint._replace(rate=rate, acceleration=(acceleration @ along) * along)
