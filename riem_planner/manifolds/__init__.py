# SPDX-License-Identifier: Apache-2.0
"""The general theory: extremals and boundary-value problems on spaces given by matrices."""

from riem_planner.manifolds.extremal import GeneralExtremal, general_extremal
from riem_planner.manifolds.potentials import OwnPotential, Plateau
from riem_planner.manifolds.problem import GeneralProblem, GeneralState, PointObstacle, Waypoint
from riem_planner.manifolds.solution import GeneralSolution, GeneralTrajectory
from riem_planner.manifolds.solver import solve_general

__all__ = [
    "GeneralExtremal",
    "GeneralProblem",
    "GeneralSolution",
    "GeneralState",
    "GeneralTrajectory",
    "OwnPotential",
    "Plateau",
    "PointObstacle",
    "Waypoint",
    "general_extremal",
    "solve_general",
]
