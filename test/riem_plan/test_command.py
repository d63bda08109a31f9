# SPDX-License-Identifier: Apache-2.0
"""The `riem_plan` command: exit codes, streams, batches, interruptions."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from riem_planner.files.output import partial_path, whole_file
from riem_planner.riem_plan import batch, command, planning
from riem_planner.riem_plan.batch import plan_line
from riem_planner.solution import Solution, Status

ROOT = Path(__file__).resolve().parents[2]
TEXTBOOK = ROOT / "config/problems/textbook.jsonl"
LINES = TEXTBOOK.read_text(encoding="utf-8").splitlines()
COMMAND = [sys.executable, "-m", "riem_planner.riem_plan.command"]


def run(*arguments, **options):
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
        **options,
    )


def without_times(text):
    """Plans of the lines of a text, without what differs from run to run."""
    plans = [json.loads(line) for line in text.splitlines()]
    for plan in plans:
        plan.pop("solve_time_s")
        plan["message"] = re.sub(r"[-+.e0-9]+ ms", "", plan["message"])
    return plans


@pytest.fixture
def problem(tmp_path):
    path = tmp_path / "problem.json"
    path.write_text(LINES[1], encoding="utf-8")
    return path


@pytest.fixture
def batch_file(tmp_path):
    """Good, blank, broken, bad, good, bad on its own terms, good."""
    inside = json.loads(LINES[3])
    inside["obstacles"][0]["half_angle_deg"] = 179.0
    path = tmp_path / "problems.jsonl"
    lines = [LINES[0], "", "{", '{"name": "odd", "spaec": "so3"}', LINES[1], json.dumps(inside)]
    path.write_text("\n".join([*lines, LINES[2], ""]), encoding="utf-8")
    return path


def test_process_writes_plan_and_figure_and_exits_0(problem, tmp_path):
    output, figure = tmp_path / "plan.json", tmp_path / "plan.png"
    done = run(problem, "--output", output, "--plot", figure)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "certified" in done.stderr
    assert json.loads(output.read_text(encoding="utf-8"))["certified"] is True
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["plan.json", "plan.png", "problem.json"]


def test_process_plans_a_batch_in_order_with_two_jobs(batch_file, tmp_path):
    output = tmp_path / "plans.jsonl"
    done = run(batch_file, "--output", output, "--jobs", "2")
    assert done.returncode == command.WRONG_FILE, done.stderr
    assert "6/6" in done.stderr  # the progress bar
    plans = without_times(output.read_text(encoding="utf-8"))
    assert [plan["name"] for plan in plans] == ["P1", None, "odd", "P2", "P6", "P4"]
    assert [plan["status"] for plan in plans] == [
        "SOLVED", "INVALID_PROBLEM", "INVALID_PROBLEM", "SOLVED", "START_IN_ZONE", "SOLVED",
    ]  # fmt: skip
    assert "line 3: line 1, column 2: not JSON" in plans[1]["message"]
    assert "line 4: spaec: unknown key" in plans[2]["message"]
    assert "line 6: start.orientation" in plans[4]["message"]
    assert len({frozenset(plan) - {"least_clearance_time"} for plan in plans if plan["times"]}) == 1


def test_process_interrupted_in_a_batch_ends_cleanly(tmp_path):
    path, output = tmp_path / "problems.jsonl", tmp_path / "plans.jsonl"
    path.write_text("\n".join(LINES * 5000), encoding="utf-8")
    with subprocess.Popen(
        [*COMMAND, str(path), "--output", str(output), "--jobs", "2"],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            wait_for_content(partial_path(output), process)
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does, workers included
            _, said = process.communicate(timeout=60)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == command.INTERRUPTED, said
    assert "Traceback" not in said
    assert "plans.jsonl.partial" in said
    assert not output.exists()
    assert all_gone(process.pid)


def wait_for_content(path, process):
    """Wait until a file has content, and fail if the process ends before."""
    deadline = time.monotonic() + 90.0
    while not (path.exists() and path.stat().st_size > 0):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)


def all_gone(group):
    """Whether no process of a group is left, workers included, after five seconds at most."""
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def test_process_ends_quietly_when_its_reader_leaves():
    line = f"{' '.join(COMMAND)} {TEXTBOOK} | head -c 10 >&2; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", line], cwd=ROOT, capture_output=True, text=True, timeout=110, check=False
    )
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


def test_plan_goes_to_standard_output(problem, capsys):
    assert command.main([str(problem)]) == command.SOLVED
    plan = json.loads(capsys.readouterr().out)
    assert (plan["name"], len(plan["times"])) == ("P2", 201)


def test_same_problem_gives_the_same_bits(problem, capsys):
    texts = []
    for _ in range(2):
        command.main([str(problem)])
        texts.append(capsys.readouterr().out)
    assert without_times(texts[0]) == without_times(texts[1])


def test_workers_give_the_same_bits_as_one_process():
    # Both in processes that load the kernels: one that compiles them may differ in the last bit.
    texts = []
    for jobs in ("1", "2"):
        run = subprocess.run(
            [sys.executable, "-m", "riem_planner.riem_plan.command", str(TEXTBOOK), "--jobs", jobs],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        texts.append(run.stdout)
    assert without_times(texts[0]) == without_times(texts[1])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("space: so3\nduraton: 1", "duraton: unknown key (its value is 1); did you mean duration?"),
        ("space: [", "line 1, column 9: not YAML"),
        ("", "document: expected a mapping"),
    ],
)
def test_wrong_file_is_code_2(tmp_path, capsys, text, words):
    path = tmp_path / "problem.yaml"
    path.write_text(text, encoding="utf-8")
    output = tmp_path / "plan.json"
    assert command.main([str(path), "--output", str(output)]) == command.WRONG_FILE
    said = capsys.readouterr()
    assert f"{path}: {words}" in said.err
    assert said.out == ""
    assert not output.exists()


def test_start_in_a_zone_is_code_2(tmp_path, capsys):
    document = json.loads(LINES[3])
    document["obstacles"][0]["half_angle_deg"] = 179.0
    path = tmp_path / "problem.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert command.main([str(path)]) == command.WRONG_FILE
    assert "start.orientation: [0.0, 0.0, 0.0, 1.0] is" in capsys.readouterr().err


def test_goal_in_a_zone_found_only_by_the_solve_is_code_2(problem, monkeypatch):
    # As with `duration: auto`, where a moving zone's place at the end is not known beforehand.
    refusal = Solution(Status.GOAL_IN_ZONE, "the goal is inside the zone")
    monkeypatch.setattr(planning, "solve", lambda *_, **__: refusal)
    assert command.main([str(problem)]) == command.WRONG_FILE


def test_sealed_off_goal_is_code_3_and_never_written_as_certified(tmp_path, capsys):
    # The boresight starts within a ring of zones that overlap.
    ring = [[-0.5, 0.866], [-0.5, -0.866], [1.0, 0.0]]
    document = {
        "space": "s2",
        "duration": 10.0,
        "start": {"direction": [1.0, 0.0, 0.0]},
        "goal": {"direction": [-1.0, 0.0, 0.0]},
        "obstacles": [
            {"kind": "keep_out", "direction": [0.3, *place], "half_angle_deg": 65.0,
             "normalized_strength": 0.01}
            for place in ring
        ],
    }  # fmt: skip
    path, output = tmp_path / "problem.json", tmp_path / "plan.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert command.main([str(path), "--output", str(output)]) == command.NO_TRAJECTORY
    assert "no certified trajectory" in capsys.readouterr().err
    plan = json.loads(output.read_text(encoding="utf-8"))
    assert plan["certified"] is False
    assert plan["times"] == []
    assert plan["message"]


def test_missing_file_is_code_2(tmp_path, capsys):
    assert command.main([str(tmp_path / "none.yaml")]) == command.WRONG_FILE
    assert "none.yaml" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["p.yaml", "--samples", "1"],
        ["p.yaml", "--jobs", "0"],
        ["p.jsonl", "--plot", "a.png"],
        ["p.yaml", "--output", "no/such/folder/plan.json"],
        ["p.yaml", "--certificate-only", "plan.json", "--output", "a.json"],
    ],
)
def test_wrong_option_is_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)
    assert ended.value.code == command.WRONG_FILE
    assert "usage:" in capsys.readouterr().err


@pytest.fixture
def plan(problem, tmp_path):
    path = tmp_path / "plan.json"
    assert command.main([str(problem), "--output", str(path)]) == command.SOLVED
    return path


def test_check_of_a_plan_is_code_0(problem, plan, capsys):
    assert command.main([str(problem), "--certificate-only", str(plan)]) == command.SOLVED
    assert f"{plan}: certified" in capsys.readouterr().out
    assert command.main(["--certificate-only", str(plan)]) == command.SOLVED


def test_check_of_a_tampered_plan_is_code_3(problem, plan, capsys):
    document = json.loads(plan.read_text(encoding="utf-8"))
    document["orientations_xyzw"][100][0] += 0.01
    plan.write_text(json.dumps(document), encoding="utf-8")
    assert command.main([str(problem), "--certificate-only", str(plan)]) == command.NO_TRAJECTORY
    assert f"{plan}: not certified" in capsys.readouterr().out


def test_check_against_another_problem_is_code_3(tmp_path, plan):
    other = tmp_path / "other.json"
    other.write_text(LINES[0], encoding="utf-8")
    assert command.main([str(other), "--certificate-only", str(plan)]) == command.NO_TRAJECTORY


def test_check_of_a_plan_without_trajectory_is_code_3(plan, capsys):
    document = json.loads(plan.read_text(encoding="utf-8"))
    document["times"] = []
    plan.write_text(json.dumps(document), encoding="utf-8")
    assert command.main(["--certificate-only", str(plan)]) == command.NO_TRAJECTORY
    assert "holds no trajectory" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["{}", "3", "{", '{"times": 3}'])
def test_check_of_what_is_no_plan_is_code_2(problem, tmp_path, capsys, text):
    path = tmp_path / "plan.json"
    path.write_text(text, encoding="utf-8")
    assert command.main([str(problem), "--certificate-only", str(path)]) == command.WRONG_FILE
    assert str(path) in capsys.readouterr().err


def test_check_of_a_batch_pairs_the_lines(tmp_path, capsys):
    plans = tmp_path / "plans.jsonl"
    assert command.main([str(TEXTBOOK), "--output", str(plans)]) == command.SOLVED
    arguments = [str(TEXTBOOK), "--certificate-only", str(plans)]
    assert command.main(arguments) == command.SOLVED
    lines = plans.read_text(encoding="utf-8").splitlines()
    plans.write_text("\n".join([lines[1], lines[0], *lines[2:]]), encoding="utf-8")
    assert command.main(arguments) == command.NO_TRAJECTORY
    assert "line 1: not certified" in capsys.readouterr().out
    plans.write_text("\n".join(lines[:3]), encoding="utf-8")
    assert command.main(arguments) == command.WRONG_FILE


def test_fault_of_the_planner_costs_one_line_alone(monkeypatch):
    def fail(*_):
        raise FloatingPointError("boom")

    monkeypatch.setattr(batch, "plan_problem", fail)
    line = plan_line(7, LINES[0].encode(), 201)
    assert line.status == "INTERNAL_ERROR"
    assert json.loads(line.text)["message"] == "line 7: FloatingPointError: boom"


def test_lines_are_read_only_as_they_are_needed(monkeypatch):
    monkeypatch.setattr(batch, "plan_line", lambda number, *_: batch.PlannedLine(str(number), "S"))
    drawn = []

    def lines():
        for number in range(1, 1001):
            drawn.append(number)
            yield number, b"{}"

    planned = batch.plan_lines(lines(), samples=201, jobs=1)
    assert next(planned).text == "1"
    assert len(drawn) == 1


def test_output_appears_only_when_it_is_whole(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text("old", encoding="utf-8")
    failing = whole_file(path)
    failing.__enter__().write("half")
    assert not failing.__exit__(RuntimeError, RuntimeError(), None)
    assert path.read_text(encoding="utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["plan.json"]
    with whole_file(path) as stream:
        stream.write("new")
    assert path.read_text(encoding="utf-8") == "new"


def test_output_through_a_link_keeps_the_link(tmp_path):
    target, link = tmp_path / "target.json", tmp_path / "link.json"
    target.write_text("old", encoding="utf-8")
    link.symlink_to(target)
    with whole_file(link) as stream:
        stream.write("new")
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == "new"


def test_output_to_a_device_leaves_the_device(problem):
    assert command.main([str(problem), "--output", "/dev/null"]) == command.SOLVED
    assert Path("/dev/null").is_char_device()
