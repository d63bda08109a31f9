"""Publishers: what the node streams, and what it tells and shows of its plans and its health."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray, QuaternionStamped
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import (
    DurabilityPolicy,
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
from riem_planner.mission.events import Event, Level, Proposal
from riem_planner.mission.mission import Mission
from riem_planner.mission.timeline import Setpoint
from riem_planner.node import reports
from riem_planner.node.inputs import overriding

if TYPE_CHECKING:
    from riem_planner.node.planner_node import PlannerNode

REDRAW = 0.2
"""Least time between two drawings: each takes milliseconds, which others may need [s]."""


def output_qos(*, latched: bool) -> QoSProfile:
    """Reliable, depth 1; latched for late joiners, or not."""
    return QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class Outputs:
    """The publishers of a planner node.

    Attributes
    ----------
    watch
        Intervals of the stream.
    rejections
        Bad messages.
    """

    def __init__(self, node: PlannerNode) -> None:
        self.watch = health.StreamWatch()
        self.rejections = health.Rejections()
        self._node = node
        self._status: tuple[Level, str, dict[str, object]] = (Level.OK, "no request yet", {})
        self._unlogged: deque[Event] = deque()
        self._shown: tuple[Proposal, Samples] | None = None
        self._marker_keys: set[Key] = set()
        self._drawn: object = None
        self._drawn_at = 0.0
        managed, plain = node.create_lifecycle_publisher, node.create_publisher
        reference = MultiDOFJointTrajectory
        self._trajectory = self._publisher(managed, PoseArray, "~/trajectory", latched=True)
        self._reference = self._publisher(managed, reference, "~/reference", latched=True)
        self._markers = self._publisher(managed, MarkerArray, "~/markers", latched=True)
        self._setpoint = self._publisher(managed, reference, "~/setpoint", latched=False)
        self._attitude = self._publisher(
            managed, QuaternionStamped, "~/attitude_setpoint", latched=False
        )
        self._report = self._publisher(plain, DiagnosticStatus, "~/status", latched=True)
        self._diagnostics = self._publisher(plain, DiagnosticArray, "/diagnostics", latched=False)
        settings = node.settings
        self._setpoint_message = SetpointMessage(settings.reference_frame, settings.body_frame)

    def _publisher(
        self, create: Callable[..., Any], kind: type, topic: str, *, latched: bool
    ) -> Any:
        def incompatible(event: Any) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            self._node.get_logger().warning(
                f"{topic}: a subscriber asks for an incompatible {policy}; nothing goes to it."
                f" Subscribe with another {policy}, or set qos_overrides of this topic"
            )

        return create(
            kind,
            topic,
            output_qos(latched=latched),
            event_callbacks=PublisherEventCallbacks(incompatible_qos=incompatible),
            qos_overriding_options=overriding(),
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

    def reject(self, topic: str, problem: str) -> None:
        """Note a bad message; warn now and then."""
        warning = self.rejections.note(topic, problem)
        if warning is None:
            return
        self._node.get_logger().warning(warning)
        level, message, values = self._status
        self._publish_status(
            Level.WARN if level is Level.OK else level,
            f"{warning}; before: {message}",
            {**values, "rejected": warning},
        )

    def tell(self, event: Event) -> None:
        """Publish an event as the status, with its plan if it has one; it is logged later."""
        if event.proposal is not None:
            self._show(event.proposal)
        self._status = (event.level, event.message, reports.status_values(event))
        self._publish_status(*self._status)
        self._unlogged.append(event)

    def catch_up(self) -> None:
        """Log and draw what has happened.

        Whoever waits for a plan must not wait for these, with the interpreter's lock held: rclpy
        takes a millisecond to find out where a line comes from, and a drawing some more.
        """
        self.write_log()
        self._draw()

    def write_log(self) -> None:
        """Log the events that have not been."""
        log = self._node.get_logger()
        while self._unlogged:
            event = self._unlogged.popleft()
            line = f"{event.code}: {event.message}"
            if event.level is Level.OK:
                log.info(line)
            elif event.level is Level.WARN:
                log.warning(line)
            else:
                log.error(line)

    def _publish_status(self, level: Level, message: str, values: dict[str, object]) -> None:
        name = f"{self._node.get_name()}: plan"
        self._report.publish(
            status_messages.status_from_report(
                reports.LEVELS[level], name, message, values, self._node.settings.body_frame
            )
        )

    def _show(self, proposal: Proposal) -> None:
        settings = self._node.settings
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

    def _draw(self) -> None:
        """Draw plan and zones, if anything has changed and the last drawing is not too recent."""
        node, shown = self._node, self._shown
        world = node.mission.world
        state = (world, world.version, shown)
        if not node.mission.active:
            return  # nothing would be published
        if state == self._drawn or time.monotonic() - self._drawn_at < REDRAW:
            return
        self._drawn, self._drawn_at = state, time.monotonic()
        now_ns, settings = node.now_ns(), node.settings

        def drawing() -> None:
            with node.lock:
                scene = reports.scene_of(shown, world, settings, now_ns)
            markers, self._marker_keys = markers_from_scene(
                scene, now_ns, settings.reference_frame, self._marker_keys
            )
            self._markers.publish(markers)

        node.worker.chore("markers", drawing)

    def report_health(self, mission: Mission, now_ns: int) -> None:
        """Publish the diagnostics."""
        node = self._node
        entries = [
            health.planner_health(mission, now_ns),
            self.watch.report(1e-9 * node.settings.period_ns, realtime=node.streamer.realtime),
            health.inputs_health(mission, self.rejections, now_ns),
            health.tracking_health(mission, now_ns),
        ]
        name, hardware = node.get_name(), node.settings.body_frame
        statuses = [reports.health_message(entry, name, hardware) for entry in entries]
        self._diagnostics.publish(status_messages.diagnostics(statuses, now_ns))
