# SPDX-License-Identifier: Apache-2.0
"""The certificate of what follows the arrival: a hold is kept clear like the slew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from riem_planner.certificate.clearance import Clearance, certify_clearance
from riem_planner.certificate.tolerances import (
    DURATION_TOLERANCE,
    HOLD_TOLERANCE,
)
from riem_planner.geometry import so3
from riem_planner.hold import hold_samples, hold_trajectory, later
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory


def with_hold(
    cleared: Clearance,
    trajectory: Trajectory,
    problem: Problem,
    hold: Trajectory | None = None,
) -> Clearance:
    """The clearance of a slew and of the hold after it, the lesser of both by name.

    Parameters
    ----------
    cleared
        Of the slew.
    trajectory
        The slew.
    problem
        Of which the goal that is nearest to the slew's end is held.
    hold
        What follows the slew; by default the hold itself.
    """
    if problem.hold == 0.0:
        return cleared
    end = so3.quaternion_to_matrix(trajectory.quaternions_xyzw[-1])
    problem = problem.with_goal(problem.goal_near(end))
    missed: tuple[str, ...] = ()
    if hold is None:
        held = hold_trajectory(problem, trajectory)
        assert held is not None  # the problem has a hold
    else:
        held, missed = hold, _missed(problem, trajectory, hold)
    after = certify_clearance(held, later(problem.forbidden, trajectory.duration))
    clearance, worst = dict(cleared.clearance), dict(cleared.least_clearance_times)
    for name, margin in after.clearance.items():
        if margin < clearance[name]:
            clearance[name], worst[name] = (
                margin,
                trajectory.duration + after.least_clearance_times[name],
            )
    told = tuple(f"after the arrival, {reason} of the hold" for reason in after.reasons)
    return replace(
        cleared,
        clearance=clearance,
        least_clearance_times=worst,
        reasons=cleared.reasons + missed + told,
    )


def _missed(problem: Problem, trajectory: Trajectory, hold: Trajectory) -> tuple[str, ...]:
    """Sentences for how a hold is not the one that the problem asks for."""
    reasons = []
    if not abs(hold.duration - problem.hold) <= DURATION_TOLERANCE * problem.hold:
        return (f"hold: expected {problem.hold:.9g} s, got {hold.duration:.9g} s",)
    gap = so3.quaternion_distance(hold.quaternions_xyzw[0], trajectory.quaternions_xyzw[-1])
    step = np.abs(hold.angular_velocities[0] - trajectory.angular_velocities[-1]).max()
    if not (gap <= HOLD_TOLERANCE and step <= HOLD_TOLERANCE):
        reasons.append(f"hold: begins {gap:.3g} rad and {step:.3g} rad/s off the slew's end")
    middles = 0.5 * (hold.times[1:] + hold.times[:-1])
    since = np.insert(hold.times, np.arange(1, hold.times.size), middles)
    wanted = hold_samples(problem, trajectory, since)
    q, v, _ = hold.evaluate_quaternion(np.minimum(since, hold.duration))
    astray = float(np.max(so3.quaternion_distance(q, wanted.quaternions_xyzw)))
    rate = float(np.max(np.abs(v - wanted.angular_velocities)))
    if not (astray <= HOLD_TOLERANCE and rate <= HOLD_TOLERANCE):
        reasons.append(f"hold: leaves the goal by {astray:.3g} rad, its rate by {rate:.3g} rad/s")
    return tuple(reasons)
