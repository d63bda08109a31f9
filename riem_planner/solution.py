# SPDX-License-Identifier: Apache-2.0
"""What a solve returns: a value with a status that gives advice, never an exception."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from riem_planner.certificate import Certificate
from riem_planner.errors import RiemPlannerError
from riem_planner.trajectory import Trajectory


class Status(Enum):
    """Outcome of a solve; the value is what to do about it."""

    SOLVED = "the trajectory is certified"
    START_IN_ZONE = "move the start out of the zone, or make the zone smaller"
    GOAL_IN_ZONE = "choose another goal, or make the zone smaller"
    NO_CERTIFIED_TRAJECTORY = "make a zone smaller, or choose another goal"
    LIMITS_EXCEEDED = "give the slew more time, or raise the limit that binds"
    OUT_OF_TIME = "raise the deadline, or plan with fewer obstacles"
    CANCELLED = "the request was withdrawn"

    @property
    def advice(self) -> str:
        """What to do about this outcome."""
        return self.value


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another certified extremal, costlier than the one chosen.

    Parameters
    ----------
    cost
        Its cost (of a problem of least time its duration), in the units of `Solution.cost`.
    clearance
        Certified lower bound of the distance to each forbidden set [rad].
    trajectory
        The trajectory itself.
    """

    cost: float
    clearance: dict[str, float]
    trajectory: Trajectory


@dataclass(frozen=True, eq=False)
class Solution:
    """Outcome of `solve`.

    Parameters
    ----------
    status
        What happened; `status.advice` says what to do about it.
    message
        The same in a sentence, with names and numbers.
    trajectory
        The cheapest certified trajectory; None unless the status is SOLVED.
    certificate
        The checker's verdict on it, or on the best trajectory that was refused.
    cost
        `1/2 int (|a|^2 + sigma |v|^2 + sum V_i) dt` of the problem as stated [rad^2/s^3]; of a
        problem of least time the duration [s].
    trajectory_error, cost_error
        Estimated distance to the exact extremal [rad], and relative error of the cost. The former
        is infinite where many ways cost nearly the same and the cheapest was not determined.
    local_minimum
        Whether the second variation is positive definite, so not where the trajectory is one of a
        family of equal cost; None where it was not computed.
    converged
        Whether both error estimates are within the requested tolerance.
    alternatives
        Other certified extremals, cheapest first.
    classes_tried
        Curves that the search descended from, one for each class of paths worth a try.
    least_cost
        The least cost of these classes without obstacles, in the units of `cost`: a cheaper path
        of them saves at most what is above it. NaN where it was not looked for.
    iterations
        Newton iterations of both stages, over all classes that were tried.
    solve_time
        Duration of the solve by a steady clock [s].
    hold
        How the attitude goes on after the arrival, its time counted from there; None where the
        problem asks for no hold.
    goal_index
        Which of several goals was reached, from 0; None where the problem has one.
    notes
        Remarks a user should read: use of the potential beyond its convex neighbourhood, a
        tolerance that was not reached.
    wall
        Of a refusal, where one is known: names of zones that close the goal off from the start,
        each overlapping the next and the last one the first, which proves that no path exists.
    level
        Of a problem of least time: `free path`, `retimed path` or `least_acceleration`.
    least_possible_duration
        Of a problem of least time: no path within the limits needs less [s].
    """

    status: Status
    message: str
    trajectory: Trajectory | None = None
    certificate: Certificate | None = None
    cost: float = float("nan")
    trajectory_error: float = float("nan")
    cost_error: float = float("nan")
    local_minimum: bool | None = None
    converged: bool = False
    alternatives: tuple[Alternative, ...] = ()
    classes_tried: int = 0
    least_cost: float = float("nan")
    iterations: int = 0
    solve_time: float = 0.0
    hold: Trajectory | None = None
    goal_index: int | None = None
    notes: tuple[str, ...] = field(default=())
    wall: tuple[str, ...] = ()
    level: str = ""
    least_possible_duration: float | None = None

    @property
    def solved(self) -> bool:
        """Whether there is a certified trajectory."""
        return self.status is Status.SOLVED


class PlanningError(RiemPlannerError):
    """No certified trajectory was found; carries the whole solution as evidence."""

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        super().__init__(solution.message)
