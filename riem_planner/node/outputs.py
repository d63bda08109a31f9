# SPDX-License-Identifier: Apache-2.0
"""Publishers: what the node streams, and what it tells and shows of its plans and its health."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray, QuaternionStamped
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import (
    DurabilityPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

from msg_adapters import status as status_messages
from msg_adapters.geometry import quaternion_stamped
from msg_adapters.markers import Key, markers_from_scene
from msg_adapters.pose_array import cdr_from_orientations
from msg_adapters.trajectory import Samples, SetpointMessage, cdr_from_samples
from riem_planner.mission import health
from riem_planner.mission.codes import Code, Level
from riem_planner.mission.events import Event, Proposal
from riem_planner.mission.mission import Mission
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Setpoint
from riem_planner.node import reports
from riem_planner.node.hearing import INPUT_POLICIES, overriding

REDRAW = 0.2
"""Least time between two drawings: each takes milliseconds, which others may need [s]."""
STATUS_DEPTH = 20
"""Events on ~/status that a late client gets."""
OUTPUT_POLICIES = (
    *INPUT_POLICIES,
    QoSPolicyKind.DEADLINE,
    QoSPolicyKind.LIFESPAN,
    QoSPolicyKind.LIVELINESS,
    QoSPolicyKind.LIVELINESS_LEASE_DURATION,
)


@dataclass(frozen=True)
class Desk:
    """What the outputs need of their node.

    Parameters
    ----------
    name
        Of the node, its namespace included.
    log, settings
        Give the logger and the present settings.
    guard
        What is held while the mission is looked at.
    chore
        Does something beside the stream when nothing is to be planned.
    """

    name: str
    log: Callable[[], Any]
    settings: Callable[[], Settings]
    guard: AbstractContextManager[object]
    chore: Callable[[str, Callable[[], None]], None]


def output_qos(*, latched: bool, depth: int = 1) -> QoSProfile:
    """Reliable; latched for late joiners, or not."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class Outputs:
    """The publishers of a planner node.

    Parameters
    ----------
    node
        Whose they are.
    desk
        What they need of it.

    Attributes
    ----------
    watch
        Intervals of the stream.
    rejections
        Bad messages.
    """

    def __init__(self, node: LifecycleNode, desk: Desk) -> None:
        self.watch = health.StreamWatch()
        self.rejections = health.Rejections()
        self._desk = desk
        self._unlogged: deque[Event] = deque()
        self._shown: tuple[Proposal, Samples] | None = None
        self._marker_keys: set[Key] = set()
        self._drawn: object = None
        self._drawn_at = 0.0
        managed, plain = node.create_lifecycle_publisher, node.create_publisher
        reference = MultiDOFJointTrajectory
        latched, brief = output_qos(latched=True), output_qos(latched=False)
        self._trajectory = self._publisher(managed, PoseArray, "~/trajectory", latched)
        self._reference = self._publisher(managed, reference, "~/reference", latched)
        self._markers = self._publisher(managed, MarkerArray, "~/markers", latched)
        self._setpoint = self._publisher(managed, reference, "~/setpoint", brief)
        self._attitude = self._publisher(managed, QuaternionStamped, "~/attitude_setpoint", brief)
        events = output_qos(latched=True, depth=STATUS_DEPTH)
        self._status = self._publisher(plain, DiagnosticStatus, "~/status", events)
        self._diagnostics = self._publisher(plain, DiagnosticArray, "/diagnostics", brief)
        settings = desk.settings()
        self._setpoint_message = SetpointMessage(settings.reference_frame, settings.body_frame)

    def _publisher(
        self, create: Callable[..., Any], kind: type, topic: str, qos: QoSProfile
    ) -> Any:
        def incompatible(event: Any) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            self._desk.log().warning(
                f"{topic}: a subscriber asks for an incompatible {policy}; nothing goes to it."
                f" Subscribe with another {policy}, or set qos_overrides of this topic"
            )

        return create(
            kind,
            topic,
            QoSProfile(depth=qos.depth, reliability=qos.reliability, durability=qos.durability),
            event_callbacks=PublisherEventCallbacks(incompatible_qos=incompatible),
            qos_overriding_options=overriding(OUTPUT_POLICIES),
        )

    def stream(self, setpoint: Setpoint) -> None:
        """Publish a setpoint."""
        stamp_ns, quaternion, rate, acceleration = setpoint
        self._setpoint.publish(
            self._setpoint_message.filled(stamp_ns, quaternion, rate, acceleration)
        )
        frame = self._setpoint_message.message.header.frame_id
        self._attitude.publish(quaternion_stamped(quaternion, stamp_ns, frame))
        self.watch.note(time.monotonic())

    def tell(self, event: Event) -> None:
        """Publish an event as the status, with its plan if it has one; it is logged later."""
        topic = event.topic or (event.goal.topic if event.goal is not None else "")
        if event.code is Code.REFUSED and not self.rejections.admit(topic):
            return
        if event.proposal is not None:
            self._show(event.proposal)
        desk = self._desk
        message = status_messages.status_from_report(
            reports.LEVELS[event.severity],
            f"{desk.name}: planner",
            event.message,
            reports.status_values(event),
            desk.settings().body_frame,
        )
        self._status.publish(message)
        if not event.topic:  # of a message that was wrong the log is told now and then
            self._unlogged.append(event)

    def catch_up(self, mission: Mission, now_ns: int) -> None:
        """Log and draw what has happened.

        Whoever waits for a plan must not wait for these, with the interpreter's lock held: rclpy
        takes a millisecond to find out where a line comes from, and a drawing some more.
        """
        self.write_log()
        self._draw(mission, now_ns)

    def write_log(self) -> None:
        """Log the events that have not been."""
        log = self._desk.log()
        while self._unlogged:
            event = self._unlogged.popleft()
            line = f"{event.code.name}: {event.message}"
            if event.severity is Level.OK:
                log.info(line)
            elif event.severity is Level.WARN:
                log.warning(line)
            else:
                log.error(line)

    def _show(self, proposal: Proposal) -> None:
        settings = self._desk.settings()
        samples = reports.samples_of(proposal, settings.trajectory_poses)
        self._shown = (proposal, samples)
        start_ns = proposal.segments[0].start_ns
        self._trajectory.publish(
            cdr_from_orientations(samples.quaternions, start_ns, settings.reference_frame)
        )
        frames = (settings.reference_frame, settings.body_frame)
        self._reference.publish(cdr_from_samples(samples, start_ns, frames))

    def forget(self) -> None:
        """Show no plan from now on."""
        self._shown = None

    def _draw(self, mission: Mission, now_ns: int) -> None:
        """Draw plan and zones, if anything has changed and the last drawing is not too recent."""
        desk, shown, world = self._desk, self._shown, mission.world
        state = (world, world.version, shown)
        if not mission.active:
            return  # nothing would be published
        if state == self._drawn or time.monotonic() - self._drawn_at < REDRAW:
            return
        self._drawn, self._drawn_at = state, time.monotonic()
        settings = desk.settings()

        def drawing() -> None:
            with desk.guard:
                scene = reports.scene_of(shown, world, settings, now_ns)
            markers, self._marker_keys = markers_from_scene(
                scene, now_ns, settings.reference_frame, self._marker_keys
            )
            self._markers.publish(markers)

        desk.chore("markers", drawing)

    def report_health(self, mission: Mission, now_ns: int, *, realtime: bool) -> None:
        """Publish the diagnostics."""
        desk, settings = self._desk, self._desk.settings()
        entries = [
            health.planner_health(mission, now_ns),
            self.watch.report(1e-9 * settings.period_ns, realtime=realtime),
            health.inputs_health(mission, self.rejections, now_ns),
            health.tracking_health(mission, now_ns),
        ]
        statuses = [
            reports.health_message(entry, desk.name, settings.body_frame) for entry in entries
        ]
        self._diagnostics.publish(status_messages.diagnostics(statuses, now_ns))
