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
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msg_adapters import geometry
from riem_planner.geometry import so3

ROOT = Path(__file__).resolve().parents[2]
CONFIG = Path(__file__).resolve().parents[2] / "config"
Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.2]))


def _start(*arguments):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([os.getcwd(), *sys.path[1:]])}
    command = [sys.executable, "-m", "riem_planner.node.main", "--ros-args", *arguments]
    return subprocess.Popen(
        command, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
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

    def wait(self, condition, seconds=20.0):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "waited in vain"
            self.executor.spin_once(timeout_sec=0.05)

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
        deadline = time.monotonic() + 300.0
        while not client.setpoints:  # as `ros2 topic pub` does, once a second
            assert time.monotonic() < deadline
            client.goals.publish(geometry.pose_from_attitude(Z_TURN, 0, "inertial"))
            end = time.monotonic() + 1.0
            while time.monotonic() < end and not client.setpoints:
                client.executor.spin_once(timeout_sec=0.05)
        client.wait(lambda: len(client.setpoints) > 20)
        service = client.node.create_client(Trigger, "/riem_planner/cancel")
        future = service.call_async(Trigger.Request())
        client.wait(future.done)
        assert future.result().success
        client.wait(lambda: client.setpoints[-1].points[0].velocities[0].angular.z == 0.0)
    finally:
        node.send_signal(signal.SIGINT)
        _, log = node.communicate(timeout=10.0)
    assert node.returncode == 0, log


def _ends_with_zero(number, after):
    """Send a signal some time after the first line of the log."""
    node = _start("--params-file", str(CONFIG / "demo.yaml"))
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
def test_a_signal_at_any_moment_ends_it_with_code_zero():
    rng = np.random.default_rng(4)
    for _ in range(100):
        number = signal.SIGINT if rng.random() < 0.5 else signal.SIGTERM
        after = float(rng.exponential(0.5))
        assert _ends_with_zero(number, after) < 3.0, (number, after)


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
