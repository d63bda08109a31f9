# SPDX-License-Identifier: Apache-2.0
"""The benchmark runs, its tables have their rows, and its peers solve the stated problem."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmark import cases, comparison, cost, hard_cases, random_cases
from benchmark.__main__ import main
from benchmark.hard import judged, run
from benchmark.own import moved
from benchmark.peers import shooting
from benchmark.peers.collocation import Collocation
from riem_planner import Trajectory, solve


@pytest.fixture(scope="module")
def quick_results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmark")
    assert main(["--quick", "--output", str(folder)]) == 0
    return folder


def test_quick_run_has_the_row_of_every_method_and_measurement(quick_results):
    text = (quick_results / "results.md").read_text()
    for name in (
        "riem_planner, one class",
        "riem_planner, all classes",
        "SciPy solve_bvp, tol 0.001",
        "SciPy solve_bvp, tol 1e-06",
        "random-cones",
        "obstacle",
        "goal",
        "from the cache",
    ):
        assert f"| {name} |" in text
    if shooting.available():
        assert "| CasADi + IPOPT, N = 50 |" in text
        assert "| CasADi + IPOPT, N = 200 |" in text
    else:
        assert comparison.NO_CASADI in text


def test_results_describe_the_machine_and_name_no_path(quick_results):
    content = json.loads((quick_results / "results.json").read_text())
    assert {"processor", "cores", "python", "numpy"} <= set(content["machine"])
    assert "/" not in json.dumps(content["machine"])


def test_without_casadi_the_table_says_so_and_goes_on(monkeypatch):
    monkeypatch.setattr(shooting, "available", lambda: False)
    table = comparison.comparison("textbook", cases.load("textbook")[:1], 1, set())
    assert comparison.NO_CASADI in table.note
    assert [row["method"] for row in table.rows][-1] == "SciPy solve_bvp, tol 1e-06"


@pytest.mark.parametrize("name", ["P2", "P4", "P6"])
def test_collocation_jacobians_are_those_of_its_functions(name):
    case = next(c for c in cases.load("textbook") if c["name"] == name)
    peer = Collocation(cases.problem_of(case))
    n, step = 4 + 3 * peer.basis.shape[1], 1e-6
    y = np.random.default_rng(0).normal(size=(n, 2))
    slope = peer.right_side_slope(None, y)
    first, last = peer.ends_slope(y[:, 0], y[:, 1])
    for i in range(n):
        d = np.zeros(n)
        d[i] = step
        difference = peer.right_side(None, y + d[:, None]) - peer.right_side(None, y - d[:, None])
        scale = max(1.0, np.abs(slope).max())
        assert np.allclose(slope[:, i], difference / (2 * step), atol=1e-7 * scale)
        at_start = peer.ends(y[:, 0] + d, y[:, 1]) - peer.ends(y[:, 0] - d, y[:, 1])
        at_goal = peer.ends(y[:, 0], y[:, 1] + d) - peer.ends(y[:, 0], y[:, 1] - d)
        assert np.allclose(first[:, i], at_start / (2 * step), atol=1e-7)
        assert np.allclose(last[:, i], at_goal / (2 * step), atol=1e-7)


@pytest.mark.parametrize("case", cases.load("textbook"), ids=lambda case: case["name"])
def test_collocation_reaches_the_best_known_cost(case):
    problem = cases.problem_of(case)
    answer = Collocation(problem).solve(1e-6)
    assert cost.cost_of(problem, answer.curve, answer.mesh) == pytest.approx(
        case["best_known_cost"], rel=1e-7
    )


@pytest.mark.parametrize("case", cases.load("textbook"), ids=lambda case: case["name"])
def test_shooting_reaches_the_best_known_cost(case):
    pytest.importorskip("casadi")
    problem = cases.problem_of(case)
    answer = shooting.Shooting(problem, 50).solve()
    assert cost.cost_of(problem, answer.curve, answer.mesh) == pytest.approx(
        case["best_known_cost"], rel=1e-5
    )


def test_cases_are_the_same_on_every_call_and_differ_by_seed():
    for kind in random_cases.KINDS:
        assert random_cases.random_cases(kind, 3, 2) == random_cases.random_cases(kind, 3, 2)
        assert random_cases.random_case(kind, 3, 0) != random_cases.random_case(kind, 4, 0)
    for name, make in hard_cases.makers().items():
        assert make(0) == make(0), name


def test_hard_sets_are_what_they_are_called():
    makers, grid = hard_cases.makers(), hard_cases.SphereGrid()
    for index in range(3):
        half_turn = cases.problem_of(makers["slew 180"](index))
        start, goal, b = half_turn.start, half_turn.goal, half_turn.boresight
        if half_turn.space.name == "s2":
            assert np.allclose(start.orientation @ b, -goal.orientation @ b, atol=1e-15)
        else:
            assert np.trace(start.orientation.T @ goal.orientation) == pytest.approx(-1, abs=1e-14)
        on_path = makers["on the path"](index)
        near = [
            cost.clearances(
                cases.problem_of(on_path), _straight(on_path, fraction)[None], np.zeros(1)
            )[0, 0]
            for fraction in np.linspace(0.0, 1.0, 2001)
        ]
        assert min(near) < 1e-3
        zones = makers["zones 60 %"](index)["obstacles"]
        assert 0.6 <= grid.covered(zones).mean() < 0.7
        sealed = makers["sealed"](index)
        ends = (np.array(sealed[end]["direction"]) for end in ("start", "goal"))
        assert not grid.connects(sealed["obstacles"], *ends)


def _straight(case, fraction):
    if case["space"] == "so3":
        return random_cases.straight_slew(case, fraction)
    direction = random_cases.straight_slew(case, fraction)
    return cases.State.from_direction(direction).quaternion_xyzw


def test_a_trajectory_moved_off_its_ends_or_into_an_obstacle_is_called_wrong():
    case = cases.load("textbook")[0]
    solution = solve(cases.problem_of(case))
    assert judged(case, solution) == []
    t = solution.trajectory
    late = np.concatenate([t.quaternions_xyzw[:1], t.quaternions_xyzw[:-1]])
    shifted = Trajectory(t.times, late, t.angular_velocities, t.angular_accelerations)
    assert any("misses an end" in fault for fault in cost.faults(cases.problem_of(case), shifted))
    middle = t.evaluate_quaternion(0.5 * t.duration)[0]
    blocked = {**case["obstacles"][0], "orientation": middle.tolist(), "radius_deg": 1.0}
    problem = cases.problem_of({**case, "obstacles": [blocked]})
    assert any("forbidden set" in fault for fault in cost.faults(problem, t))


def test_a_sealed_goal_is_refused_with_a_reason():
    outcome = run([hard_cases.makers()["sealed"](0)])
    assert not outcome.wrong
    assert "NO_CERTIFIED_TRAJECTORY" in outcome.refused[0][1]


@pytest.mark.parametrize("what", ["goal", "obstacle"])
@pytest.mark.parametrize("name", cases.SETS)
def test_moved_means_by_one_degree_and_nothing_else(name, what):
    case = cases.load(name)[0]
    other = moved(case, what, 5)
    assert case == cases.load(name)[0]
    changed = [other["goal"]] if what == "goal" else other["obstacles"]
    before = [case["goal"]] if what == "goal" else case["obstacles"]
    key = "orientation" if "orientation" in before[0] else "direction"
    angles = [
        (2 if key == "orientation" else 1)
        * np.arctan2(np.linalg.norm(np.subtract(a[key], b[key])), np.dot(a[key], b[key]))
        for a, b in zip(changed, before, strict=True)
    ]
    assert max(angles) == pytest.approx(np.radians(1.0), rel=1e-3)
    assert cases.problem_of(other)
