# SPDX-License-Identifier: Apache-2.0
"""The descent: exact derivatives of the discretised cost, its linear algebra, saddles."""

import numpy as np
import pytest
from taylor import remainder_order

from riem_planner import S2, SO3, OrientationObstacle, Problem, State, Zone, solve
from riem_planner.extremals import first_biconjugate_time
from riem_planner.geometry import so3
from riem_planner.solver.descent import (
    SADDLES,
    assemble,
    begin_stage,
    descend,
    factor,
    fresh_memory,
    kinetic_stencil,
    positive_definite,
    substitute,
)
from riem_planner.solver.guesses import ways_round
from riem_planner.solver.setup import set_up
from riem_planner.solver.watch import StopFlag

NODES = 9
NEWEST_COST = 7  # of the recent ones in the memory


def slew(space, obstacles=(), tension=2.0, angle=1.4, rates=(0.5, -0.3)):
    start = State(so3.exp([0.3, -0.2, 0.5]), rates[0] * np.array([0.0, 1.0, 0.4]))
    goal = State(start.orientation @ so3.exp([0.0, 0.0, angle]), rates[1] * np.array([0.0, 0.7, 1]))
    return Problem(start, goal, 1.0, space, tension=tension, obstacles=tuple(obstacles))


OBSTACLES = {
    SO3: (
        OrientationObstacle(so3.exp([1.0, 0.4, -0.7]), strength=0.3, rate=[0.1, 0.3, 0.2]),
        Zone([0.1, 0.8, 0.9], 0.2, boresight=[0.0, 1.0, 0.3], strength=0.2),
        Zone([1.0, 0.6, 0.4], 2.0, kind="keep_in", strength=0.2),
    ),
    S2: (
        Zone([0.1, 0.9, -0.6], 0.1, strength=0.3, rate=[0.1, 0.3, 0.2]),
        Zone([1.0, 0.6, 0.4], 2.0, kind="keep_in", strength=0.2),
    ),
}


def assembled(setup, times, q, soft):
    """Cost, gradient (m,) and dense Hessian (m, m) by the interior nodes' perturbations."""
    n = times.size - 1
    gradient = np.empty((n + 1, 3))
    D, L1, L2 = (np.empty((n + 1, 3, 3)) for _ in range(3))
    cost = assemble(
        setup.pointing, setup.table, setup.sigma, times, q, setup.start[4:], setup.goal,
        soft, gradient, D, L1, L2,
    )  # fmt: skip
    return cost, gradient[1:n].ravel(), dense(1, n, D, L1, L2)


def dense(first, last, D, L1, L2):
    """Symmetric matrix of nodes first..last - 1 from its blocks on and below the diagonal."""
    count = last - first
    matrix = np.zeros((3 * count, 3 * count))
    for below, blocks in enumerate((D, L1, L2)):
        for k in range(count - below):
            rows, columns = slice(3 * (k + below), 3 * (k + below + 1)), slice(3 * k, 3 * k + 3)
            matrix[rows, columns] = blocks[first + k]
            matrix[columns, rows] = blocks[first + k].T
    return matrix


def uneven_curve(setup, seed=0):
    """Uneven times, and a wavy curve with both ends of the problem."""
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.4, 1.6, NODES))])
    times /= times[-1]
    guess = ways_round(setup)
    at = np.searchsorted(guess[0], times).clip(0, guess[0].size - 1)
    q = guess[1][0][at].copy()
    q[1:-1] = moved(q, 0.15 * rng.normal(size=(NODES + 1, 3)))[1:-1]
    return times, q


def moved(q, delta):
    return np.ascontiguousarray(so3.quaternion_multiply(q, so3.quaternion_exp(delta)))


