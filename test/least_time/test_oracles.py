# SPDX-License-Identifier: Apache-2.0
"""Least durations that are known: closed forms, and published ones."""

import math

import numpy as np
import pytest

from riem_planner import S2, Limits, Problem, State, Wheel, solve
from riem_planner.geometry import so3
from riem_planner.least_time import least_possible_duration

REST = State(np.eye(3))
BETTS = np.diag([5621.0, 4547.0, 2364.0])
DIAGONAL = np.array([1.0, -2.0, 0.5]) / math.sqrt(5.25)


def least(start, goal, limits, **options):
    return solve(Problem(start, goal, "auto", limits=limits, objective="least_time", **options))


def bang_bang(angle, fastest, quickest):
    if angle * quickest <= fastest**2:
        return 2.0 * math.sqrt(angle / quickest)
    return angle / fastest + fastest / quickest


def with_jerk(angle, V, A, J):
    def rise(v):
        return v / A + A / J if v * J >= A * A else 2.0 * math.sqrt(v / J)

    if V * rise(V) <= angle:
        return angle / V + rise(V)
    low, high = 0.0, V
    for _ in range(60):
        v = 0.5 * (low + high)
        low, high = (v, high) if v * rise(v) < angle else (low, v)
    return 2.0 * rise(high)


@pytest.mark.parametrize("angle", [0.01, 0.4, 2.0, 3.0])
def test_norms_are_met_by_the_turn_about_one_axis(angle):
    goal = State(so3.exp(angle * DIAGONAL))
    solution = least(REST, goal, Limits(rate=0.05, acceleration=0.002))
    expected = bang_bang(angle, 0.05, 0.002)
    assert solution.certificate.certified
    assert solution.cost == solution.trajectory.duration
    assert expected * (1.0 - 1e-6) <= solution.cost <= 1.004 * expected
    assert solution.least_possible_duration == pytest.approx(expected, rel=1e-9)
    assert solution.level == "free path"
    assert solution.converged


def test_a_sphere_is_turned_by_the_torque_over_its_moment():
    limits = Limits(torque=0.02, inertia=4.0 * np.eye(3))
    solution = least(REST, State(so3.exp(1.5 * DIAGONAL)), limits)
    assert solution.cost == pytest.approx(bang_bang(1.5, math.inf, 0.005), rel=0.004)


def test_a_boresight_takes_the_great_circle():
    start, goal = (State.from_direction(x) for x in ([1.0, 0.0, 0.0], [-0.6, 0.64, 0.48]))
    solution = least(start, goal, Limits(rate=0.04, acceleration=0.003), space=S2)
    angle = math.acos(-0.6)
    assert solution.certificate.certified
    assert solution.cost == pytest.approx(bang_bang(angle, 0.04, 0.003), rel=0.004)


def test_half_a_turn_of_a_cube_is_quicker_off_its_axis():
    """Bilimoria and Wie (1993): 3.2432 by these torques, about the axis alone 3.5449."""
    goal = State(so3.exp([0.0, 0.0, math.pi]))
    solution = least(REST, goal, Limits(torque=[1.0] * 3, inertia=np.eye(3)))
    assert solution.certificate.certified
    assert solution.cost == pytest.approx(3.2432, rel=0.002)
    assert least_possible_duration(solution_problem(goal)) < 3.2432


def solution_problem(goal):
    limits = Limits(torque=[1.0] * 3, inertia=np.eye(3))
    return Problem(REST, goal, "auto", limits=limits, objective="least_time")


def test_a_published_reorientation_is_met():
    """Betts, Practical Methods for Optimal Control (2010): 28.6304 s."""
    goal = State(so3.exp([math.radians(150.0), 0.0, 0.0]))
    solution = least(REST, goal, Limits(torque=[50.0] * 3, inertia=BETTS))
    assert solution.certificate.certified
    assert 28.6304 * (1.0 - 1e-4) < solution.cost < 1.003 * 28.6304
    assert "bound by limits.torque (free path)" in solution.message


@pytest.mark.parametrize(
    ("angle", "V", "A", "J"),
    [(0.5, 0.05, 2e-3, 2e-4), (2.0, 0.05, 2e-3, 5e-4), (1.0, 9.0, 9.0, 1e-4)],
)
def test_with_a_jerk_it_is_no_slower_than_about_one_axis(angle, V, A, J):
    goal = State(so3.exp(angle * DIAGONAL))
    solution = least(REST, goal, Limits(rate=V, acceleration=A, jerk=J))
    a = np.linalg.norm(solution.trajectory.angular_accelerations, axis=1)
    assert solution.certificate.certified
    assert max(a[0], a[-1]) <= 1e-9 * a.max()
    assert solution.cost <= 1.01 * with_jerk(angle, V, A, J)
    assert solution.least_possible_duration <= solution.cost


def test_wheels_on_the_axes_are_limits_of_each_axis():
    wheels = [Wheel(axis, 0.01, 0.2) for axis in np.eye(3)]
    inertia, goal = np.diag([2.0, 2.0, 2.0]), State(so3.exp([0.9, -0.7, 1.1]))
    by_wheels = least(REST, goal, Limits(wheels=wheels, inertia=inertia))
    by_axes = least(REST, goal, Limits(acceleration=[0.005] * 3, rate=[0.1] * 3))
    assert by_wheels.certificate.certified
    assert by_wheels.cost == pytest.approx(by_axes.cost, rel=2e-3)
    assert list(by_wheels.certificate.limits_left) == ["wheels"]
