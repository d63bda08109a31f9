# SPDX-License-Identifier: Apache-2.0
"""The node as a process of its own, driven from this one; signals at any moment."""

import signal
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")

from lifecycle_msgs.msg import Transition
from processes import CONFIG, Client, start
from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger


@pytest.fixture
def client():
    found = Client()
    yield found
    found.close()


def test_a_goal_from_another_process_is_flown_and_cancelled(client):
    node = start("-p", "duration:=4.0")
    try:
        client.wait(lambda: client.goals.get_subscription_count() > 0, 60.0)
        client.wait(lambda: client.node.count_services("/riem_planner/cancel") > 0)
        client.send_goal(until=lambda: client.setpoints)
        client.wait(lambda: len(client.setpoints) > 20)
        assert client.call(Trigger, "cancel").success
        client.wait(lambda: client.setpoints[-1].points[0].velocities[0].angular.z == 0.0)
    finally:
        node.send_signal(signal.SIGINT)
        _, log = node.communicate(timeout=10.0)
    assert node.returncode == 0, log


def test_parameters_lifecycle_and_services_answer_another_process(client):
    node = start("-p", "auto_execute:=false", "-p", "duration:=4.0")
    try:
        client.wait(client.parameters.services_are_ready, 60.0)
        # What `ros2 param dump` asks for: one answer to all names, of which none is left out.
        names = client.result(client.parameters.list_parameters()).result.names
        values = client.result(client.parameters.get_parameters(names)).values
        assert dict(zip(names, values, strict=True))["duration"].double_value == 4.0
        unset = dict(zip(names, values, strict=True))["inertia"]
        assert unset.type == ParameterType.PARAMETER_DOUBLE_ARRAY
        described = client.result(client.parameters.describe_parameters(["duration"]))
        assert "[s]" in described.descriptors[0].description
        change = [Parameter("duration", value=5.0), Parameter("planning_budget", value=-1.0)]
        good, bad = client.result(client.parameters.set_parameters(change)).results
        assert good.successful
        assert not bad.successful
        assert "planning_budget" in bad.reason

        client.send_goal(until=lambda: client.told("SHOWN"))
        assert not client.setpoints
        assert client.call(Trigger, "execute").success
        client.wait(lambda: len(client.setpoints) > 20)
        assert client.call(Trigger, "replan").success
        client.wait(lambda: client.statuses[-1].message.startswith("certified; call ~/execute"))

        assert not client.transition(Transition.TRANSITION_ACTIVATE)  # refused, and the node lives
        assert client.state() == "active"
        assert client.transition(Transition.TRANSITION_DEACTIVATE)
        assert client.state() == "inactive"
        client.wait(lambda: client.setpoints[-1].points[0].velocities[0].angular.z == 0.0)
        assert client.transition(Transition.TRANSITION_CLEANUP)
        assert client.transition(Transition.TRANSITION_CONFIGURE)
        assert client.state() == "inactive"
    finally:
        node.send_signal(signal.SIGTERM)
        _, log = node.communicate(timeout=10.0)
    assert node.returncode == 0, log


def _ends_with_zero(number, after, **variables):
    """Send a signal some time [s] after the first line of the log; how long it then takes."""
    # The demonstration, so short that all of it is seen: solve, stream, hold.
    demonstration = ("--params-file", str(CONFIG / "demo.yaml"), "-p", "duration:=1.0")
    node = start(*demonstration, **variables)
    first = node.stderr.readline()
    assert first, "no log"
    time.sleep(after)
    begin = time.monotonic()
    node.send_signal(number)
    _, log = node.communicate(timeout=10.0)
    assert node.returncode == 0, first + log
    return time.monotonic() - begin


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("after", [0.0, 1.0])
def test_a_signal_ends_it_with_code_zero(number, after):
    assert _ends_with_zero(number, after) < 3.0


@pytest.mark.soak
def test_a_signal_at_any_moment_ends_it_with_code_zero_within_a_second():
    rng = np.random.default_rng(4)
    for _ in range(100):
        number = signal.SIGINT if rng.random() < 0.5 else signal.SIGTERM
        after = float(rng.exponential(0.8))
        assert _ends_with_zero(number, after) < 1.0, (number, after)


@pytest.mark.soak
def test_a_signal_while_it_compiles_ends_it_with_code_zero_within_three_seconds(tmp_path):
    rng = np.random.default_rng(5)
    for k in range(10):
        number = signal.SIGINT if rng.random() < 0.5 else signal.SIGTERM
        nothing_compiled = str(tmp_path / str(k))
        after = float(rng.uniform(0.0, 20.0))
        taken = _ends_with_zero(number, after, NUMBA_CACHE_DIR=nothing_compiled)
        assert taken < 3.0, (number, after)


def test_a_wrong_parameter_ends_it_with_a_sentence_and_code_two():
    node = start("-p", "duration:=-1.0")
    _, log = node.communicate(timeout=60.0)
    assert node.returncode == 2
    assert "duration" in log
    assert "Traceback" not in log


def test_an_unknown_parameter_is_reported():
    node = start("-p", "durration:=20.0")
    line = ""
    for line in node.stderr:
        if "durration" in line:
            break
    node.send_signal(signal.SIGTERM)
    node.communicate(timeout=10.0)
    assert "did you mean duration?" in line


def test_an_end_that_hangs_is_cut_off_and_told():
    hangs = (
        "import sys, time; from riem_planner.node import main, planner_node; main.HUNG = 0.5;"
        "planner_node.PlannerNode.close = lambda _: time.sleep(60.0); sys.exit(main.main())"
    )
    node = start(command=["-c", hangs])
    assert node.stderr.readline(), "no log"
    node.send_signal(signal.SIGTERM)
    _, log = node.communicate(timeout=30.0)
    assert node.returncode == 1
    assert "Timeout" in log
    assert "main.py" in log  # where
