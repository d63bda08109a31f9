# SPDX-License-Identifier: Apache-2.0
"""Direction goals: one axis on its direction, the roll about it free."""

import numpy as np
import pytest
from scipy.integrate import simpson
from taylor import remainder_order

from riem_planner import OrientationObstacle, Problem, State, Zone, solve
from riem_planner.certificate import certify
from riem_planner.geometry import so3, sphere
from riem_planner.geometry.paths import Turning
from riem_planner.goals import PointingGoal
from riem_planner.obstacles.potential import potential
from riem_planner.solver.descent import assemble
from riem_planner.solver.extremal import extremal_near
from riem_planner.solver.guesses import ways_round
from riem_planner.solver.search import local_search
from riem_planner.solver.setup import set_up
from riem_planner.solver.watch import Watch

B = np.array([0.2, -0.3, 0.9])
D = np.array([0.9, 0.3, -0.2])
ZONES = (
    Zone([0.5, 0.9, 0.1], 0.3, boresight=[1.0, 0.0, 0.2], normalized_strength=0.05),
    Zone([0.8, -0.6, 0.5], 0.2, boresight=B, normalized_strength=0.02, rate=[0.0, 0.01, 0.02]),
    OrientationObstacle(so3.exp([0.4, 0.9, 0.9]), normalized_strength=0.01),
)
START = State(so3.exp([0.3, -0.2, 0.5]), [0.02, -0.01, 0.03])


def pointing(zones=ZONES, rate=(0.0, 0.0, 0.0), start=START, **options):
    return Problem(start, PointingGoal(B, Turning(D, rate)), 20.0, obstacles=zones, **options)


def transversality(problem, extremal, setup):
    """`e3 . (m + v' x v)` at the end, and the size of its terms; normalised."""
    _, _, v, a, j = np.split(extremal.states[-1], [4, 4, 7, 10])
    terms = np.array([setup.sigma * v[2], -j[2], np.cross(a, v)[2]])
    return terms.sum(), np.abs(terms).sum() + np.linalg.norm(j)


@pytest.mark.parametrize("hold", [0.0, 30.0], ids=["no hold", "hold"])
def test_discretised_cost_has_exact_derivatives_by_the_last_roll(hold):
    setup = set_up(pointing(rate=[0.01, 0.02, -0.03], hold=hold, normalized_tension=3.0))
    times, guesses = ways_round(setup)
    rng = np.random.default_rng(2)
    n = times.size - 1
    delta = 0.05 * rng.normal(size=(n + 1, 3))
    delta[0] = delta[n, :2] = 0.0

    def at(h, direction):
        q = np.ascontiguousarray(
            so3.quaternion_multiply(guesses[0], so3.quaternion_exp(delta + h * direction))
        )
        gradient, D, L1, L2 = (np.zeros((n + 1, 3, *s)) for s in ((), (3,), (3,), (3,)))
        cost = assemble(
            setup.pointing, setup.table, setup.sigma, times, q, setup.start[4:], setup.goal,
            0.3, gradient, D, L1, L2,
        )  # fmt: skip
        return cost, gradient, D, L1, L2

    # Turns about e3 alone compose; the last two nodes and the last one alone.
    delta[n - 2 :, :2] = 0.0
    directions = np.zeros((2, n + 1, 3))
    directions[0, n, 2] = directions[1, n, 2] = 1.0
    directions[1, n - 2 : n, 2] = 0.7, -0.4
    cost, gradient, D, L1, L2 = at(0.0, directions[0])
    for direction in directions:
        slope = np.sum(gradient[1:] * direction[1:])
        bend = sum(direction[k] @ D[k] @ direction[k] for k in range(1, n + 1))
        bend += 2.0 * sum(direction[k + 1] @ L1[k] @ direction[k] for k in range(1, n))
        bend += 2.0 * sum(direction[k + 2] @ L2[k] @ direction[k] for k in range(1, n - 1))

        def remainder(h, direction=direction, slope=slope, bend=bend):
            return [at(h, direction)[0] - cost - h * slope - 0.5 * h * h * bend]

        assert remainder_order(remainder, 0.02, 1e-15 * cost) == pytest.approx(3.0, abs=0.25)


