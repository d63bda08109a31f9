"""What is known of the zones and obstacles at a time, from parameters and messages."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

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


class World:
    """The newest good data of every zone, and the set of orientation obstacles.

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
        self._standing: tuple[Obstacle, ...] = ()

    def configure(self, settings: Settings) -> None:
        """Take new settings; the data that came stays."""
        self._settings = settings
        self._place_orientations()
        self.version += 1

    def update_zone(self, name: str, direction: Array, stamp_ns: int) -> bool:
        """Take in the direction (3,) of a zone; False if it is older than what is known."""
        zone = next(zone for zone in self._settings.zones if zone.name == name)
        track = self._tracks.get(name)
        if track is not None and stamp_ns < track.stamp_ns:
            return False
        if track is None:
            track = self._tracks[name] = _Track(direction, stamp_ns)
        track.update(direction, stamp_ns, zone.max_speed)
        self.version += 1
        return True

    def update_orientations(self, quaternions: Array) -> bool:
        """Replace the whole set of orientation obstacles (n, 4); False if nothing changed."""
        if np.array_equal(quaternions, self._orientations):
            return False
        self._orientations = np.array(quaternions)
        self._place_orientations()
        self.version += 1
        return True

    def _place_orientations(self) -> None:
        matrices = so3.quaternion_to_matrix(self._orientations)
        self._standing = tuple(self._obstacle(i, matrix) for i, matrix in enumerate(matrices))

    def shift(self, nanoseconds: int, *, everything: bool = True) -> None:
        """Move stamps: the clock has jumped by that much [ns].

        Where the clock has only begun to be known, not `everything`: what was stamped by a sender
        is right, what came without a stamp came at time 0.
        """
        for track in self._tracks.values():
            if everything or track.stamp_ns == 0:
                track.stamp_ns += nanoseconds
                track.history.clear()

    @property
    def missing(self) -> tuple[str, ...]:
        """Zones whose direction is not known."""
        return tuple(
            zone.name
            for zone in self._settings.zones
            if zone.direction is None and zone.name not in self._tracks
        )

    @property
    def moving(self) -> bool:
        """Whether a zone moves or grows, so that its place has to be looked at as time passes."""
        return any(zone.timeout > 0.0 or np.any(self._rate(zone)) for zone in self._settings.zones)

    def age(self, name: str, now_ns: int) -> float | None:
        """Age of a zone's data [s]; None if no message has come."""
        track = self._tracks.get(name)
        return None if track is None else (now_ns - track.stamp_ns) * 1e-9

    def stale(self, now_ns: int) -> tuple[str, ...]:
        """Zones whose data is older than their timeout."""
        return tuple(
            zone.name for zone in self._settings.zones if self._overdue(zone, now_ns) > 0.0
        )

    def _rate(self, zone: ZoneSettings) -> Array:
        if zone.rate is not None:
            return zone.rate
        track = self._tracks.get(zone.name)
        return np.zeros(3) if track is None else track.rate

    def _overdue(self, zone: ZoneSettings, now_ns: int) -> float:
        age = self.age(zone.name, now_ns)
        if age is None or zone.timeout == 0.0:
            return 0.0
        return max(0.0, age - zone.timeout)

    def zone_at(self, zone: ZoneSettings, now_ns: int) -> Zone:
        """A zone as it is at a time: moved on since it was seen, grown if that was long ago."""
        track = self._tracks.get(zone.name)
        rate = self._rate(zone)
        direction = zone.direction if track is None else track.direction
        assert direction is not None  # callers look at `missing` first
        if track is not None and np.any(rate):
            direction = so3.exp(rate * ((now_ns - track.stamp_ns) * 1e-9)) @ direction
        overdue = self._overdue(zone, now_ns)
        growth = zone.max_speed * (overdue + _LOOK_AHEAD) if overdue > 0.0 else 0.0
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
        return (*zones, *self._standing)

    def _obstacle(self, index: int, matrix: Array) -> Obstacle:
        """One of ~/obstacles: an attitude, or on s2 the direction of its boresight."""
        settings = self._settings
        name = f"obstacle_{index}"
        if settings.space == S2:
            return Zone(
                matrix @ settings.boresight,
                settings.obstacle_radius,
                boresight=settings.boresight,
                normalized_strength=settings.normalized_strength,
                name=name,
            )
        return OrientationObstacle(
            matrix,
            normalized_strength=settings.normalized_strength,
            radius=settings.obstacle_radius,
            name=name,
        )
