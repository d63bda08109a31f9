# SPDX-License-Identifier: Apache-2.0
"""Least torque: the cost and its variations, the descent, and its own first-order check."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from riem_planner import (
    S2,
    InvalidProblemError,
    Limits,
    OrientationObstacle,
    Problem,
    State,
    Trajectory,
    Zone,
    solve,
)
from riem_planner.certificate.extremality import extremality
from riem_planner.files.problem_files import read_problem
from riem_planner.geometry import so3
from riem_planner.torque import refine_torque, torque_extremality
from riem_planner.torque.cost import Motion, TorqueCost
from riem_planner.torque.splines import SplineMesh

PROBLEMS = Path(__file__).resolve().parents[1] / "config" / "problems"
LOPSIDED = np.array([[1.0, 0.2, 0.1], [0.2, 3.0, -0.3], [0.1, -0.3, 3.4]])


def crowded(factor=1.0, turn=None, body=None):
    """Rates at both ends, tension, an attitude, a moving cone and a keep-in zone.

    `turn` is of the reference frame (3, 3), `body` of the body's axes: `p_new = body p`.
    """
    turn, body = (np.eye(3) if given is None else given for given in (turn, body))

    def seen(state):
        return State(turn @ state.orientation @ body.T, body @ state.angular_velocity)

    middle = State.from_quaternion_xyzw(np.array([0.1, 0.4, 0.3, 0.86]) / np.sqrt(0.9996))
    drift = turn @ np.array([0.0, 0.0, 0.01])
    b = [body @ axis for axis in np.eye(3)]
    return Problem(
        seen(State.from_quaternion_xyzw([0.0, 0.0, 0.0, 1.0], [0.1, -0.2, 0.05])),
        seen(State.from_quaternion_xyzw(np.array([0.3, -0.2, 0.6, 0.8]) / np.sqrt(1.13))),
        10.0,
        normalized_tension=0.7,
        obstacles=(
            Zone(turn @ [0.8, 0.6, 0.05], 0.25, b[0], normalized_strength=0.3 * factor,
                 rate=drift, name="sun"),
            OrientationObstacle(seen(middle).orientation, normalized_strength=0.6 * factor),
            Zone(turn @ [-0.4, 0.7, 0.2], 1.5, b[1], normalized_strength=0.3 * factor,
                 kind="keep_in", name="sensor"),
        ),
    )  # fmt: skip


def own_cost(trajectory, problem, J, sigma):
    """The cost in seconds, of samples alone, without the code under test."""
    x, w = np.polynomial.legendre.leggauss(8)
    h = np.diff(trajectory.times)[:, None]
    t = trajectory.times[:-1, None] + 0.5 * h * (x + 1.0)
    R, v, a = (values.reshape(-1, *values.shape[2:]) for values in trajectory.evaluate(t))
    u = a @ J + np.cross(v, v @ J)
    V = problem.forbidden.repulsion(R, t.ravel(), problem.duration)[0]
    moment = np.trace(J) / 3.0
    density = np.sum(u**2, axis=1) / moment**2 + sigma * np.sum(v**2, axis=1) + V
    return 0.5 * float((0.5 * h * w).ravel() @ density)


def distance(first, second, samples=201):
    times = np.linspace(0.0, first.duration, samples)
    there = second.evaluate_quaternion(times)[0]
    return so3.quaternion_distance(first.evaluate_quaternion(times)[0], there).max()


@pytest.fixture(scope="module")
def refined():
    problem = crowded()
    start = solve(problem).trajectory
    return problem, start, refine_torque(start, problem, LOPSIDED)


def test_the_motion_of_a_moved_curve_is_its_derivative():
    rng = np.random.default_rng(1)
    q = so3.quaternion_exp(rng.normal(size=(1, 3)))
    v, a = rng.normal(size=(2, 1, 3))
    xi, xi_1, xi_2 = 0.4 * rng.normal(size=(3, 1, 3))
    moved = Motion(q, v, a).moved(xi, xi_1, xi_2)

    def attitude(t):
        # Any curve with this attitude, rate and acceleration, and any rotation vector likewise.
        turn = t * v + 0.5 * t**2 * a + t**3 / 12.0 * np.cross(v, a)
        here = so3.quaternion_multiply(q, so3.quaternion_exp(turn))
        there = so3.quaternion_exp(xi + t * xi_1 + 0.5 * t**2 * xi_2)
        return so3.quaternion_multiply(here, there)

    h = 1e-3
    back, now, ahead = (attitude(t) for t in (-h, 0.0, h))
    ahead, back = (
        so3.quaternion_log(so3.quaternion_multiply(so3.quaternion_conjugate(now), other))
        for other in (ahead, back)
    )
    assert so3.quaternion_distance(moved.q, now) < 1e-15
    assert (ahead - back) / (2.0 * h) == pytest.approx(moved.v, abs=1e-5)
    assert (ahead + back) / h**2 == pytest.approx(moved.a, abs=1e-5)


def test_variations_are_the_derivatives_of_the_cost():
    problem = crowded()
    mesh = SplineMesh(np.linspace(0.0, 1.0, 13))
    cost = TorqueCost(problem, LOPSIDED, mesh.points, mesh.weights)
    trajectory = solve(crowded(3.0)).trajectory  # an extremal of another problem
    q, v, a = trajectory.evaluate_quaternion(mesh.points * 10.0)
    motion = Motion(q, v * 10.0, a * 100.0)
    step = np.random.default_rng(2).normal(size=mesh.unknowns)
    jets = mesh.jets(step / np.abs(mesh.jets(step)[0]).max())
    direction = np.concatenate(jets, axis=1)
    gradient, hessian, model = cost.variations(motion)
    first = mesh.weights @ np.sum(gradient * direction, axis=1)
    second = mesh.weights @ np.einsum("mi,mij,mj->m", direction, hessian, direction)
    errors = []
    for size in (2e-3, 1e-3):
        value = {k: cost.value(motion.moved(*(k * size * jet for jet in jets))) for k in (-1, 0, 1)}
        rate = (value[1] - value[-1]) / (2.0 * size) - first
        bend = (value[1] - 2.0 * value[0] + value[-1]) / size**2 - second
        errors.append((abs(rate), abs(bend) / second))
    slopes = np.log2(np.divide(errors[0], errors[1]))
    assert slopes == pytest.approx(2.0, abs=0.2)
    assert errors[1][1] < 1e-6
    assert np.linalg.eigvalsh(model).min() > -1e-9 * np.abs(model).max()


@pytest.mark.parametrize("moment", [1.0, 7.0])
def test_equal_moments_give_the_answer_of_solve_from_another_curve(moment):
    problem = crowded()
    expected = solve(problem)
    start = solve(crowded(5.0)).trajectory
    assert distance(start, expected.trajectory) > 0.02
    found = refine_torque(start, problem, moment * np.eye(3))
    assert found.cost == pytest.approx(expected.cost, rel=1e-6)
    assert distance(found.trajectory, expected.trajectory) < 1e-6
    assert found.local_minimum


def about(axis, angle, samples=21, duration=8.0):
    """A slew about a body axis, from rest to rest by another profile than the cubic."""
    s = np.linspace(0.0, 1.0, samples)[:, None]
    profile = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    rate = 30.0 * s**2 * (1.0 - s) ** 2 / duration
    change = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / duration**2
    turned = so3.quaternion_exp(profile * angle * axis)
    return Trajectory(s[:, 0] * duration, turned, rate * angle * axis, change * angle * axis)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_slew_about_a_principal_axis_is_the_cubic(axis):
    J = so3.exp([0.3, -0.5, 0.2])
    e, moments = J[:, axis], np.array([1.0, 2.5, 3.3])
    J = (J * moments) @ J.T
    start = about(e, 2.0)
    ends = (State.from_quaternion_xyzw(start.quaternions_xyzw[k]) for k in (0, -1))
    found = refine_torque(start, Problem(*ends, 8.0), J)
    t = np.linspace(0.0, 8.0, 50)
    s = t[:, None] / 8.0
    q, v, a = found.trajectory.evaluate_quaternion(t)
    assert so3.quaternion_distance(q, so3.quaternion_exp(2.0 * s**2 * (3 - 2 * s) * e)).max() < 1e-9
    assert v == pytest.approx(2.0 * 6.0 * s * (1.0 - s) * e / 8.0, abs=1e-9)
    assert a == pytest.approx(2.0 * 6.0 * (1.0 - 2.0 * s) * e / 64.0, abs=1e-9)
    # int (6 theta / T^2)^2 (1 - 2 s)^2 T ds J_e^2 = 12 theta^2 J_e^2 / T^3
    assert found.effort == pytest.approx(12.0 * 4.0 * moments[axis] ** 2 / 512.0, rel=1e-9)
    assert found.first_order_residual < 1e-9


def test_the_cost_is_what_it_says_and_falls(refined):
    problem, start, found = refined
    sigma = problem.sigma
    for trajectory, cost in ((start, found.cost_before), (found.trajectory, found.cost)):
        assert own_cost(trajectory, problem, LOPSIDED, sigma) == pytest.approx(cost, rel=1e-7)
    assert found.cost < 0.98 * found.cost_before
    assert found.certificate.certified


def test_effort_is_never_above_that_of_the_start():
    rng = np.random.default_rng(6)
    for _ in range(8):
        axes = so3.exp(rng.normal(size=3))
        a, b = rng.uniform(1.0, 3.0, 2)
        J = axes @ np.diag([a, b, rng.uniform(abs(a - b) + 0.05, a + b)]) @ axes.T
        states = (State(so3.exp(rng.normal(size=3)), 0.05 * rng.normal(size=3)) for _ in range(2))
        problem = Problem(*states, 10.0)
        found = refine_torque(solve(problem).trajectory, problem, J)
        assert found.solved
        assert found.effort <= found.effort_before
        assert found.effort == pytest.approx(2.0 * found.cost * (np.trace(J) / 3.0) ** 2)
        assert found.first_order_residual < 1e-6


def test_any_admissible_perturbation_raises_the_cost_to_second_order(refined):
    problem, _, found = refined
    trajectory, T = found.trajectory, problem.duration
    s = trajectory.times / T
    motion = Motion(*trajectory.evaluate_quaternion(trajectory.times))
    rng = np.random.default_rng(3)
    for _ in range(2):
        # s^2 (1 - s)^2 times anything keeps place and rate at both ends.
        shape = np.poly1d([1.0, -2.0, 1.0, 0.0, 0.0])
        shapes = [shape * np.poly1d(rng.normal(size=3)) for _ in range(3)]
        jets = [np.stack([np.polyder(p, k)(s) for p in shapes], 1) / T**k for k in range(3)]
        largest = np.abs(jets[0]).max()

        def raised(size, jets=jets, largest=largest):
            moved = motion.moved(*(size / largest * jet for jet in jets))
            curve = Trajectory(trajectory.times, *moved)
            return own_cost(curve, problem, LOPSIDED, problem.sigma) - found.cost

        little, more = raised(0.005), raised(0.01)
        assert little > 0.0
        assert raised(-0.005) > 0.0
        assert np.log2(more / little) == pytest.approx(2.0, abs=0.2)


def test_the_first_order_check_tells_an_extremal_from_what_is_none(refined):
    problem, start, found = refined
    assert found.first_order_residual < 1e-6
    assert torque_extremality(found.trajectory, problem, 3.0 * LOPSIDED) < 1e-6
    assert torque_extremality(found.trajectory.resampled(301), problem, LOPSIDED) < 1e-6
    assert torque_extremality(start, problem, LOPSIDED) > 1e-2
    # With J = I the conditions are those of the ordinary certificate.
    assert torque_extremality(start, problem, np.eye(3)) < 1e-6
    assert torque_extremality(found.trajectory, problem, np.eye(3)) > 1e-2
    assert extremality(found.trajectory, problem) > 1e-2


def test_finer_meshes_agree(refined):
    problem, start, found = refined
    finer = refine_torque(start, problem, LOPSIDED, tolerance=1e-9)
    assert finer.first_order_residual < 0.1 * found.first_order_residual
    assert finer.cost == pytest.approx(found.cost, rel=1e-9)
    assert distance(finer.trajectory, found.trajectory) < 1e-6


def test_another_reference_frame_turns_the_answer(refined):
    _, _, found = refined
    turn = so3.exp([0.7, -1.1, 0.4])
    problem = crowded(turn=turn)
    other = refine_torque(solve(problem).trajectory, problem, LOPSIDED)
    t = np.linspace(0.0, 10.0, 40)
    R, v, _ = found.trajectory.evaluate(t)
    assert other.cost == pytest.approx(found.cost, rel=1e-8)
    assert so3.distance(other.trajectory.evaluate(t)[0], turn @ R).max() < 1e-6
    assert other.trajectory.evaluate(t)[1] == pytest.approx(v, abs=1e-6)


def test_other_body_axes_are_the_same_body(refined):
    _, _, found = refined
    body = so3.exp([-0.2, 0.9, 1.3])
    problem = crowded(body=body)
    other = refine_torque(solve(problem).trajectory, problem, body @ LOPSIDED @ body.T)
    t = np.linspace(0.0, 10.0, 40)
    R = found.trajectory.evaluate(t)[0]
    assert other.cost == pytest.approx(found.cost, rel=1e-8)
    assert so3.distance(other.trajectory.evaluate(t)[0], R @ body.T).max() < 1e-6


def test_slower_is_the_same_path_with_effort_by_the_cube(refined):
    problem, start, found = refined
    slow = 3.0
    ends = (
        replace(s, angular_velocity=s.angular_velocity / slow)
        for s in (problem.start, problem.goal)
    )
    obstacles = tuple(replace(o, rate=o.rate / slow) for o in problem.obstacles)
    slower = Problem(*ends, 30.0, normalized_tension=0.7, obstacles=obstacles)
    stretched = Trajectory(
        slow * start.times,
        start.quaternions_xyzw,
        start.angular_velocities / slow,
        start.angular_accelerations / slow**2,
    )
    other = refine_torque(stretched, slower, LOPSIDED)
    assert other.effort * slow**3 == pytest.approx(found.effort, rel=1e-9)
    assert other.cost * slow**3 == pytest.approx(found.cost, rel=1e-9)


def test_a_published_manoeuvre_of_a_lopsided_body_takes_a_fifth_less_effort():
    problem = read_problem(PROBLEMS / "bevo2_case1.yaml")
    found = refine_torque(solve(problem).trajectory, problem)  # the inertia is that of its limits
    assert found.solved
    assert 0.75 < found.effort / found.effort_before < 0.85
    assert found.first_order_residual < 1e-6
    assert found.local_minimum


def test_what_the_certificate_refuses_is_no_trajectory():
    start = about(np.array([0.0, 0.0, 1.0]), 2.0)
    ends = [State.from_quaternion_xyzw(start.quaternions_xyzw[k]) for k in (0, -1)]
    peak = 1.5 * 2.0 / 8.0  # of the cubic
    for limit, solved in ((0.99 * peak, False), (1.01 * peak, True)):
        problem = Problem(*ends, 8.0, limits=Limits(rate=limit, inertia=LOPSIDED))
        found = refine_torque(start, problem, np.diag([1.0, 2.0, 2.5]))
        assert found.solved is solved
        assert (found.trajectory is not None) is solved
        assert any("rate" in reason for reason in found.certificate.reasons) is not solved


def test_what_can_not_be_refined_is_said():
    problem = crowded()
    start = solve(problem).trajectory
    with pytest.raises(InvalidProblemError, match="inertia"):
        refine_torque(start, problem)
    with pytest.raises(InvalidProblemError, match="no body has"):
        refine_torque(start, problem, np.diag([1.0, 1.0, 3.0]))
    with pytest.raises(InvalidProblemError, match="duration of 20 s"):
        refine_torque(start, replace(problem, duration=20.0), LOPSIDED)
    middle = start.evaluate(5.0)[0]
    blocked = replace(problem, obstacles=(OrientationObstacle(middle, 1.0, radius=0.1),))
    with pytest.raises(InvalidProblemError, match=re.escape("enters a zone")):
        refine_torque(start, blocked, LOPSIDED)
    directions = (State.from_direction(x) for x in np.eye(3)[:2])
    with pytest.raises(InvalidProblemError, match="so3"):
        refine_torque(start, Problem(*directions, 10.0, S2), LOPSIDED)
