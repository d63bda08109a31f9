# SPDX-License-Identifier: Apache-2.0
"""What is known of the zones and obstacles at a time, from parameters and messages."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3, sphere
from riem_planner.mission.settings import Settings, ZoneSettings
from riem_planner.obstacles import Obstacle, OrientationObstacle, Zone
from riem_planner.problem import S2

Array = NDArray[np.float64]

_SHORTEST = 0.2  # s; over less, the noise of a direction outweighs its motion
_WINDOW = 10.0  # s; over more, the rate itself may have changed
_LEAP = 0.1  # rad/s; a direction that seems to move faster has leapt, if no max_speed is known
_SLOWEST = 1e-9  # rad/s; slower is not motion, for any body that is seen from a spacecraft
_LOOK_AHEAD = 0.25  # s of growth beyond now, so that it holds until the next check
_LEAST, _MOST = 1e-6, math.pi - 1e-3  # half-angles that shrinking and growing stop at [rad]


@dataclass
class _Track:
    """Where one zone was seen: newest direction, its time, and the motion up to it."""

    direction: Array
    stamp_ns: int
    rate: Array = field(default_factory=lambda: np.zeros(3))
    history: deque[tuple[int, Array]] = field(default_factory=lambda: deque(maxlen=64))

    def update(self, direction: Array, stamp_ns: int, fastest: float) -> None:
        """Take in a newer direction; the rate is that over the last seconds."""
        self.direction, self.stamp_ns = direction, stamp_ns
        if self.history:
            last_ns, last = self.history[-1]
            angle, elapsed = float(sphere.angle(last, direction)), (stamp_ns - last_ns) * 1e-9
            if elapsed <= 0.0 or angle > 2.0 * (fastest or _LEAP) * elapsed + 1e-3:
                self.history.clear()  # a leap, or time ran backward: no motion to learn from
                self.rate = np.zeros(3)
            elif elapsed < 0.1 * _SHORTEST and len(self.history) > 1:
                return
        self.history.append((stamp_ns, direction))
        while (stamp_ns - self.history[0][0]) * 1e-9 > _WINDOW and len(self.history) > 2:
            self.history.popleft()
        first_ns, first = self.history[0]
        elapsed = (stamp_ns - first_ns) * 1e-9
        if elapsed >= _SHORTEST:
            turn = so3.quaternion_log(so3.minimal_rotation(first, direction))
            self.rate = _slowed(turn / elapsed, fastest)


def _slowed(rate: Array, fastest: float) -> Array:
    speed = float(np.linalg.norm(rate))
    if speed < _SLOWEST:
        return np.zeros(3)
    return rate * (fastest / speed) if 0.0 < fastest < speed else rate


class TurningBodies(NamedTuple):
    """Attitudes that turn on at their rates: orientation obstacles that move.

    Attributes
    ----------
    names : (n)
        Each once.
    quaternions : (n, 4)
        x, y, z, w, at the stamp.
    rates : (n, 3)
        In each one's own axes [rad/s], constant from the stamp on.
    stamp_ns
        [ns].
    """

    names: tuple[str, ...]
    quaternions: Array
    rates: Array
    stamp_ns: int


class World:
    """The newest good data of every zone and body, and the sets of orientation obstacles.

    Parameters
    ----------
    settings
        Which zones there are, and what they are as long as no message came.

    Attributes
    ----------
    version
        Counts the changes.
    """

    def __init__(self, settings: Settings) -> None:
        self.version = 0
        self._settings = settings
        self._tracks: dict[str, _Track] = {}
        self._orientations: Array = np.zeros((0, 4))
        self._orientations_ns: int | None = None
        self._matrices: Array = np.zeros((0, 3, 3))
        self._turning: TurningBodies | None = None

    def configure(self, settings: Settings) -> None:
        """Take new settings; the data that came stays."""
        self._settings = settings
        self.version += 1

    def update(self, source: str, direction: Array, stamp_ns: int) -> bool:
        """Take in a direction (3,) of `zones/<name>` or `bodies/<name>`; False if it is old."""
        zone = next(zone for zone in self._settings.zones if zone.source == source)
        track = self._tracks.get(source)
        if track is not None and stamp_ns < track.stamp_ns:
            return False
        if track is None:
            track = self._tracks[source] = _Track(direction, stamp_ns)
        track.update(direction, stamp_ns, zone.max_speed)
        self.version += 1
        return True

    def update_orientations(self, quaternions: Array, stamp_ns: int) -> bool:
        """Replace the whole set of orientation obstacles (n, 4); False if nothing changed."""
        aged = self._overdue(self._orientations_ns, self._settings.obstacle_timeout, stamp_ns)
        self._orientations_ns = stamp_ns
        if np.array_equal(quaternions, self._orientations) and not aged:
            return False
        self._orientations = np.array(quaternions)
        self._matrices = so3.quaternion_to_matrix(self._orientations)
        self.version += 1
        return True

    def update_turning(self, bodies: TurningBodies) -> None:
        """Replace the whole set of orientation obstacles that turn."""
        self._turning = bodies if bodies.names else None
        self.version += 1

    def shift(self, nanoseconds: int, *, everything: bool = True) -> None:
        """Move stamps: the clock has jumped by that much [ns].

        Where the clock has only begun to be known, not `everything`: what was stamped by a sender
        is right, what came without a stamp came at time 0.
        """

        def moved(stamp_ns: int) -> int:
            return stamp_ns + nanoseconds if everything or stamp_ns == 0 else stamp_ns

        for track in self._tracks.values():
            if moved(track.stamp_ns) != track.stamp_ns:
                track.history.clear()
            track.stamp_ns = moved(track.stamp_ns)
        if self._orientations_ns is not None:
            self._orientations_ns = moved(self._orientations_ns)
        if self._turning is not None:
            self._turning = self._turning._replace(stamp_ns=moved(self._turning.stamp_ns))

    @property
    def missing(self) -> tuple[str, ...]:
        """Zones whose direction is not known, with the body's name."""
        return tuple(
            zone.title
            for zone in self._settings.zones
            if zone.direction is None and zone.source not in self._tracks
        )

    @property
    def moving(self) -> bool:
        """Whether a zone moves or grows, so that its place has to be looked at as time passes."""
        settings = self._settings
        if any(zone.timeout > 0.0 or np.any(self._rate(zone)) for zone in settings.zones):
            return True
        told = self._turning is not None or len(self._orientations) > 0
        return self._turning is not None or (told and settings.obstacle_timeout > 0.0)

    def age(self, source: str, now_ns: int) -> float | None:
        """Age of the data of `zones/<name>` or such [s]; None if no message has come."""
        stamp_ns = self._stamp(source)
        return None if stamp_ns is None else (now_ns - stamp_ns) * 1e-9

    def _stamp(self, source: str) -> int | None:
        if source == "obstacles":
            return self._orientations_ns
        if source == "obstacle_states":
            return None if self._turning is None else self._turning.stamp_ns
        track = self._tracks.get(source)
        return None if track is None else track.stamp_ns

    def stale(self, now_ns: int) -> tuple[str, ...]:
        """Sources of data that is older than its timeout, so that what it tells of grows."""
        timeouts = {zone.source: zone.timeout for zone in self._settings.zones}
        if len(self._orientations):
            timeouts["obstacles"] = self._settings.obstacle_timeout
        timeouts["obstacle_states"] = self._settings.obstacle_timeout
        return tuple(
            source
            for source, timeout in timeouts.items()
            if self._overdue(self._stamp(source), timeout, now_ns) > 0.0
        )

    def _rate(self, zone: ZoneSettings) -> Array:
        if zone.rate is not None:
            return zone.rate
        track = self._tracks.get(zone.source)
        return np.zeros(3) if track is None else track.rate

    @staticmethod
    def _overdue(stamp_ns: int | None, timeout: float, now_ns: int) -> float:
        if stamp_ns is None or timeout == 0.0:
            return 0.0
        return max(0.0, (now_ns - stamp_ns) * 1e-9 - timeout)

    def _growth(self, source: str, timeout: float, speed: float, now_ns: int) -> float:
        """By how much what is told of has grown [rad]."""
        overdue = self._overdue(self._stamp(source), timeout, now_ns)
        return speed * (overdue + _LOOK_AHEAD) if overdue > 0.0 else 0.0

    def zone_at(self, zone: ZoneSettings, now_ns: int) -> Zone:
        """A zone as it is at a time: moved on since it was seen, grown if that was long ago."""
        track = self._tracks.get(zone.source)
        rate = self._rate(zone)
        direction = zone.direction if track is None else track.direction
        assert direction is not None  # callers look at `missing` first
        if track is not None and np.any(rate):
            direction = so3.exp(rate * ((now_ns - track.stamp_ns) * 1e-9)) @ direction
        growth = self._growth(zone.source, zone.timeout, zone.max_speed, now_ns)
        angle = zone.half_angle + (growth if zone.kind == "keep_out" else -growth)
        angle = zone.half_angle if growth == 0.0 else min(max(angle, _LEAST), _MOST)
        strength = zone.normalized_strength
        if strength is None:
            strength = self._settings.normalized_strength
        return Zone(
            direction=direction,
            half_angle=angle,
            boresight=self._settings.boresight if zone.boresight is None else zone.boresight,
            normalized_strength=strength,
            kind="keep_out" if zone.kind == "keep_out" else "keep_in",
            group=zone.group,
            rate=rate,
            name=zone.name,
        )

    def obstacles(self, now_ns: int) -> tuple[Obstacle, ...]:
        """Everything to keep away from or inside of, with its place at a time [ns]."""
        zones = [self.zone_at(zone, now_ns) for zone in self._settings.zones]
        radius = self._radius("obstacles", now_ns)
        still = np.zeros(3)
        standing = [
            self._obstacle(f"obstacle_{i}", matrix, still, radius)
            for i, matrix in enumerate(self._matrices)
        ]
        return (*zones, *standing, *self._turned(now_ns))

    def _radius(self, source: str, now_ns: int) -> float:
        settings = self._settings
        growth = self._growth(
            source, settings.obstacle_timeout, settings.obstacle_max_speed, now_ns
        )
        return min(settings.obstacle_radius + growth, _MOST) if growth else settings.obstacle_radius

    def _turned(self, now_ns: int) -> list[Obstacle]:
        bodies = self._turning
        if bodies is None:
            return []
        elapsed = (now_ns - bodies.stamp_ns) * 1e-9
        told = so3.quaternion_to_matrix(bodies.quaternions)
        matrices = told @ so3.exp(bodies.rates * elapsed)
        radius = self._radius("obstacle_states", now_ns)
        # A constant rate is the same in the body's axes for ever, so in the reference's as well.
        rates = np.einsum("nij,nj->ni", matrices, bodies.rates)
        return [
            self._obstacle(f"obstacle_states/{name}", matrix, rate, radius)
            for name, matrix, rate in zip(bodies.names, matrices, rates, strict=True)
        ]

    def _obstacle(self, name: str, matrix: Array, rate: Array, radius: float) -> Obstacle:
        """An attitude to keep away from, or on s2 the direction of its boresight."""
        settings = self._settings
        if settings.space == S2:
            return Zone(
                matrix @ settings.boresight,
                radius,
                boresight=settings.boresight,
                normalized_strength=settings.normalized_strength,
                rate=rate,
                name=name,
            )
        return OrientationObstacle(
            matrix,
            normalized_strength=settings.normalized_strength,
            radius=radius,
            rate=rate,
            name=name,
        )
