# SPDX-License-Identifier: Apache-2.0
"""Stop, then slew: a class of its own, for starts so fast that every curved path meets a zone.

The rate dies along its own axis at a constant deceleration, ramped off over the last tenth; from
there a slew from rest goes to the goal.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from riem_planner.certificate import certify, certify_limits
from riem_planner.cost import trajectory_cost
from riem_planner.goals import State
from riem_planner.limits import Limits
from riem_planner.problem import Problem
from riem_planner.solution import Solution, Status
from riem_planner.stop import trajectory_of_turns
from riem_planner.trajectory import Trajectory

_RAMP = 0.1  # of a stop, over which its deceleration dies away
_SAMPLES = 40  # of a stop
_USED = 0.98  # of the limits, by the stop
_PAUSE = 0.01  # of the whole, at rest between both, over which the slew's acceleration sets in
_HALVINGS = 40
_GENTLEST, _HARDEST = 1e-9, 1e6  # rad/s^2 of deceleration
NOTE = (
    "a stop, then a slew from rest: certified, but no extremal, and its duration is the least of"
    " the slews and stops tried"
)


def applies(problem: Problem) -> bool:
    """Whether a stop before the slew is a path of its own.

    Not where zones, the goal or the total momentum move in the meantime, nor where jerk is limited.
    """
    limits = problem.limits
    assert limits is not None  # an automatic duration has them
    return bool(
        np.any(problem.start.angular_velocity)
        and not problem.forbidden.moving
        and not problem.goals[0].moves
        and not np.any(problem.total_momentum)
        and problem.hold == 0.0
        and not {"jerk", "torque_rate"} & set(limits.keys)
    )


def stop_then_slew(problem: Problem, stop: Trajectory, slew: Trajectory) -> Solution | None:
    """The answer that flies a stop and a slew from where it ends; None if it is not certified.

    Parameters
    ----------
    problem
        With a duration to be found.
    stop, slew
        From the start to rest, and from there to the goal.
    """
    trajectory = joined(stop, slew)
    timed = replace(problem, duration=trajectory.duration)
    certificate = certify(trajectory, timed)
    if not certificate.certified:
        return None
    return Solution(
        Status.SOLVED,
        f"solved and certified; {NOTE}",
        trajectory=trajectory,
        certificate=certificate,
        cost=trajectory_cost(trajectory, timed),
        trajectory_error=math.inf,
        cost_error=math.inf,
        notes=(NOTE,),
    )


def hardest_stop(problem: Problem, limits: Limits) -> Trajectory | None:
    """The quickest stop along the start's rate within limits; None if there is none."""
    low, high = math.log(_GENTLEST), math.log(_HARDEST)
    best = None
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        stop = _stop(problem.start, math.exp(middle))
        parts = certify_limits(stop, limits).parts
        broken = any(
            part > (1.0 if key in ("rate", "momentum") else _USED) for key, part in parts.items()
        )
        if broken:
            high = middle
        else:
            low, best = middle, stop
    return best


def _stop(start: State, deceleration: float) -> Trajectory:
    speed = float(np.linalg.norm(start.angular_velocity))
    axis = np.asarray(start.angular_velocity) / speed
    T = speed / ((1.0 - 0.5 * _RAMP) * deceleration)
    begin = (1.0 - _RAMP) * T
    times = np.unique(np.concatenate([np.linspace(0.0, T, _SAMPLES), [begin]]))
    late = np.maximum(times - begin, 0.0)
    ramp = late / (_RAMP * T)
    # The part of the deceleration that is ramped off, and its two integrals.
    a = -deceleration * (1.0 - ramp)
    v = speed - deceleration * (times - 0.5 * ramp * late)
    angle = speed * times - deceleration * (0.5 * times**2 - ramp * late**2 / 6.0)
    v[-1] = a[-1] = 0.0
    turns = (np.outer(angle, axis), np.outer(v, axis), np.outer(a, axis))
    return trajectory_of_turns(start.quaternion_xyzw, times, turns)


def joined(stop: Trajectory, slew: Trajectory) -> Trajectory:
    """Both as one trajectory, with a pause between them in which accelerations change."""
    pause = _PAUSE * (stop.duration + slew.duration)
    times = np.concatenate([stop.times, stop.duration + pause + slew.times])
    q = slew.quaternions_xyzw
    if q[0] @ stop.quaternions_xyzw[-1] < 0.0:
        q = -q
    return Trajectory(
        times,
        np.concatenate([stop.quaternions_xyzw, q]),
        np.concatenate([stop.angular_velocities, slew.angular_velocities]),
        np.concatenate([stop.angular_accelerations, slew.angular_accelerations]),
    )
