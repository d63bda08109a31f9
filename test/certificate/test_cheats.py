# SPDX-License-Identifier: Apache-2.0
"""Trajectories that cheat are refused, with a reason that names what is wrong."""

import math

import numpy as np
import pytest
from curves import curve, pointing_slew, problem_of, replaced, slew

from riem_planner import S2, OrientationObstacle, State, Trajectory, Zone, certify
from riem_planner.geometry import so3


def refused(trajectory, problem, *words):
    certificate = certify(trajectory, problem)
    assert not certificate.certified
    assert len(certificate.reasons) == 1, certificate.reasons
    for word in words:
        assert word in certificate.reasons[0], certificate.reasons
    return certificate


def test_an_honest_slew_is_certified():
    trajectory = slew()
    certificate = certify(trajectory, problem_of(trajectory))
    assert certificate.certified
    assert certificate.reasons == ()
    assert max(certificate.boundary_error) < 1e-15
    assert certificate.rate_bound == pytest.approx(1.5 * 2.0 / 10.0, rel=1e-3)


@pytest.mark.parametrize("half_angle", [0.02, 1e-3, 1e-5])
def test_a_zone_cut_only_between_two_samples_is_entered(half_angle):
    trajectory = slew(samples=11)
    between = trajectory.evaluate(0.5 * (trajectory.times[4] + trajectory.times[5]))[0]
    zone = Zone(between[:, 0], half_angle, boresight=[1, 0, 0], strength=1.0, name="sun")
    problem = problem_of(trajectory, (zone,))
    for t in trajectory.times:
        assert problem.margins(trajectory.evaluate(t)[0], t)["sun"] > 0.0
    certificate = refused(trajectory, problem, "sun: enters the zone", "t = 4.5 s")
    assert certificate.clearance["sun"] == pytest.approx(-half_angle, abs=1.1e-4)
    assert certificate.least_clearance_times["sun"] == pytest.approx(4.5, abs=0.01)


def test_a_point_obstacle_on_the_path_is_met():
    trajectory = slew(samples=11)
    Q = trajectory.evaluate(3.21)[0]
    obstacle = OrientationObstacle(Q, strength=1.0)
    refused(trajectory, problem_of(trajectory, (obstacle,)), "0: ")


def test_a_keep_in_zone_left_only_between_two_samples_is_left():
    # Looking up from the equator's plane by at most 0.2 rad, half-way between two samples.
    path = curve([0.0, 0.0, 0.0, 1.0], np.outer([0.8, -0.8], [0.0, 1.0, 0.0]), 10.0, 4)
    allowed = {"kind": "keep_in", "strength": 1.0, "name": "antenna"}
    inside = Zone([1, 0, 0], 0.2 + 1e-4, **allowed)
    left = Zone([1, 0, 0], 0.2 - 1e-4, **allowed)
    assert certify(path, problem_of(path, (inside,))).certified
    for t in path.times:
        assert problem_of(path, (left,)).margins(path.evaluate(t)[0])["antenna"] > 0.0
    refused(path, problem_of(path, (left,)), "antenna: enters the zone by")


@pytest.mark.parametrize("angle", [0.1, 0.5, 3.0])
def test_a_jump_is_refused(angle):
    whole = slew(samples=101)
    q = whole.quaternions_xyzw.copy()
    q[50:] = so3.quaternion_multiply(q[50:], so3.quaternion_exp([0.0, angle, 0.0]))
    cheat = replaced(whole, quaternions_xyzw=q)
    certificate = certify(cheat, problem_of(cheat))
    assert not certificate.certified
    assert any("4.9" in reason for reason in certificate.reasons), certificate.reasons


def test_a_flipped_sign_is_refused():
    whole = slew()
    q = whole.quaternions_xyzw.copy()
    q[7:] *= -1.0
    cheat = replaced(whole, quaternions_xyzw=q)
    refused(cheat, problem_of(cheat), "sample at 3 s", "flipped sign")


def test_rates_that_have_nothing_to_do_with_the_attitudes_are_refused():
    whole = slew()
    cheat = replaced(whole, angular_velocities=np.zeros_like(whole.angular_velocities))
    certificate = certify(cheat, problem_of(cheat))
    assert not certificate.certified
    assert "do not account for its turn" in certificate.reasons[0]


