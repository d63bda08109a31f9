# SPDX-License-Identifier: Apache-2.0
"""`riem_plan --least-torque`: what it writes, what it says, and what it refuses."""

import json
import re
from pathlib import Path

import pytest

from riem_planner import Limits, solve
from riem_planner.files.problem_files import read_problem
from riem_planner.riem_plan import command
from riem_planner.riem_plan.least_torque import with_least_torque

PROBLEMS = Path(__file__).resolve().parents[2] / "config" / "problems"
BEVO = PROBLEMS / "bevo2_case2.yaml"


def test_the_cheapest_by_torque_of_all_paths_is_planned_and_passes_the_check(tmp_path, capsys):
    output = tmp_path / "plan.json"
    assert command.main([str(BEVO), "--least-torque", "--output", str(output)]) == command.SOLVED
    said = capsys.readouterr().err
    assert "least torque: int |u|^2 dt" in said
    plan = json.loads(output.read_text(encoding="utf-8"))
    assert plan["certified"]
    assert plan["local_minimum"]
    assert plan["trajectory_error"] is None  # an estimate is not made
    assert any("least torque" in note for note in plan["notes"])
    # An alternative by acceleration takes less than half of the torque.
    effort, before = re.search(r"dt (\S+) N.* by least acceleration (\S+);", said).groups()
    assert float(effort) < 0.5 * float(before)
    assert command.main([str(BEVO), "--certificate-only", str(output)]) == command.SOLVED


def test_a_refused_path_leaves_that_of_least_acceleration():
    problem = read_problem(PROBLEMS / "bevo2_case3.yaml")
    solution = solve(problem)
    tight = Limits(rate=1e-6, inertia=problem.limits.inertia)
    object.__setattr__(problem, "limits", tight)
    kept = with_least_torque(problem, solution)
    assert kept.trajectory is solution.trajectory
    assert kept.cost == solution.cost
    assert "least torque was refused" in kept.notes[-1]
    assert "rate" in kept.notes[-1]


POINTING = "{space: s2, duration: 9, start: {direction: [1, 0, 0]}, goal: {direction: [0, 1, 0]}}"
WITH_INERTIA = (PROBLEMS / "shen_yue_goh_2018.yaml").read_text(encoding="utf-8")
WITHOUT_INERTIA = WITH_INERTIA[: WITH_INERTIA.index("limits:")]


@pytest.mark.parametrize(("text", "told"), [(WITHOUT_INERTIA, "inertia"), (POINTING, "space")])
def test_without_an_inertia_or_on_s2_it_is_refused_by_name(text, told, tmp_path, capsys):
    path = tmp_path / "problem.yaml"
    path.write_text(text, encoding="utf-8")
    assert command.main([str(path), "--least-torque"]) == command.WRONG_FILE
    assert f"problem.yaml: {told}: " in capsys.readouterr().err


def test_a_batch_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        command.main([str(PROBLEMS / "textbook.jsonl"), "--least-torque"])
    assert ended.value.code == 2
    assert "--least-torque" in capsys.readouterr().err
