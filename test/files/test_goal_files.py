# SPDX-License-Identifier: Apache-2.0
"""Goals and holds in problem and plan files."""

import json
import math

import numpy as np
import pytest

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import parse_json
from riem_planner.files.end_states import StateInZoneError
from riem_planner.files.plan_files import check_plan, encoded, parsed_plan, plan_document
from riem_planner.files.problem_files import parse_problem
from riem_planner.files.problem_writing import problem_document
from riem_planner.goals import AttitudeGoal, PointingGoal
from riem_planner.riem_plan.planning import plan_problem

X, Y, Z = [1, 0, 0], [0, 1, 0], [0, 0, 1]
TURN = [0, 0, 0.6, 0.8]
TIMES = [0, 20, 40, 60]
PATH = [[1, 0, 0], [1, 0.1, 0], [1, 0.2, 0], [1, 0.3, 0.1]]
GOALS = {
    "attitude": {"orientation": TURN, "angular_velocity": [0, 0, 0.01]},
    "turning attitude": {"mrp": [0, 0, 0.2], "rate": [0, 0, 0.01]},
    "direction": {"boresight": Z, "direction": [0, 2, 0]},
    "turning direction": {"boresight": Z, "direction": Y, "rate": [0.01, 0, 0]},
    "path": {"boresight": Z, "directions": PATH, "times": TIMES},
    "two axes": {"boresight": Z, "direction": Y, "second": {"boresight": X, "direction": X}},
    "list": {"any_of": [{"orientation": TURN}, {"boresight": Z, "direction": Y}]},
}


def document(goal, **more):
    start = {"orientation": [0, 0, 0, 1]}
    return {"space": "so3", "duration": 40, "start": start, "goal": goal} | more


@pytest.mark.parametrize("name", GOALS)
def test_goal_survives_a_round_trip(name):
    first = parse_problem(document(GOALS[name]))
    second = parse_problem(json.loads(json.dumps(problem_document(first))))
    for one, other in zip(first.goals, second.goals, strict=True):
        for time in (0.0, 40.0):
            a, b = one.arrival(time), other.arrival(time)
            np.testing.assert_allclose(a.orientation, b.orientation, atol=1e-14)
            np.testing.assert_allclose(a.angular_velocity, b.angular_velocity, atol=1e-14)
        assert type(one) is type(other)


def test_goal_means_what_it_says():
    assert isinstance(parse_problem(document(GOALS["turning attitude"])).goal, AttitudeGoal)
    goal = parse_problem(document(GOALS["two axes"])).goal
    assert isinstance(goal, PointingGoal)
    R = goal.arrival(0.0).orientation
    np.testing.assert_allclose(R @ Z, Y, atol=1e-15)
    np.testing.assert_allclose(R @ X, X, atol=1e-15)
    # The problem's own boresight is that of a goal that names none.
    named = parse_problem(document({"direction": Y}, boresight=[0, 0, 3])).goal
    np.testing.assert_array_equal(named.boresight, Z)
    assert parse_problem(document(GOALS["direction"], hold=5)).hold == 5.0


@pytest.mark.parametrize("name", ["turning direction", "path", "two axes", "list"])
def test_plan_with_a_hold_is_judged_from_its_file(name):
    problem = parse_problem(document(GOALS[name], hold=20))
    plan = plan_problem(problem)
    text = encoded(plan_document(plan))
    written = parsed_plan(text)
    hold = written["hold"]
    assert hold["times"][0] == written["times"][-1] == 40.0
    assert hold["times"][-1] == 60.0
    assert hold["orientations_xyzw"][0] == written["orientations_xyzw"][-1]
    assert written.get("goal_index") == (0 if name == "list" else None)
    stated = parse_problem(written["problem"])
    certificate, claims = check_plan(written, stated)
    assert certificate.certified, certificate.reasons
    assert not claims
    # Another hold is refused, and none at all.
    spoiled = parse_json(text)
    tilted = np.array(hold["orientations_xyzw"])
    tilted[-1] += [1e-4, 0, 0, 0]
    tilted /= np.linalg.norm(tilted, axis=1)[:, None]
    spoiled["hold"]["orientations_xyzw"] = tilted.tolist()
    certificate, _ = check_plan(spoiled, stated)
    assert any("leaves the goal" in reason for reason in certificate.reasons)
    del spoiled["hold"]
    with pytest.raises(InvalidProblemError, match="hold: missing"):
        check_plan(spoiled, stated)


