# SPDX-License-Identifier: Apache-2.0
"""What the planner is asked: from which state on, and what is tried in which order."""

from __future__ import annotations

import numpy as np

from riem_planner.geometry import so3
from riem_planner.mission import planning
from riem_planner.mission.events import Measurement
from riem_planner.mission.planning import Attempt, Goal, Reason
from riem_planner.mission.safety import Judge, portion, without_roll
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Segment, Setpoint, Timeline
from riem_planner.mission.zone_tracker import World

SETTLED = 1e-5
"""A turn within one budget that a measured attitude may make and count as at rest [rad]."""
_TOO_LITTLE = 0.02  # of a slew left, to keep its arrival time or to look for a gain


def reference_state(
    timeline: Timeline, settings: Settings, splice_ns: int, leaving: Judge | None
) -> Setpoint:
    """The state that is streamed at a time [ns]; on the way out of a zone, where it is clear.

    Parameters
    ----------
    leaving
        Who judges where it is clear; None if it is not on the way out.
    """
    start = timeline.at(splice_ns)
    assert start is not None  # a timeline is streamed from now on
    if leaving is not None and leaving.inside(start):
        start = timeline.at(max(splice_ns, timeline.end_ns))
        assert start is not None
    return without_roll(start, settings)


def measured_state(measured: Measurement | None, settings: Settings, splice_ns: int) -> Setpoint:
    """The measured state, carried on to a time [ns]; that of the parameters where there is none."""
    if measured is None:
        rest = np.zeros(3)
        return Setpoint(splice_ns, np.array(settings.start_orientation), rest, rest)
    q, v, stamp_ns = measured
    if float(np.linalg.norm(v)) * settings.planning_budget < SETTLED:
        return Setpoint(splice_ns, q, np.zeros(3), np.zeros(3))
    turn = so3.quaternion_exp(v * ((splice_ns - stamp_ns) * 1e-9))
    predicted = so3.quaternion_multiply(q, turn)
    start = Setpoint(splice_ns, predicted / np.linalg.norm(predicted), v, np.zeros(3))
    return without_roll(start, settings)


def attempts(
    settings: Settings,
    world: World,
    start: Setpoint,
    goal: Goal,
    reason: Reason,
    flying: Segment | None,
) -> tuple[Attempt, ...]:
    """What is tried to get from a state to a goal; nothing where there is too little to gain.

    Parameters
    ----------
    flying
        The slew to this goal that is flown, if there is one.

    Raises
    ------
    InvalidProblemError
        A value is wrong, such as a goal on s2 that rolls.
    """
    durations = [settings.duration]
    if goal.moving and not settings.duration:
        durations = _durations(settings, start, goal)
    problems = [
        planning.build_problem(settings, world, start, goal, duration) for duration in durations
    ]
    anew = problems[0]
    left = 0.0 if flying is None else (flying.end_ns - start.stamp_ns) * 1e-9
    keeping = reason in (Reason.OBSTACLE, Reason.GAIN, Reason.TARGET)
    if flying is None or not keeping or left < _TOO_LITTLE * flying.trajectory.duration:
        if reason is Reason.GAIN:
            return ()
        return tuple(each for problem in problems for each in planning.attempts_anew(problem))
    kept = planning.build_problem(settings, world, start, goal, left)
    flown = flying.trajectory
    warm_start = portion(flown, flying.elapsed(start.stamp_ns), flown.duration)
    if reason is Reason.GAIN:
        return (Attempt(kept, "global", warm_start),)
    peak = float(np.max(np.linalg.norm(flown.angular_velocities, axis=1)))
    return planning.attempts_keeping(kept, anew, warm_start, peak)


def _durations(settings: Settings, start: Setpoint, goal: Goal) -> list[float]:
    """Durations [s] to be tried where the least is asked for, and the target moves meanwhile."""
    assert settings.limits is not None  # the least duration is within limits
    angle = float(so3.quaternion_distance(start.quaternion, goal.at(start.stamp_ns)))
    axis = np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
    still = np.zeros(3)
    fast, hard, rough = (
        max(settings.limits.used(*motion).values())
        for motion in ((axis, still, still), (still, axis, still), (still, still, axis))
    )
    speed = float(np.linalg.norm(goal.rate))
    turn = max(angle, 0.1)
    least = turn * fast + 2.5 * np.sqrt(turn * hard) + 3.0 * np.cbrt(turn * rough)
    least += 2.0 * speed * hard
    return [float(least * factor) for factor in (1.0, 1.4, 2.0, 3.0, 5.0)]
