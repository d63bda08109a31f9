# SPDX-License-Identifier: Apache-2.0
"""Goals that move: a target that turns on at its body rate, met, then followed, corrected as told.

What is flown to it is bent to where it is told to be by a turn that grows from nothing,

    R(t) = B(t) exp(hat(xi(t))),   xi(0) = xi'(0) = xi''(0) = 0,

with B what was flown so far and xi the quintic that ends at the target's attitude and rate.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.mission import recovery
from riem_planner.mission.flight import Flight
from riem_planner.mission.planning import Goal
from riem_planner.mission.safety import Judge
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Purpose, Segment, Setpoint, Timeline
from riem_planner.problem import S2
from riem_planner.trajectory import Trajectory, follow_turns

Array = NDArray[np.float64]

NEAR = 0.05
"""A message that is no farther from the target corrects it [rad]."""
ALIKE = 0.02
"""If its rate is no farther from the target's [rad/s]."""
SHORTEST = 1.0
"""Time in which a correction is taken up, at least [s]."""
SAMPLE_TURN = 0.5
"""A turn from sample to sample of what is followed [rad]."""
SAMPLES = 33
"""Of a way that is bent."""


def corrects(told: Goal, goal: Goal, time_ns: int) -> bool:
    """Whether a message tells of the target that is gone to already."""
    if not (goal.moving and told.topic == goal.topic):
        return False
    apart = float(so3.quaternion_distance(told.at(time_ns), goal.at(time_ns)))
    return apart <= NEAR and float(np.linalg.norm(told.rate - goal.rate)) <= ALIKE


def target_at(goal: Goal, time_ns: int, settings: Settings, near: Array) -> tuple[Array, Array]:
    """Attitude (4,) and body rate (3,) [rad/s] that are at the target at a time [ns].

    Parameters
    ----------
    goal
        The target.
    time_ns
        When [ns].
    settings
        On s2 only the boresight counts.
    near : (4,)
        The attitude whose roll is kept there.
    """
    told = goal.at(time_ns)
    if settings.space != S2:
        return told, goal.rate
    b = settings.boresight
    R, there = so3.quaternion_to_matrix(near), so3.quaternion_to_matrix(told)
    turn = so3.minimal_rotation(b, R.T @ there @ b)
    q = so3.quaternion_multiply(near, turn)
    rate = so3.quaternion_to_matrix(q).T @ there @ goal.rate
    return q / np.linalg.norm(q), rate - (rate @ b) * b


def followed(start: Setpoint, duration: float) -> Trajectory:
    """Turning on at a state's rate for a duration [s]."""
    turned = float(np.linalg.norm(start.rate)) * duration
    times = np.linspace(0.0, duration, 2 + int(turned / SAMPLE_TURN))
    quaternions = so3.quaternion_multiply(
        start.quaternion, so3.quaternion_exp(start.rate * times[:, None])
    )
    rates = np.tile(start.rate, (times.size, 1))
    return Trajectory(times, quaternions, rates, np.zeros_like(rates))


def bend(timeline: Timeline, begin_ns: int, end_ns: int, end: tuple[Array, Array]) -> Trajectory:
    """What a timeline flies from one time to another [ns], bent to end in a state.

    Parameters
    ----------
    timeline
        Streamed from the first time on.
    begin_ns, end_ns
        [ns].
    end
        Quaternion (4,) and body rate (3,) [rad/s] to end in.
    """
    duration = (end_ns - begin_ns) * 1e-9
    times = np.linspace(0.0, duration, SAMPLES)
    stamps = begin_ns + np.round(times * 1e9).astype(np.int64)
    stamps[-1] = end_ns - 1  # what is flown till then, not what begins there
    flown = [timeline.at(int(stamp)) for stamp in stamps]
    assert all(each is not None for each in flown)  # it is streamed from the first time on
    q, v, a = (np.array([each[k] for each in flown if each is not None]) for k in (1, 2, 3))
    to_go = so3.quaternion_multiply(so3.quaternion_conjugate(q[-1]), end[0])
    xi = so3.quaternion_log(to_go)
    missing = end[1] - so3.exp(-xi) @ v[-1]
    xi_1 = np.linalg.solve(_right_jacobian(xi), missing)
    u = (times / duration)[:, None]
    place = xi * u**3 * (10 - 15 * u + 6 * u**2) + xi_1 * duration * u**3 * (-4 + 7 * u - 3 * u**2)
    speed = xi * u**2 * (30 - 60 * u + 30 * u**2) / duration
    speed = speed + xi_1 * u**2 * (-12 + 28 * u - 15 * u**2)
    gain = xi * u * (60 - 180 * u + 120 * u**2) / duration**2
    gain = gain + xi_1 * u * (-24 + 84 * u - 60 * u**2) / duration
    identity = np.array([0.0, 0.0, 0.0, 1.0])
    q_turn, v_turn, a_turn = follow_turns(identity, place, speed, gain)
    carried = np.einsum("nji,nj->ni", so3.exp(place), v)  # exp(xi)^T v
    carried_on = np.einsum("nji,nj->ni", so3.exp(place), a)
    return Trajectory(
        times,
        so3.quaternion_multiply(q, q_turn),
        carried + v_turn,
        carried_on - np.cross(v_turn, carried) + a_turn,
    )