WRONG = {
    "empty list": ({"any_of": []}, "goal.any_of", "expected at least one goal"),
    "wrong in a list": (
        {"any_of": [{"orientation": TURN}, {"orientation": [0, 0, 0, 2]}]},
        "goal.any_of[1].orientation", "norm 2",
    ),
    "list and more": ({"any_of": [{"orientation": TURN}], "rate": X}, "goal.rate", "any_of"),
    "no list": ({"any_of": 3}, "goal.any_of", "list of goals"),
    "parallel directions": (
        {"boresight": Z, "direction": Y, "second": {"boresight": X, "direction": [0, -2, 0]}},
        "goal.second.direction", "parallel to goal.direction: the roll is not determined",
    ),
    "parallel axes": (
        {"boresight": Z, "direction": Y, "second": {"boresight": [0, 0, -1], "direction": X}},
        "goal.second.boresight", "parallel to goal.boresight",
    ),
    "attitude and direction": (
        {"orientation": TURN, "direction": Y}, "goal", "orientation and direction",
    ),
    "no boresight": ({"direction": Y}, "goal.boresight", "missing"),
    "no direction": ({"boresight": Z}, "goal.direction", "exactly one of direction, directions"),
    "two places": (
        {"boresight": Z, "direction": Y, "directions": PATH, "times": TIMES}, "goal.direction",
        "both",
    ),
    "path too short": (
        {"boresight": Z, "directions": PATH, "times": [0, 10, 20, 30]}, "goal.times",
        "end at 30 s, before the arrival and hold at 50 s",
    ),
    "path of three": (
        {"boresight": Z, "directions": PATH[:3], "times": TIMES[:3]}, "goal.times", "at least 4",
    ),
    "times that fall": (
        {"boresight": Z, "directions": PATH, "times": [0, 30, 20, 60]}, "goal.times[2]", "increas",
    ),
    "rate of an attitude twice": (
        {"orientation": TURN, "rate": X, "angular_velocity": X}, "goal.angular_velocity", "rate",
    ),
    "two attitudes": (
        {"orientation": TURN, "mrp": X}, "goal", "exactly one of orientation",
    ),
    "unknown key": ({"primary": {}}, "goal.primary", "unknown key"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_goal_is_named_with_its_key(case):
    goal, key, words = WRONG[case]
    with pytest.raises(InvalidProblemError) as caught:
        parse_problem(document(goal, hold=10))
    assert caught.value.key == key
    assert words in str(caught.value)


def test_direction_goal_on_s2_needs_no_boresight_of_its_own():
    s2 = {"space": "s2", "duration": 4, "start": {"direction": X}, "goal": {"direction": Y}}
    assert parse_problem(s2).goal.orientation.shape == (3, 3)
    with pytest.raises(InvalidProblemError, match=r"goal.boresight: needs space: so3"):
        parse_problem(s2 | {"goal": {"boresight": X, "direction": Y}})


def test_hold_that_enters_a_zone_is_refused_with_zone_and_time():
    moon = {
        "name": "moon", "kind": "keep_out", "direction": Y, "rate": [0, 0, -0.01],
        "half_angle_deg": 10, "normalized_strength": 0.01,
    }  # fmt: skip
    stated = document({"orientation": [0, 0, 0, 1]}, obstacles=[moon], hold=200)
    with pytest.raises(StateInZoneError) as caught:
        parse_problem(stated)
    assert caught.value.key == "goal"
    assert "'moon'" in str(caught.value)
    time = math.radians(80) / 0.01
    assert f"t = {time:.6g} s" in str(caught.value)
    free = document({"boresight": Z, "direction": Z}, obstacles=[moon], hold=200)
    assert parse_problem(free).hold == 200.0
    both = {"any_of": [{"orientation": [0, 0, 0, 1]}, {"orientation": TURN}]}
    assert len(parse_problem(document(both, obstacles=[moon], hold=60)).goals) == 2
    with pytest.raises(StateInZoneError, match=r"any_of\[0\].*any_of\[1\]"):
        parse_problem(document({"any_of": [both["any_of"][0]] * 2}, obstacles=[moon], hold=200))