@pytest.mark.parametrize("soft", [0.0, 0.35])
@pytest.mark.parametrize("tension", [0.0, 3.0])
@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
@pytest.mark.parametrize("obstacles", [True, False], ids=["obstacles", "free"])
def test_gradient_and_hessian_leave_a_third_order_remainder(space, tension, soft, obstacles):
    setup = set_up(slew(space, OBSTACLES[space] if obstacles else (), tension))
    times, q = uneven_curve(setup)
    cost, gradient, H = assembled(setup, times, q, soft)
    assert np.isfinite(cost)
    np.testing.assert_allclose(H, H.T, atol=1e-12 * np.abs(H).max())
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(10, NODES + 1, 3))
    # Each end's neighbour alone as well: the clamped ends have terms of their own.
    directions[6:] = 0.0
    directions[6, 1] = directions[7, -2] = directions[8, 2] = directions[9, -3] = rng.normal(size=3)
    directions[:, 0] = directions[:, -1] = 0.0
    if space is S2:
        directions[:, :, 2] = 0.0  # the roll is no unknown

    for direction in directions:
        flat = direction[1:-1].ravel()

        def remainder(h, direction=direction, flat=flat):
            change = assembled(setup, times, moved(q, h * direction), soft)[0] - cost
            return [change - h * gradient @ flat - 0.5 * h * h * flat @ H @ flat]

        assert remainder_order(remainder, 0.02, 1e-15 * cost) == pytest.approx(3.0, abs=0.2)


def test_roll_is_no_unknown_on_the_sphere():
    setup = set_up(slew(S2, OBSTACLES[S2]))
    times, q = uneven_curve(setup)
    _, gradient, H = assembled(setup, times, q, 0.0)
    np.testing.assert_array_equal(gradient[2::3], 0.0)
    np.testing.assert_array_equal(H[2::3], np.eye(H.shape[0])[2::3])


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_discretised_cost_converges_to_the_cost_with_order_two(space):
    problem = slew(space, OBSTACLES[space])
    solution = solve(problem)
    setup = set_up(problem)
    nodes = np.array([40, 80, 160])
    errors = []
    for n in nodes:
        s = np.linspace(0.0, 1.0, n + 1)
        times = s + 0.05 * np.sin(2.0 * np.pi * s)
        times[0], times[-1] = 0.0, 1.0
        q = so3.quaternion_multiply(solution.trajectory.evaluate_quaternion(times)[0], setup.body)
        errors.append(assembled(setup, times, setup.with_goal(q), 0.0)[0] - solution.cost)
    orders = np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))
    np.testing.assert_allclose(orders, 2.0, atol=0.2)


def random_blocks(seed, smallest):
    """Blocks of a random pentadiagonal matrix whose smallest eigenvalue is given."""
    rng = np.random.default_rng(seed)
    n = NODES
    D, L1, L2 = rng.normal(size=(3, n + 1, 3, 3))
    D += np.swapaxes(D, 1, 2)
    least = np.linalg.eigvalsh(dense(1, n, D, L1, L2))[0]
    D += (smallest - least) * np.eye(3)
    return D, L1, L2


def factored(D, L1, L2, shift=0.0, stencil=None):
    C, M1, M2 = (np.empty_like(D) for _ in range(3))
    stencil = np.zeros((NODES + 1, 3)) if stencil is None else stencil
    return factor(1, NODES, D, L1, L2, C, M1, M2, shift, stencil), (C, M1, M2)


