# SPDX-License-Identifier: Apache-2.0
"""Obstacles on the way: both sides of a symmetric saddle, and a value whatever happens."""

import numpy as np
import pytest

from riem_planner import Status
from riem_planner.manifolds import GeneralProblem, GeneralState, PointObstacle, solve_general
from riem_planner.manifolds.lie_groups import (
    euclidean,
    special_orthogonal,
    special_unitary,
)
from riem_planner.manifolds.symmetric_spaces import real_grassmannian, unit_sphere

SPACES = [
    special_orthogonal(3),
    special_unitary(2, scale=2.0),
    euclidean(3),
    unit_sphere(2),
    unit_sphere(3),
    real_grassmannian(1, 3),
    real_grassmannian(2, 4),
]


def on_the_way(space, length=1.0, strength=0.01, share=0.5, aside=0.0):
    """Rest to rest along the first axis, with an obstacle on the geodesic."""
    first, second = np.eye(space.dimension)[:2]
    return GeneralProblem(
        space,
        GeneralState(space.identity),
        GeneralState(space.exp(length * first)),
        1.0,
        obstacles=(PointObstacle(space.exp(share * length * first + aside * second), strength),),
    )


@pytest.mark.parametrize("space", SPACES, ids=str)
def test_obstacle_on_the_geodesic_is_passed(space):
    solution = solve_general(on_the_way(space), detours=0, both_sides=False)
    assert solution.solved, solution.message
    assert 6.0 < solution.cost < 7.0  # 6 without the obstacle; the long way round costs 167
    assert max(solution.boundary_error) < 1e-9
    assert solution.clearance_proven
    assert 0.0 < solution.clearance["0"] < 0.2


def test_cost_of_the_paper_s_own_case_is_that_of_the_compiled_solver():
    costs = [
        solve_general(on_the_way(space), detours=0).cost
        for space in (special_orthogonal(3), special_unitary(2, scale=2.0))
    ]
    assert costs[0] == pytest.approx(6.407, abs=1e-3)
    assert costs[1] == pytest.approx(costs[0], rel=1e-9)


def test_family_round_an_obstacle_is_no_strict_minimum():
    solution = solve_general(on_the_way(euclidean(3)), detours=0)
    assert solution.local_minimum is False
    assert "family" in solution.message
    alone = solve_general(on_the_way(unit_sphere(2)), detours=0)
    assert alone.local_minimum is True
    assert alone.notes == ()


@pytest.mark.parametrize("aside", [0.01, -0.01])
def test_both_sides_of_a_near_saddle_are_tried_and_the_cheaper_is_kept(aside):
    problem = on_the_way(unit_sphere(2), share=0.4, aside=aside)
    solution = solve_general(problem, detours=0)
    (other, _), *_ = solution.alternatives
    assert solution.cost < other < 1.1 * solution.cost
    # It passes on the side that the obstacle is not on.
    g = solution.trajectory.evaluate(0.4)[0]
    towards = problem.space.between(g, problem.obstacles[0].element)
    assert np.sign(towards[1]) == np.sign(aside)


@pytest.mark.parametrize("space", [unit_sphere(2), euclidean(2)], ids=str)
@pytest.mark.parametrize("distance", [1e-6, 1e-3])
def test_obstacle_at_the_start_gives_a_value(space, distance):
    first = np.eye(space.dimension)[0]
    problem = GeneralProblem(
        space,
        GeneralState(space.identity),
        GeneralState(space.exp(first)),
        1.0,
        obstacles=(PointObstacle(space.exp(distance * first), 0.01),),
    )
    solution = solve_general(problem, detours=0, both_sides=False)
    assert solution.status in (Status.SOLVED, Status.NO_CERTIFIED_TRAJECTORY)


def test_deadline_returns_the_best_found_so_far():
    problem = on_the_way(special_orthogonal(3))
    full = solve_general(problem, detours=4)
    # The first extremal takes about a third of the time.
    part = solve_general(problem, detours=4, deadline=0.7 * full.solve_time)
    assert full.converged
    assert part.solved
    assert not part.converged
    assert part.cost == full.cost
    assert "the deadline passed" in part.message
