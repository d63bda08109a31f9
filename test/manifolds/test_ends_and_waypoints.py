# SPDX-License-Identifier: Apache-2.0
"""Points to pass, free ends, other potentials and moving obstacles, by the first variation.

The cost of a varied curve is computed from the curve alone: group elements are multiplied by
`exp(epsilon xi(t))` and differentiated by differences of high order.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from riem_planner import InvalidProblemError
from riem_planner.manifolds import (
    GeneralProblem,
    GeneralState,
    OwnPotential,
    Plateau,
    PointObstacle,
    Waypoint,
    solve_general,
)
from riem_planner.manifolds.lie_groups import euclidean, special_orthogonal, special_unitary
from riem_planner.manifolds.repulsion import Repulsion
from riem_planner.manifolds.symmetric_spaces import unit_sphere

V0, V1 = np.array([0.3, 0.8, -0.4]), np.array([-0.5, 0.2, 0.9])
X1, XM = np.array([0.9, -0.7, 0.4]), np.array([0.5, 0.3, 0.2])


def problem(space, **changes):
    values = {
        "start": GeneralState(space.identity, V0),
        "goal": GeneralState(space.exp(X1), V1),
        "duration": 1.5,
        "tension": 0.4,
    }
    return GeneralProblem(space, **(values | changes))


def solved(stated, **options):
    solution = solve_general(stated, detours=0, **options)
    assert solution.solved, solution.message
    assert max(solution.boundary_error) < 1e-9
    return solution


def cost_of(space, curve, stated, pieces):
    """The cost of a curve g(t) on a group or R^n, from its elements alone."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    total, h = 0.0, 1e-3
    repulsion = Repulsion(space, stated.obstacles)
    for begin, end in pairwise(pieces):
        t = begin + 0.5 * (end - begin) * (nodes + 1.0)
        g = curve(t)
        steps = {k: space.between(g, curve(t + k * h)) for k in (-2, -1, 1, 2)}
        v = (steps[-2] - 8 * steps[-1] + 8 * steps[1] - steps[2]) / (12 * h)
        a = (-steps[-2] + 16 * steps[-1] + 16 * steps[1] - steps[2]) / (12 * h**2)
        density = np.sum(a**2 + stated.tension * v**2, axis=1) + repulsion.potential(g, t)
        total += 0.25 * (end - begin) * float(weights @ density)
    return total


def variation(solution, shapes, epsilon=1e-4):
    """Largest derivative of the cost by steps `shape(t)` (k, n) of the curve."""
    stated = solution.trajectory.problem
    space, T = stated.space, stated.duration
    pieces = [0.0, *(w.time for w in stated.waypoints), T]

    def at(t):
        # Differences reach a little beyond the ends, where the jets go on.
        inner = np.clip(t, 0.0, T)
        g, v, a, j = solution.trajectory.evaluate_state(inner)
        d = (t - inner)[:, None]
        return g @ space.exp(d * v + d**2 / 2 * a + d**3 / 6 * j)

    def cost(sign, shape):
        return cost_of(
            space, lambda t: at(t) @ space.exp(sign * epsilon * shape(t)), stated, pieces
        )

    return max(abs(cost(1.0, x) - cost(-1.0, x)) / (2.0 * epsilon) for x in shapes)


DIRECTION = np.array([0.4, -0.7, 0.6])


def bump(T, *zeros):
    """s^2 (1 - s)^2 and a simple zero at each further time."""

    def shape(t):
        s = t / T
        value = 16.0 * s**2 * (1.0 - s) ** 2
        for zero in zeros:
            value = value * (t - zero)
        return value[:, None] * DIRECTION

    return shape


