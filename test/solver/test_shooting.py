# SPDX-License-Identifier: Apache-2.0
"""Multiple shooting: its Newton step, its extremals' invariants, and its error estimate."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from taylor import remainder_order

from benchmark.cases import problem_of
from benchmark.cost import trajectory_cost
from benchmark.random_cases import random_case, random_cases
from riem_planner import S2, SO3, OrientationObstacle, Problem, State, Zone, solve
from riem_planner.extremals import (
    attitude_momentum,
    hamiltonian,
    orientation_momentum,
    pointing_momentum,
)
from riem_planner.geometry import so3, sphere
from riem_planner.obstacles.potential import potential
from riem_planner.solve import published
from riem_planner.solver.curves import mesh_and_states, shift_end
from riem_planner.solver.extremal import INTERVAL, extremal_near
from riem_planner.solver.search import local_search
from riem_planner.solver.setup import set_up
from riem_planner.solver.shooting import advance, newton
from riem_planner.solver.watch import Watch

SEED = 71


def slew(space, obstacles):
    start = State(so3.exp([0.3, -0.2, 0.5]), [0.0, 0.4, -0.3])
    goal = State(start.orientation @ so3.exp([0.0, 0.6, 1.3]), [0.0, 0.3, 0.2])
    return Problem(start, goal, 1.5, space, tension=0.8, obstacles=tuple(obstacles))


ORIENTATION = OrientationObstacle(so3.exp([0.5, 0.3, 1.1]), strength=0.3)
OBSTACLES = {
    SO3: (
        ORIENTATION,
        Zone([0.1, 0.8, 0.9], 0.1, boresight=[0.0, 1.0, 0.3], strength=0.2, rate=[0.1, 0.3, 0.2]),
        Zone([0.5, 0.8, 0.1], 2.0, kind="keep_in", strength=0.2),
    ),
    S2: (
        Zone([0.1, 0.9, -0.6], 0.1, strength=0.3, rate=[0.1, 0.3, 0.2]),
        Zone([0.5, 0.8, 0.1], 2.0, kind="keep_in", strength=0.2),
    ),
}
BOTH = pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])


def on_mesh(problem):
    """A problem's set-up, and the mesh and states where shooting begins."""
    setup = set_up(problem)
    curve = local_search(setup, Watch(None, None), None).minima[0]
    mesh, states = mesh_and_states(
        setup.pointing, setup.table, curve.times, setup.lifted(curve.q), setup.start, setup.goal,
        0.95, 10, 160,
    )  # fmt: skip
    return setup, mesh, states


def newton_step(setup, mesh, states):
    """Defects of whole steps, and the Newton step for them."""
    defects, whole = np.empty((mesh.size - 1, 12)), np.empty((mesh.size - 1, 13))
    step, left = np.empty((2, mesh.size, 12))
    missed = newton(
        setup.pointing, setup.table, setup.sigma, mesh, states, setup.goal,
        defects, False, np.zeros(mesh.size - 1), np.inf, whole, step, left,
    )  # fmt: skip
    assert missed == 0.0
    return defects, step


def goal_error(setup, state):
    """What a last state (13,) misses: (6,) on SO(3), on S^2 direction and velocity (6,)."""
    R, G = (so3.quaternion_to_matrix(q) for q in (state[:4], setup.goal[:4]))
    if not setup.pointing:
        return np.concatenate([so3.log(R.T @ G), setup.goal[4:] - state[4:7]])
    e3 = np.array([0.0, 0.0, 1.0])
    velocities = (A @ np.cross(v, e3) for A, v in ((R, state[4:7]), (G, setup.goal[4:])))
    there, wanted = velocities
    return np.concatenate([sphere.log(R[:, 2], G[:, 2]), wanted - there])


def extremal_of(problem, tolerance=1e-8):
    setup = set_up(problem)
    watch = Watch(None, None)
    curve = local_search(setup, watch, None).minima[0]
    return setup, extremal_near(setup, curve.times, curve.q, tolerance, watch)


