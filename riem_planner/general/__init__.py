"""The general theory: extremals and boundary-value problems on spaces given by matrices."""

from riem_planner.general.extremal import GeneralExtremal, general_extremal
from riem_planner.general.problem import GeneralProblem, GeneralState, PointObstacle
from riem_planner.general.solution import GeneralSolution, GeneralTrajectory
from riem_planner.general.solver import solve_general

__all__ = [
    "GeneralExtremal",
    "GeneralProblem",
    "GeneralSolution",
    "GeneralState",
    "GeneralTrajectory",
    "PointObstacle",
    "general_extremal",
    "solve_general",
]
