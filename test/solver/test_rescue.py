# SPDX-License-Identifier: Apache-2.0
"""An answer before an extremal, and extremals that leave or reach an edge."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from riem_planner import S2, SO3, Problem, State, Zone, certify, solve
from riem_planner.files.problem_files import parse_problem
from riem_planner.geometry import so3
from riem_planner.riem_plan.planning import plan_problem
from riem_planner.solve import _cost_of
from riem_planner.solver import rescue
from riem_planner.solver.search import local_search
from riem_planner.solver.setup import set_up
from riem_planner.solver.splines import splined
from riem_planner.solver.watch import Watch

DATA = Path(__file__).parent / "data"


def cases(name):
    return [json.loads(line) for line in (DATA / f"{name}.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("case", cases("edges"), ids=lambda case: case["name"])
def test_ends_near_an_edge_still_or_moving_are_solved_and_their_cost_is_right(case):
    problem = parse_problem(case)
    solution = solve(problem)
    assert solution.solved
    assert solution.converged
    assert solution.cost <= case["best_known_cost"] * (1.0 + 1e-6)
    own = _cost_of(problem, set_up(problem), solution.trajectory) / problem.duration**3
    assert own == pytest.approx(solution.cost, rel=1e-6)
    assert plan_problem(problem).certified


# On S^2 at 1e-5 degrees the solution is certified, but no even samples of it are: known and open.
@pytest.mark.parametrize(
    ("space", "margin_deg"), [(SO3, 1e-5), (SO3, 1e-3), (SO3, 1e-2), (S2, 1e-3), (S2, 1e-2)]
)
def test_a_start_at_rest_at_an_edge_is_left_straight_and_round_the_zone(space, margin_deg):
    zone = Zone([1.0, 0.0, 0.0], 0.5, [1.0, 0.0, 0.0], normalized_strength=0.01)
    angle = 0.5 + np.radians(margin_deg)
    start = State(so3.exp([0.0, 0.0, angle]))
    for goal in (so3.exp([0.0, 0.0, 1.5]), so3.exp([0.0, 0.2, -1.2])):
        problem = Problem(start, State(goal), 60.0, space, obstacles=(zone,))
        plan = plan_problem(problem)
        assert plan.certified, plan.solution.message


@pytest.mark.parametrize("case", cases("half-turns"), ids=lambda case: case["name"])
def test_half_turns_past_a_weak_zone_are_answered(case):
    solution = solve(parse_problem(case))
    assert solution.solved
    assert solution.cost <= case["best_known_cost"] * (1.0 + 1e-3)
    if not solution.converged:
        assert "no extremal" in solution.message


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_a_splined_curve_is_certified_and_costs_what_it_says(space):
    rate = [0.0, 0.1, -0.2]
    zone = Zone([0.7, 0.7, 0.1], 0.3, [1.0, 0.0, 0.0], normalized_strength=0.01)
    start, goal = State(np.eye(3), rate), State(so3.exp([0.0, 0.3, 1.5]), rate)
    problem = Problem(start, goal, 2.0, space, obstacles=(zone,))
    setup, watch = set_up(problem), Watch(None, None)
    curve = local_search(setup, watch, None).minima[0]
    times, states = splined(setup, curve.times, curve.q)
    assert times.size == 2 * curve.times.size - 1
    v, a = states[:, 4:7], states[:, 7:10]
    step = np.diff(v, axis=0) - 0.5 * np.diff(times)[:, None] * (a[1:] + a[:-1])
    assert np.abs(step).max() < 1e-3 * np.abs(v).max()
    answer = rescue.as_answer(setup, curve)
    assert not answer.settled
    solution = solve(problem)
    assert answer.cost == pytest.approx(solution.cost * problem.duration**3, rel=0.02)


def test_a_certified_warm_start_is_an_answer_where_nothing_else_is(monkeypatch):
    zone = Zone([0.7, 0.7, 0.1], 0.3, [1.0, 0.0, 0.0], normalized_strength=0.01)
    problem = Problem(State(np.eye(3)), State(so3.exp([0.0, 0.0, 1.5])), 2.0, obstacles=(zone,))
    flown = solve(problem).trajectory
    monkeypatch.setattr(sys.modules["riem_planner.solve"], "extremal_near", lambda *_: None)
    longer = replace(problem, duration=3.0)
    for search in ("local", "global"):
        solution = solve(longer, warm_start=flown, search=search)
        assert solution.solved
        assert not solution.converged
        assert "the warm start" in solution.message
        assert certify(solution.trajectory, longer).certified
        cost = _cost_of(longer, set_up(longer), solution.trajectory) / longer.duration**3
        assert solution.cost == pytest.approx(cost, rel=1e-9)


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
def test_a_small_move_that_obstacles_push_far_out_says_so(space):
    zone = Zone([1.0, 0.0, 0.0], 0.8, [1.0, 0.0, 0.0], normalized_strength=0.01)
    start = State(so3.exp([0.0, 0.0, 0.82]))
    dither = Problem(start, State(so3.exp([0.0, 0.0, 0.822])), 60.0, space, obstacles=(zone,))
    said = [note for note in solve(dither).notes if "obstacles push this move" in note]
    assert len(said) == 1
    slew = replace(dither, goal=State(so3.exp([0.0, 0.0, 2.0])))
    assert not any("obstacles push" in note for note in solve(slew).notes)