@BOTH
def test_newton_step_leaves_a_second_order_remainder(space):
    setup, mesh, states = on_mesh(slew(space, OBSTACLES[space]))
    for _ in range(6):
        advance(states, newton_step(setup, mesh, states)[1], 1.0)
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(mesh.size, 12)) * unknown(setup, mesh.size)

    def remainder(h):
        after = states.copy()
        advance(after, direction, h)
        step = newton_step(setup, mesh, after)[1]
        np.testing.assert_allclose(step[0, :6], 0.0, atol=1e-12)
        advance(after, step, 1.0)
        defects = newton_step(setup, mesh, after)[0]
        return np.concatenate([defects.ravel(), goal_error(setup, after[-1])])

    noise = 1e-15 * np.abs(states).max()
    assert remainder_order(remainder, 0.03, noise) == pytest.approx(2.0, abs=0.2)


def unknown(setup, count):
    """1 for the components of perturbations (count, 12) that are unknowns, else 0."""
    mask = np.ones((count, 12))
    mask[0, :6] = 0.0
    if setup.pointing:
        mask[:, 2::3] = 0.0
    return mask


@BOTH
def test_newton_converges_quadratically(space):
    setup, mesh, states = on_mesh(slew(space, OBSTACLES[space]))
    sizes = []
    for _ in range(8):
        step = newton_step(setup, mesh, states)[1]
        sizes.append(np.abs(step).max())
        advance(states, step, 1.0)
        if sizes[-1] < 1e-10:
            break
    else:
        pytest.fail(f"no convergence: {sizes}")
    assert len(sizes) <= 6
    scale = np.abs(states[:, 4:]).max()
    for before, after in pairwise(sizes[1:]):
        assert after <= max(20.0 * before**2 / scale, 1e-11 * scale)


@BOTH
def test_extremal_meets_both_ends(space):
    setup, extremal = extremal_of(slew(space, OBSTACLES[space]))
    np.testing.assert_allclose(extremal.states[0, :7], setup.start, atol=1e-14)
    np.testing.assert_allclose(goal_error(setup, extremal.states[-1]), 0.0, atol=1e-10)


def test_the_cost_of_an_extremal_that_is_turned_to_another_goal_is_known_to_first_order():
    problem = slew(SO3, OBSTACLES[SO3][:2])
    setup, extremal = extremal_of(problem)
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(5, 6))

    def shifted(direction, h):
        states = extremal.states.copy()
        goal = setup.goal.copy()
        turned = so3.quaternion_exp(h * direction[:3])
        goal[:4] = so3.quaternion_multiply(setup.goal[:4], turned)
        goal[4:] += h * direction[3:]
        added = shift_end(setup.sigma, extremal.times, states, goal)
        np.testing.assert_array_equal(states[-1, :7], goal)
        return added, published(problem, setup, replace(extremal, states=states))

    before = trajectory_cost(problem, shifted(directions[0], 0.0)[1])

    def remainder(h):
        pairs = [shifted(direction, h) for direction in directions]
        scale = problem.duration**-3
        after = np.array([trajectory_cost(problem, trajectory) for _, trajectory in pairs])
        return after - before - scale * np.array([added for added, _ in pairs])

    assert remainder_order(remainder, 0.02, 1e-10 * before) == pytest.approx(2.0, abs=0.2)


def parts(setup, extremal):
    q, v, a, j = np.split(extremal.states, [4, 7, 10], axis=1)
    V = [potential(setup.table, t, *x, 0.0)[0] for t, x in zip(extremal.times, q, strict=True)]
    return so3.quaternion_to_matrix(q), v, a, j, np.array(V)


def assert_constant(values, terms, tolerance=1e-8):
    scale = max(np.abs(term).max() for term in terms)
    np.testing.assert_allclose(values, np.broadcast_to(values[0], values.shape),
                               rtol=0.0, atol=tolerance * scale)  # fmt: skip


@pytest.mark.parametrize(
    "obstacles",
    [
        (ORIENTATION,),
        (Zone([0.1, 0.8, 0.9], 0.1, boresight=[0.0, 1.0, 0.3], strength=0.2),),
        (OrientationObstacle(so3.exp([0.5, 0.3, 1.1]), strength=0.3, radius=0.1, range=(0.4, 2)),),
        (Zone([0.5, 0.8, 0.1], 2.0, kind="keep_in", strength=0.2),),
    ],
    ids=["orientation", "keep_out", "range", "keep_in"],
)
@BOTH
def test_hamiltonian_is_constant_with_fixed_obstacles(space, obstacles):
    if space is S2:
        obstacles = [
            Zone(o.direction, o.half_angle, strength=o.strength, kind=o.kind)
            if isinstance(o, Zone)
            else Zone([0.1, 0.9, -0.6], 0.1, strength=0.3, range=o.range)
            for o in obstacles
        ]
    setup, extremal = extremal_of(slew(space, obstacles))
    _, v, a, j, V = parts(setup, extremal)
    assert_constant(hamiltonian(v, a, j, setup.sigma, V), (a**2, V, v * j))


