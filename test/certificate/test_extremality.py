# SPDX-License-Identifier: Apache-2.0
"""The residual of the first-order conditions tells extremals from other curves."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from curves import problem_of, random_quaternion, replaced, slew
from scipy.integrate import solve_ivp

from riem_planner import S2, SO3, OrientationObstacle, Problem, State, Trajectory, Zone, certify
from riem_planner.geometry import so3

SPACES = pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
T = 1.5


def obstacles_for(space, rate=0.0):
    turning = rate * np.array([0.1, -0.2, 0.3])
    zones = (
        Zone([-0.4, 0.9, 0.3], 0.2, strength=0.5, name="plain", rate=turning),
        Zone([0.1, -0.8, 0.5], 0.2, strength=0.5, name="tapered", range=(0.8, 2.5)),
        Zone([1.0, 0.2, 0.4], 2.6, strength=0.5, kind="keep_in", group="g", rate=turning),
        Zone([0.8, -0.2, -0.4], 2.8, strength=0.2, kind="keep_in", group="g"),
        Zone([0.9, 0.1, -0.1], 2.9, strength=0.5, kind="keep_in", name="alone"),
    )
    if space == S2:
        return zones
    Q = so3.exp([0.6, -0.9, 0.5])
    return (*zones, OrientationObstacle(Q, strength=0.5, radius=0.1, name="q", rate=turning))


@cache
def integrated(space, samples, rate=0.0, tension=0.7):
    """An extremal by its initial values, and the boundary-value problem it solves."""
    state = State(np.eye(3), [0.0, 0.7, -0.3])
    problem = Problem(state, state, T, space, tension, obstacles=obstacles_for(space, rate))
    b = problem.boresight

    def field(t, y):
        q, v, a, j = y[:4], y[4:7], y[7:10], y[10:]
        _, force = problem.forbidden.repulsion(so3.quaternion_to_matrix(q)[None], t, T)
        if space == S2:
            snap = np.cross(np.cross(a, v), v) + tension * a - (force[0] - (force[0] @ b) * b)
        else:
            snap = np.cross(j, v) + tension * a - force[0]
        return np.concatenate([0.5 * so3.quaternion_multiply(q, [*v, 0.0]), a, j, snap])

    roll = 0.0 if space == S2 else 0.4
    first = [*state.quaternion_xyzw, *state.angular_velocity, roll, 0.3, 0.2, -roll, 0.2, -0.3]
    t = np.linspace(0.0, T, samples)
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12, "max_step": t[1]}
    y = solve_ivp(field, (0.0, T), first, t_eval=t, **options).y.T
    q = y[:, :4] / np.linalg.norm(y[:, :4], axis=1, keepdims=True)
    trajectory = Trajectory(t, q, y[:, 4:7], y[:, 7:10])
    return trajectory, replace(problem, goal=State.from_quaternion_xyzw(q[-1], y[-1, 4:7]))


@SPACES
def test_force_is_half_the_gradient_of_the_potential(space):
    rng = np.random.default_rng(0)
    problem = Problem(
        State(np.eye(3)), State(np.eye(3)), T, space, obstacles=obstacles_for(space, 1)
    )
    t = np.full(1, 0.7)
    compared = 0
    while compared < 30:
        R = so3.quaternion_to_matrix(random_quaternion(rng))[None]
        if min(problem.margins(R[0], 0.7).values()) < 0.1:
            continue
        compared += 1
        _, F = problem.forbidden.repulsion(R, t, T)
        direction = rng.normal(size=3)
        step = 1e-5

        def at(x, R=R, direction=direction):
            return problem.forbidden.repulsion(R @ so3.exp(x * direction), t, T)[0][0]

        slope = (8 * (at(step) - at(-step)) - (at(2 * step) - at(-2 * step))) / (12 * step)
        assert 2.0 * F[0] @ direction == pytest.approx(slope, rel=1e-7, abs=1e-8)


@SPACES
@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_an_extremal_has_a_residual_of_the_interpolation_only(space, rate):
    trajectory, problem = integrated(space, 31, rate)
    certificate = certify(trajectory, problem)
    assert certificate.certified
    assert 0.0 < certificate.extremality < 1e-6
    if rate == 0.0:
        assert 0.0 < certificate.invariant_drift < 1e-6
    else:
        assert certificate.invariant_drift is None


@SPACES
@pytest.mark.parametrize(
    "change",
    [
        {"tension": 0.8},
        {"obstacles": ()},
        {"space": None},
    ],
    ids=["tension", "obstacles", "space"],
)
def test_an_extremal_of_another_problem_has_not(space, change):
    trajectory, problem = integrated(space, 31)
    if "space" in change:
        if space == SO3:
            pytest.skip("an extremal with roll is no problem of S^2")
        change = {"space": SO3}
    certificate = certify(trajectory, replace(problem, **change))
    assert certificate.extremality > 1e-3


@SPACES
def test_each_obstacle_is_felt(space):
    trajectory, problem = integrated(space, 31)
    for obstacle in problem.obstacles:
        stronger = replace(obstacle, strength=1.2 * obstacle.strength)
        obstacles = tuple(stronger if o is obstacle else o for o in problem.obstacles)
        other = certify(trajectory, replace(problem, obstacles=obstacles))
        assert other.extremality > 2e-5, obstacle.name
        assert other.invariant_drift > 2e-5, obstacle.name


@SPACES
def test_residual_and_drift_fall_with_the_fourth_power_of_the_step(space):
    def figures(samples):
        trajectory, problem = integrated(space, samples)
        certificate = certify(trajectory, problem)
        return np.array([certificate.extremality, certificate.invariant_drift])

    order = np.log2(figures(31) / figures(61))
    assert order[0] == pytest.approx(4.0, abs=0.2)
    assert order[1] > 3.0  # down to the noise of the integration


def test_the_cubic_is_an_extremal_and_a_slower_start_is_not():
    trajectory = slew()
    certificate = certify(trajectory, problem_of(trajectory))
    assert certificate.extremality < 1e-12
    assert certificate.invariant_drift < 1e-10
    times = trajectory.times
    assert certify(trajectory, problem_of(trajectory, tension=1.0)).extremality > 0.1
    bent = replaced(trajectory, times=times + 0.3 * np.sin(np.pi * times / 10.0) ** 2)
    assert certify(bent, problem_of(bent)).extremality > 0.01


def test_a_trajectory_at_rest_is_an_extremal():
    q, rest = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)), np.zeros((3, 3))
    hold = Trajectory([0.0, 1.0, 5.0], q, rest, rest)
    certificate = certify(hold, problem_of(hold))
    assert certificate.extremality == 0.0
    assert certificate.invariant_drift == 0.0


def test_inside_a_zone_the_residual_is_not_a_number_and_nothing_is_raised():
    trajectory = slew()
    zone = Zone([1, 0, 0], 0.5, [1, 0, 0], strength=1.0, kind="keep_in", name="left")
    certificate = certify(trajectory, problem_of(trajectory, (zone,)))
    assert not certificate.certified
    assert np.isnan(certificate.extremality)
