# SPDX-License-Identifier: Apache-2.0
"""The demonstration of `make run`: what it says, and that it ends well."""

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")

from riem_planner import certify, solve
from riem_planner.demo.demo import Demonstration, main, problem_of, settings_of
from riem_planner.demo.listener import Flown
from riem_planner.demo.report import achieved_clearance, clearance_table, tracking_error
from riem_planner.geometry import so3
from riem_planner.plots.straight import straight_slew

DEMO = Path(__file__).resolve().parents[2] / "config" / "demo.yaml"


@pytest.fixture(scope="module")
def slew():
    problem = problem_of(settings_of(DEMO))
    return problem, solve(problem).trajectory


def _start(config, picture):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([os.getcwd(), *sys.path[1:]])}
    command = [sys.executable, "-m", "riem_planner.demo.demo"]
    return subprocess.Popen(
        [*command, "--config", str(config), "--picture", str(picture)],
        env=environment, stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip


def _quick(tmp_path, **spacecraft):
    """The demonstration in 2 s, by wheels that are strong enough for it."""
    tree = yaml.safe_load(DEMO.read_text())
    planner = tree["/**"]["ros__parameters"]
    planner |= {"duration": 2.0, "limits.torque": [1.0] * 3, "limits.momentum": [1.0] * 3}
    tree["/**/spacecraft_sim"]["ros__parameters"] |= {
        "wheel_torque": [1.0] * 3, "wheel_momentum": [1.0] * 3, **spacecraft
    }  # fmt: skip
    path = tmp_path / "quick.yaml"
    path.write_text(yaml.safe_dump(tree))
    return path


def test_the_simulated_spacecraft_is_that_of_the_plan():
    tree = yaml.safe_load(DEMO.read_text())
    planner, simulator = (tree[name]["ros__parameters"] for name in tree)
    assert list(tree) == ["/**", "/**/spacecraft_sim"]
    assert simulator["start.orientation"] == planner["start.orientation"]
    assert simulator["inertia"] == planner["inertia"]
    assert simulator["wheel_torque"] == planner["limits.torque"]
    assert simulator["wheel_momentum"] == planner["limits.momentum"]


def test_what_follows_the_plan_achieves_its_clearance(slew):
    problem, trajectory = slew
    times = np.linspace(0.0, trajectory.duration, 2001)
    flown = Flown(times, trajectory.evaluate_quaternion(times)[0])
    achieved, planned = achieved_clearance(problem, flown), certify(trajectory, problem).clearance
    assert achieved.keys() == planned.keys()
    for name, bound in planned.items():
        assert bound <= achieved[name] <= 1.011 * bound  # as near as a certificate is
    assert tracking_error(trajectory, flown) < 1e-12


def test_what_flies_straight_is_seen_inside_the_zones(slew):
    problem, trajectory = slew
    times = np.linspace(0.0, trajectory.duration, 501)
    straight = straight_slew(problem)
    flown = Flown(times, straight.evaluate_quaternion(times)[0])
    for margin in achieved_clearance(problem, flown).values():
        assert np.degrees(margin) == pytest.approx(-4.49, abs=0.01)
    between = so3.quaternion_distance(flown.quaternions, trajectory.evaluate_quaternion(times)[0])
    assert tracking_error(trajectory, flown) == pytest.approx(between.max())


def test_the_table_has_what_was_achieved_only_where_something_flew(slew):
    problem, trajectory = slew
    nothing = Flown(np.zeros(0), np.zeros((0, 4)))
    for flown in (None, nothing):
        table = clearance_table(problem, trajectory, flown)
        assert "achieved" not in table
        assert "tracking error" not in table


def test_a_run_flies_the_plan_and_shows_planned_beside_achieved(tmp_path, capfd, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([os.getcwd(), *sys.path[1:]]))
    picture = tmp_path / "demo.png"
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:  # in this process, which has imported all that takes long
        code = main(["--config", str(_quick(tmp_path)), "--picture", str(picture)])
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    said = "\n".join(capfd.readouterr())
    assert code == 0, said
    assert picture.stat().st_size > 0
    page = picture.with_suffix(".html").read_text(encoding="utf-8")
    assert '"certified":true' in page
    rows = re.findall(r"^(star_tracker_sun|sun_sensors) +(\S+) +(\S+) +(\S+)$", said, re.MULTILINE)
    error = float(re.search(r"tracking error at most (\S+) deg", said)[1])
    assert 0.0 < error < 90.0  # it follows: by less than a machine that stalls for half a second
    assert len(rows) == 2, said
    for _, planned, achieved, straight in rows:
        assert float(achieved) > float(planned) - error - 0.02
        assert float(straight) < 0.0 < float(planned)


def test_a_simulator_that_ends_is_told_once_and_stood_in_for(capfd):
    told = []
    listener = SimpleNamespace(
        reference=None, status=None, is_refused=False, tell_state=told.append
    )  # fmt: skip
    with subprocess.Popen(["sleep", "9"]) as planner, subprocess.Popen(["false"]) as spacecraft:
        spacecraft.wait()
        settings = settings_of(DEMO)
        show = Demonstration(settings, Path(), listener, planner, spacecraft, threading.Event())
        threading.Timer(0.3, planner.kill).start()
        assert show.run() == 1  # no plan ever came
    said = capfd.readouterr().err
    assert said.count("the simulated spacecraft ended; going on without") == 1
    assert "the node ended" in said
    assert len(told) > 1
    assert np.array_equal(told[0], settings.start_orientation)


@pytest.mark.soak
def test_without_a_simulator_it_goes_on_and_ctrl_c_ends_it_with_zero(tmp_path):
    process = _start(_quick(tmp_path, natural_frequency=-1.0), tmp_path / "demo.png")
    said = ""
    for line in process.stdout:
        said += line
        if "certified" in line and "checked here" in line:
            break
    process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=20.0)
    assert process.returncode == 0, said + rest
    assert "the simulated spacecraft ended; going on without" in said
    assert "achieved" not in rest
    assert "Traceback" not in said + rest
