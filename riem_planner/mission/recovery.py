# SPDX-License-Identifier: Apache-2.0
"""What is flown when the timeline may not be: a certified stop, else the way out."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from riem_planner.escape import WayOut, way_out
from riem_planner.mission.codes import Code
from riem_planner.mission.safety import Judge, Verdict, hold_horizon, without_roll
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Purpose, Segment, Setpoint, Timeline
from riem_planner.stop import stops
from riem_planner.trajectory import Trajectory

MARGIN = 0.01
"""What a way out or a dodge leaves to each zone [rad], beside what the zone will move."""
_GENTLE = 6.0  # rad; the peak acceleration of a slew by one radian, times duration squared


@dataclass(frozen=True)
class Rescue:
    """What to fly instead.

    Parameters
    ----------
    timeline
        The timeline that is now to be streamed.
    purpose
        Why.
    certified
        Whether all of it is certified; a way out never is.
    verdict
        On the timeline, all the same.
    message
        What it is, in a sentence.
    """

    timeline: Timeline
    purpose: Purpose
    certified: bool
    verdict: Verdict
    message: str

    @property
    def code(self) -> Code:
        """What is told of it."""
        if self.purpose is Purpose.STOP:
            return Code.STOP
        return Code.DODGE if self.certified else Code.WAY_OUT


def lead_ns(settings: Settings) -> int:
    """How far ahead of now a timeline may change: nothing there has been streamed yet [ns]."""
    return max(settings.period_ns, 10_000_000)


def gentle_acceleration(settings: Settings, flying: Trajectory | None) -> float:
    """The acceleration that stops and ways out begin with [rad/s^2]: what is flown anyway."""
    duration = settings.duration or (60.0 if flying is None else flying.duration)
    gentle = _GENTLE / duration**2
    if flying is not None:
        peak = float(np.max(np.linalg.norm(flying.angular_accelerations, axis=1)))
        gentle = max(gentle, peak)
    limit = None if settings.limits is None else settings.limits.acceleration
    return gentle if limit is None else min(gentle, float(np.min(limit)))


def _stops(timeline: Timeline, settings: Settings, at_ns: int) -> Iterable[Timeline]:
    segment, start = timeline.segment_at(at_ns), timeline.at(at_ns)
    assert segment is not None  # the timeline is streamed from now on
    assert start is not None
    start = without_roll(start, settings)
    gentle = gentle_acceleration(settings, segment.trajectory)
    for stop in stops(start.quaternion, start.rate, start.acceleration, gentle):
        if within_limits(stop, settings):
            yield timeline.spliced(Segment(at_ns, stop, Purpose.STOP))


def within_limits(stop: Trajectory, settings: Settings) -> bool:
    """Whether a stop keeps the limits, or at least asks no more than its own start did."""
    if settings.limits is None:
        return True
    times = np.linspace(0.0, stop.duration, 101)
    _, v, a = stop.evaluate(times)
    j = np.gradient(a, times, axis=0)
    start = settings.limits.used(v[0], a[0], j[0])
    used = settings.limits.used(v, a, j)
    return all(part <= max(1.0, start[key]) + 1e-6 for key, part in used.items())


def come_to_rest(
    timeline: Timeline,
    judge: Judge,
    settings: Settings,
    at_ns: int,
    within: float | None = None,
) -> Rescue | None:
    """The gentlest certified stop from a time on, and the hold after it; None if there is none.

    Parameters
    ----------
    timeline, judge, settings
        What is streamed, and who judges what is to be.
    at_ns
        When the stop is to begin [ns].
    within
        How long it may take [s]; if none is certified that is so short, the shortest is taken.
    """
    longer: Rescue | None = None
    for candidate in _stops(timeline, settings, at_ns):
        verdict = judge.timeline(candidate)
        if verdict.certified:
            seconds = candidate.last.trajectory.duration
            message = f"a certified stop within {seconds:.3g} s and hold"
            found = Rescue(candidate, Purpose.STOP, True, verdict, message)
            if within is None or seconds <= within:
                return found
            longer = found  # each is shorter than the one before
    return longer


def leave(timeline: Timeline, judge: Judge, settings: Settings, at_ns: int) -> Rescue:
    """The shortest way to where everything is clear, from a time on."""
    segment, start = timeline.segment_at(at_ns), timeline.at(at_ns)
    assert segment is not None  # the timeline is streamed from now on
    assert start is not None
    way = _way_out(start, judge, settings, segment.trajectory)
    candidate = timeline.spliced(Segment(at_ns, way.trajectory, Purpose.WAY_OUT))
    verdict = judge.timeline(candidate)
    angle = math.degrees(_turn(way.trajectory))
    speed = np.linalg.norm(way.trajectory.angular_velocities, axis=1)
    message = (
        f"a turn by {angle:.3g} deg within {way.trajectory.duration:.3g} s, at most"
        f" {math.degrees(float(np.max(speed))):.3g} deg/s, bound by {way.binds}"
    )
    return Rescue(candidate, Purpose.WAY_OUT, verdict.certified, verdict, message)


def _way_out(
    start: Setpoint, judge: Judge, settings: Settings, flying: Trajectory | None
) -> WayOut:
    """The soonest way out from a reference state."""
    forbidden = judge.forbidden(start.stamp_ns)
    calm = without_roll(start, settings)
    return way_out(
        calm.quaternion,
        calm.rate,
        calm.acceleration,
        forbidden,
        gentle_acceleration(settings, flying),
        MARGIN + forbidden.fastest * hold_horizon(settings),
        settings.limits,
    )


def _turn(trajectory: Trajectory) -> float:
    first, last = trajectory.quaternions_xyzw[[0, -1]]
    return 2.0 * math.acos(min(1.0, abs(float(first @ last))))


def rescue(timeline: Timeline, judge: Judge, settings: Settings) -> Rescue:
    """What to fly when the timeline is no longer certified.

    In this order: the stop that begins one planning budget from now (a new plan may come before
    it), the stop that begins at once, a certified turn to where it is clear, the way out.
    """
    soon = judge.now_ns + lead_ns(settings)
    later = judge.now_ns + max(settings.budget_ns, lead_ns(settings))
    start = timeline.at(soon)
    assert start is not None  # the timeline is streamed from now on
    inside = judge.inside(start)
    if inside:
        found = leave(timeline, judge, settings, soon)
        message = f"inside {', '.join(inside)}: the way out, {found.message}"
        return replace(found, certified=False, message=message)
    for at_ns in dict.fromkeys((later, soon)):
        stop = come_to_rest(timeline, judge, settings, at_ns)
        if stop is not None:
            return stop
    dodge = leave(timeline, judge, settings, soon)
    if dodge.certified:
        return replace(dodge, message=f"a certified {dodge.message[2:]}")
    return _least_bad(timeline, dodge, judge, settings, soon)


def _least_bad(
    timeline: Timeline, dodge: Rescue, judge: Judge, settings: Settings, soon: int
) -> Rescue:
    candidates = [(dodge.timeline, dodge.verdict)]
    candidates += [(stop, judge.timeline(stop)) for stop in _stops(timeline, settings, soon)]
    best, verdict = max(candidates, key=lambda each: min(each[1].clearance.values(), default=0.0))
    return Rescue(
        best,
        best.last.purpose,
        False,
        verdict,
        "nothing certified is left; the way that comes least near is flown",
    )
