# SPDX-License-Identifier: Apache-2.0
"""Certified attitude trajectories that keep away from obstacles on SO(3) and S^2."""

from typing import TYPE_CHECKING, Any

from riem_planner.certificate import Certificate, certify
from riem_planner.cost import trajectory_cost
from riem_planner.errors import InvalidProblemError, RiemPlannerError
from riem_planner.extremals import extremal
from riem_planner.geometry.paths import Path, Turning
from riem_planner.goals import AttitudeGoal, PointingGoal
from riem_planner.limits import Limits, Wheel
from riem_planner.obstacles import OrientationObstacle, Zone
from riem_planner.problem import S2, SO3, Problem, Space, State
from riem_planner.solution import Alternative, PlanningError, Solution, Status
from riem_planner.solve import plan, solve, solve_many, warm_up
from riem_planner.solver.watch import StopFlag
from riem_planner.trajectory import Trajectory
from riem_planner.version import __version__

if TYPE_CHECKING:
    from riem_planner.files.problem_files import read_problem as load_problem
    from riem_planner.plots.plots import plot_plan as plot

__all__ = [
    "S2",
    "SO3",
    "Alternative",
    "AttitudeGoal",
    "Certificate",
    "InvalidProblemError",
    "Limits",
    "OrientationObstacle",
    "Path",
    "PlanningError",
    "PointingGoal",
    "Problem",
    "RiemPlannerError",
    "Solution",
    "Space",
    "State",
    "Status",
    "StopFlag",
    "Trajectory",
    "Turning",
    "Wheel",
    "Zone",
    "__version__",
    "certify",
    "extremal",
    "load_problem",
    "plan",
    "plot",
    "solve",
    "solve_many",
    "trajectory_cost",
    "warm_up",
]

# What reads files and draws takes time to import, which only those pay who ask for it.
_LATER = {
    "load_problem": ("riem_planner.files.problem_files", "read_problem"),
    "plot": ("riem_planner.plots.plots", "plot_plan"),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for late."""
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    module, attribute = _LATER[name]
    return getattr(import_module(module), attribute)
