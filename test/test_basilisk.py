# SPDX-License-Identifier: Apache-2.0
"""What `make basilisk` computes without Basilisk: its conventions, its references, its measures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmark.basilisk.document import DOCUMENT, insert
from benchmark.basilisk.measures import between_samples, effort, margins, rigid_torque
from benchmark.basilisk.reference import (
    Reference,
    even_times,
    mrp_of_quaternion,
    quaternion_of_mrp,
    streamed,
)
from riem_planner import SO3, Problem, State, plan
from riem_planner.certificate.clearance import clearance_along
from riem_planner.files.problem_files import read_problem
from riem_planner.geometry import so3

PROBLEM = Path(__file__).parents[1] / "config/problems/bevo2_case1.yaml"


def attitudes(count=200):
    """Uniform, with some at half a turn and some near the identity."""
    random = np.random.default_rng(5)
    q = random.normal(size=(count, 4))
    q[:20, 3] = 0.0
    q[20:40, :3] *= 1e-7
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def basilisk_matrix(sigma):
    """[BN] of modified Rodrigues parameters, by the formula of Schaub and Junkins, (3.152)."""
    square, S = sigma @ sigma, so3.hat(sigma)
    return np.eye(3) + (8.0 * S @ S - 4.0 * (1.0 - square) * S) / (1.0 + square) ** 2


def test_mrp_and_quaternion_are_inverse_and_never_longer_than_one():
    q = attitudes()
    sigma = mrp_of_quaternion(q)
    assert np.linalg.norm(sigma, axis=1).max() <= 1.0 + 1e-15
    assert so3.quaternion_distance(quaternion_of_mrp(sigma), q).max() < 4e-15
    assert np.allclose(np.linalg.norm(quaternion_of_mrp(sigma), axis=1), 1.0, rtol=0, atol=4e-16)


def test_direction_cosine_matrix_of_the_mrp_is_the_transpose_of_our_attitude():
    for q in attitudes():
        BN = basilisk_matrix(mrp_of_quaternion(q))
        assert np.allclose(BN.T, so3.quaternion_to_matrix(q), rtol=0.0, atol=4e-15)


def test_shadow_set_is_the_same_attitude():
    sigma = mrp_of_quaternion(attitudes())[40:]
    shadow = -sigma / np.sum(sigma**2, axis=1, keepdims=True)
    apart = so3.quaternion_distance(quaternion_of_mrp(shadow), quaternion_of_mrp(sigma))
    assert apart.max() < 4e-15


def test_published_start_has_the_mrp_of_its_source():
    start = read_problem(PROBLEM).start.quaternion_xyzw
    assert mrp_of_quaternion(start) == pytest.approx([0.314, -0.251, 0.228], abs=1e-12)


@pytest.fixture(scope="module")
def slew():
    """A slew that turns from one rate to another about changing axes."""
    start = State.from_quaternion_xyzw([0.1, -0.5, 0.3, 0.806], [0.01, -0.02, 0.03])
    goal = State.from_quaternion_xyzw([0.6, 0.3, -0.2, 0.714])
    return plan(Problem(start, goal, 60.0, space=SO3))


def test_rates_in_the_inertial_frame_are_the_motion_of_the_attitude(slew):
    step = 1e-3
    t = 20.0 + step * np.arange(-1, 2)
    reference = Reference.of_body(t, *slew.evaluate_quaternion(t))
    R = so3.quaternion_to_matrix(reference.quaternions)
    # R' = hat(omega_N) R for the rate in the inertial frame.
    skew = (R[2] - R[0]) / (2.0 * step) @ R[1].T
    rate = [skew[2, 1], skew[0, 2], skew[1, 0]]
    assert reference.rates[1] == pytest.approx(rate, abs=1e-8)
    change = (reference.rates[2] - reference.rates[0]) / (2.0 * step)
    assert reference.accelerations[1] == pytest.approx(change, abs=1e-8)
    body = slew.evaluate_quaternion(t)[1:]
    for ours, theirs in zip(body, reference.body(), strict=True):
        assert np.allclose(ours, theirs, rtol=0.0, atol=1e-15)


def test_stream_is_exact_at_setpoints_and_extrapolated_between(slew):
    reference = streamed(slew, 0.01, setpoint_rate=10.0)
    apart = so3.quaternion_distance(
        reference.quaternions, slew.evaluate_quaternion(reference.times)[0]
    )
    assert apart[::10].max() < 1e-14
    # What the acceleration changes by within a setpoint's time, integrated twice.
    a = slew.evaluate_quaternion(reference.times)[2]
    jerk = np.linalg.norm(np.diff(a, axis=0), axis=1).max() / 0.01
    assert 1e-10 < apart.max() < 0.2 * jerk * 0.1**3


def test_extrapolation_is_off_by_the_cube_of_the_time_since_the_setpoint(slew):
    step, rates, errors = 0.01, np.array([10.0, 5.0, 2.5]), []
    for rate in rates:
        reference = streamed(slew, step, setpoint_rate=rate)
        planned = slew.evaluate_quaternion(reference.times)[0]
        errors.append(so3.quaternion_distance(reference.quaternions, planned).max())
    oldest = 1.0 / rates - step
    orders = np.diff(np.log(errors)) / np.diff(np.log(oldest))
    assert orders == pytest.approx([3.0, 3.0], abs=0.1)


def test_stream_holds_the_end_at_rest(slew):
    reference = streamed(slew, 0.01, hold=2.0)
    held = reference.times >= slew.duration
    end = slew.evaluate_quaternion(slew.duration)[0]
    assert np.count_nonzero(held) == 201
    assert so3.quaternion_distance(reference.quaternions[held], end).max() < 1e-14
    assert not reference.rates[held].any()
    assert not reference.accelerations[held].any()


@pytest.mark.parametrize("duration", [1.0, 0.999, 85.4321])
def test_times_are_a_step_apart_and_reach_the_end(duration):
    times = even_times(duration, 0.01)
    assert np.allclose(np.diff(times), 0.01, rtol=0.0, atol=1e-12)
    assert times[0] == 0.0
    assert times[-2] < duration <= times[-1] + 1e-9


def test_effort_of_a_constant_torque_is_its_norm_and_square_times_the_time():
    torques = np.tile([3.0, 0.0, 4.0], (101, 1))
    torques[0] = 100.0  # before the start
    spent = effort(torques, 0.1)
    assert spent.norm == pytest.approx(50.0)
    assert spent.square == pytest.approx(250.0)


def test_rigid_torque_is_the_rate_of_the_angular_momentum(slew):
    inertia, t, step = np.diag([1.0, 2.0, 3.0]), 20.0, 1e-3
    q, v, a = slew.evaluate_quaternion(t + step * np.arange(-1, 2))
    R = so3.quaternion_to_matrix(q)
    momenta = np.einsum("nij,nj->ni", R, v @ inertia)
    change = R[1].T @ (momenta[2] - momenta[0]) / (2.0 * step)
    assert rigid_torque(inertia, v, a)[1] == pytest.approx(change, abs=1e-8)


def test_margins_of_sampled_attitudes_bound_those_between_them():
    problem = read_problem(PROBLEM)
    trajectory = plan(problem)
    step = 2.0
    t = even_times(trajectory.duration, step)
    q, v, _ = trajectory.evaluate_quaternion(np.minimum(t, trajectory.duration))
    fine = clearance_along(trajectory, problem, np.linspace(0.0, trajectory.duration, 20001))
    slack = between_samples(v, step)
    for name, margin in margins(problem, q).items():
        assert margin - slack <= fine[name].min() <= margin + 1e-12


def test_tables_go_between_the_markers_of_the_page_and_nowhere_else():
    page = DOCUMENT.read_text()
    once = insert(page, "| a |")
    assert insert(once, "| a |") == once
    assert "\n| a |\n" in once
    assert once.split("<!--")[0] == page.split("<!--")[0]
    assert once.split("<!-- to here -->")[1] == page.split("<!-- to here -->")[1]
    with pytest.raises(ValueError, match="once in the page"):
        insert("no markers", "| a |")
