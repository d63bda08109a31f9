# SPDX-License-Identifier: Apache-2.0
"""The simulated spacecraft as a node: follows what it hears, in its clock's time, and ends well."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")

import rclpy
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msg_adapters.geometry import attitude_from_odometry, time_from_nanoseconds
from msg_adapters.trajectory import SetpointMessage
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.spacecraft_sim.spacecraft_node import SPECIFICATIONS, SpacecraftNode

SECOND = 1_000_000_000
FRAMES = "inertial", "base_link"
BEGIN_NS = 1_700_000_000 * SECOND


class Stage:
    """The node under test and a client that plays the clock, in a context of their own."""

    def __init__(self, **values):
        self.context = Context()
        rclpy.init(context=self.context)
        given = {"use_sim_time": True, "step_rate": 20.0, **values}
        overrides = [Parameter(name.replace("__", "."), value=v) for name, v in given.items()]
        self.client = Node("client", context=self.context)
        self.node = None
        try:
            self.node = SpacecraftNode(context=self.context, parameter_overrides=overrides)
        except InvalidProblemError:
            self.close()
            raise
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.client)
        self.executor.add_node(self.node)
        self.heard = []
        listen = self.client.create_subscription
        listen(Odometry, "/riem_planner/state", self.heard.append, 10)
        self.clock = self.client.create_publisher(Clock, "/clock", 1)
        self.setpoints = self.client.create_publisher(
            MultiDOFJointTrajectory, "/riem_planner/setpoint", 1
        )
        self.message = SetpointMessage(*FRAMES)
        self.now_ns = BEGIN_NS
        self.wait(
            lambda: (
                self.clock.get_subscription_count() > 0
                and self.setpoints.get_subscription_count() > 0
                and self.node.count_subscribers("/riem_planner/state") > 0
            )
        )

    def wait(self, condition, seconds=10.0):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "waited in vain"
            self.executor.spin_once(timeout_sec=0.01)

    def advance(self, seconds=0.05):
        """Let the clock go on, and wait for the state of that time."""
        self.now_ns += round(seconds * SECOND)
        self.clock.publish(Clock(clock=time_from_nanoseconds(self.now_ns)))
        self.wait(lambda: self.heard and self.told().stamp == self.now_ns)

    def setpoint(self, quaternion, rate=(0, 0, 0), acceleration=(0, 0, 0), frame=FRAMES[0]):
        """Send a setpoint of this time, and wait until it is taken."""
        arrays = (np.array(value, dtype=float) for value in (quaternion, rate, acceleration))
        message = self.message.filled(self.now_ns, *arrays)
        message.header.frame_id = frame
        before = self.node.setpoints
        self.setpoints.publish(message)
        self.wait(lambda: self.node.setpoints > before)

    def told(self):
        """The last state that was published."""
        return attitude_from_odometry(self.heard[-1], *FRAMES)

    def close(self):
        if self.node is not None:
            self.executor.shutdown()
            self.node.destroy_node()
        self.client.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def stage():
    stages = []

    def start(**values):
        stages.append(Stage(**values))
        return stages[-1]

    yield start
    for one in stages:
        one.close()


def test_it_holds_its_start_then_follows_setpoints_in_the_clocks_time(stage):
    start = so3.quaternion_exp([0.3, 0.0, 0.0])
    one = stage(start__orientation=start.tolist())
    one.advance()
    one.advance(0.5)
    assert one.told().quaternion == pytest.approx(start, abs=1e-12)
    # From there a turn about x at 10 Hz that speeds up evenly, within the wheels' torque.
    acceleration = np.array([0.02, 0.0, 0.0])
    begin_ns, errors = one.now_ns, []
    for k in range(40):
        t = (one.now_ns - begin_ns) / SECOND
        if k % 2 == 0:
            wanted = so3.quaternion_exp([0.3 + 0.01 * t * t, 0.0, 0.0])
            one.setpoint(wanted, acceleration * t, acceleration)
        one.advance()
        t = (one.now_ns - begin_ns) / SECOND
        there = so3.quaternion_exp([0.3 + 0.01 * t * t, 0.0, 0.0])
        errors.append(float(so3.quaternion_distance(one.told().quaternion, there)))
    assert one.told().rate == pytest.approx([0.02 * t, 0.0, 0.0], abs=1e-6)
    assert max(errors) < 1e-6


def test_without_new_setpoints_it_comes_to_rest(stage):
    one = stage(setpoint_timeout=0.2)
    one.advance()
    one.setpoint([0.0, 0.0, 0.0, 1.0], rate=(0.05, 0.0, 0.0))
    for _ in range(4):
        one.advance()
    assert one.told().rate[0] > 0.005
    for _ in range(20):
        one.advance(1.0)
    assert np.linalg.norm(one.told().rate) < 1e-6
    assert so3.quaternion_log(one.told().quaternion) == pytest.approx([0.01, 0.0, 0.0], abs=1e-6)


def test_a_clock_that_is_set_moves_nothing(stage):
    one = stage(start__rate=[0.1, 0.0, 0.0], wheel_torque=[1e-12] * 3)
    one.advance()
    one.advance(1.0)
    turned = one.told().quaternion
    assert so3.quaternion_log(turned) == pytest.approx([0.1, 0.0, 0.0], abs=1e-6)
    one.advance(1000.0)
    assert one.told().quaternion.tolist() == turned.tolist()
    one.advance(1.0)
    assert so3.quaternion_log(one.told().quaternion) == pytest.approx([0.2, 0.0, 0.0], abs=1e-6)
    one.now_ns -= 500 * SECOND
    one.clock.publish(Clock(clock=time_from_nanoseconds(one.now_ns)))
    one.wait(lambda: one.node.get_clock().now().nanoseconds == one.now_ns)
    one.advance(0.1)
    one.advance(1.0)
    assert so3.quaternion_log(one.told().quaternion) == pytest.approx([0.3, 0.0, 0.0], abs=1e-6)


def test_a_setpoint_in_another_frame_is_rejected(stage):
    one = stage()
    one.advance()
    one.setpoint(so3.quaternion_exp([0.0, 0.0, 1.0]), frame="moon")
    one.advance(1.0)
    assert one.told().quaternion.tolist() == [0.0, 0.0, 0.0, 1.0]


def test_noise_follows_its_seed(stage):
    rates = []
    for seed in (1, 1, 2):
        one = stage(attitude_noise=1e-3, rate_noise=1e-3, seed=seed)
        one.advance()
        rates.append(one.told().rate.tolist())
        one.close()
    assert rates[0] == rates[1] != rates[2]
    assert 0.0 < np.max(np.abs(rates)) < 6e-3


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("inertia", [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]),
        ("wheel_torque", [1.0, 2.0]),
        ("step_rate", 0.0),
        ("start__orientation", [0.0, 0.0, 0.0, 0.5]),
    ],
)
def test_a_wrong_parameter_is_refused_by_name(stage, name, value):
    with pytest.raises(InvalidProblemError, match=name.split("__")[-1]):
        stage(**{name: value})


def test_every_parameter_is_described_with_its_range(stage):
    node = stage().node
    for name in (item.name for item in SPECIFICATIONS):
        described = node.describe_parameter(name)
        assert described.description
        assert described.read_only
    assert node.describe_parameter("step_rate").floating_point_range[0].to_value == 1000.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_code_zero(number):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([os.getcwd(), *sys.path[1:]])}
    command = [
        sys.executable,
        "-m",
        "riem_planner.spacecraft_sim.main",
        "--ros-args",
        "-p",
        "step_rate:=100.0",
    ]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    assert "spacecraft_sim" in process.stderr.readline()  # it says that it has begun
    begin = time.monotonic()
    process.send_signal(number)
    _, log = process.communicate(timeout=10.0)
    assert process.returncode == 0, log
    assert time.monotonic() - begin < 10.0
