"""The way out of a zone: the margin never falls until it is positive."""

import numpy as np
import pytest

from riem_planner import S2, SO3, OrientationObstacle, Problem, State, Zone
from riem_planner.escape import fall_before_exit, least_margin, margins_along, way_out
from riem_planner.geometry import so3

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
REST = np.zeros(3)
GENTLE = 1e-3


def _problem(*obstacles, space=SO3):
    here = State(np.eye(3))
    return Problem(here, here, 1.0, space=space, obstacles=obstacles)


def _out_zone(direction, half_angle=0.3, **more):
    return Zone(direction, half_angle, normalized_strength=0.01, **more)


def _margins(problem, trajectory):
    times = np.linspace(0.0, trajectory.duration, 1000)
    return least_margin(problem, trajectory.evaluate(times)[0], times)


def _checked(problem, target=0.02):
    trajectory = way_out(IDENTITY, REST, REST, problem, GENTLE, target)
    margins = _margins(problem, trajectory)
    assert margins[0] < 0.0
    assert margins[-1] >= target - 1e-3
    assert fall_before_exit(margins) < 1e-6
    assert not trajectory.angular_velocities[[0, -1]].any()
    return trajectory


@pytest.mark.parametrize("offset", [0.0, 1e-6, 0.1, 0.29])
def test_out_of_one_zone_straight_away_from_its_axis(offset):
    problem = _problem(_out_zone([1.0, offset, 0.0]))
    trajectory = _checked(problem)
    turn = so3.distance(np.eye(3), trajectory.evaluate(trajectory.duration)[0])
    assert turn == pytest.approx(0.3 - np.arctan(offset) + 0.02, abs=0.05)


def test_out_of_two_zones_that_overlap():
    problem = _problem(
        _out_zone([1.0, 0.15, 0.0], name="sun"), _out_zone([1.0, -0.15, 0.05], name="moon")
    )
    _checked(problem)


def test_back_into_a_keep_in_zone_and_group():
    single = _out_zone([0.0, 1.0, 0.0], 1.2, kind="keep_in", name="in")
    _checked(_problem(single))
    group = [
        _out_zone([0.0, 1.0, 0.0], 1.0, kind="keep_in", group="sensors", name="a"),
        _out_zone([0.0, 0.6, 0.8], 0.9, kind="keep_in", group="sensors", name="b"),
    ]
    _checked(_problem(*group))


def test_away_from_an_attitude():
    Q = so3.exp(np.array([0.0, 0.05, 0.1]))
    _checked(_problem(OrientationObstacle(Q, normalized_strength=0.01, radius=0.2)))


def test_without_roll_on_s2():
    problem = _problem(_out_zone([1.0, 0.1, 0.05]), space=S2)
    trajectory = _checked(problem)
    assert np.abs(trajectory.angular_velocities[:, 0]).max() < 1e-12


def test_begins_with_the_rate_it_comes_with():
    problem = _problem(_out_zone([1.0, 0.1, 0.0]))
    v, a = np.array([0.0, 0.01, 0.005]), np.array([1e-3, 0.0, 0.0])
    trajectory = way_out(IDENTITY, v, a, problem, GENTLE, 0.02)
    assert np.allclose(trajectory.angular_velocities[0], v, atol=1e-15)
    assert np.allclose(trajectory.angular_accelerations[0], a, atol=1e-15)
    assert _margins(problem, trajectory)[-1] >= 0.019


def test_margins_are_those_of_the_problem():
    problem = _problem(
        _out_zone([1.0, 0.1, 0.0], name="sun", rate=(0.0, 0.01, 0.0)),
        _out_zone([0.0, 1.0, 0.0], 1.0, kind="keep_in", group="g", name="a"),
        _out_zone([0.0, 0.0, 1.0], 1.0, kind="keep_in", group="g", name="b"),
    )
    rng = np.random.default_rng(0)
    attitudes, times = so3.exp(rng.normal(size=(20, 3))), np.linspace(0.0, 5.0, 20)
    batched = margins_along(problem, attitudes, times)
    for index, (R, t) in enumerate(zip(attitudes, times, strict=True)):
        for name, margin in problem.margins(R, t).items():
            assert batched[name][index] == pytest.approx(margin, abs=1e-14)


def test_a_fall_counts_only_before_the_exit():
    assert fall_before_exit(np.array([-0.2, -0.1, 0.1, 0.3, 0.2])) == 0.0
    assert fall_before_exit(np.array([-0.1, -0.2, 0.1])) == pytest.approx(0.1)
    assert fall_before_exit(np.array([-0.1, 0.1, -0.2])) > 6.0
    assert fall_before_exit(np.array([0.3, 0.1, 0.2])) == 0.0
