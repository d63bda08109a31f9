# SPDX-License-Identifier: Apache-2.0
"""What the demonstration hears: the plan, the setpoints and the states that are flown."""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msg_adapters import MessageError
from msg_adapters.geometry import (
    attitude_from_odometry,
    nanoseconds_from_time,
    odometry_from_attitude,
)

Array = NDArray[np.float64]

KEPT_STATES = 1000
"""States that may wait while a picture is drawn: 20 s of them."""


class Flown(NamedTuple):
    """Attitudes that a spacecraft told of during a slew.

    Attributes
    ----------
    times : (n,)
        From the slew's start [s].
    quaternions : (n, 4)
        x, y, z, w, body to reference frame.
    """

    times: Array
    quaternions: Array


class Listener:
    """Hears the topics of the planner and of the spacecraft, in a thread of its own."""

    def __init__(self, frames: tuple[str, str]) -> None:
        self.reference: MultiDOFJointTrajectory | None = None
        self.status: DiagnosticStatus | None = None
        self.setpoint_ns = 0
        self.setpoints = 0
        self._states: list[tuple[int, Array]] = []
        self._frames = frames
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("riem_planner_demo")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        listen = self._node.create_subscription
        listen(MultiDOFJointTrajectory, "/riem_planner/reference", self._hear_reference, latched)
        listen(DiagnosticStatus, "/riem_planner/status", self._hear_status, latched)
        listen(MultiDOFJointTrajectory, "/riem_planner/setpoint", self._hear_setpoint, 1)
        listen(Odometry, "/riem_planner/state", self._hear_state, KEPT_STATES)
        self._stand_in = self._node.create_publisher(Odometry, "/riem_planner/state", 1)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        try:
            while rclpy.ok():
                self._executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return

    def _hear_reference(self, message: MultiDOFJointTrajectory) -> None:
        self.reference = message

    def _hear_status(self, message: DiagnosticStatus) -> None:
        # What is told later must not hide the figures of the plan.
        if self.status is None or not any(item.key == "cost" for item in self.status.values):
            self.status = message

    def _hear_setpoint(self, message: MultiDOFJointTrajectory) -> None:
        self.setpoint_ns = nanoseconds_from_time(message.header.stamp)
        self.setpoints += 1

    def _hear_state(self, message: Any) -> None:
        try:
            state = attitude_from_odometry(message, *self._frames)
        except MessageError:
            return  # somebody else's; the planner says what is wrong with it
        self._states.append((state.stamp, state.quaternion))

    @property
    def hears_state(self) -> bool:
        """Whether the spacecraft has told of its state."""
        return bool(self._states)

    @property
    def is_refused(self) -> bool:
        """Whether the last word of the planner is that there is no plan."""
        return self.status is not None and self.status.level == DiagnosticStatus.ERROR

    def tell_state(self, quaternion: Array) -> None:
        """Say in the spacecraft's place that it is at rest in an attitude (4,)."""
        self._stand_in.publish(odometry_from_attitude(quaternion, np.zeros(3), 0, self._frames))

    def flown(self, start_ns: int, duration: float) -> Flown:
        """What was heard of a slew that begins at a stamp [ns] and takes a duration [s]."""
        heard = [((stamp - start_ns) * 1e-9, attitude) for stamp, attitude in list(self._states)]
        during = sorted((row for row in heard if 0.0 <= row[0] <= duration), key=lambda row: row[0])
        times = np.array([time for time, _ in during])
        return Flown(times, np.array([attitude for _, attitude in during]).reshape(-1, 4))

    def close(self) -> None:
        """End the thread, then the node."""
        rclpy.try_shutdown()
        self._thread.join(1.0)
        self._node.destroy_node()
