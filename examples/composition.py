# SPDX-License-Identifier: Apache-2.0
"""A planner, a simulated spacecraft and a sender of goals in one namespace, without a launch file.

    python examples/composition.py [--namespace /sat1] [--duration 10]

Both nodes are processes of their own. This one takes the planner through its life cycle, sends a
goal, waits for what becomes of it, and ends them again; exit code 0 if it arrived.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

PATIENCE = 300.0
"""How long each step may take: the very first start compiles the solver [s]."""


def start(module: str, name: str, namespace: str, **parameters: object) -> subprocess.Popen[bytes]:
    """Start a node under a name in a namespace."""
    command = [sys.executable, "-m", module, "--ros-args"]
    command += ["-r", f"__node:={name}", "-r", f"__ns:={namespace}"]
    for key, value in parameters.items():
        command += ["-p", f"{key}:={value}"]
    return subprocess.Popen(command)


class Conductor(Node):
    """Takes a planner through its life cycle, and sends it a goal.

    Parameters
    ----------
    planner
        Its full name.
    """

    def __init__(self, planner: str) -> None:
        super().__init__("conductor")
        self.events: list[dict[str, str]] = []
        latched = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(DiagnosticStatus, f"{planner}/status", self._hear, latched)
        self._goals = self.create_publisher(PoseStamped, f"{planner}/goal", 1)
        self._change = self.create_client(ChangeState, f"{planner}/change_state")
        self._get = self.create_client(GetState, f"{planner}/get_state")

    def _hear(self, message: DiagnosticStatus) -> None:
        event = {item.key: item.value for item in message.values}
        self.events.append(event)
        print(event["code"], message.message)

    def wait(self, condition: Callable[[], bool]) -> None:
        """Spin until something is so."""
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the planner did not answer")
            rclpy.spin_once(self, timeout_sec=0.1)

    def transition(self, number: int, state: str) -> None:
        """Ask for a transition, and wait for the state that it leads to."""
        self.wait(self._change.service_is_ready)
        self._change.call_async(ChangeState.Request(transition=Transition(id=number)))
        self.wait(lambda: self._state() == state)

    def _state(self) -> str:
        self.wait(self._get.service_is_ready)
        future: Any = self._get.call_async(GetState.Request())
        end = time.monotonic() + 5.0  # an answer may be lost while nodes find each other
        self.wait(lambda: future.done() or time.monotonic() > end)
        return str(future.result().current_state.label) if future.done() else "unknown"

    def fly_to(self, z: float, w: float) -> str:
        """Send a goal about z, and wait for its end; the code."""
        self.wait(lambda: self._goals.get_subscription_count() > 0)
        now = self.get_clock().now().to_msg()
        goal = PoseStamped()
        goal.header.stamp, goal.header.frame_id = now, "inertial"
        goal.pose.orientation.z, goal.pose.orientation.w = z, w
        self._goals.publish(goal)
        stamp = f"{now.sec}.{now.nanosec:09d}"
        ends = ("ARRIVED", "REPLACED", "CANCELLED", "REFUSED")

        def codes() -> list[str]:
            mine = [event for event in self.events if event.get("goal_stamp") == stamp]
            return [event["code"] for event in mine if event["code"] in ends]

        self.wait(lambda: bool(codes()))
        return codes()[0]


def main() -> int:
    """Run it; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--namespace", default="/sat1")
    parser.add_argument("--duration", type=float, default=10.0, help="of the slew [s]")
    options = parser.parse_args()
    space = options.namespace
    nodes = [
        start("riem_planner.spacecraft_sim.main", "spacecraft", space, planner="att"),
        start(
            "riem_planner.node.main", "att", space,
            autostart="false", require_state="true", duration=options.duration,
        ),
    ]  # fmt: skip
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    conductor = Conductor(f"{space}/att")
    try:
        conductor.transition(Transition.TRANSITION_CONFIGURE, "inactive")
        conductor.transition(Transition.TRANSITION_ACTIVATE, "active")
        code = conductor.fly_to(0.6, 0.8)
        conductor.transition(Transition.TRANSITION_DEACTIVATE, "inactive")
    finally:
        conductor.destroy_node()
        rclpy.try_shutdown()
        for node in nodes:
            node.terminate()
        ends = [node.wait(10.0) for node in nodes]
    print(f"the goal: {code}; exit codes of planner and spacecraft: {ends[::-1]}")
    return 0 if code == "ARRIVED" and not any(ends) else 1


if __name__ == "__main__":
    sys.exit(main())
