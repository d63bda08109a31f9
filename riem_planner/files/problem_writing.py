"""A `Problem` to the document that states it: the inverse of `problem_files`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from riem_planner.limits import QUANTITIES, Limits
from riem_planner.obstacles import Obstacle, OrientationObstacle
from riem_planner.problem import AUTO, Problem, State


def problem_document(problem: Problem) -> dict[str, Any]:
    """Document that states a problem, of plain values; `parse_problem` reads it back."""
    document: dict[str, Any] = {"name": problem.name} if problem.name else {}
    document["space"] = problem.space.name
    document["boresight"] = problem.boresight.tolist()
    document["duration"] = AUTO if problem.has_auto_duration else problem.duration
    if problem.normalized_tension is not None:
        document["normalized_tension"] = problem.normalized_tension
    else:
        document["tension"] = problem.sigma
    for key, state in (("start", problem.start), ("goal", problem.arrival)):
        document[key] = {
            "orientation": state.quaternion_xyzw.tolist(),
            "angular_velocity": state.angular_velocity.tolist(),
        }
    document["obstacles"] = [_obstacle_document(obstacle) for obstacle in problem.obstacles]
    if problem.limits is not None:
        document.update(_limits_document(problem.limits))
    if np.any(problem.total_momentum):
        document["total_momentum"] = problem.total_momentum.tolist()
    return document


def _limits_document(limits: Limits) -> dict[str, Any]:
    bounds = {name: getattr(limits, name) for name in QUANTITIES}
    document: dict[str, Any] = {
        "limits": {k: np.asarray(v).tolist() for k, v in bounds.items() if v is not None}
    }
    if limits.wheels:
        document["limits"]["wheels"] = [
            {"axis": np.asarray(w.axis).tolist(), "torque": w.torque, "momentum": w.momentum}
            for w in limits.wheels
        ]
    if limits.inertia is not None:
        document["inertia"] = np.asarray(limits.inertia).ravel().tolist()
    return document


def _obstacle_document(obstacle: Obstacle) -> dict[str, Any]:
    document: dict[str, Any] = {"name": obstacle.name, "kind": obstacle.kind}
    if isinstance(obstacle, OrientationObstacle):
        document["orientation"] = State(obstacle.orientation).quaternion_xyzw.tolist()
        document["radius_deg"] = math.degrees(obstacle.radius)
    else:
        document["direction"] = obstacle.direction.tolist()
        document["boresight"] = np.asarray(obstacle.boresight).tolist()
        document["half_angle_deg"] = math.degrees(obstacle.half_angle)
        if obstacle.group is not None:
            document["group"] = obstacle.group
    if obstacle.normalized_strength is not None:
        document["normalized_strength"] = obstacle.normalized_strength
    else:
        document["strength"] = obstacle.strength
    if np.any(obstacle.rate):
        document["rate"] = obstacle.rate.tolist()
    if obstacle.range is not None:
        document["range_deg"] = [math.degrees(angle) for angle in obstacle.range]
    return document
