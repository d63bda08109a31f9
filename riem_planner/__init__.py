"""Certified attitude trajectories that keep away from obstacles on SO(3) and S^2."""

from riem_planner.certificate import Certificate, certify
from riem_planner.errors import InvalidProblemError, PlanningError, RiemPlannerError
from riem_planner.extremals import extremal
from riem_planner.limits import Limits, Wheel
from riem_planner.obstacles import OrientationObstacle, Zone
from riem_planner.problem import S2, SO3, Problem, Space, State
from riem_planner.solution import Alternative, Solution, Status
from riem_planner.solve import plan, solve, solve_many, warm_up
from riem_planner.trajectory import Trajectory

__version__ = "0.1.0"

__all__ = [
    "S2",
    "SO3",
    "Alternative",
    "Certificate",
    "InvalidProblemError",
    "Limits",
    "OrientationObstacle",
    "PlanningError",
    "Problem",
    "RiemPlannerError",
    "Solution",
    "Space",
    "State",
    "Status",
    "Trajectory",
    "Wheel",
    "Zone",
    "certify",
    "extremal",
    "plan",
    "solve",
    "solve_many",
    "warm_up",
]
