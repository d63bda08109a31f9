# SPDX-License-Identifier: Apache-2.0
"""A node of its own that judges the planner's topics by the sentences of `riem_planner.monitor`."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3Stamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from trajectory_msgs.msg import MultiDOFJointTrajectory

from riem_planner.monitor.curve import State, Vector
from riem_planner.monitor.sentences import SENTENCES, Monitor, Rules, Violation, Zone

NAME = "riem_monitor"
_LIMITS = ("rate", "acceleration", "torque", "momentum")
_STREAM_DEPTH = 1000  # setpoints that may wait while the machine is busy; none may be lost
_SECOND = 1_000_000_000


def stamp_of(message: Any) -> int:
    """Nanoseconds of a message's header."""
    stamp = message.header.stamp
    return int(stamp.sec) * _SECOND + int(stamp.nanosec)


def state_of(point: Any, stamp_ns: int) -> State:
    """A point of a trajectory message as plain numbers."""
    q, v, a = point.transforms[0].rotation, point.velocities[0], point.accelerations[0]
    return State(
        stamp_ns,
        (q.x, q.y, q.z, q.w),
        (v.angular.x, v.angular.y, v.angular.z),
        (a.angular.x, a.angular.y, a.angular.z),
    )


def states_of(message: MultiDOFJointTrajectory) -> list[State]:
    """The points of a trajectory message; none where one of them is incomplete."""
    start = stamp_of(message)
    for point in message.points:
        if not (point.transforms and point.velocities and point.accelerations):
            return []
    return [
        state_of(p, start + p.time_from_start.sec * _SECOND + p.time_from_start.nanosec)
        for p in message.points
    ]


class MonitorNode(Node):
    """Hears a planner, judges it, and tells on ~/verdict (latched) and /diagnostics.

    It reads the planner's own parameter file: zones, limits, inertia and setpoint rate mean there
    what they mean here. Its own parameter is `planner`, the name of the node that it hears.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NAME, automatically_declare_parameters_from_overrides=True, **options)
        if not self.has_parameter("planner"):
            description = ParameterDescriptor(
                description="name of the planner that is judged", read_only=True
            )
            self.declare_parameter("planner", "riem_planner", description)
        self.monitor = Monitor(self._rules())
        planner = str(self.get_parameter("planner").value)
        root = planner if planner.startswith("/") else f"/{planner}"
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._verdict = self.create_publisher(DiagnosticStatus, "~/verdict", latched)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 1)
        self._told: Violation | None = None
        self._listen(root, latched)
        self.create_timer(1.0, self._tick)
        self._tell()

    def _listen(self, root: str, latched: QoSProfile) -> None:
        stream = QoSProfile(depth=_STREAM_DEPTH)
        events = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        hear = self.create_subscription
        trajectory = MultiDOFJointTrajectory
        hear(trajectory, f"{root}/setpoint", self._on_setpoint, stream)
        hear(trajectory, f"{root}/reference", self._on_reference, latched)
        hear(DiagnosticStatus, f"{root}/status", self._on_status, events)
        hear(DiagnosticArray, "/diagnostics", self._on_diagnostics, 20)
        for zone in self.monitor.rules.zones:
            hear(Vector3Stamped, f"{root}/zones/{zone.name}", partial(self._on_zone, zone.name), 20)
            body = self._value(f"zones.{zone.name}.body", "")
            if body:
                hear(Vector3Stamped, f"{root}/bodies/{body}", partial(self._on_zone, zone.name), 20)

    def _value(self, name: str, default: Any) -> Any:
        value = self.get_parameter_or(name, Parameter(name, value=default)).value
        return default if value is None else value

    def _rules(self) -> Rules:
        limits = {}
        for key in _LIMITS:
            value = self._value(f"limits.{key}", [])
            limits[key] = (float(value),) if isinstance(value, float) else tuple(value)
        return Rules(
            setpoint_rate=float(self._value("setpoint_rate", 50.0)),
            zones=tuple(self._zone(name) for name in self._value("zone_names", [])),
            limits={key: bounds for key, bounds in limits.items() if bounds},
            inertia=tuple(self._value("inertia", [])),
        )

    def _zone(self, name: str) -> Zone:
        def value(key: str, default: Any) -> Any:
            return self._value(f"zones.{name}.{key}", default)

        boresight = self._value("boresight", [1.0, 0.0, 0.0])
        direction = list(value("direction", []))
        return Zone(
            name=name,
            keep_in=value("kind", "keep_out") == "keep_in",
            boresight=_unit(list(value("boresight", [])) or boresight),
            half_angle=float(value("half_angle", 0.0)),
            direction=_unit(direction) if direction else None,
            rate=_vector(value("rate", []) or [0.0, 0.0, 0.0]),
            timeout=float(value("timeout", 0.0)),
            group=str(value("group", "")),
            member=str(value("member", "")),
        )

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _on_setpoint(self, message: MultiDOFJointTrajectory) -> None:
        for state in states_of(message):
            self.monitor.setpoint(state)
        if self.monitor.verdict is not self._told:
            self._tell()

    def _on_reference(self, message: MultiDOFJointTrajectory) -> None:
        self.monitor.reference(states_of(message))

    def _on_status(self, message: DiagnosticStatus) -> None:
        code = next((item.value for item in message.values if item.key == "code"), "")
        warns = message.level != DiagnosticStatus.OK
        self.monitor.status(code, message.message, self._now(), warns=warns)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if not status.name.startswith(NAME) and status.level != DiagnosticStatus.OK:
                self.monitor.status("", status.message, self._now(), warns=True)

    def _on_zone(self, name: str, message: Vector3Stamped) -> None:
        x, now = message.vector, self._now()
        stamp = stamp_of(message) or now
        self.monitor.zone(name, (x.x, x.y, x.z), stamp, now)

    def _tick(self) -> None:
        self.monitor.tick(self._now())
        if self.monitor.verdict is not self._told:
            self._tell()
        stamped = DiagnosticArray(status=[self._status()])
        stamped.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(stamped)

    def _tell(self) -> None:
        self._told = self.monitor.verdict
        status = self._status()
        if self._told is not None:
            self.get_logger().error(status.message)
        self._verdict.publish(status)

    def _status(self) -> DiagnosticStatus:
        monitor, first = self.monitor, self.monitor.verdict
        values: dict[str, object] = {
            "setpoints": monitor.setpoints,
            "violations": len(monitor.violations),
        }
        status = DiagnosticStatus(level=DiagnosticStatus.OK, name=f"{NAME}: verdict")
        status.message = f"no sentence of {', '.join(SENTENCES)} was broken"
        if first is not None:
            status.level = DiagnosticStatus.ERROR
            time = first.stamp_ns / _SECOND
            status.message = f"{first.sentence}: {first.what} at {time:.9f} s"
            values |= {"sentence": first.sentence, "stated": SENTENCES[first.sentence]}
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        return status


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _unit(values: Any) -> Vector:
    x, y, z = _vector(values)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length
