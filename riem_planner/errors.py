"""The errors of the package, one class per cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from riem_planner.solution import Solution


class RiemPlannerError(Exception):
    """Root of every error that the package raises on purpose."""


class InvalidProblemError(RiemPlannerError, ValueError):
    """A value of a problem is wrong; the message says what was expected, what came, what to do.

    Parameters
    ----------
    key
        Name of the offending value, as in a problem file (`start.orientation`).
    problem
        What is wrong with it and what to do.
    """

    def __init__(self, key: str, problem: str) -> None:
        self.key = key
        self.problem = problem
        super().__init__(f"{key}: {problem}")


class PlanningError(RiemPlannerError):
    """No certified trajectory was found; carries the whole solution as evidence."""

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        super().__init__(solution.message)
