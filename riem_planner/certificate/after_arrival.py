"""The certificate of what follows the arrival: a hold is kept clear like the slew."""

from __future__ import annotations

from dataclasses import replace

from riem_planner.certificate.clearance import Clearance, certify_clearance
from riem_planner.geometry import so3
from riem_planner.hold import hold_trajectory, later
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
    held = hold_trajectory(problem, trajectory) if hold is None else hold
    assert held is not None  # the problem has a hold
    after = certify_clearance(held, later(problem.forbidden, trajectory.duration))
    clearance, worst = dict(cleared.clearance), dict(cleared.worst)
    for name, margin in after.clearance.items():
        if margin < clearance[name]:
            clearance[name], worst[name] = margin, trajectory.duration + after.worst[name]
    told = tuple(f"after the arrival, {reason} of the hold" for reason in after.reasons)
    return replace(cleared, clearance=clearance, worst=worst, reasons=cleared.reasons + told)
