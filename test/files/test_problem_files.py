# SPDX-License-Identifier: Apache-2.0
"""Problem files: what they mean, and what is said about wrong ones."""

import copy
import json
import math
from pathlib import Path

import numpy as np
import pytest

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import parse_json, parse_yaml
from riem_planner.files.end_states import StateInZoneError
from riem_planner.files.problem_files import (
    parse_problem,
    read_problem,
)
from riem_planner.files.problem_writing import problem_document
from riem_planner.geometry import so3
from riem_planner.problem import S2, SO3

ROOT = Path(__file__).resolve().parents[2]
PROBLEMS = sorted((ROOT / "config/problems").glob("*.yaml"))
TEXTBOOK = (ROOT / "config/problems/textbook.jsonl").read_text(encoding="utf-8").splitlines()

SO3_DOCUMENT = {
    "name": "a slew",
    "space": "so3",
    "duration": 20.0,
    "tension": 0.5,
    "start": {"orientation": [0.0, 0.0, 0.0, 1.0], "angular_velocity": [0.01, 0.0, 0.02]},
    "goal": {"orientation": [0.0, 0.0, 1.0, 0.0]},
    "obstacles": [
        {
            "name": "q1",
            "kind": "orientation",
            "orientation": [1.0, 0.0, 0.0, 0.0],
            "strength": 1.0,
            "radius_deg": 3.0,
            "range_deg": [30.0, 90.0],
        },
        {
            "name": "sun",
            "kind": "keep_out",
            "direction": [0.0, 3.0, 4.0],
            "boresight": [0.0, 0.0, 2.0],
            "half_angle_deg": 10.0,
            "normalized_strength": 0.01,
            "rate": [0.0, 0.0, 0.001],
        },
        {
            "name": "y",
            "kind": "keep_in",
            "group": "sensors",
            "direction": [0.0, 0.0, 1.0],
            "boresight": [0.0, 0.1, 1.0],
            "half_angle_deg": 70.0,
            "normalized_strength": 0.01,
        },
        {
            "kind": "keep_in",
            "group": "sensors",
            "direction": [0.0, 0.0, 1.0],
            "half_angle_deg": 91.0,
            "normalized_strength": 0.02,
        },
    ],
    "limits": {"rate": 0.5, "torque": [0.1, 0.2, 0.3]},
    "inertia": [2.0, 0.1, 0.0, 0.1, 2.0, 0.0, 0.0, 0.0, 3.0],
}
S2_DOCUMENT = {
    "space": "s2",
    "boresight": [0.0, 0.0, 1.0],
    "duration": 2.0,
    "start": {"direction": [1.0, 0.0, 0.0], "velocity": [0.0, 0.5, 0.0]},
    "goal": {"direction": [0.0, 2.0, 0.0]},
    "obstacles": [{"kind": "keep_out", "direction": [1.0, 1.0, 0.3], "strength": 0.1}],
}


def changed(document, path, value):
    """Copy of a document with the entry at a path replaced; `...` removes it."""
    result = copy.deepcopy(document)
    place = result
    for key in path[:-1]:
        place = place[key]
    if value is ...:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return result


def test_so3_document_states_what_it_says():
    problem = parse_problem(SO3_DOCUMENT)
    assert (problem.name, problem.space, problem.duration) == ("a slew", SO3, 20.0)
    assert problem.sigma == 0.5
    np.testing.assert_allclose(problem.goal.orientation, np.diag([-1.0, -1.0, 1.0]), atol=1e-15)
    np.testing.assert_array_equal(problem.start.angular_velocity, [0.01, 0.0, 0.02])
    q1, sun, y, unnamed = problem.obstacles
    assert q1.radius == pytest.approx(math.radians(3.0), rel=1e-15)
    np.testing.assert_allclose(np.degrees(q1.range), [30.0, 90.0], rtol=1e-14)
    np.testing.assert_allclose(sun.direction, [0.0, 0.6, 0.8], atol=1e-15)
    np.testing.assert_array_equal(sun.boresight, [0.0, 0.0, 1.0])
    assert (y.kind, y.group, unnamed.name) == ("keep_in", "sensors", "3")
    np.testing.assert_array_equal(unnamed.boresight, [1.0, 0.0, 0.0])
    assert problem.limits.rate == 0.5
    np.testing.assert_array_equal(problem.limits.torque, [0.1, 0.2, 0.3])
    assert problem.limits.inertia[0, 1] == 0.1
    assert not problem.has_auto_duration