@pytest.mark.parametrize("seed", range(5))
def test_substitution_solves_the_system_as_numpy_does(seed):
    blocks = random_blocks(seed, 0.1)
    exists, factors = factored(*blocks)
    assert exists
    right = np.random.default_rng(seed).normal(size=(NODES + 1, 3))
    expected = np.linalg.solve(dense(1, NODES, *blocks), right[1:NODES].ravel())
    x = right.copy()
    substitute(1, NODES, *factors, x)
    np.testing.assert_allclose(x[1:NODES].ravel(), expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(x[[0, NODES]], right[[0, NODES]])


@pytest.mark.parametrize("seed", range(20))
def test_factorisation_exists_just_for_positive_definite_matrices(seed):
    assert factored(*random_blocks(seed, 1e-6))[0]
    assert not factored(*random_blocks(seed, -1e-6))[0]


def test_shift_adds_the_kinetic_stencil():
    D, L1, L2 = random_blocks(1, -0.5)
    stencil = np.empty((NODES + 1, 3))
    times = np.linspace(0.0, 1.0, NODES + 1) ** 1.2
    kinetic_stencil(times, stencil)
    shifted = [
        blocks + 0.7 * stencil[:, m, None, None] * np.eye(3) for m, blocks in enumerate((D, L1, L2))
    ]
    exists, (C, M1, M2) = factored(D, L1, L2, 0.7, stencil)
    assert exists
    C = np.tril(C)  # above the diagonal nothing is promised
    lower = np.tril(dense(1, NODES, C + np.tril(C, -1).swapaxes(1, 2), M1, M2))
    np.testing.assert_allclose(
        lower @ lower.T, dense(1, NODES, *shifted), atol=1e-12 * stencil.max()
    )
    # In flat space the second variation of a clamped curve is that of sum mean |x''|^2.
    x = np.zeros(NODES + 1)
    x[1:-1] = np.random.default_rng(0).normal(size=NODES - 1)
    h = np.diff(times)
    mean = 0.5 * (h[1:] + h[:-1])
    second = (np.diff(x)[1:] / h[1:] - np.diff(x)[:-1] / h[:-1]) / mean
    ends = 2.0 * (x[1] ** 2 / h[0] ** 3 + x[-2] ** 2 / h[-1] ** 3)
    matrix = dense(1, NODES, *(stencil[:, m, None, None] * np.eye(3) for m in range(3)))
    assert x[1:-1] @ matrix[::3, ::3] @ x[1:-1] == pytest.approx(mean @ second**2 + ends)


def run(setup, q, soft, side=1.0, most=300, tolerance=1e-10, memory=None, stop=None):
    times = np.arange(q.shape[0]) / (q.shape[0] - 1)
    memory = fresh_memory(q.shape[0]) if memory is None else memory
    cost, iterations, converged = descend(
        setup.pointing, setup.table, setup.sigma, times, q, setup.start[4:], setup.goal,
        soft, tolerance, side, most, memory, (stop or StopFlag()).memory,
    )  # fmt: skip
    return cost, iterations, converged, memory


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_descent_ends_at_a_minimum_and_never_climbs(space):
    setup = set_up(slew(space, OBSTACLES[space]))
    times, guesses = ways_round(setup)
    for guess in guesses[:2]:
        q, memory = guess.copy(), fresh_memory(times.size)
        costs = [assembled(setup, times, q, 0.35)[0]]
        for _ in range(200):
            cost, _, converged, _ = run(setup, q, 0.35, most=1, memory=memory)
            costs.append(cost)
            if converged:
                break
        assert converged
        assert np.all(np.diff(costs) <= 1e-12 * costs[0])
        cost, gradient, H = assembled(setup, times, q, 0.35)
        assert cost == pytest.approx(costs[-1], rel=1e-12)
        assert -gradient @ np.linalg.solve(H, -gradient) <= 1e-8 * cost
        assert np.linalg.eigvalsh(H)[0] > 0.0
        np.testing.assert_array_equal(q[[0, -1]], guess[[0, -1]])


def test_iterations_in_portions_are_the_same_descent():
    setup = set_up(slew(SO3, OBSTACLES[SO3]))
    guess = ways_round(setup)[1][0]
    whole, parts, memory = guess.copy(), guess.copy(), fresh_memory(guess.shape[0])
    cost, iterations, _, _ = run(setup, whole, 0.35)
    for _ in range(iterations + 1):
        last = run(setup, parts, 0.35, most=1, memory=memory)[0]
    assert last == cost
    np.testing.assert_array_equal(parts, whole)


def test_a_stop_flag_is_looked_at_before_each_iteration():
    setup = set_up(slew(SO3, OBSTACLES[SO3]))
    q = ways_round(setup)[1][1]
    assert run(setup, q.copy(), 0.03)[1] > 5
    stop = StopFlag()
    stop.set()
    assert run(setup, q.copy(), 0.03, stop=stop)[1:3] == (0, False)
    # A flag that is raised while the descent runs: a byte of what it writes in an iteration.
    memory = fresh_memory(q.shape[0])
    stop.memory = memory.view(np.uint8)[8 * NEWEST_COST + 7 : 8 * NEWEST_COST + 8]
    assert run(setup, q.copy(), 0.03, memory=memory, stop=stop)[1:3] == (1, False)


def blocked_slew(space):
    """A slew at rest, straight through an obstacle at its middle."""
    obstacle = Zone(so3.exp([0.0, 0.0, 0.6])[:, 0], 0.0, [1.0, 0.0, 0.0], strength=0.5)
    start, goal = State(np.eye(3)), State(so3.exp([0.0, 0.0, 1.2]))
    return Problem(start, goal, 1.0, space, obstacles=(obstacle,)), obstacle


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_a_symmetric_saddle_is_left_both_ways(space):
    problem, obstacle = blocked_slew(space)
    setup = set_up(problem)
    times, guesses = ways_round(setup)
    middle = times.size // 2
    ways, costs = [], []
    for side in (1.0, -1.0):
        q, memory = guesses[0].copy(), fresh_memory(times.size)
        for soft, tolerance in ((0.35, 1e-2), (0.1, 1e-2), (0.03, 1e-2), (0.0, 1e-10)):
            begin_stage(memory)
            cost, _, converged, _ = run(setup, q, soft, side, tolerance=tolerance, memory=memory)
        assert memory[SADDLES] >= 1.0  # it was a saddle
        assert converged
        body_to_user = so3.quaternion_to_matrix(so3.quaternion_conjugate(setup.body))
        R = so3.quaternion_to_matrix(q[middle]) @ body_to_user
        assert obstacle.distance(R) > 0.1
        ways.append(R[2, 0])
        costs.append(cost)
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)
    # Opposite sides of the obstacle, equally far.
    assert ways[0] == pytest.approx(-ways[1], abs=1e-6)
    assert abs(ways[0]) > 0.1