@pytest.mark.parametrize("rate", [(0.0, 0.0, 0.0), (0.01, 0.02, -0.03)], ids=["rest", "moving"])
def test_end_meets_direction_rate_and_transversality(rate):
    problem = pointing(rate=rate, normalized_tension=2.0)
    setup = set_up(problem)
    watch = Watch(None, None)
    curve = local_search(setup, watch, None).minima[0]
    extremal = extremal_near(setup, curve.times, curve.q, 1e-8, watch)
    residual, scale = transversality(problem, extremal, setup)
    assert abs(residual) < 1e-9 * scale
    solution = solve(problem)
    assert solution.solved
    R, v, _ = solution.trajectory.evaluate(20.0)
    goal = problem.goal.direction
    d, velocity, _ = goal.motion_at(20.0)
    assert sphere.angle(R @ problem.goal.boresight, d) < 1e-9
    np.testing.assert_allclose(R @ v, np.cross(d, velocity), atol=1e-9)


@pytest.mark.parametrize("hold", [0.0, 30.0], ids=["no hold", "hold"])
def test_no_fixed_roll_is_cheaper(hold):
    problem = pointing(rate=[0.005, 0.01, -0.01], hold=hold)
    free = solve(problem)
    assert free.solved
    assert free.local_minimum
    R = free.trajectory.evaluate(20.0)[0]
    w = R @ free.trajectory.evaluate(20.0)[1]
    axis = problem.goal.boresight
    costs = {}
    for roll in (-0.05, -0.02, 0.0, 0.02, 0.05):
        turned = R @ so3.exp(roll * axis)
        fixed = Problem(START, State(turned, turned.T @ w), 20.0, obstacles=ZONES)
        costs[roll] = solve(fixed, search="local", warm_start=free.trajectory).cost
        if hold:
            costs[roll] += held_cost(problem, turned)
    assert costs[0.0] == pytest.approx(free.cost, rel=1e-8)
    # The parabola through them has its vertex at the roll that was found.
    a, b, _ = np.polyfit([-0.02, 0.0, 0.02], [costs[r] for r in (-0.02, 0.0, 0.02)], 2)
    assert a > 0.0
    assert abs(b / (2.0 * a)) < 1e-3
    assert min(costs, key=costs.get) == 0.0


def held_cost(problem, attitude):
    """`1/2 int V dt` over the hold, by Simpson's rule."""
    times = np.linspace(20.0, 20.0 + problem.hold, 201)
    turns = problem.goal.tracked(20.0, times)[0]
    table = set_up(Problem(START, State(attitude), 20.0, obstacles=ZONES)).table
    values = [
        potential(table, t / 20.0, *so3.matrix_to_quaternion(L @ attitude), 0.0)[0]
        for t, L in zip(times, turns, strict=True)
    ]
    return 0.5 * simpson(values, x=times) / 20.0**4


@pytest.mark.parametrize("tension", [0.0, 5.0])
def test_without_zones_from_rest_the_least_rotation_is_the_answer(tension):
    start = State(START.orientation)
    solution = solve(pointing((), start=start, normalized_tension=tension))
    x, d = START.orientation @ B / np.linalg.norm(B), D / np.linalg.norm(D)
    turn = so3.quaternion_log(so3.minimal_rotation(x, d))
    np.testing.assert_allclose(
        solution.trajectory.evaluate(20.0)[0], so3.exp(turn) @ START.orientation, atol=1e-9
    )
    if tension == 0.0:
        assert solution.cost == pytest.approx(6.0 * (turn @ turn) / 20.0**3, rel=1e-9)


def test_opposite_direction_is_reached_by_half_a_turn():
    goal = PointingGoal(B, -START.orientation @ B)
    solution = solve(Problem(State(START.orientation), goal, 20.0))
    assert solution.solved
    assert solution.cost == pytest.approx(6.0 * np.pi**2 / 20.0**3, rel=1e-9)


def test_certificate_takes_any_roll_and_no_other_direction():
    problem = pointing(())
    trajectory = solve(problem).trajectory
    R = trajectory.evaluate(20.0)[0]
    for turn, certified in ((2.0 * B / np.linalg.norm(B), True), (0.01 * np.cross(B, D), False)):
        to = Problem(START, State(R @ so3.exp(turn)), 20.0)
        assert certify(solve(to).trajectory, problem).certified is certified


def test_free_rolls_start_from_several_and_the_cheapest_wins():
    # The roll that the least rotation brings has the tracker in the zone: either side of it.
    goal = PointingGoal([0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    ahead = so3.quaternion_to_matrix(so3.minimal_rotation([0, 0, 1.0], [1.0, 0, 0]))[:, 0]
    zone = Zone(ahead, 0.4, boresight=[1.0, 0.0, 0.0], normalized_strength=0.01)
    solution = solve(Problem(State(np.eye(3)), goal, 20.0, obstacles=(zone,)))
    assert solution.solved
    end = solution.trajectory.evaluate(20.0)[0]
    assert sphere.angle(end[:, 0], ahead) > 0.4
