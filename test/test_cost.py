# SPDX-License-Identifier: Apache-2.0
"""The cost of a given trajectory: against closed forms, and against what the solver tells."""

import numpy as np
import pytest

from riem_planner import (
    SO3,
    OrientationObstacle,
    Problem,
    State,
    Trajectory,
    Zone,
    load_problem,
    solve,
    trajectory_cost,
)
from riem_planner.geometry import so3

START = State.from_quaternion_xyzw([0.0, 0.0, 0.0, 1.0])
GOAL = State.from_quaternion_xyzw([0.0, 0.0, 0.6, 0.8])


def test_of_a_turn_about_one_axis_it_is_the_cubics():
    angle, T, sigma = 2 * np.arctan2(0.6, 0.8), 10.0, 0.3
    s = np.linspace(0.0, 1.0, 41)[:, None]
    turn = np.array([0.0, 0.0, angle])
    trajectory = Trajectory(
        T * s[:, 0],
        so3.quaternion_exp(turn * s**2 * (3 - 2 * s)),
        turn * 6 * s * (1 - s) / T,
        turn * (6 - 12 * s) / T**2,
    )
    cost = trajectory_cost(trajectory, Problem(START, GOAL, T, tension=sigma))
    # 1/2 int |a|^2 = 6 angle^2 / T^3, 1/2 int |v|^2 = 0.6 angle^2 / T
    assert cost == pytest.approx(6 * angle**2 / T**3 + sigma * 0.6 * angle**2 / T, rel=1e-12)


@pytest.mark.parametrize(
    "obstacle",
    [
        Zone(np.array([0.8, 0.6, 0.05]), 0.35, normalized_strength=0.01, name="sun"),
        Zone(np.array([0.8, 0.6, 0.0]), 1.5, kind="keep_in", strength=1e-6, name="sensor"),
        OrientationObstacle(so3.exp([0.3, 0.0, 0.6]), normalized_strength=0.1, name="q"),
    ],
    ids=lambda obstacle: obstacle.kind,
)
def test_of_a_solution_it_is_what_the_solver_tells(obstacle):
    problem = Problem(START, GOAL, 10.0, SO3, normalized_tension=1.0, obstacles=(obstacle,))
    solution = solve(problem)
    assert trajectory_cost(solution.trajectory, problem) == pytest.approx(solution.cost, rel=1e-7)


def test_through_a_zone_it_is_infinite():
    straight = solve(Problem(START, GOAL, 10.0)).trajectory
    sun = Zone(np.array([0.8, 0.6, 0.0]), 0.35, normalized_strength=0.01)
    assert trajectory_cost(straight, Problem(START, GOAL, 10.0, obstacles=(sun,))) == np.inf


def test_a_problem_file_is_loaded_from_the_front_door(tmp_path):
    file = tmp_path / "slew.yaml"
    file.write_text(
        "{space: so3, duration: 10, start: {orientation: [0, 0, 0, 1]},"
        " goal: {orientation: [0, 0, 0.6, 0.8]}}"
    )
    assert load_problem(file).duration == 10.0
