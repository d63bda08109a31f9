# SPDX-License-Identifier: Apache-2.0
"""The node as a process of its own, and a client in this one that talks to it."""

import gc
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msg_adapters import geometry
from riem_planner.geometry import so3

ROOT = Path(__file__).resolve().parents[2]
CONFIG = Path(__file__).resolve().parents[2] / "config"
Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.2]))


STARTED = []


def start(*arguments, command=("-m", "riem_planner.node.main"), **variables):
    path = os.pathsep.join([os.getcwd(), *sys.path[1:]])
    environment = {**os.environ, "PYTHONPATH": path, **variables}
    process = subprocess.Popen(
        [sys.executable, *command, "--ros-args", *arguments],
        env=environment,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    STARTED.append(process)
    return process


class Client:
    """A node in this process that talks to the one in the other."""

    def __init__(self, name="/riem_planner"):
        self.name = name
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("other_process", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.setpoints, self.statuses = [], []
        latched = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        listen = self.node.create_subscription
        listen(MultiDOFJointTrajectory, f"{name}/setpoint", self.setpoints.append, 10)
        listen(DiagnosticStatus, f"{name}/status", self.statuses.append, latched)
        self.goals = self.node.create_publisher(PoseStamped, f"{name}/goal", 1)
        self.parameters = AsyncParameterClient(self.node, name)

    def wait(self, condition, seconds=20.0):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "waited in vain"
            self.executor.spin_once(timeout_sec=0.05)

    def result(self, future):
        self.wait(future.done)
        return future.result()

    def call(self, kind, name, **fields):
        service = self.node.create_client(kind, f"{self.name}/{name}")
        self.wait(service.service_is_ready)
        found = self.result(service.call_async(kind.Request(**fields)))
        self.node.destroy_client(service)
        return found

    def transition(self, number):
        wanted = Transition(id=number)
        return self.call(ChangeState, "change_state", transition=wanted).success

    def transition_begun(self, number):
        """The future of a transition's answer."""
        service = self.node.create_client(ChangeState, f"{self.name}/change_state")
        self.wait(service.service_is_ready)
        return service.call_async(ChangeState.Request(transition=Transition(id=number)))

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

    def events(self):
        """(code, goal_stamp) of all that came on ~/status."""
        tables = [{item.key: item.value for item in m.values} for m in self.statuses]
        return [(table["code"], table.get("goal_stamp")) for table in tables]

    def publish_once(self, kind, topic, message):
        """Publish as soon as somebody listens, once."""
        publisher = self.node.create_publisher(kind, f"{self.name}/{topic}", 1)
        self.wait(lambda: publisher.get_subscription_count() > 0, 60.0)
        publisher.publish(message)
        return publisher

    def goal(self, quaternion, stamp_ns=0):
        """Send a goal once."""
        self.wait(lambda: self.goals.get_subscription_count() > 0, 60.0)
        self.goals.publish(geometry.pose_from_attitude(quaternion, stamp_ns, "inertial"))

    def zone(self, name, direction):
        """Tell of a zone once."""
        message = geometry.vector_from_direction(np.array(direction), 0, "inertial")
        return self.publish_once(Vector3Stamped, f"zones/{name}", message)

    def now_ns(self):
        return self.node.get_clock().now().nanoseconds

    def rests(self):
        """Whether the last setpoint is at rest."""
        turning = self.setpoints[-1].points[0].velocities[0].angular
        return (turning.x, turning.y, turning.z) == (0.0, 0.0, 0.0)

    def close(self):
        """End everything, and what a test that failed has left running."""
        for process in STARTED:
            if process.poll() is None:
                process.kill()
                process.communicate()
        STARTED.clear()
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()
        # A context that is left keeps a number in the domain, and of these there are few.
        self.context.destroy()
        self.node = self.executor = self.parameters = None
        gc.collect()
