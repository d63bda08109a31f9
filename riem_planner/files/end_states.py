# SPDX-License-Identifier: Apache-2.0
"""Start and goal of a problem file, and whether they are clear of its zones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from riem_planner.errors import InvalidProblemError
from riem_planner.files.attitudes import ATTITUDE_KEYS, read_attitude
from riem_planner.files.places import PLACE_KEYS, read_direction, read_place
from riem_planner.files.section import Section, joined, shown, within
from riem_planner.geometry import so3
from riem_planner.goals import AttitudeGoal, Goal, PointingGoal
from riem_planner.hold import contact
from riem_planner.obstacles import OrientationObstacle, Zone
from riem_planner.problem import S2, Problem, Space, State, horizontal_rate

_POINTING = ("boresight", "direction", "directions", "times")
_GOAL_KEYS = (*ATTITUDE_KEYS, "angular_velocity", "boresight", *PLACE_KEYS, "second", "any_of")


class StateInZoneError(InvalidProblemError):
    """The start or the goal of a problem is inside a zone, or the hold after it enters one."""


def read_goal(top: Section, space: Space, boresight: Any) -> Goal | tuple[Goal, ...]:
    """The goal of a problem; `any_of` gives several."""
    value = top.value("goal", expected="a goal")
    if space == S2:
        if isinstance(value, dict):
            for key in ("boresight", "any_of", "second", "rate"):
                if key in value:
                    raise InvalidProblemError(
                        f"goal.{key}", "needs space: so3; on s2 give a direction or an orientation"
                    )
        return read_state(top, "goal", space, boresight)
    default = boresight if "boresight" in top else None
    section = Section("goal", value, _GOAL_KEYS)
    if "any_of" not in section:
        return _goal("goal", value, default)
    others = [key for key in _GOAL_KEYS[:-1] if key in section]
    if others:
        raise InvalidProblemError(f"goal.{others[0]}", "given beside any_of; move it into one")
    goals = section.value("any_of")
    if not isinstance(goals, list):
        raise InvalidProblemError("goal.any_of", f"expected a list of goals, got {shown(goals)}")
    if not goals:
        raise InvalidProblemError("goal.any_of", "expected at least one goal")
    return tuple(_goal(f"goal.any_of[{i}]", goal, default) for i, goal in enumerate(goals))


def _goal(path: str, value: Any, boresight: Any) -> Goal:
    section = Section(path, value, _GOAL_KEYS[:-1])
    attitudes, pointing = section.given(*ATTITUDE_KEYS), section.given(*_POINTING)
    if attitudes and pointing:
        raise InvalidProblemError(
            path,
            "expected either an attitude or a boresight and its direction, got"
            f" {attitudes[0]} and {pointing[0]}; remove one",
        )
    if pointing:
        return _pointing_goal(section, boresight)
    if "second" in section:
        raise InvalidProblemError(section.key("second"), "needs a boresight and its direction")
    q = read_attitude(section)
    if "rate" not in section:
        rate = section.numbers("angular_velocity", 3, [0.0, 0.0, 0.0])
        return State.from_quaternion_xyzw(q, rate)
    if "angular_velocity" in section:
        raise InvalidProblemError(
            section.key("angular_velocity"),
            "given beside rate, which the goal is met with already; remove one",
        )
    return AttitudeGoal(so3.quaternion_to_matrix(q), section.numbers("rate", 3))


def _pointing_goal(section: Section, boresight: Any) -> PointingGoal:
    if "angular_velocity" in section:
        raise InvalidProblemError(
            section.key("angular_velocity"), "a direction moves with a rate; give that"
        )
    axis = boresight
    if axis is None or "boresight" in section:
        axis = read_direction(section, "boresight")
    second = None
    if "second" in section:
        other = Section(section.key("second"), section.value("second"), ("boresight", *PLACE_KEYS))
        second = read_direction(other, "boresight"), read_place(other)
    place = read_place(section)
    with within(section.path):
        return PointingGoal(axis, place, second)


def read_state(top: Section, name: str, space: Space, boresight: Any) -> State:
    """An attitude, on S^2 also a direction, with its rate."""
    keys = [*ATTITUDE_KEYS, "angular_velocity"]
    if space == S2:
        keys += ["direction", "velocity"]
    section = Section(name, top.value(name, expected="an end state"), keys)
    if space == S2:
        attitude = bool(section.given(*ATTITUDE_KEYS))
        if attitude == ("direction" in section):
            raise InvalidProblemError(
                name,
                "expected either direction or orientation on s2, got "
                + ("both; remove one" if attitude else "neither; give one"),
            )
    if "direction" in section:
        return _state_of_direction(section, boresight)
    quaternion = read_attitude(section)
    rate = section.numbers("angular_velocity", 3, [0.0, 0.0, 0.0])
    with within(name):
        state = State.from_quaternion_xyzw(quaternion, rate)
    if "velocity" not in section:
        return state
    if "angular_velocity" in section:
        raise InvalidProblemError(
            section.key("velocity"),
            "given beside angular_velocity, which says the same; remove one",
        )
    velocity = np.array(section.numbers("velocity", 3))
    R = state.orientation
    with within(name):
        return State(R, horizontal_rate(R, R @ boresight, velocity, boresight))


def _state_of_direction(section: Section, boresight: Any) -> State:
    if "angular_velocity" in section:
        raise InvalidProblemError(
            section.key("angular_velocity"),
            "a direction moves with a velocity [rad/s], tangent to the sphere; give that",
        )
    direction = read_direction(section, "direction")
    velocity = section.numbers("velocity", 3, [0.0, 0.0, 0.0])
    with within(section.path):
        return State.from_direction(direction, velocity, boresight)


def check_end_states(problem: Problem, top: Section) -> None:
    """Refuse a start or a goal inside a zone, and a hold that enters one.

    A goal's zones stand where they are at the arrival: where anything moves, that is not known
    before an automatic duration is.
    """
    for name, margin in problem.margins(problem.start.orientation, 0.0).items():
        if margin <= 0.0:
            raise _in_zone(problem, "start", top.value("start"), name, margin)
    if problem.has_auto_duration:
        if problem.forbidden.moving or any(goal.moves for goal in problem.goals):
            return
        problem = problem.timed(1.0, problem.limits)  # any will do where nothing moves
    refused = []
    several = isinstance(problem.goal, tuple)
    for i in range(len(problem.goals)):
        found = contact(problem.with_goal(i))
        if found is None:
            return
        key = f"goal.any_of[{i}]" if several else "goal"
        value = top.value("goal")["any_of"][i] if several else top.value("goal")
        if found.at_any_roll or found.time > problem.duration:
            text = f"{found.sentence(problem.duration)}; choose another goal, or a smaller zone"
            refused.append(StateInZoneError(key, text))
        else:
            refused.append(_in_zone(problem, key, value, found.name, -found.depth))
    if several:
        raise StateInZoneError("goal.any_of", "; ".join(map(str, refused)))
    raise refused[0]


def _in_zone(problem: Problem, key: str, stated: Any, name: str, margin: float) -> StateInZoneError:
    given = next(name for name in ("direction", "directions", *ATTITUDE_KEYS) if name in stated)
    value = shown(stated[given])
    degrees = math.degrees(-margin)
    names = {str(obstacle.name): obstacle for obstacle in problem.obstacles}
    obstacle = names.get(name)
    if isinstance(obstacle, Zone) and obstacle.kind == "keep_out":
        where = f"is {degrees:.4g} degrees inside the keep_out zone {name!r}"
        remedy = "move it out, or make the zone smaller"
    elif isinstance(obstacle, OrientationObstacle):
        where = f"is {degrees:.4g} degrees inside the radius of the obstacle {name!r}"
        remedy = "move it out, or make the radius smaller"
    else:
        what = "the keep_in zone" if obstacle is not None else "every zone of the keep_in group"
        where = f"is {degrees:.4g} degrees outside {what} {name!r}"
        remedy = "move it in, or make the zone larger"
    return StateInZoneError(joined(key, given), f"{value} {where}; {remedy}")
