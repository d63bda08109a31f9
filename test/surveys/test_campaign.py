# SPDX-License-Identifier: Apache-2.0
"""Campaigns: every row answered, resumed to the byte, whatever is killed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.extras

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "riem_planner.riem_campaign.command"]
ROWS, BATCH = 90, 5
OPTIONS = ["--batch-rows", str(BATCH), "--samples", "21"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def unit(rng):
    q = rng.normal(size=4)
    return (q / np.linalg.norm(q)).tolist()


def problem(rng, name):
    obstacle = {
        "name": "sun", "kind": "keep_out", "direction": rng.normal(size=3).tolist(),
        "half_angle_deg": 25.0, "normalized_strength": 0.01,
    }  # fmt: skip
    ends = {key: {"orientation": unit(rng)} for key in ("start", "goal")}
    return {"name": name, "space": "so3", "duration": 60.0, "obstacles": [obstacle], **ends}


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    rng = np.random.default_rng(3)
    lines = []
    for i in range(ROWS):
        lines.append("{broken" if i % 30 == 7 else json.dumps(problem(rng, f"row {i}")))
        if i % 20 == 3:
            lines.append("   ")
    path = tmp_path_factory.mktemp("campaign") / "problems.jsonl"
    path.write_text("\n".join(lines) + "\n")
    return path


def run(path, folder, *options, code=0):
    done = subprocess.run(
        [*COMMAND, str(path), "--output", str(folder), *options],
        env=ENVIRONMENT, capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    return done.stderr


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.glob("part-*.parquet"))}


def rows_of(folder):
    from pyarrow import parquet

    parts = [parquet.read_table(path) for path in sorted(folder.glob("part-*.parquet"))]
    return [row for part in parts for row in part.to_pylist()]


@pytest.fixture(scope="module")
def undisturbed(table, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    run(table, folder, "--jobs", "1", *OPTIONS)
    return folder


def test_every_line_that_is_not_blank_is_a_row(undisturbed, table):
    rows = rows_of(undisturbed)
    assert [row["row"] for row in rows] == list(range(ROWS))
    for i, row in enumerate(rows):
        if i % 30 == 7:
            assert row["status"] == "INVALID_PROBLEM"
            assert "JSON" in row["message"]
            continue
        assert row["name"] == f"row {i}"
        assert row["certified"] == (row["status"] == "SOLVED")
        assert " ms" not in row["message"]
        if row["certified"]:
            assert row["zone"] == "sun"
            assert row["clearance_deg"] > 0.0
            assert row["duration"] == 60.0
            assert row["cost"] > 0.0
    statuses = {row["status"] for row in rows}
    assert {"SOLVED", "INVALID_PROBLEM", "START_IN_ZONE"} <= statuses
    assert len(contents(undisturbed)) == ROWS // BATCH
    assert not [*undisturbed.glob(".*")]


def test_the_same_command_changes_nothing_and_another_is_refused(undisturbed, table):
    before = {path: path.stat().st_mtime_ns for path in undisturbed.iterdir()}
    assert "planned now: none" in run(table, undisturbed, "--jobs", "1", *OPTIONS)
    assert before == {path: path.stat().st_mtime_ns for path in undisturbed.iterdir()}
    told = run(table, undisturbed, "--batch-rows", str(BATCH), "--samples", "31", code=2)
    assert "samples" in told
    assert "21" in told
    assert "31" in told


def children(pid):
    """Processes below one, by /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(path.read_text().rsplit(")", 1)[1].split()[1])
        except (OSError, IndexError):
            continue
        if parent == pid:
            child = int(path.parent.name)
            found += [child, *children(child)]
    return found


def workers(pid):
    """The worker processes of a local cluster: those that were spawned."""
    chosen = []
    for child in children(pid):
        try:
            command = (Path("/proc") / str(child) / "cmdline").read_bytes()
        except OSError:
            continue
        if b"spawn_main" in command:
            chosen.append(child)
    return chosen