@pytest.mark.parametrize("end", ["start", "goal"])
def test_a_wrong_end_is_refused(end):
    trajectory = slew()
    problem = problem_of(trajectory)
    state = getattr(problem, end)
    away = State(state.orientation @ so3.exp([0.0, 2e-6, 0.0]), state.angular_velocity)
    faster = State(state.orientation, state.angular_velocity + np.array([0.0, 0.0, 3e-6]))
    wrong = problem_of(trajectory)
    object.__setattr__(wrong, end, away)
    certificate = refused(trajectory, wrong, f"{end}: missed by 2e-06 rad")
    assert certificate.boundary_error[0] == pytest.approx(2e-6, rel=1e-6)
    object.__setattr__(wrong, end, faster)
    certificate = refused(trajectory, wrong, f"{end}: angular velocity missed by 3e-06 rad/s")
    assert certificate.boundary_error[1] == pytest.approx(3e-6, rel=1e-6)


def test_on_s2_the_roll_of_the_goal_is_free_but_not_its_direction():
    trajectory, options = pointing_slew()
    rolled = trajectory.evaluate(10.0)[0] @ so3.exp([1.0, 0.0, 0.0])
    problem = problem_of(trajectory, **options)
    object.__setattr__(problem, "goal", State(rolled))
    assert certify(trajectory, problem).certified
    object.__setattr__(problem, "goal", State(rolled @ so3.exp([0.0, 1e-5, 0.0])))
    refused(trajectory, problem, "goal: missed by 1e-05 rad")
    antipode = rolled @ so3.exp([0.0, math.pi, 0.0])
    object.__setattr__(problem, "goal", State(antipode))
    refused(trajectory, problem, "goal: missed by 3.14 rad")


def test_on_s2_the_velocity_of_the_direction_counts():
    steady = slew(rate=True)
    problem = problem_of(steady, space=S2)
    assert certify(steady, problem).certified
    goal = State(problem.goal.orientation, problem.goal.angular_velocity * (1.0 + 1e-4))
    object.__setattr__(problem, "goal", goal)
    refused(steady, problem, "goal: angular velocity missed by 2e-05 rad/s")


def test_a_rolling_lift_is_refused_on_s2():
    # From rest to rest, so that only the curve in between tells.
    profile = np.outer([0.0, 3.0, -2.0], [0.5, 0.0, 1.0])
    rolling = curve([0.0, 0.0, 0.0, 1.0], profile, 10.0, 21)
    refused(rolling, problem_of(rolling, space=S2), "roll: ", "about the boresight after")


def test_a_lift_that_rolls_only_between_samples_is_refused_on_s2():
    trajectory, options = pointing_slew(samples=101)
    roll = 0.005 * np.arange(101)[:, None] * np.array([1.0, 0.0, 0.0])
    q = so3.quaternion_multiply(trajectory.quaternions_xyzw, so3.quaternion_exp(roll))
    turned_back = so3.quaternion_to_matrix(so3.quaternion_exp(-roll))
    v = np.einsum("nij,nj->ni", turned_back, trajectory.angular_velocities)
    a = np.einsum("nij,nj->ni", turned_back, trajectory.angular_accelerations)
    cheat = Trajectory(trajectory.times, q, v, a)
    certificate = certify(cheat, problem_of(cheat, **options))
    assert any("about the boresight" in reason for reason in certificate.reasons)


def test_another_duration_is_refused():
    trajectory = slew()
    refused(trajectory, problem_of(trajectory, duration=10.0001), "duration: expected 10.0001 s")


def test_quaternions_off_the_unit_sphere_are_refused():
    trajectory = slew()
    q = trajectory.quaternions_xyzw.copy()
    q[3] *= 1.0 + 1e-6
    cheat = replaced(trajectory, quaternions_xyzw=q)
    refused(cheat, problem_of(cheat), "norms are off by up to 1e-06")


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("key", ["_coefficients", "quaternions_xyzw", "angular_velocities"])
def test_a_value_that_is_not_finite_is_refused_and_never_raises(key, value):
    trajectory = slew()
    array = getattr(trajectory, key).copy()
    array.flat[array.size // 2] = value
    array.setflags(write=False)
    zones = (
        Zone([0, 0, 1], 0.3, strength=1.0, name="out"),
        Zone([1, 0, 0], 3.0, strength=1.0, name="in", kind="keep_in"),
    )
    problem = problem_of(trajectory, zones)
    object.__setattr__(trajectory, key, array)
    certificate = certify(trajectory, problem)
    assert not certificate.certified
    assert "not finite" in certificate.reasons[0]


def test_polynomials_that_overflow_are_refused():
    rest = np.zeros((2, 3))
    with np.errstate(over="ignore"):
        trajectory = Trajectory([0.0, 1.0], [[0, 0, 0, 1], [0, 0, 0.6, 0.8]], rest, rest + 1e308)
    certificate = certify(trajectory, problem_of(trajectory))
    assert not certificate.certified
    assert "not finite" in certificate.reasons[0]
