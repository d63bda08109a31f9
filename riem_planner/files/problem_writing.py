# SPDX-License-Identifier: Apache-2.0
"""A `Problem` to the document that states it: the inverse of `problem_files`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path, Turning
from riem_planner.goals import AttitudeGoal, Goal
from riem_planner.limit_rows import QUANTITIES
from riem_planner.limits import Limits
from riem_planner.obstacles import Obstacle, OrientationObstacle
from riem_planner.problem import AUTO, LEAST_ACCELERATION, Problem, State


def problem_document(problem: Problem) -> dict[str, Any]:
    """Document that states a problem, of plain values; `parse_problem` reads it back."""
    document: dict[str, Any] = {"name": problem.name} if problem.name else {}
    document["space"] = problem.space.name
    if problem.objective != LEAST_ACCELERATION:
        document["objective"] = problem.objective
    document["boresight"] = problem.boresight.tolist()
    document["duration"] = AUTO if problem.has_auto_duration else problem.duration
    if problem.normalized_tension is not None:
        document["normalized_tension"] = problem.normalized_tension
    else:
        document["tension"] = problem.sigma
    document["start"] = _state_document(problem.start)
    goals = [_goal_document(goal) for goal in problem.goals]
    document["goal"] = {"any_of": goals} if isinstance(problem.goal, tuple) else goals[0]
    if problem.hold > 0.0:
        document["hold"] = problem.hold
    if problem.notes:
        document["notes"] = list(problem.notes)
    document["obstacles"] = [_obstacle_document(obstacle) for obstacle in problem.obstacles]
    if problem.limits is not None:
        document.update(_limits_document(problem.limits))
    if np.any(problem.total_momentum):
        document["total_momentum"] = problem.total_momentum.tolist()
    return document


def _state_document(state: State) -> dict[str, Any]:
    return {
        "orientation": state.quaternion_xyzw.tolist(),
        "angular_velocity": state.angular_velocity.tolist(),
    }


def _goal_document(goal: Goal) -> dict[str, Any]:
    if isinstance(goal, State):
        return _state_document(goal)
    if isinstance(goal, AttitudeGoal):
        q = so3.matrix_to_quaternion(goal.orientation)
        return {"orientation": q.tolist(), "rate": goal.rate.tolist()}
    document = {"boresight": goal.boresight.tolist(), **_place_document(goal.direction)}
    if goal.second is not None:
        boresight, direction = goal.second
        document["second"] = {"boresight": boresight.tolist(), **_place_document(direction)}
    return document


def _place_document(place: Turning | Path) -> dict[str, Any]:
    if isinstance(place, Path):
        return {"times": place.times.tolist(), "directions": place.directions.tolist()}
    document = {"direction": place.direction.tolist()}
    if np.any(place.rate):
        document["rate"] = place.rate.tolist()
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
        document.update(_place_document(obstacle.place))
        document["boresight"] = np.asarray(obstacle.boresight).tolist()
        key = "half_angles_deg" if np.ndim(obstacle.half_angle) else "half_angle_deg"
        document[key] = np.degrees(obstacle.half_angle).tolist()
        stated = {"group": obstacle.group, "member": obstacle.member}
        document.update({key: name for key, name in stated.items() if name is not None})
        if obstacle.active:
            document["active"] = [list(window) for window in obstacle.active]
    if obstacle.normalized_strength is not None:
        document["normalized_strength"] = obstacle.normalized_strength
    else:
        document["strength"] = obstacle.strength
    if isinstance(obstacle, OrientationObstacle) and np.any(obstacle.rate):
        document["rate"] = obstacle.rate.tolist()
    if obstacle.range is not None:
        document["range_deg"] = [math.degrees(angle) for angle in obstacle.range]
    return document