def test_hamiltonian_is_not_constant_with_a_moving_obstacle():
    setup, extremal = extremal_of(slew(SO3, OBSTACLES[SO3]))
    _, v, a, j, V = parts(setup, extremal)
    H = hamiltonian(v, a, j, setup.sigma, V)
    assert np.ptp(H) > 1e-3 * V.max()


def test_momentum_of_one_orientation_obstacle_is_constant():
    setup, extremal = extremal_of(slew(SO3, (ORIENTATION,)))
    R, v, a, j, _ = parts(setup, extremal)
    M = orientation_momentum(R, v, a, j, ORIENTATION.orientation, setup.sigma)
    assert_constant(M, (j, setup.sigma * v))


def test_momentum_without_obstacles_is_constant():
    setup, extremal = extremal_of(slew(SO3, ()))
    R, v, a, j, _ = parts(setup, extremal)
    assert_constant(attitude_momentum(R, v, j, setup.sigma), (j, setup.sigma * v))
    invariant = np.sum(j * j, axis=1) - setup.sigma * np.sum(a * a, axis=1)
    assert_constant(invariant, (j * j,))


def test_pointing_momentum_is_constant():
    setup, extremal = extremal_of(slew(S2, ()))
    R, v, a, j, _ = parts(setup, extremal)
    assert_constant(pointing_momentum(R, v, a, j, setup.sigma), (j, setup.sigma * v))
    fixed = Zone([0.1, 0.9, -0.6], 0.1, strength=0.3)
    setup, extremal = extremal_of(slew(S2, (fixed,)))
    R, v, a, j, _ = parts(setup, extremal)
    N = pointing_momentum(R, v, a, j, setup.sigma)
    assert_constant(N @ fixed.direction, (j, setup.sigma * v))
    assert np.ptp(N, axis=0).max() > 1e-3 * np.abs(j).max()


TIMES = np.linspace(0.0, 1.0, 701)


def true_errors(case, tolerance=1e-8):
    """Error of an extremal and of its cost, by a mesh four times finer; and its estimate."""
    problem = problem_of(case)
    setup, watch = set_up(problem), Watch(None, None)
    curve = local_search(setup, watch, None).minima[0]
    answer = extremal_near(setup, curve.times, curve.q, tolerance, watch)
    exact = extremal_near(setup, curve.times, curve.q, 1e-10, watch, INTERVAL / 4.0)
    q, p = (
        published(problem, setup, e).evaluate_quaternion(TIMES * problem.duration)[0]
        for e in (answer, exact)
    )
    error = so3.quaternion_distance(q, p).max()
    return error, abs(answer.cost / exact.cost - 1.0), answer


@pytest.mark.parametrize("kind", ["so3", "s2", "cones"])
def test_error_estimate_is_honest_and_the_tolerance_met(kind):
    tolerance, beyond = 1e-8, []
    for case in random_cases(kind, SEED, 20):
        error, cost_error, answer = true_errors(case, tolerance)
        assert max(answer.error, answer.cost_error) <= tolerance, case["name"]
        assert max(error, cost_error) <= tolerance, case["name"]
        beyond.append(error > 2.0 * answer.error)
    # An estimate, not a bound: it may be off by more than a factor of 2 now and then.
    assert np.mean(beyond) <= 0.2


@pytest.mark.parametrize("index", [76, 99])
def test_tolerance_is_met_where_interpolation_rules(index):
    assert true_errors(random_case("cones", SEED, index))[0] <= 1e-8


def test_a_looser_tolerance_takes_fewer_nodes():
    problem = slew(SO3, OBSTACLES[SO3])
    sizes = [solve(problem, tolerance=t).trajectory.times.size for t in (1e-6, 1e-8, 1e-10)]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[2]


def test_what_was_not_reached_is_told():
    solution = solve(slew(SO3, OBSTACLES[SO3]), tolerance=1e-15)
    assert solution.solved
    assert not solution.converged
    assert any("tolerance" in note for note in solution.notes)
