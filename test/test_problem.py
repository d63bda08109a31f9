# SPDX-License-Identifier: Apache-2.0
"""Wrong values of a problem are refused with the key, the value and the remedy."""

import math

import numpy as np
import pytest

from riem_planner import (
    S2,
    SO3,
    InvalidProblemError,
    OrientationObstacle,
    Problem,
    State,
    Zone,
)
from riem_planner.geometry import so3

REST = State(np.eye(3))
TURNED = State(so3.exp([0.0, 0.0, 1.0]))


def stated(**values):
    return Problem(**({"start": REST, "goal": TURNED, "duration": 10.0} | values))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"duration": 0.0}, "duration: expected a number above 0, got 0"),
        ({"duration": -1.0}, "duration: .* -1"),
        ({"duration": math.nan}, "duration: expected a finite number"),
        ({"duration": True}, "duration: expected a number, got True"),
        ({"duration": "10"}, "duration: expected a number, got '10'"),
        ({"tension": -0.1}, "tension: .* at least 0"),
        ({"normalized_tension": math.inf}, "normalized_tension: .* finite"),
        ({"tension": 0.0, "normalized_tension": 0.0}, "tension: .* at most one"),
        ({"space": "so3"}, "space: expected SO3 or S2"),
        ({"boresight": [0.0, 0.0, 0.0]}, "boresight: .* zero vector"),
        ({"boresight": [1.0, 0.0]}, "boresight: expected 3 numbers"),
        ({"obstacles": ("sun",)}, r"obstacles\[0\]: expected an OrientationObstacle or a Zone"),
    ],
)
def test_wrong_problem_values(values, message):
    with pytest.raises(InvalidProblemError, match=message):
        stated(**values)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: State(np.diag([1.0, 1.0, -1.0])), "orientation: .* determinant -1"),
        (lambda: State(1.001 * np.eye(3)), "orientation: expected a rotation matrix"),
        (lambda: State(np.eye(2)), "orientation: expected 3x3 numbers"),
        (lambda: State(np.eye(3), [0.0, math.nan, 0.0]), "angular_velocity: .* finite"),
        (lambda: State.from_quaternion_xyzw([0, 0, 0, 1.002]), "orientation: .* norm 1.002"),
        (lambda: State.from_quaternion_xyzw([0, 0, 0, 0]), "orientation: .* norm 0"),
        (lambda: State.from_quaternion_xyzw([0, 0, 1]), "orientation: expected 4 numbers"),
        (lambda: State.from_direction([0, 0, 0]), "direction: .* zero vector"),
        (lambda: State.from_direction([1, 0, 0], [0.1, 0, 0]), "velocity: .* radial part of 0.1"),
    ],
)
def test_wrong_states(make, message):
    with pytest.raises(InvalidProblemError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: OrientationObstacle(np.eye(3), 1.0, 1.0), "strength: .* and normalized"),
        (lambda: OrientationObstacle(np.eye(3), -1.0), "strength: .* above 0"),
        (lambda: OrientationObstacle(np.eye(3), 1.0, radius=-0.1), "radius: .* at least 0"),
        (lambda: OrientationObstacle(np.eye(3), 1.0, radius=math.pi), "radius: .* no attitude"),
        (lambda: OrientationObstacle(np.eye(3), 1.0, rate=[1, 2]), "rate: expected 3 numbers"),
        (lambda: OrientationObstacle(np.eye(3), 1.0, range=(1.0, 0.5)), "range: .* on < off"),
        (lambda: Zone([0, 0, 0], 0.1, strength=1.0), "direction: .* zero vector"),
        (lambda: Zone([1, 0, 0], -0.1, strength=1.0), "half_angle: .* at least 0"),
        (lambda: Zone([1, 0, 0], 3.2, strength=1.0), "half_angle: .* less than pi"),
        (lambda: Zone([1, 0, 0], 0.1, strength=0.0), "strength: .* above 0, got 0"),
        (lambda: Zone([1, 0, 0], 0.1, strength=1.0, kind="avoid"), "kind: .* 'avoid'"),
        (lambda: Zone([1, 0, 0], 0.0, strength=1.0, kind="keep_in"), "half_angle: .* keep_in"),
        (lambda: Zone([1, 0, 0], 0.1, strength=1.0, member="m"), "member: "),
        (lambda: Zone([1, 0, 0], 0.1, strength=1.0, range=(0.05, 1.0)), "range: .* radius < on"),
        (lambda: Zone([1, 0, 0], 1, strength=1, kind="keep_in", range=(2, 3)), "range: .*keep_in"),
    ],
)
def test_wrong_obstacles(make, message):
    with pytest.raises(InvalidProblemError, match=message):
        make()


