# SPDX-License-Identifier: Apache-2.0
"""What the search begins with: every way round, and bounds that are none too high."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmark.random_cases import random_cases
from riem_planner import S2, SO3, Problem, State, solve
from riem_planner.files.problem_files import parse_problem
from riem_planner.geometry import so3
from riem_planner.solver.guesses import all_guesses
from riem_planner.solver.search import unhindered
from riem_planner.solver.setup import set_up
from riem_planner.solver.watch import Watch

DATA = Path(__file__).parent / "data"


def cases(name):
    return [json.loads(line) for line in (DATA / f"{name}.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("case", cases("rates"), ids=lambda case: case["name"])
def test_the_cheapest_way_of_fast_ends_is_found(case):
    solution = solve(parse_problem(case))
    assert solution.solved
    assert solution.cost <= case["best_known_cost"] * (1.0 + 1e-6)


def test_the_cost_without_obstacles_is_a_lower_bound_of_the_answer():
    for case in [c for kind in ("so3", "s2", "cones") for c in random_cases(kind, 5, 8)]:
        problem = parse_problem(case)
        setup = set_up(problem)
        watch = Watch(None, None)
        ways = unhindered(setup, watch, all_guesses(setup))
        costs = [way.minimum.cost for way in ways]
        assert costs == sorted(costs)
        # Coarse nodes are good to a percent.
        assert costs[0] <= 1.02 * solve(problem).cost * problem.duration**3


def test_the_least_bound_does_not_depend_on_the_direction_of_time():
    rng = np.random.default_rng(3)
    for space in (SO3, S2):
        problem = Problem(random_state(rng, space), random_state(rng, space), 1.0, space)
        back = Problem(backwards(problem.goal), backwards(problem.start), 1.0, space)
        ways, mirrored = (
            unhindered(s, Watch(None, None), all_guesses(s))[0].minimum.cost
            for s in (set_up(problem), set_up(back))
        )
        assert ways == pytest.approx(mirrored, rel=1e-6)


def random_state(rng, space):
    v = rng.normal(scale=8.0, size=3)
    if space is S2:
        v[0] = 0.0
    return State(so3.quaternion_to_matrix(so3.quaternion_exp(rng.normal(scale=2.0, size=3))), v)


def backwards(state):
    return replace(state, angular_velocity=-state.angular_velocity)
