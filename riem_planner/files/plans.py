# SPDX-License-Identifier: Apache-2.0
"""What a plan file holds, as a value."""

from __future__ import annotations

from dataclasses import dataclass, replace

from riem_planner.certificate import Certificate
from riem_planner.problem import LEAST_TIME, Problem
from riem_planner.solution import Solution
from riem_planner.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Plan:
    """What a plan file holds.

    Parameters
    ----------
    problem
        What was solved, with the duration that was found where it asked for the least.
    solution
        Outcome of the solve; its status is NO_CERTIFIED_TRAJECTORY if the samples are refused.
    trajectory
        The evenly sampled trajectory; None unless certified.
    certificate
        The verdict on that trajectory itself; None where there is none to judge.
    hold
        What follows the trajectory, where the problem asks for a hold.
    stated
        The problem as it was stated, where that is another: of least time.
    """

    problem: Problem
    solution: Solution
    trajectory: Trajectory | None = None
    certificate: Certificate | None = None
    hold: Trajectory | None = None
    stated: Problem | None = None

    @property
    def certified(self) -> bool:
        """Whether it holds a certified trajectory."""
        return self.trajectory is not None


def with_duration_of(problem: Problem, trajectory: Trajectory) -> Problem:
    """The problem with a trajectory's duration, where it asks for the least."""
    if not problem.has_auto_duration or problem.objective == LEAST_TIME:
        return problem
    return replace(problem, duration=trajectory.duration)
