# SPDX-License-Identifier: Apache-2.0
"""What a timeline is made of: the spacecraft, the observations, the sky."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import UNIT_TOLERANCE, unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_yaml
from riem_planner.files.problem_files import read_limits
from riem_planner.files.section import Section, of_file, shown
from riem_planner.files.tables import names_of, read_table
from riem_planner.limits import Limits
from riem_planner.surveys import celestial_attitudes

Array = NDArray[np.float64]

_TOP = ("boresight", "limits", "inertia", "settling_time", "zones")
_ZONE = ("name", "body", "boresight", "half_angle_deg", "limb_angle_deg")
_WIDEST = np.radians(60.0)  # between two rows of the sky; further leaves open which way it went
_OVERLAP = 1e-6  # s by which observations may overlap: rounding of their table


@dataclass(frozen=True, eq=False)
class BodyZone:
    """A cone about a body of the sky that a body axis is kept out of.

    Parameters
    ----------
    name, body
        Its own, and that of the body's columns in the sky table.
    boresight : (3,)
        Unit vector in the body.
    half_angle
        [rad]; above the limb if `from_limb`, else from the centre.
    """

    name: str
    body: str
    boresight: Array
    half_angle: float
    from_limb: bool


@dataclass(frozen=True, eq=False)
class Spacecraft:
    """What a spacecraft file states."""

    boresight: Array
    limits: Limits
    settling_time: float
    zones: tuple[BodyZone, ...]


def read_spacecraft(path: Path) -> Spacecraft:
    """Spacecraft of a YAML file; InvalidProblemError names what is wrong with it."""
    with of_file(path):
        top = Section("", parse_yaml(decoded(path.read_bytes())), _TOP)
        limits = read_limits(top)
        if limits is None:
            raise InvalidProblemError("limits", "missing; give rate and acceleration at least")
        settling_time = top.number("settling_time", 0.0)
        if settling_time < 0.0:
            raise InvalidProblemError(
                "settling_time", f"expected at least 0 s, got {settling_time:g}"
            )
        boresight = unit_vector("boresight", top.numbers("boresight", 3, [1.0, 0.0, 0.0]))
        entries = top.value("zones", [])
        if not isinstance(entries, list):
            raise InvalidProblemError("zones", f"expected a list, got {shown(entries)}")
        zones = tuple(_zone(f"zones[{i}]", e, boresight) for i, e in enumerate(entries))
        names = [zone.name for zone in zones]
        if len(set(names)) != len(names):
            raise InvalidProblemError("zones", f"expected different names, got {names}")
        return Spacecraft(boresight, limits, settling_time, zones)


def _zone(path: str, entry: object, boresight: Array) -> BodyZone:
    section = Section(path, entry, _ZONE)
    given = section.given("half_angle_deg", "limb_angle_deg")
    if len(given) != 1:
        raise InvalidProblemError(
            section.key("half_angle_deg"),
            "expected exactly one of half_angle_deg, limb_angle_deg, got "
            + (" and ".join(given) or "neither"),
        )
    angle = section.number(given[0])
    if not 0.0 <= angle < 180.0:
        raise InvalidProblemError(
            section.key(given[0]), f"expected from 0 to below 180 degrees, got {angle:g}"
        )
    axis = section.numbers("boresight", 3, boresight.tolist())
    return BodyZone(
        section.text("name"),
        section.text("body", section.text("name")),
        unit_vector(section.key("boresight"), axis),
        float(np.radians(angle)),
        given[0] == "limb_angle_deg",
    )


@dataclass(frozen=True, eq=False)
class Observations:
    """Attitudes to hold, in time.

    Parameters
    ----------
    start, duration : (n,)
        [s].
    attitudes : (n, 4)
        Unit quaternions x, y, z, w, body to reference.
    """

    start: Array
    duration: Array
    attitudes: Array

    @property
    def end(self) -> Array:
        """Ends (n,) [s]."""
        return np.asarray(self.start + self.duration)


def read_observations(path: Path) -> Observations:
    """Observations of a table; InvalidProblemError names column and row of what is wrong."""
    table = read_table(path)
    if table.rows == 0:
        raise InvalidProblemError(str(path), "holds no observation")
    start, duration = table.numbers("start_s", "duration_s").T
    for row in np.flatnonzero(duration < 0.0):
        raise InvalidProblemError(
            f"{path}: duration_s, row {row}", f"expected at least 0 s, got {duration[row]:g}"
        )
    for row in np.flatnonzero(start[1:] < (start + duration)[:-1] - _OVERLAP) + 1:
        raise InvalidProblemError(
            f"{path}: start_s, row {row}",
            f"starts at {start[row]:.6f} s, before row {row - 1} ends at"
            f" {start[row - 1] + duration[row - 1]:.6f} s; order them, or shorten one",
        )
    if "orientation_x" in table.names:
        attitudes = table.numbers(*names_of("orientation", "xyzw"))
        norms = np.linalg.norm(attitudes, axis=1)
        for row in np.flatnonzero(np.abs(norms - 1.0) > UNIT_TOLERANCE):
            raise InvalidProblemError(
                f"{path}: orientation, row {row}",
                f"expected a unit quaternion x, y, z, w, got one of norm {norms[row]:.6g}",
            )
        return Observations(start, duration, attitudes / norms[:, None])
    angles = np.radians(table.numbers("ra_deg", "dec_deg", "roll_deg"))
    return Observations(start, duration, celestial_attitudes(*angles.T))


@dataclass(frozen=True, eq=False)
class SkyZone:
    """A zone along the rows of the sky.

    Parameters
    ----------
    zone
        What the spacecraft file states.
    times : (n,)
        [s].
    directions : (n, 3)
        Unit vectors to the body; between rows it moves on great circles.
    half_angles : (n,)
        [rad]; between rows they change linearly.
    """

    zone: BodyZone
    times: Array
    directions: Array
    half_angles: Array

    @cached_property
    def rows(self) -> tuple[Array, Array, Array]:
        """Times, directions, half-angles, as compiled code takes them."""
        return self.times, self.directions, self.half_angles

    def at(self, times: Array) -> tuple[Array, Array]:
        """Directions (m, 3) and half-angles (m,) [rad] at times (m,) within the rows [s]."""
        j = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, self.times.size - 2)
        u = ((times - self.times[j]) / (self.times[j + 1] - self.times[j]))[:, None]
        a, b = self.directions[j], self.directions[j + 1]
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))[:, None]
        near = angle < 1e-6
        sine = np.where(near, 1.0, np.sin(angle))
        first = np.where(near, 1.0 - u, np.sin((1.0 - u) * angle) / sine)
        second = np.where(near, u, np.sin(u * angle) / sine)
        z = first * a + second * b
        half_angles = (1.0 - u[:, 0]) * self.half_angles[j] + u[:, 0] * self.half_angles[j + 1]
        return z / np.linalg.norm(z, axis=1, keepdims=True), half_angles

    def motion(self, first: float, last: float) -> float:
        """How far its edge moves at most between two times [rad]."""
        inside = self.times[(self.times > first) & (self.times < last)]
        z, half_angles = self.at(np.array([first, *inside, last]))
        turns = np.arctan2(
            np.linalg.norm(np.cross(z[1:], z[:-1]), axis=1), np.sum(z[1:] * z[:-1], axis=1)
        )
        return float(np.sum(turns) + np.sum(np.abs(np.diff(half_angles))))


def read_sky(path: Path, zones: tuple[BodyZone, ...]) -> tuple[SkyZone, ...]:
    """The zones along a table of the sky; InvalidProblemError names what is wrong with it."""
    table = read_table(path)
    times = table.numbers("time_s")[:, 0]
    if times.size < 2 or np.any(np.diff(times) <= 0.0):
        raise InvalidProblemError(f"{path}: time_s", "expected at least two increasing times")
    placed = []
    for zone in zones:
        vectors = table.numbers(*names_of(zone.body, "xyz"))
        lengths = np.linalg.norm(vectors, axis=1)
        for row in np.flatnonzero(lengths == 0.0):
            raise InvalidProblemError(
                f"{path}: {zone.body}_x, row {row}", "expected a direction, got the zero vector"
            )
        directions = vectors / lengths[:, None]
        cosines = np.sum(directions[1:] * directions[:-1], axis=1)
        for row in np.flatnonzero(cosines < np.cos(_WIDEST)) + 1:
            raise InvalidProblemError(
                f"{path}: {zone.body}_x, row {row}",
                "expected less than 60 degrees from the row before; give more rows",
            )
        half_angles = np.full(times.size, zone.half_angle)
        if zone.from_limb:
            half_angles += np.radians(table.numbers(f"{zone.body}_limb_deg")[:, 0])
        if np.any(half_angles >= np.pi):
            raise InvalidProblemError(f"{path}: {zone.body}_limb_deg", "the zone is the whole sky")
        placed.append(SkyZone(zone, times, directions, half_angles))
    return tuple(placed)