def test_s2_document_lifts_by_the_least_rotation():
    problem = parse_problem(S2_DOCUMENT)
    assert problem.space == S2
    boresight = problem.boresight
    np.testing.assert_allclose(problem.start.orientation @ boresight, [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(problem.goal.orientation @ boresight, [0, 1, 0], atol=1e-15)
    rate = problem.start.orientation @ problem.start.angular_velocity
    np.testing.assert_allclose(np.cross(rate, [1, 0, 0]), [0.0, 0.5, 0.0], atol=1e-15)
    assert so3.distance(np.eye(3), problem.start.orientation) == pytest.approx(math.pi / 2)


def test_s2_state_may_be_given_by_an_orientation():
    half = math.sqrt(0.5)
    start = {"orientation": [0.0, half, 0.0, half], "velocity": [0.0, 0.5, 0.0]}
    by_orientation = parse_problem(changed(S2_DOCUMENT, ["start"], start)).start
    by_direction = parse_problem(S2_DOCUMENT).start
    np.testing.assert_allclose(by_orientation.orientation, by_direction.orientation, atol=1e-15)
    np.testing.assert_allclose(
        by_orientation.angular_velocity, by_direction.angular_velocity, atol=1e-15
    )


def test_wheels_and_jerk_are_read_and_written():
    wheels = [
        {"axis": axis, "torque": 0.005, "momentum": 0.12}
        for axis in ([2, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1])
    ]
    limits = {"jerk": 5e-4, "torque_rate": [1e-3, 2e-3, 3e-3], "wheels": wheels}
    document = changed(SO3_DOCUMENT, ["limits"], limits)
    problem = parse_problem(changed(document, ["total_momentum"], [0.1, 0.2, 0.3]))
    assert problem.limits.keys == ("jerk", "torque_rate", "wheels")
    np.testing.assert_array_equal(problem.limits.wheels[0].axis, [1.0, 0.0, 0.0])
    again = parse_problem(json.loads(json.dumps(problem_document(problem))))
    for one, other in zip(problem.limits.table, again.limits.table, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(again.total_momentum, [0.1, 0.2, 0.3])


def test_duration_auto_asks_for_the_least_within_limits():
    problem = parse_problem(changed(SO3_DOCUMENT, ["duration"], "auto"))
    assert problem.has_auto_duration
    assert problem_document(problem)["duration"] == "auto"


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda path: path.stem)
def test_published_problem_is_read(path):
    problem = read_problem(path)
    assert problem.name == path.stem
    assert min(problem.margins(problem.start.orientation).values()) > 0.0


def test_yaml_and_json_state_the_same(tmp_path):
    text = json.dumps(SO3_DOCUMENT)
    (tmp_path / "a.json").write_text(text, encoding="utf-8")
    (tmp_path / "a.yaml").write_text("\ufeff" + text, encoding="utf-8")
    first, second = (
        problem_document(read_problem(tmp_path / name)) for name in ("a.json", "a.yaml")
    )
    assert first == second


def all_documents():
    lines = [line for line in TEXTBOOK if line.strip()]
    return [SO3_DOCUMENT, S2_DOCUMENT, *map(json.loads, lines)]


@pytest.mark.parametrize("document", all_documents(), ids=lambda d: d.get("name", "s2"))
def test_round_trip_keeps_the_problem(document):
    first = parse_problem(document)
    written = json.loads(json.dumps(problem_document(first)))
    second = parse_problem(written)
    for name in ("start", "goal"):
        one, other = getattr(first, name), getattr(second, name)
        np.testing.assert_allclose(one.orientation, other.orientation, atol=2e-15)
        np.testing.assert_array_equal(one.angular_velocity, other.angular_velocity)
    assert first.duration == second.duration
    assert first.sigma == second.sigma
    for one, other in zip(first.obstacles, second.obstacles, strict=True):
        assert (one.name, one.kind) == (other.name, other.kind)
        assert one.strength == other.strength
        assert one.normalized_strength == other.normalized_strength
        assert one.radius == pytest.approx(other.radius, rel=1e-14)
        np.testing.assert_array_equal(one.rate, other.rate)
    R = so3.exp(np.array([0.3, -0.2, 0.9]))
    one, other = first.margins(R, 0.7), second.margins(R, 0.7)
    assert one == pytest.approx(other, abs=1e-14)
    assert (first.limits is None) == (second.limits is None)
    if first.limits is not None:
        for one, other in zip(first.limits.table, second.limits.table, strict=True):
            np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(first.limits.inertia, second.limits.inertia)


# Path to change, its new value, the key the error names, words it must hold.
OBSTACLE = ["obstacles", 1]
WRONG = {
    "unknown key": (["durration"], 3.0, "durration", ["3.0", "did you mean duration"]),
    "unknown nested key": (
        [*OBSTACLE, "half_angle"], 0.3, "obstacles[1].half_angle", ["0.3", "half_angle_deg"],
    ),
    "key of another kind": (
        ["obstacles", 0, "boresight"], [1, 0, 0], "obstacles[0].boresight", ["unknown"],
    ),
    "range on keep_in": (["obstacles", 2, "range_deg"], [80, 90], "obstacles[2].range_deg", []),
    "missing space": (["space"], ..., "space", ["missing", "so3 or s2"]),
    "missing duration": (["duration"], ..., "duration", ["missing", "seconds"]),
    "missing start": (["start"], ..., "start", ["missing"]),
    "missing goal": (["goal"], ..., "goal", ["missing"]),
    "missing orientation": (["goal", "orientation"], ..., "goal.orientation", ["missing"]),
    "missing kind": ([*OBSTACLE, "kind"], ..., "obstacles[1].kind", ["missing", "keep_out"]),
    "missing direction": ([*OBSTACLE, "direction"], ..., "obstacles[1].direction", ["missing"]),
    "two strengths": ([*OBSTACLE, "strength"], 1.0, "obstacles[1].strength", ["both"]),
    "keep_in without angle": (
        ["obstacles", 2, "half_angle_deg"], ..., "obstacles[2].half_angle_deg", ["missing"],
    ),
    "wrong space": (["space"], "SO3", "space", ["'SO3'", "so3 or s2"]),
    "wrong kind": ([*OBSTACLE, "kind"], "cone", "obstacles[1].kind", ["'cone'", "keep_in"]),
    "NaN duration": (["duration"], math.nan, "duration", ["nan"]),
    "infinite tension": (["tension"], math.inf, "tension", ["inf"]),
    "NaN in a quaternion": (
        ["start", "orientation"], [0, 0, math.nan, 1], "start.orientation[2]", ["nan"],
    ),
    "too large an integer": (["tension"], 10**400, "tension", ["finite"]),
    "duration 0": (["duration"], 0, "duration", ["above 0", "got 0", "auto"]),
    "negative duration": (["duration"], -5.0, "duration", ["above 0", "-5"]),
    "duration in words": (["duration"], "ten", "duration", ["'ten'"]),
    "duration true": (["duration"], True, "duration", ["True"]),
    "no value": (["tension"], None, "tension", ["nothing"]),
    "non-unit quaternion": (
        ["start", "orientation"], [0, 0, 0.1, 1], "start.orientation", ["norm 1.00499", "normalis"],
    ),
    "three numbers for a quaternion": (
        ["start", "orientation"], [0, 0, 1], "start.orientation", ["[0, 0, 1]", "x, y, z, w"],
    ),
    "text among numbers": (
        ["start", "angular_velocity"], [0, "1", 0], "start.angular_velocity[1]", ["'1'"],
    ),
    "zero direction": (
        [*OBSTACLE, "direction"], [0, 0, 0], "obstacles[1].direction", ["zero vector"],
    ),
    "zero boresight": ([*OBSTACLE, "boresight"], [0, 0, 0], "obstacles[1].boresight", ["zero"]),
    "negative strength": (
        [*OBSTACLE, "normalized_strength"], -0.01, "obstacles[1].normalized_strength",
        ["above 0", "-0.01"],
    ),
    "strength 0": (["obstacles", 0, "strength"], 0, "obstacles[0].strength", ["above 0"]),
    "negative tension": (["tension"], -1.0, "tension", ["at least 0", "-1"]),
    "two tensions": (["normalized_tension"], 1.0, "tension", ["both"]),
    "angle of 180 degrees": (
        [*OBSTACLE, "half_angle_deg"], 180, "obstacles[1].half_angle_deg", ["below 180", "180"],
    ),
    "negative radius": (["obstacles", 0, "radius_deg"], -1, "obstacles[0].radius_deg", ["-1"]),
    "range within the radius": (
        ["obstacles", 0, "range_deg"], [2.0, 90.0], "obstacles[0].range_deg", ["radius_deg 3"],
    ),
    "name that is a number": ([*OBSTACLE, "name"], 7, "obstacles[1].name", ["7", "quotes"]),
    "name used twice": ([*OBSTACLE, "name"], "sensors", "obstacles", ["'sensors'", "twice"]),
    "obstacles no list": (["obstacles"], {"a": 1}, "obstacles", ["list"]),
    "obstacle no mapping": ([*OBSTACLE], "sun", "obstacles[1]", ["mapping", "'sun'"]),
    "start no mapping": (["start"], [0, 0, 0, 1], "start", ["mapping"]),
    "direction on so3": (["start", "direction"], [1, 0, 0], "start.direction", ["unknown"]),
    "unknown limit": (["limits", "speed"], 1.0, "limits.speed", ["1.0", "rate"]),
    "negative limit": (["limits", "rate"], -1.0, "limits.rate", ["-1.0", "rad/s"]),
    "limit of two numbers": (["limits", "torque"], [1, 2], "limits.torque", ["[1, 2]"]),
    "no inertia": (["inertia"], ..., "inertia", ["limits.torque"]),
    "impossible inertia": (
        ["inertia"], [1, 0, 0, 0, 1, 0, 0, 0, 3], "inertia", ["principal moments"],
    ),
    "asymmetric inertia": (["inertia"], [1, 0.1, 0, 0, 1, 0, 0, 0, 1], "inertia", ["symmetric"]),
    "eight numbers of inertia": (["inertia"], [1] * 8, "inertia", ["nine", "kg m^2"]),
    "ragged inertia": (
        ["inertia"], [[1, 0, 0, 0], [1, 0, 0], [0, 1]], "inertia", ["nine", "[[1, 0, 0, 0]"],
    ),
    "NaN in the inertia": (
        ["inertia"], [1, 0, 0, 0, math.nan, 0, 0, 0, 1], "inertia[4]", ["finite", "nan"],
    ),
    "negative moment": (
        ["inertia"], [1, 0, 0, 0, -1, 0, 0, 0, 1], "inertia", ["positive", "-1, 1, 1", "signs"],
    ),
    "skew inertia": (
        ["inertia"], [1, 0, 0.2, 0, 1, 0, 0.1, 0, 1], "inertia",
        ["0.2 in row 1, column 3", "0.1 in row 3, column 1", "make them equal"],
    ),
    "inertia among the limits": (
        ["limits", "inertia"], [1, 0, 0, 0, 1, 0, 0, 0, 1], "limits.inertia", ["beside limits"],
    ),
    "negative on one axis": (
        ["limits", "torque"], [0.1, -0.2, 0.3], "limits.torque[1]", ["above 0 [N m]", "-0.2"],
    ),
    "NaN on one axis": (["limits", "torque"], [0.1, 0.2, math.nan], "limits.torque[2]", ["nan"]),
    "infinite limit": (["limits", "rate"], math.inf, "limits.rate", ["rad/s", "inf"]),
    "negative jerk": (["limits", "jerk"], -1.0, "limits.jerk", ["-1.0", "rad/s^3"]),
    "wheels no list": (["limits", "wheels"], 4, "limits.wheels", ["a list of wheels", "4"]),
    "wheel without a torque": (
        ["limits", "wheels"], [{"axis": [1, 0, 0], "momentum": 1}], "limits.wheels[0].torque",
        ["missing", "N m"],
    ),
    "two wheels": (
        ["limits", "wheels"],
        [{"axis": axis, "torque": 1, "momentum": 1} for axis in ([1, 0, 0], [0, 1, 0])],
        "limits.wheels", ["at least three", "got 2"],
    ),
    "total momentum without wheels": (
        ["total_momentum"], [0, 0, 1], "total_momentum", ["limits.wheels"],
    ),
    "limits no mapping": (["limits"], 0.1, "limits", ["mapping", "rate", "0.1"]),
    "limits of nothing": (["limits"], {}, "limits", ["at least one of rate", "none"]),
    "duration beyond numbers": (["duration"], 1e200, "duration", ["1e+12 s", "1e+200"]),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_value_is_named_with_its_key_and_a_remedy(case):
    path, value, key, words = WRONG[case]
    with pytest.raises(InvalidProblemError) as caught:
        parse_problem(changed(SO3_DOCUMENT, path, value))
    assert caught.value.key == key
    for word in words:
        assert word in str(caught.value)


WRONG_ON_S2 = {
    "no place": (["start", "direction"], ..., "start", "neither"),
    "two places": (["start", "orientation"], [0, 0, 0, 1], "start", "both"),
    "zero direction": (["goal", "direction"], [0, 0, 0], "goal.direction", "zero vector"),
    "radial velocity": (["start", "velocity"], [0.1, 0.5, 0], "start.velocity", "tangent"),
    "rate of a direction": (
        ["start", "angular_velocity"], [0, 0, 0], "start.angular_velocity", "velocity",
    ),
    "NaN velocity": (["start", "velocity"], [0, math.nan, 0], "start.velocity[1]", "nan"),
    "another boresight": (
        ["obstacles", 0, "boresight"], [1, 0, 0], "obstacles[0].boresight", "space's boresight",
    ),
    "an orientation": (
        ["obstacles", 0],
        {"kind": "orientation", "orientation": [0, 0, 0, 1], "strength": 1},
        "obstacles[0].kind",
        "roll",
    ),
    "rolling goal": (
        ["goal"],
        {"orientation": [0, 0, 0, 1], "angular_velocity": [0, 0, 1]},
        "goal.angular_velocity",
        "roll",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG_ON_S2)
def test_wrong_value_on_s2_is_named(case):
    path, value, key, word = WRONG_ON_S2[case]
    with pytest.raises(InvalidProblemError) as caught:
        parse_problem(changed(S2_DOCUMENT, path, value))
    assert caught.value.key == key
    assert word in str(caught.value)


def test_auto_duration_without_limits_is_refused():
    document = changed(changed(SO3_DOCUMENT, ["limits"], ...), ["duration"], "auto")
    with pytest.raises(InvalidProblemError, match=r"limits: missing.*\{rate: 0.02\} in rad/s"):
        parse_problem(document)


def test_a_wrong_inertia_is_refused_where_no_limit_needs_it_too():
    document = changed(SO3_DOCUMENT, ["limits"], ...)
    document = changed(document, ["inertia"], [1, 0, 0, 0, -1, 0, 0, 0, 1])
    with pytest.raises(InvalidProblemError, match="inertia: expected positive"):
        parse_problem(document)


@pytest.mark.parametrize(
    ("place", "value", "key", "words"),
    [
        ([*OBSTACLE, "half_angle_deg"], 40.0, "start.orientation", "3.13 degrees inside"),
        (["obstacles", 0, "orientation"], [0, 0, 1, 0], "goal.orientation", "'q1'"),
        (["obstacles", 2, "half_angle_deg"], 4.0, None, None),
        (["obstacles", 3, "half_angle_deg"], 80.0, None, None),
    ],
)
def test_end_state_in_a_zone_is_refused(place, value, key, words):
    document = changed(SO3_DOCUMENT, ["obstacles", 0, "range_deg"], ...)
    document = changed(document, place, value)
    if key is None:  # one member of the group still sees the Sun
        parse_problem(document)
        return
    with pytest.raises(StateInZoneError) as caught:
        parse_problem(document)
    assert caught.value.key == key
    assert words in str(caught.value)


def test_keep_in_group_that_sees_nothing_is_named():
    document = changed(SO3_DOCUMENT, ["obstacles", 2, "half_angle_deg"], 4.0)
    document = changed(document, ["obstacles", 3, "half_angle_deg"], 80.0)
    with pytest.raises(StateInZoneError, match=r"start\.orientation: .* keep_in group 'sensors'"):
        parse_problem(document)


def test_moving_zone_is_judged_where_it_is_at_the_end():
    # It starts 37 degrees from the boresight and comes over the goal in 20 s.
    document = changed(SO3_DOCUMENT, [*OBSTACLE, "rate"], [math.radians(36.9) / 20.0, 0.0, 0.0])
    with pytest.raises(StateInZoneError, match=r"goal\.orientation: .*'sun'"):
        parse_problem(document)


def test_foreign_results_are_allowed_and_nothing_else():
    parse_problem(changed(SO3_DOCUMENT, ["best_known_cost"], 3.0))
    with pytest.raises(InvalidProblemError, match="known_cost: unknown key"):
        parse_problem(changed(SO3_DOCUMENT, ["known_cost"], 3.0))


@pytest.mark.parametrize("parse", [parse_yaml, parse_json])
@pytest.mark.parametrize(
    ("change", "key"),
    [
        (('"tension": 0.5', '"tension": 0.5, "tension": 0.6'), "tension"),
        (('"name": "sun"', '"name": "sun", "name": "moon"'), "obstacles[1].name"),
    ],
)
def test_duplicate_key_is_refused(parse, change, key):
    text = json.dumps(SO3_DOCUMENT)
    assert change[0] in text
    with pytest.raises(InvalidProblemError, match="more than once") as caught:
        parse_problem(parse(text.replace(*change)))
    assert caught.value.key == key


def test_yaml_numbers_are_what_looks_like_one():
    values = parse_yaml("[1e-3, 1E5, .5, 2., -0, +7, 010, .nan, -.inf, 1:30, no, on, 2021-01-01]")
    assert values[:7] == [1e-3, 1e5, 0.5, 2.0, 0, 7, 10]
    assert math.isnan(values[7])
    assert values[8:] == [-math.inf, "1:30", "no", "on", "2021-01-01"]


@pytest.mark.parametrize(
    "text",
    ["a: [1, 2", "a: 1\n b: 2", "{a: 1}\n---\n{b: 2}", "? [1]\n: 2", "!!python/tuple [1]", "\0"],
)
def test_text_that_is_no_yaml_is_refused(text):
    with pytest.raises(InvalidProblemError, match="not YAML"):
        parse_yaml(text)


@pytest.mark.parametrize("text", ["", "{", '{"a": 1} x', "[" * 100_000, "9" * 5000])
def test_text_that_is_no_json_is_refused(text):
    with pytest.raises(InvalidProblemError, match="not JSON"):
        parse_json(text)


@pytest.mark.parametrize("content", [b"\xff\xfe", b"", b"3", b"- 1"])
def test_file_that_states_no_problem_is_refused(tmp_path, content):
    path = tmp_path / "problem.yaml"
    path.write_bytes(content)
    with pytest.raises(InvalidProblemError, match="document: "):
        read_problem(path)


def test_other_file_names_are_refused(tmp_path):
    with pytest.raises(InvalidProblemError, match=r"problem\.txt"):
        read_problem(tmp_path / "problem.txt")