def _right_jacobian(xi: Array) -> Array:
    """J_r(xi) (3, 3): the body rate of exp(hat(xi)) is J_r(xi) xi'."""
    angle = float(np.linalg.norm(xi))
    x, y, z = xi
    hat = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-4:
        first, second = 0.5, 1.0 / 6.0
    else:
        first = (1.0 - math.cos(angle)) / angle**2
        second = (angle - math.sin(angle)) / angle**3
    return np.asarray(np.eye(3) - first * hat + second * hat @ hat)


def takes(correction: float, gentle: float) -> float:
    """Time in which a correction [rad] is taken up at an acceleration [rad/s^2], about [s]."""
    return max(SHORTEST, math.sqrt(6.0 * correction / gentle))


def pursued(
    timeline: Timeline, start: Setpoint, until_ns: int, judge: Judge, settings: Settings
) -> recovery.Rescue | None:
    """A timeline that turns on from a state until a time [ns] and then stops, if certified.

    Where it is not, for half as long, or not at all.
    """
    longest = max((until_ns - start.stamp_ns) * 1e-9, 0.0)
    for share in (1.0, 0.5, 0.0):
        flown, end_ns = timeline, start.stamp_ns
        if share * longest > 0.0:
            track = Segment(start.stamp_ns, followed(start, share * longest), Purpose.TRACK)
            flown, end_ns = timeline.spliced(track), track.end_ns
        found = recovery.come_to_rest(flown, judge, settings, end_ns - 1)
        if found is not None:
            return found
    return None


def arrived(slew: Segment) -> Setpoint:
    """The state at the end of a slew, whatever follows."""
    q, v, a = slew.trajectory.evaluate_quaternion(slew.trajectory.duration)
    return Setpoint(slew.end_ns, slew.sign * q, v, a)


def silent_from(goal: Goal, arrival_ns: int, settings: Settings) -> int:
    """Until when a target is followed of which no more is heard [ns]."""
    return max(arrival_ns, goal.heard_ns) + round(settings.tracking_timeout * 1e9)


def correct(flight: Flight, goal: Goal, now_ns: int) -> bool:
    """Fly to where a target is told to be now, and follow it on; False if that is not certified.

    The time of arrival stays; what is corrected after it is taken up within a second or so.
    """
    settings, timeline, slew = flight.settings, flight.timeline, flight.slew
    assert slew is not None  # it is flown to the target
    judge = Judge(flight.world, settings, now_ns)
    begin_ns = now_ns + recovery.lead_ns(settings)
    until_ns = silent_from(goal, slew.end_ns, settings)
    cut_ns = max(begin_ns, slew.end_ns)
    gentle = recovery.gentle_acceleration(settings, None)
    here = timeline.at(cut_ns)
    assert here is not None  # it is streamed from now on
    before = arrived(slew) if cut_ns == slew.end_ns else here
    off = _off(goal, before, settings)
    if off < 1e-9:
        found = pursued(timeline, before, until_ns, judge, settings)
        return found is not None and flight.go_over(found, cut_ns - 1)
    ends = [begin_ns + round(1e9 * factor * takes(off, gentle)) for factor in (1.0, 2.0, 4.0)]
    if begin_ns + round(1e9 * SHORTEST) < slew.end_ns:
        ends = [slew.end_ns]
    for end_ns in ends:
        last = timeline.at(end_ns - 1)
        assert last is not None  # it is streamed from now on
        q, v = target_at(goal, end_ns, settings, last.quaternion)
        meets = end_ns == slew.end_ns
        way = bend(timeline, begin_ns, end_ns, (q, v))
        if not recovery.within_limits(way, settings):
            continue
        bent = Segment(begin_ns, way, Purpose.SLEW if meets else Purpose.TRACK)
        flown = timeline.spliced(bent)
        start = arrived(flown.last)
        found = pursued(flown, start, max(until_ns, end_ns), judge, settings)
        if found is not None:
            return flight.go_over(found, begin_ns, flown.last if meets else None)
    return False


def _off(goal: Goal, before: Setpoint, settings: Settings) -> float:
    """How far what is flown is from the target at a time: angle [rad] and rate [rad/s] added."""
    q, v = target_at(goal, before.stamp_ns, settings, before.quaternion)
    apart = float(so3.quaternion_distance(q, before.quaternion))
    return apart + float(np.linalg.norm(v - before.rate))