def wait_until(condition, seconds=120.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def begin_and_kill(table, folder, *, kill_worker):
    """Begin a campaign, kill a worker if asked, then the driver; wait for the workers' end."""
    begun = len(contents(folder))
    driver = subprocess.Popen(
        [*COMMAND, str(table), "--output", str(folder), "--jobs", "2", *OPTIONS],
        env=ENVIRONMENT, stderr=subprocess.DEVNULL,
    )  # fmt: skip

    def grown(parts):
        return len(contents(folder)) > begun + parts or driver.poll() is not None

    wait_until(lambda: grown(1))
    ours = workers(driver.pid)
    if kill_worker and ours:
        os.kill(ours[-1], signal.SIGKILL)
        wait_until(lambda: grown(4))
        ours = workers(driver.pid)
    driver.send_signal(signal.SIGKILL)
    driver.wait()
    wait_until(lambda: not any((Path("/proc") / str(pid)).exists() for pid in ours), 60.0)


def test_worker_and_driver_killed_and_resumed_the_bytes_are_the_same(undisturbed, table, tmp_path):
    begin_and_kill(table, tmp_path, kill_worker=True)
    begin_and_kill(table, tmp_path, kill_worker=False)
    (tmp_path / ".part-000000000000-0123456789abcdef.parquet.x.partial").write_text("half")
    run(table, tmp_path, "--jobs", "2", *OPTIONS)
    assert contents(tmp_path) == contents(undisturbed)
    assert not [*tmp_path.glob(".*")]


def test_on_a_cluster_one_of_whose_workers_is_killed_the_bytes_are_the_same(
    undisturbed, table, tmp_path
):
    dask = [sys.executable, "-m", "dask"]
    place = tmp_path / "scheduler.json"
    quiet = {"env": ENVIRONMENT, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = subprocess.Popen(
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
         "--scheduler-file", str(place)], **quiet,
    )  # fmt: skip
    crew = []
    try:
        wait_until(lambda: place.exists() and place.read_text().strip().endswith("}"))
        for _ in range(2):
            crew.append(
                subprocess.Popen(
                    [*dask, "worker", "--scheduler-file", str(place), "--nthreads", "1",
                     "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"], **quiet,
                )
            )  # fmt: skip
        folder = tmp_path / "out"
        driver = subprocess.Popen(
            [*COMMAND, str(table), "--output", str(folder), "--scheduler",
             json.loads(place.read_text())["address"], *OPTIONS],
            env=ENVIRONMENT, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        wait_until(lambda: folder.exists() and len(contents(folder)) > 1)
        crew[0].send_signal(signal.SIGKILL)
        assert driver.wait(timeout=240) == 0
        assert contents(folder) == contents(undisturbed)
    finally:
        for process in (*crew, scheduler):
            process.kill()
            process.wait()


def test_a_batch_that_workers_die_of_becomes_rows_of_faults(tmp_path, monkeypatch):
    import cloudpickle

    from riem_planner.riem_campaign import engine
    from riem_planner.riem_campaign.parts import Options
    from riem_planner.riem_campaign.rows import Batch

    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    monkeypatch.setattr(engine, "compute_part", die)
    counts = []
    options = Options(21, False, None)
    with engine.local_client(1, print) as client:
        engine.run_batches(
            [Batch(0, (b"a", b"b"))], tmp_path, options, client, lambda _, n: counts.append(n)
        )
    assert counts == [{"INTERNAL_ERROR": 2}]
    assert [row["status"] for row in rows_of(tmp_path)] == ["INTERNAL_ERROR"] * 2


def die(*_):
    os._exit(1)


TEMPLATE = """
space: so3
duration: auto
limits: {rate: 0.01, acceleration: 1.0e-4}
start: {orientation: [0, 0, 0, 1]}
goal: {orientation: [0, 0, 1, 0]}
obstacles:
  - {name: a, kind: keep_out, direction: [0, 1, 0.2], half_angle_deg: 30, normalized_strength: 0.01}
"""


def test_tables_beside_a_template_and_trajectories(tmp_path):
    from pyarrow import csv, parquet

    rng = np.random.default_rng(6)
    names = [f"{key}_{part}" for key in ("start", "goal") for part in "xyzw"]
    lines = [",".join(["name", *names])]
    for i in range(6):
        numbers = [repr(x) for _ in range(2) for x in unit(rng)]
        if i == 2:
            numbers[3] = "wide"
        lines.append(",".join([f"slew {i}", *numbers]))
    (tmp_path / "slews.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "template.yaml").write_text(TEMPLATE)
    more = ["--problem", str(tmp_path / "template.yaml"), "--trajectories", "--samples", "21"]
    run(tmp_path / "slews.csv", tmp_path / "a", "--jobs", "1", *more)
    rows = rows_of(tmp_path / "a")
    assert [row["name"] for row in rows] == [f"slew {i}" for i in range(6)]
    assert rows[2]["status"] == "INVALID_PROBLEM"
    assert "wide" in rows[2]["message"]
    for row in rows:
        if row["certified"]:
            assert row["times"][-1] == pytest.approx(row["duration"])
            assert np.shape(row["orientations_xyzw"])[1] == 4
            assert len(row["times"]) >= 21
        else:
            assert row["times"] is None
    assert sum(row["certified"] for row in rows) >= 2
    (tmp_path / "good.csv").write_text("\n".join(lines[:3] + lines[4:]) + "\n")
    parquet.write_table(csv.read_csv(tmp_path / "good.csv"), tmp_path / "good.parquet")
    for name in ("good.csv", "good.parquet"):
        run(tmp_path / name, tmp_path / name.replace(".", "-"), "--jobs", "1", *more)
    assert contents(tmp_path / "good-csv") == contents(tmp_path / "good-parquet")
    (tmp_path / "bad.csv").write_text("start_x,start_y\n1,2\n")
    assert "start_z" in run(tmp_path / "bad.csv", tmp_path / "b", *more, code=2)
    assert "--problem" in run(tmp_path / "good.csv", tmp_path / "c", code=2)
