"""Subscriptions: every message checked as a whole, the good ones turned into calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import (
    DurabilityPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu

from msg_adapters import MessageError
from msg_adapters.geometry import (
    Attitude,
    attitude_from_imu,
    attitude_from_odometry,
    attitude_from_pose,
    direction_from_vector,
)
from msg_adapters.pose_array import orientations_from_cdr
from riem_planner.mission.planning import Goal

if TYPE_CHECKING:
    from riem_planner.node.planner_node import PlannerNode

MOST_OBSTACLES = 500
"""Poses in ~/obstacles; a message with more is a mistake, and would be too slow to plan with."""

OVERRIDABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)


def input_qos() -> QoSProfile:
    """Reliable, volatile, depth 1: the newest wins."""
    return QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


def overriding() -> QoSOverridingOptions:
    """QoS parameters of a topic that users may set."""
    return QoSOverridingOptions(policy_kinds=OVERRIDABLE)


def check_stamp(stamp_ns: int, now_ns: int, timeout: float) -> int:
    """The time of a message [ns]; zero means now, a stale or future stamp is refused."""
    if stamp_ns == 0:
        return now_ns
    age = (now_ns - stamp_ns) * 1e-9
    if age > timeout:
        raise MessageError("header.stamp", f"{age:.3f} s old", f"at most {timeout:g} s")
    if age < -timeout:
        raise MessageError(
            "header.stamp", f"{-age:.3f} s in the future", f"at most {timeout:g} s ahead"
        )
    return stamp_ns


class Inputs:
    """The subscriptions of a planner node."""

    def __init__(self, node: PlannerNode) -> None:
        self._node = node
        settings = node.settings
        self._subscribe(PoseStamped, "~/goal", self._goal)
        self._subscribe(Odometry, "~/goal_state", self._goal_state)
        self._subscribe(Odometry, "~/state", self._state)
        self._subscribe(Imu, "~/imu", self._imu)
        # As bytes: a large array as Python objects would stop the stream.
        self._subscribe(PoseArray, "~/obstacles", self._obstacles, raw=True)
        for zone in settings.zones:
            callback = partial(self._zone, zone.name)
            self._subscribe(Vector3Stamped, f"~/zones/{zone.name}", callback)

    def _subscribe(
        self, kind: type, topic: str, use: Callable[[Any, int], None], *, raw: bool = False
    ) -> None:
        node = self._node

        def incompatible(event: Any) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            node.get_logger().warning(
                f"{topic}: a publisher offers an incompatible {policy}; nothing comes from it."
                f" Publish with another {policy}, or set qos_overrides of this topic"
            )

        def receive(message: Any) -> None:
            with node.calls() as now_ns:
                try:
                    use(message, now_ns)
                except MessageError as error:
                    node.outputs.reject(topic, str(error))

        node.create_subscription(
            kind,
            topic,
            receive,
            input_qos(),
            raw=raw,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=incompatible),
            qos_overriding_options=overriding(),
        )

    def _stamp(self, stamp_ns: int, now_ns: int) -> int:
        return check_stamp(stamp_ns, now_ns, self._node.settings.input_timeout)

    def _set_goal(self, attitude: Attitude, now_ns: int) -> None:
        self._stamp(attitude.stamp, now_ns)
        self._node.mission.set_goal(Goal(attitude.quaternion, attitude.rate), now_ns)

    def _goal(self, message: PoseStamped, now_ns: int) -> None:
        self._set_goal(attitude_from_pose(message, self._node.settings.reference_frame), now_ns)

    def _goal_state(self, message: Odometry, now_ns: int) -> None:
        settings = self._node.settings
        attitude = attitude_from_odometry(message, settings.reference_frame, settings.body_frame)
        self._set_goal(attitude, now_ns)

    def _see_state(self, attitude: Attitude, now_ns: int) -> None:
        stamp_ns = self._stamp(attitude.stamp, now_ns)
        self._node.mission.see_state(attitude.quaternion, attitude.rate, stamp_ns, now_ns)

    def _state(self, message: Odometry, now_ns: int) -> None:
        settings = self._node.settings
        attitude = attitude_from_odometry(message, settings.reference_frame, settings.body_frame)
        self._see_state(attitude, now_ns)

    def _imu(self, message: Imu, now_ns: int) -> None:
        self._see_state(attitude_from_imu(message, self._node.settings.body_frame), now_ns)

    def _obstacles(self, data: bytes, now_ns: int) -> None:
        settings = self._node.settings
        found = orientations_from_cdr(data, settings.reference_frame, MOST_OBSTACLES)
        self._stamp(found.stamp, now_ns)
        self._node.mission.see_obstacles(np.asarray(found.quaternions), now_ns)

    def _zone(self, name: str, message: Vector3Stamped, now_ns: int) -> None:
        direction = direction_from_vector(message, self._node.settings.reference_frame)
        stamp_ns = self._stamp(direction.stamp, now_ns)
        self._node.mission.see_zone(name, direction.vector, stamp_ns, now_ns)