def along_geodesic(space, speed, sigma, duration, nodes=240):
    """Whether the straight slew at constant speed is a minimum, by the discretised Hessian."""
    rate = np.array([0.0, 0.0, speed])
    goal = State(so3.exp(rate * duration), rate)
    problem = Problem(State(np.eye(3), rate), goal, duration, space, tension=sigma)
    setup = set_up(problem)
    times = np.linspace(0.0, 1.0, nodes + 1)
    turn = so3.quaternion_exp(times[:, None] * duration * rate)
    q = np.ascontiguousarray(so3.quaternion_multiply(turn, setup.body))
    return positive_definite(
        setup.pointing, setup.table, setup.sigma, times, q, setup.start[4:], setup.goal
    )


# Section 5 of the mathematics: (a, sigma) and the first biconjugate time.
BICONJUGATE = (
    (1.0, 2.0, 4.730040744862704),
    (1.0, 5.0, 4.069355175139395),
    (1.0, 0.5, 20.275177591916513),
    (0.5, 0.5, 9.460081489725408),
    (0.5, 1.0, 8.380023460992886),
)


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
@pytest.mark.parametrize(("a", "sigma", "last"), BICONJUGATE)
def test_a_geodesic_is_a_minimum_just_until_its_biconjugate_time(space, a, sigma, last):
    assert first_biconjugate_time(a * a, sigma) == pytest.approx(last, rel=1e-14)
    speed = a if space is S2 else 2.0 * a
    assert along_geodesic(space, speed, sigma, 0.99 * last)
    assert not along_geodesic(space, speed, sigma, 1.01 * last)


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_a_geodesic_without_tension_is_always_a_minimum(space):
    for duration in (3.0, 9.0, 20.0):
        assert along_geodesic(space, 1.0, 0.0, duration, nodes=600)
