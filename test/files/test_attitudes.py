# SPDX-License-Identifier: Apache-2.0
"""Attitudes by the keys that people have them under, and YAML's merge keys."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riem_planner.errors import InvalidProblemError
from riem_planner.files.attitudes import ATTITUDE_KEYS, read_attitude
from riem_planner.files.documents import parse_yaml
from riem_planner.files.problem_files import parse_problem
from riem_planner.files.section import Section
from riem_planner.geometry import so3

TURNS = [np.array([0.3, -0.2, 0.9]), np.array([0.0, 0.0, 1e-9]), np.array([-1.8, 2.1, 1.4])]


def attitude(**values):
    return so3.quaternion_to_matrix(read_attitude(Section("goal", values, ATTITUDE_KEYS)))


@pytest.mark.parametrize("turn", TURNS)
def test_every_key_states_the_same_attitude(turn):
    rotation = Rotation.from_rotvec(turn)
    x, y, z, w = rotation.as_quat()
    stated = {
        "orientation": [x, y, z, w],
        "orientation_wxyz": [w, x, y, z],
        "rotation_vector": turn.tolist(),
        "mrp": rotation.as_mrp().tolist(),
        "matrix": rotation.as_matrix().tolist(),
        "euler": {"sequence": "ZYX", "angles_deg": rotation.as_euler("ZYX", True).tolist()},
    }
    for key, value in stated.items():
        np.testing.assert_allclose(attitude(**{key: value}), rotation.as_matrix(), atol=1e-14)


@pytest.mark.parametrize("sequence", ["ZYX", "zyx", "XZX", "yzy", "XYZ", "zxy"])
def test_euler_turns_about_body_axes_in_upper_case_and_about_fixed_ones_in_lower(sequence):
    angles = [40.0, -25.0, 110.0]
    expected = Rotation.from_euler(sequence, angles, degrees=True).as_matrix()
    euler = {"sequence": sequence, "angles_deg": angles}
    np.testing.assert_allclose(attitude(euler=euler), expected, atol=1e-14)


def test_mrp_of_any_length_is_the_same_as_its_shadow():
    p = np.array([0.9, -2.0, 0.4])
    shadow = -p / (p @ p)
    np.testing.assert_allclose(attitude(mrp=p.tolist()), attitude(mrp=shadow.tolist()), atol=1e-14)
    np.testing.assert_allclose(attitude(mrp=[0.0, 0.0, 1e300]), np.eye(3), atol=1e-14)


def test_right_ascension_and_declination_are_those_of_the_x_axis():
    R = attitude(ra_dec_roll_deg=[279.234735, 38.783689, 25.0])
    ra, dec = math.radians(279.234735), math.radians(38.783689)
    x = [math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)]
    np.testing.assert_allclose(R[:, 0], x, atol=1e-15)
    # Rolled by 0 the z axis is as near to north as it gets; 25 degrees about x then.
    assert R[2, 2] == pytest.approx(math.cos(dec) * math.cos(math.radians(25.0)), abs=1e-15)


def test_typed_matrix_is_taken_for_the_nearest_rotation():
    exact = so3.exp(TURNS[0])
    typed = np.round(exact, 4)
    R = attitude(matrix=typed.tolist())
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)
    assert so3.distance(R, exact) < 1e-4


WRONG = {
    "two keys": (
        {"orientation": [0, 0, 0, 1], "mrp": [0, 0, 0]}, "goal",
        "expected exactly one of orientation, orientation_wxyz, rotation_vector, mrp, matrix,"
        " euler, ra_dec_roll_deg, got orientation, mrp",
    ),
    "none": ({}, "goal.orientation", "missing"),
    "letter twice in a row": (
        {"euler": {"sequence": "ZZX", "angles_deg": [0, 0, 0]}}, "goal.euler.sequence",
        "expected three of XYZ (body axes) or of xyz (fixed axes), no letter twice in a row,"
        " got 'ZZX'",
    ),
    "mixed case": ({"euler": {"sequence": "ZyX", "angles_deg": [0, 0, 0]}},
                   "goal.euler.sequence", "got 'ZyX'"),
    "no sequence": ({"euler": {"angles_deg": [0, 0, 0]}}, "goal.euler.sequence", "missing"),
    "two angles": ({"euler": {"sequence": "ZYX", "angles_deg": [0, 0]}},
                   "goal.euler.angles_deg", "three angles in degrees, got [0, 0]"),
    "a mirror": (
        {"matrix": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "goal.matrix",
        "expected a rotation matrix, got one of determinant -1; ",
    ),
    "a stretch": ({"matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1.01]]}, "goal.matrix", "0.0201"),
    "two rows": ({"matrix": [[1, 0, 0], [0, 1, 0]]}, "goal.matrix", "three rows"),
    "NaN in a row": ({"matrix": [[1, 0, 0], [0, math.nan, 0], [0, 0, 1]]},
                     "goal.matrix[1][1]", "nan"),
    "a mapping": ({"orientation": {"w": 0.8, "x": 0, "y": 0, "z": 0.6}}, "goal.orientation",
                  "[x, y, z, w] (scalar first is orientation_wxyz), got {'w': 0.8"),
    "no unit, scalar first": ({"orientation_wxyz": [1, 0, 0, 1]}, "goal.orientation_wxyz",
                              "w, x, y, z, got [1.0, 0.0, 0.0, 1.0] of norm 1.41421"),
    "past the pole": ({"ra_dec_roll_deg": [0, 91, 0]}, "goal.ra_dec_roll_deg[1]", "91"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_attitude_is_named_with_its_key(case):
    values, key, words = WRONG[case]
    with pytest.raises(InvalidProblemError) as caught:
        attitude(**values)
    assert caught.value.key == key
    assert words in str(caught.value)


def test_attitudes_of_states_and_obstacles_take_any_of_the_keys():
    problem = parse_problem(
        {
            "space": "so3",
            "duration": 60,
            "start": {"euler": {"sequence": "ZYX", "angles_deg": [90, 0, 0]}},
            "goal": {"mrp": [0, 0, 0.2], "angular_velocity": [0, 0, 0.01]},
            "obstacles": [{"kind": "orientation", "rotation_vector": [2.0, 0, 0], "strength": 1.0}],
        }
    )
    np.testing.assert_allclose(problem.start.orientation, so3.exp([0, 0, math.pi / 2]), atol=1e-15)
    np.testing.assert_allclose(problem.goal.orientation, so3.exp([0, 0, 4 * math.atan(0.2)]))
    np.testing.assert_allclose(problem.obstacles[0].orientation, so3.exp([2.0, 0, 0]))


def test_merge_key_gives_what_a_mapping_does_not_say_itself():
    document = parse_yaml(
        "zones:\n  - &z {name: a, half: 10, b: [1, 0, 0]}\n  - &y {half: 20, c: 3}\n"
        "  - {name: b, <<: *z, b: [0, 0, 1]}\n  - {<<: [*z, *y], name: c}\n  - {'<<': 5}\n"
    )
    a, _, b, c, quoted = document["zones"]
    assert a == {"name": "a", "half": 10, "b": [1, 0, 0]}
    assert b == {"name": "b", "half": 10, "b": [0, 0, 1]}
    assert c == {"name": "c", "half": 10, "b": [1, 0, 0], "c": 3}
    assert quoted == {"<<": 5}
    assert not b.duplicates
    with pytest.raises(InvalidProblemError, match="expects a mapping"):
        parse_yaml("a: {<<: 5}")
