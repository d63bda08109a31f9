"""The node as a process of its own, driven from this one; signals at any moment."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import ParameterType
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msg_adapters import geometry
from riem_planner.geometry import so3

ROOT = Path(__file__).resolve().parents[2]
CONFIG = Path(__file__).resolve().parents[2] / "config"
Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.2]))


def _start(*arguments, command=("-m", "riem_planner.node.main"), **variables):
    path = os.pathsep.join([os.getcwd(), *sys.path[1:]])
    environment = {**os.environ, "PYTHONPATH": path, **variables}
    return subprocess.Popen(
        [sys.executable, *command, "--ros-args", *arguments],
        env=environment,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )


class Client:
    """A node in this process that talks to the one in the other."""

    def __init__(self):
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("other_process", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.setpoints, self.statuses = [], []
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        listen = self.node.create_subscription
        listen(MultiDOFJointTrajectory, "/riem_planner/setpoint", self.setpoints.append, 10)
        listen(DiagnosticStatus, "/riem_planner/status", self.statuses.append, latched)
        self.goals = self.node.create_publisher(PoseStamped, "/riem_planner/goal", 1)
        self.parameters = AsyncParameterClient(self.node, "/riem_planner")

    def wait(self, condition, seconds=20.0):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "waited in vain"
            self.executor.spin_once(timeout_sec=0.05)

    def result(self, future):
        self.wait(future.done)
        return future.result()

    def call(self, kind, name, **fields):
        service = self.node.create_client(kind, f"/riem_planner/{name}")
        self.wait(service.service_is_ready)
        found = self.result(service.call_async(kind.Request(**fields)))
        self.node.destroy_client(service)
        return found

    def transition(self, number):
        wanted = Transition(id=number)
        return self.call(ChangeState, "change_state", transition=wanted).success

    def state(self):
        return self.call(GetState, "get_state").current_state.label

    def send_goal(self, until):
        """Send it until something is so, as `ros2 topic pub` does, once a second."""
        deadline = time.monotonic() + 300.0
        while not until():
            assert time.monotonic() < deadline
            self.goals.publish(geometry.pose_from_attitude(Z_TURN, 0, "inertial"))
            end = time.monotonic() + 1.0
            while time.monotonic() < end and not until():
                self.executor.spin_once(timeout_sec=0.05)

    def told(self, code):
        return any(v.value == code for m in self.statuses for v in m.values if v.key == "code")

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def client():
    found = Client()
    yield found
    found.close()


def test_a_goal_from_another_process_is_flown_and_cancelled(client):
    node = _start("-p", "duration:=4.0")
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
    node = _start("-p", "auto_execute:=false", "-p", "duration:=4.0")
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
    node = _start(*demonstration, **variables)
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
    node = _start("-p", "duration:=-1.0")
    _, log = node.communicate(timeout=60.0)
    assert node.returncode == 2
    assert "duration" in log
    assert "Traceback" not in log


def test_an_unknown_parameter_is_reported():
    node = _start("-p", "durration:=20.0")
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
    node = _start(command=["-c", hangs])
    assert node.stderr.readline(), "no log"
    node.send_signal(signal.SIGTERM)
    _, log = node.communicate(timeout=30.0)
    assert node.returncode == 1
    assert "Timeout" in log
    assert "main.py" in log  # where