@pytest.mark.parametrize(
    "space", [special_orthogonal(3), special_unitary(2), euclidean(3)], ids=str
)
def test_waypoint_is_passed_and_the_rest_is_stationary(space):
    stated = problem(
        space,
        waypoints=(Waypoint(space.exp(XM), 0.6),),
        obstacles=(PointObstacle(space.exp(0.3 * XM + [0.0, 0.0, 0.4]), 0.02),),
    )
    solution = solved(stated)
    trajectory = solution.trajectory
    assert space.gap(trajectory.evaluate(0.6)[0], space.exp(XM)) < 1e-9
    before, after = (trajectory.evaluate_state(0.6 + d) for d in (-1e-9, 1e-9))
    for k in (1, 2):  # C^2: rate and acceleration, while v'' jumps
        np.testing.assert_allclose(before[k], after[k], atol=1e-6)
    assert np.linalg.norm(before[3] - after[3]) > 0.1
    assert variation(solution, [bump(1.5, 0.6)]) < 1e-5
    # A variation that moves the waypoint changes the cost: it is not the plain problem's answer.
    assert variation(solution, [bump(1.5)]) > 1e-2


@pytest.mark.parametrize("space", [special_orthogonal(3), unit_sphere(3)], ids=str)
def test_waypoint_on_the_answer_changes_nothing(space):
    plain = solved(problem(space))
    g, v, _ = plain.trajectory.evaluate(0.6)
    through = solved(problem(space, waypoints=(Waypoint(g, 0.6),)))
    assert through.cost == pytest.approx(plain.cost, rel=1e-9)
    turned = space.in_frame(space.inverse(g) @ through.trajectory.evaluate(0.6)[0], v)
    np.testing.assert_allclose(through.trajectory.evaluate(0.6)[1], turned, atol=1e-8)


def test_free_end_rate_has_no_acceleration_and_is_stationary():
    space = special_orthogonal(3)
    solution = solved(problem(space, goal=GeneralState(space.exp(X1), None)))
    np.testing.assert_allclose(solution.trajectory.evaluate(1.5)[2], 0.0, atol=1e-9)
    assert solution.cost < solved(problem(space)).cost

    def swing(t):  # place stays at both ends, the rate at the start alone
        s = t[:, None] / 1.5
        return s**2 * (1.0 - s) * DIRECTION

    assert variation(solution, [bump(1.5), swing]) < 1e-5
    assert variation(solved(problem(space)), [swing]) > 1e-2


def test_free_start_rate_in_flat_space_is_the_natural_cubic():
    space = euclidean(3)
    solution = solved(
        problem(
            space,
            tension=0.0,
            start=GeneralState(space.identity, None),
            goal=GeneralState(space.exp(X1), None),
        )
    )
    assert solution.cost == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(solution.trajectory.evaluate(0.75)[0][:3, 3], X1 / 2, atol=1e-9)


def test_goal_that_may_roll_is_stationary_along_the_subgroup():
    space = special_orthogonal(3)
    roll = np.array([[1.0, 0.0, 0.0]])
    stated = problem(space, goal=GeneralState(space.exp(X1), V1, along=roll))
    solution = solved(stated)
    assert solution.cost < solved(problem(space)).cost
    g, v, _, j = solution.trajectory.evaluate_state(1.5)
    turn = space.between(space.exp(X1), g)
    np.testing.assert_allclose(turn[1:], 0.0, atol=1e-9)
    assert abs(turn[0]) > 1e-3
    assert (0.4 * v - j)[0] == pytest.approx(0.0, abs=1e-8)
    # No roll of the goal is cheaper.
    for more in (-0.05, 0.05):
        end = space.exp(X1) @ space.exp((turn[0] + more) * roll[0])
        assert solved(problem(space, goal=GeneralState(end, V1))).cost > solution.cost


def test_directions_that_span_no_subalgebra_are_refused():
    space = special_orthogonal(3)
    with pytest.raises(InvalidProblemError, match=r"goal\.along.*subalgebra"):
        problem(space, goal=GeneralState(space.exp(X1), V1, along=np.eye(3)[:2]))


