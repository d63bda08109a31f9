"""The way out of a zone: the margin never falls until it is positive."""

import numpy as np
import pytest

from riem_planner import S2, SO3, OrientationObstacle, Zone
from riem_planner.escape import fall_before_exit, way_out
from riem_planner.geometry import so3
from riem_planner.obstacles import Forbidden

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
REST = np.zeros(3)
GENTLE = 1e-3


def _forbidden(*obstacles, space=SO3):
    return Forbidden(obstacles, pointing=space == S2)


def _out_zone(direction, half_angle=0.3, **more):
    return Zone(direction, half_angle, normalized_strength=0.01, **more)


def _margins(forbidden, trajectory):
    times = np.linspace(0.0, trajectory.duration, 1000)
    return forbidden.least_margin(trajectory.evaluate(times)[0], times)


def _checked(forbidden, target=0.02):
    trajectory = way_out(IDENTITY, REST, REST, forbidden, GENTLE, target)
    margins = _margins(forbidden, trajectory)
    assert margins[0] < 0.0
    assert margins[-1] >= target - 1e-3
    assert fall_before_exit(margins) < 1e-6
    assert not trajectory.angular_velocities[[0, -1]].any()
    return trajectory


@pytest.mark.parametrize("offset", [0.0, 1e-6, 0.1, 0.29])
def test_out_of_one_zone_straight_away_from_its_axis(offset):
    forbidden = _forbidden(_out_zone([1.0, offset, 0.0]))
    trajectory = _checked(forbidden)
    turn = so3.distance(np.eye(3), trajectory.evaluate(trajectory.duration)[0])
    assert turn == pytest.approx(0.3 - np.arctan(offset) + 0.02, abs=0.05)


def test_out_of_two_zones_that_overlap():
    forbidden = _forbidden(
        _out_zone([1.0, 0.15, 0.0], name="sun"), _out_zone([1.0, -0.15, 0.05], name="moon")
    )
    _checked(forbidden)


def test_back_into_a_keep_in_zone_and_group():
    single = _out_zone([0.0, 1.0, 0.0], 1.2, kind="keep_in", name="in")
    _checked(_forbidden(single))
    group = [
        _out_zone([0.0, 1.0, 0.0], 1.0, kind="keep_in", group="sensors", name="a"),
        _out_zone([0.0, 0.6, 0.8], 0.9, kind="keep_in", group="sensors", name="b"),
    ]
    _checked(_forbidden(*group))


def test_away_from_an_attitude():
    Q = so3.exp(np.array([0.0, 0.05, 0.1]))
    _checked(_forbidden(OrientationObstacle(Q, normalized_strength=0.01, radius=0.2)))


def test_without_roll_on_s2():
    forbidden = _forbidden(_out_zone([1.0, 0.1, 0.05]), space=S2)
    trajectory = _checked(forbidden)
    assert np.abs(trajectory.angular_velocities[:, 0]).max() < 1e-12


def test_begins_with_the_rate_it_comes_with():
    forbidden = _forbidden(_out_zone([1.0, 0.1, 0.0]))
    v, a = np.array([0.0, 0.01, 0.005]), np.array([1e-3, 0.0, 0.0])
    trajectory = way_out(IDENTITY, v, a, forbidden, GENTLE, 0.02)
    assert np.allclose(trajectory.angular_velocities[0], v, atol=1e-15)
    assert np.allclose(trajectory.angular_accelerations[0], a, atol=1e-15)
    assert _margins(forbidden, trajectory)[-1] >= 0.019


def test_a_fall_counts_only_before_the_exit():
    assert fall_before_exit(np.array([-0.2, -0.1, 0.1, 0.3, 0.2])) == 0.0
    assert fall_before_exit(np.array([-0.1, -0.2, 0.1])) == pytest.approx(0.1)
    assert fall_before_exit(np.array([-0.1, 0.1, -0.2])) > 6.0
    assert fall_before_exit(np.array([0.3, 0.1, 0.2])) == 0.0