def test_sphere_refuses_what_would_depend_on_the_roll():
    with pytest.raises(InvalidProblemError, match=r"obstacles\[0\]\.kind: .* roll history"):
        stated(space=S2, obstacles=(OrientationObstacle(np.eye(3), 1.0),))
    with pytest.raises(InvalidProblemError, match=r"obstacles\[0\]\.boresight: on s2"):
        stated(space=S2, obstacles=(Zone([0, 1, 0], 0.1, [0, 1, 0], strength=1.0),))
    with pytest.raises(InvalidProblemError, match=r"goal\.angular_velocity: .* roll of 0\.2"):
        stated(space=S2, goal=State(np.eye(3), [0.2, 0.0, 0.0]))


def test_names_are_used_once():
    zone = Zone([0, 1, 0], 0.1, strength=1.0, name="sun")
    with pytest.raises(InvalidProblemError, match="'sun' is used twice"):
        stated(obstacles=(zone, zone))
    member = Zone([0, 1, 0], 2.0, strength=1.0, kind="keep_in", group="sun")
    with pytest.raises(InvalidProblemError, match="'sun' is used twice"):
        stated(obstacles=(zone, member))
    unnamed = Zone([0, 1, 0], 0.1, strength=1.0)
    assert [o.name for o in stated(obstacles=(unnamed, zone)).obstacles] == ["0", "sun"]


def test_quaternion_within_a_thousandth_is_normalised():
    state = State.from_quaternion_xyzw([0.0, 0.0, 0.0, 1.0005])
    np.testing.assert_allclose(state.orientation, np.eye(3), atol=1e-15)


def test_normalised_values_do_not_depend_on_the_duration():
    zone = Zone([0, 1, 0], 0.1, normalized_strength=0.01)
    for duration in (1.0, 100.0):
        problem = stated(duration=duration, normalized_tension=2.0, obstacles=(zone,))
        assert problem.sigma * duration**2 == pytest.approx(2.0)
        assert problem.strength_of(problem.obstacles[0]) * duration**4 == pytest.approx(0.01)
    assert stated(tension=0.3).sigma == 0.3
    assert stated().sigma == 0.0


def test_direction_state_points_and_moves_as_told_without_roll():
    x, velocity, boresight = np.array([0.6, 0.0, 0.8]), np.array([0.08, 0.3, -0.06]), [0, 0, 2]
    state = State.from_direction(5.0 * x, velocity, boresight)
    b = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(state.orientation @ b, x, atol=1e-15)
    moved = state.orientation @ np.cross(state.angular_velocity, b)
    np.testing.assert_allclose(moved, velocity, atol=1e-15)
    assert state.angular_velocity @ b == 0.0


def test_margins_are_signed_and_a_group_counts_its_best_member():
    problem = stated(
        obstacles=(
            Zone([1, 0, 0], 0.3, strength=1.0, name="out"),
            Zone([1, 0, 0], 0.5, [0, 1, 0], strength=1.0, kind="keep_in", group="g"),
            Zone([0, 1, 0], 0.4, [0, 1, 0], strength=1.0, kind="keep_in", group="g"),
            OrientationObstacle(so3.exp([0, 0, 0.7]), 1.0, radius=0.1, name="q"),
        )
    )
    margins = problem.margins(np.eye(3))
    assert margins == pytest.approx({"out": -0.3, "g": 0.4, "q": 0.6})


def test_moving_obstacles_turn_in_the_reference_frame():
    zone = Zone([1, 0, 0], 0.0, strength=1.0, rate=[0, 0, 0.1])
    np.testing.assert_allclose(zone.direction_at(5 * np.pi), [0, 1, 0], atol=1e-15)
    obstacle = OrientationObstacle(so3.exp([0.3, 0, 0]), 1.0, rate=[0, 0, 0.1])
    expected = so3.exp([0, 0, 0.2]) @ so3.exp([0.3, 0, 0])
    np.testing.assert_allclose(obstacle.orientation_at(2.0), expected, atol=1e-15)
    assert stated(obstacles=(zone,)).margins(np.eye(3), 5 * np.pi)["0"] == pytest.approx(np.pi / 2)


def test_problem_is_frozen_and_copies_its_input():
    R = np.eye(3)
    state = State(R)
    R[0, 0] = -1.0
    assert state.orientation[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        state.orientation[0, 0] = 2.0
    with pytest.raises(AttributeError):
        stated().duration = 3.0
    assert stated().space is SO3