@pytest.mark.parametrize(
    "potential",
    [
        Plateau(2.0, 0.4, 3),
        Plateau(1.0, 0.5, 1),
        OwnPotential(lambda d: (np.exp(-d * d), -2 * d * np.exp(-d * d),
                                (4 * d * d - 2) * np.exp(-d * d)), 0.9),
    ],
    ids=["plateau", "Cauchy", "Gauss"],
)  # fmt: skip
def test_other_potentials_are_stationary(potential):
    space = special_orthogonal(3)
    obstacle = PointObstacle(space.exp(0.5 * X1 + [0.0, 0.1, 0.1]), potential=potential)
    solution = solved(problem(space, obstacles=(obstacle,)))
    assert variation(solution, [bump(1.5), bump(1.5, 0.7)]) < 1e-5
    assert solution.clearance_proven


def test_own_potential_with_a_wrong_derivative_is_refused():
    space = special_orthogonal(3)
    wrong = OwnPotential(lambda d: (np.exp(-d), np.exp(-d), np.exp(-d)))
    with pytest.raises(InvalidProblemError, match=r"obstacles\[0\]\.potential.*expected V'"):
        problem(space, obstacles=(PointObstacle(space.exp(XM), potential=wrong),))


def test_own_potential_without_a_bound_has_a_sampled_clearance():
    space = euclidean(2)
    own = OwnPotential(lambda d: (np.exp(-d), -np.exp(-d), np.exp(-d)))
    solution = solve_general(
        GeneralProblem(
            space,
            GeneralState(space.identity),
            GeneralState(space.exp(np.array([1.0, 0.0]))),
            1.0,
            obstacles=(PointObstacle(space.exp(np.array([0.5, 0.2])), potential=own),),
        ),
        detours=0,
    )
    assert not solution.clearance_proven
    assert "sampled" in solution.message


def test_plateau_keeps_the_clearance_that_it_guarantees():
    space = euclidean(2)
    shape = Plateau(20000.0, 0.3, 6)
    solution = solve_general(
        GeneralProblem(
            space,
            GeneralState(space.identity),
            GeneralState(space.exp(np.array([1.0, 0.0]))),
            1.0,
            obstacles=(PointObstacle(space.exp(np.array([0.5, 0.02])), potential=shape),),
        ),
        detours=0,
    )
    promised = shape.clearance(solution.cost, 0.0, 1.0)
    assert promised > 0.05
    assert solution.clearance["0"] >= promised
    assert Plateau(1.0, 0.3).clearance(solution.cost, 0.0, 1.0) == 0.0


@pytest.mark.parametrize("space", [special_orthogonal(3), euclidean(3)], ids=str)
def test_moving_obstacle_is_stationary_and_kept_off_where_it_is(space):
    rate = np.array([0.0, 0.3, -0.5])
    obstacle = PointObstacle(space.exp(0.4 * X1 + [0.0, 0.0, 0.2]), 0.02, 0.05, "q", rate=rate)
    solution = solved(problem(space, obstacles=(obstacle,)))
    assert variation(solution, [bump(1.5), bump(1.5, 0.7)]) < 1e-5
    t = np.linspace(0.0, 1.5, 400)
    turn = expm(space.algebra(rate) * t[100])
    place = turn @ obstacle.element
    g = solution.trajectory.evaluate(t)[0]
    d = Repulsion(space, (obstacle,)).distances(g, t)[0][:, 0]
    assert d[100] == pytest.approx(float(space.distance(g[100], place)), abs=1e-12)
    assert 0.0 < solution.clearance["q"] <= d.min() - 0.05
    assert solution.clearance_proven


def test_warm_start_finds_the_same():
    space = special_orthogonal(3)
    stated = problem(space, obstacles=(PointObstacle(space.exp(0.5 * X1), 0.02),))
    first = solved(stated)
    again = solved(stated, warm_start=first.trajectory)
    assert again.cost == pytest.approx(first.cost, rel=1e-8)
