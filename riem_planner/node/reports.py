# SPDX-License-Identifier: Apache-2.0
"""What the node tells of plans and health, as samples, drawings and values."""

from __future__ import annotations

import math

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from msg_adapters import status as status_messages
from msg_adapters.markers import Cap, Scene
from msg_adapters.trajectory import Samples
from riem_planner.geometry import so3
from riem_planner.mission.codes import Level
from riem_planner.mission.events import Event, Proposal
from riem_planner.mission.health import Health
from riem_planner.mission.settings import Settings
from riem_planner.mission.zone_tracker import World
from riem_planner.obstacles import Zone

Array = NDArray[np.float64]

LEVELS = {
    Level.OK: status_messages.OK,
    Level.WARN: status_messages.WARN,
    Level.ERROR: status_messages.ERROR,
}
_AXES = 9  # attitudes whose body axes are drawn


def readiness(settings: Settings) -> str:
    """The one line that says what the node watches and keeps to."""
    zones = settings.zones
    names = ", ".join(zone.name for zone in zones)
    parts = [f"{_counted(len(zones), 'zone')} ({names})" if zones else "no zones are watched"]
    if settings.bodies:
        parts.append(_counted(len(settings.bodies), "bod", "y", "ies"))
    limits = settings.limits
    parts.append("no limits" if limits is None else " ".join(["limits", *limits.keys]))
    duration = settings.duration
    parts.append(f"duration {duration:g} s" if duration else "the least duration")
    return f"ready: {', '.join(parts)}"


def _counted(count: int, noun: str, one: str = "", many: str = "s") -> str:
    return f"{count} {noun}{one if count == 1 else many}"


def samples_of(proposal: Proposal, count: int) -> Samples:
    """States of a plan, evenly in time, from its start; the final stop, if any, included."""
    first = proposal.segments[0]
    total = (proposal.segments[-1].end_ns - first.start_ns) * 1e-9
    times = np.linspace(0.0, total, count)
    stamps = first.start_ns + np.round(times * 1e9).astype(np.int64)
    starts = [segment.start_ns for segment in proposal.segments]
    flown = np.searchsorted(starts, stamps, side="right") - 1
    quaternions, rates, accelerations = np.empty((count, 4)), *np.empty((2, count, 3))
    for index, segment in enumerate(proposal.segments):
        here = flown == index
        elapsed = np.minimum((stamps[here] - segment.start_ns) * 1e-9, segment.trajectory.duration)
        q, v, a = segment.trajectory.evaluate_quaternion(elapsed)
        held = (stamps[here] >= segment.end_ns)[:, None]
        quaternions[here] = segment.sign * q
        rates[here], accelerations[here] = np.where(held, 0.0, v), np.where(held, 0.0, a)
    return Samples(times, quaternions, rates, accelerations)


def scene_of(
    shown: tuple[Proposal, Samples] | None, world: World, settings: Settings, now_ns: int
) -> Scene:
    """Drawing of the zones, and of a plan if there is one."""
    obstacles = () if world.missing else world.obstacles(now_ns)
    zones = [obstacle for obstacle in obstacles if isinstance(obstacle, Zone)]
    caps = tuple(
        Cap(
            str(zone.name),
            zone.kind == "keep_in",
            zone.direction_at(0.0),
            float(zone.radius_at(0.0)),
        )
        for zone in zones
    )
    if shown is None:
        return Scene({}, caps, None, np.zeros((0, 3, 3)), settings.boresight)
    proposal, samples = shown
    attitudes = so3.quaternion_to_matrix(samples.quaternions)
    paths = {"boresight": attitudes @ settings.boresight}
    for zone in zones:
        if zone.boresight is not None and not np.allclose(zone.boresight, settings.boresight):
            paths[str(zone.name)] = attitudes @ zone.boresight
    picked = attitudes[np.linspace(0, len(attitudes) - 1, _AXES).round().astype(int)]
    worst = _worst(proposal, zones, settings)
    return Scene(paths, caps, worst, picked, settings.boresight)


def _worst(proposal: Proposal, zones: list[Zone], settings: Settings) -> tuple[str, Array] | None:
    certificate = proposal.solution.certificate
    if certificate is None or not certificate.clearance:
        return None
    name = min(certificate.clearance, key=lambda key: certificate.clearance[key])
    trajectory = proposal.segments[0].trajectory
    time = min(max(certificate.least_clearance_times[name], 0.0), trajectory.duration)
    zone = next((zone for zone in zones if name in (zone.name, zone.group)), None)
    axis = settings.boresight if zone is None or zone.boresight is None else zone.boresight
    place = trajectory.evaluate(time)[0] @ axis
    return f"{name}: {math.degrees(certificate.clearance[name]):.2f} deg", place


def status_values(event: Event) -> dict[str, object]:
    """What ~/status tells of an event beside its sentence: identity, times, numbers."""
    values: dict[str, object] = {"code": event.code.name}
    if event.goal is not None:
        values["goal_stamp"] = status_messages.stamp_text(event.goal.stamp_ns)
    if event.start_ns is not None:
        values["start_time"] = status_messages.stamp_text(event.start_ns)
    if event.arrival_ns is not None:
        values["arrival_time"] = status_messages.stamp_text(event.arrival_ns)
    if event.reason:
        values["reason"] = event.reason
    solution, problem = event.solution, event.problem
    if solution is None:
        return values
    values["solve_time_ms"] = 1e3 * solution.solve_time
    values["iterations"] = solution.iterations
    certificate = solution.certificate
    if certificate is not None:
        values["certified"] = certificate.certified
        for name, clearance in certificate.clearance.items():
            values[f"clearance_deg.{name}"] = math.degrees(clearance)
        values["rate_bound_rad_s"] = certificate.rate_bound
        values["boundary_error_rad"] = certificate.boundary_error[0]
    if solution.trajectory is not None:
        values["cost"] = solution.cost
        values["duration_s"] = solution.trajectory.duration
        values["trajectory_error_rad"] = solution.trajectory_error
        values["local_minimum"] = (
            "unknown" if solution.local_minimum is None else solution.local_minimum
        )
        values["alternatives"] = len(solution.alternatives)
    if problem is not None:
        values["obstacles"] = len(problem.obstacles)
    return values


def health_message(health: Health, node: str, hardware: str) -> DiagnosticStatus:
    """An entry of /diagnostics."""
    return status_messages.status_from_report(
        LEVELS[health.level], f"{node}: {health.name}", health.message, health.values, hardware
    )
