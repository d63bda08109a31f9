# SPDX-License-Identifier: Apache-2.0
"""Orbits: where the spacecraft, or another one, is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import finite_array, finite_number
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.sky.ephemeris import times_after, timescale

Array = NDArray[np.float64]

MU = 398600.4418
"""Gravitational parameter of the Earth [km^3/s^2]."""
EARTH_RADIUS = 6378.137
"""Equatorial radius of the Earth [km]."""

_STALE = 7.0  # days from a TLE's epoch, after which it is off by kilometres
_KEPLER_STEPS, _KEPLER_ERROR = 60, 1e-13
_TLE_LENGTH = 69
_FILLER = "999999"  # in place of the revolutions and the checksum, the last six columns of line 2


@dataclass(frozen=True)
class Tle:
    """Two lines of mean elements, propagated by SGP4.

    Raises
    ------
    InvalidProblemError
        A line is no line of a TLE, or its checksum is wrong; the key is `tle[0]` or `tle[1]`.
    """

    line_1: str
    line_2: str

    def __post_init__(self) -> None:
        """Check both lines, which the propagator does not."""
        for i, line in enumerate((self.line_1, self.line_2)):
            _check_line(i, line)
        if self.line_1[2:7] != self.line_2[2:7]:
            raise InvalidProblemError(
                "tle",
                f"expected both lines of one satellite, got those of {self.line_1[2:7].strip()}"
                f" and {self.line_2[2:7].strip()}",
            )

    def position_velocity(self, epoch: datetime, seconds: Array) -> tuple[Array, Array]:
        """Positions [km] and velocities [km/s] (n, 3) in the GCRS, seconds (n,) after an epoch."""
        satellite = self._satellite()
        placed = satellite.at(times_after(epoch, seconds))
        position, velocity = placed.position.km.T, placed.velocity.km_per_s.T
        wrong = np.flatnonzero(~np.isfinite(position).all(axis=1))
        if wrong.size:
            told = np.atleast_1d(np.asarray(placed.message, dtype=object))
            why = told[min(int(wrong[0]), told.size - 1)]
            raise InvalidProblemError(
                "tle", f"SGP4 gives no place {seconds[wrong[0]]:.6g} s after the epoch: {why}"
            )
        height = np.linalg.norm(position, axis=1) - EARTH_RADIUS
        if height.min() <= 0.0:
            raise InvalidProblemError(
                "tle",
                f"SGP4 puts it {-height.min():.4g} km below the ground; take elements nearer to the"
                " epoch",
            )
        return position, velocity

    def notes(self, epoch: datetime) -> list[str]:
        """What a user should know: elements that are far from the epoch."""
        begin = times_after(epoch, np.zeros(1))
        days = float(begin.tt[0]) - float(self._satellite().epoch.tt)
        told = []
        if _made_up(self.line_2):
            told.append(f"orbit.tle[1]: ends in the filler {_FILLER}, so its checksum says nothing")
        if abs(days) > _STALE:
            when = "after" if days > 0.0 else "before"
            told.append(f"orbit.tle: the epoch is {abs(days):.1f} days {when} that of the elements")
        return told

    def _satellite(self) -> Any:
        scale = timescale()
        from skyfield.api import EarthSatellite

        try:
            return EarthSatellite(self.line_1, self.line_2, None, scale)
        except ValueError as error:
            raise InvalidProblemError("tle", f"SGP4 can't read it: {error}") from None


def _check_line(index: int, line: Any) -> None:
    key = f"tle[{index}]"
    if not isinstance(line, str) or len(line.rstrip()) != _TLE_LENGTH:
        size = len(line.rstrip()) if isinstance(line, str) else 0
        raise InvalidProblemError(
            key, f"expected a line of {_TLE_LENGTH} characters, got {size}: {line!r}"
        )
    if not line.startswith(f"{index + 1} "):
        raise InvalidProblemError(
            key, f"expected a line that begins with {index + 1}, got {line!r}"
        )
    if _made_up(line):
        return
    found = sum(int(c) if c.isdigit() else c == "-" for c in line[: _TLE_LENGTH - 1]) % 10
    if line[_TLE_LENGTH - 1] != str(found):
        raise InvalidProblemError(
            key,
            f"checksum: the line ends in {line[_TLE_LENGTH - 1]}, its digits make {found}; copy it"
            " again",
        )


def _made_up(line: str) -> bool:
    """Whether revolutions and checksum are nines throughout: filler of elements made by hand."""
    return line.startswith("2 ") and line.rstrip().endswith(_FILLER)


@dataclass(frozen=True, eq=False)
class Inertial:
    """A position [km] and velocity [km/s] (3,) at time 0 in the GCRS; two bodies from there on."""

    position_km: Array
    velocity_km_s: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        for key in ("position_km", "velocity_km_s"):
            object.__setattr__(self, key, finite_array(key, getattr(self, key), (3,)))
        distance = float(np.linalg.norm(self.position_km))
        if distance <= EARTH_RADIUS:
            raise InvalidProblemError(
                "position_km",
                f"expected more than {EARTH_RADIUS:g} km from the Earth's centre, got"
                f" {distance:.6g} km",
            )
        if not np.any(np.cross(self.position_km, self.velocity_km_s)):
            raise InvalidProblemError("velocity_km_s", "expected an orbit, got a fall")
        if self._energy() >= 0.0:
            raise InvalidProblemError(
                "velocity_km_s", "expected an orbit about the Earth, got an escape from it"
            )

    def _energy(self) -> float:
        r, v = np.linalg.norm(self.position_km), np.linalg.norm(self.velocity_km_s)
        return float(0.5 * v * v - MU / r)

    def position_velocity(self, epoch: datetime, seconds: Array) -> tuple[Array, Array]:
        """Positions [km] and velocities [km/s] (n, 3), seconds (n,) after time 0.

        By Lagrange's coefficients and Kepler's equation in the eccentric anomaly's difference
        (Battin 1999, section 4.3).
        """
        r, v = self.position_km, self.velocity_km_s
        radius, a = float(np.linalg.norm(r)), -0.5 * MU / self._energy()
        n = math.sqrt(MU / a**3)
        sigma = float(r @ v) / math.sqrt(MU)
        cosine, sine = 1.0 - radius / a, sigma / math.sqrt(a)  # e cos E, e sin E at time 0
        M = n * np.asarray(seconds, dtype=float)
        x = M.copy()
        for _ in range(_KEPLER_STEPS):
            error = x - cosine * np.sin(x) + sine * (1.0 - np.cos(x)) - M
            step = error / (1.0 - cosine * np.cos(x) + sine * np.sin(x))
            x -= np.clip(step, -1.0, 1.0)
            if np.all(np.abs(step) <= _KEPLER_ERROR * (1.0 + np.abs(M))):
                break
        f = 1.0 - a / radius * (1.0 - np.cos(x))
        g = (M - (x - np.sin(x))) / n
        position = f[:, None] * r + g[:, None] * v
        distance = np.linalg.norm(position, axis=1)
        f_1 = -math.sqrt(MU * a) / (radius * distance) * np.sin(x)
        g_1 = 1.0 - a / distance * (1.0 - np.cos(x))
        return position, f_1[:, None] * r + g_1[:, None] * v

    def notes(self, epoch: datetime) -> list[str]:
        """What a user should know: nothing."""
        return []


@dataclass(frozen=True)
class Circular:
    """A circular orbit of two bodies, by its height and angles about the axes of the GCRS."""

    altitude_km: float
    inclination_deg: float
    raan_deg: float
    argument_of_latitude_deg: float

    def __post_init__(self) -> None:
        """Validate."""
        for key in ("altitude_km", "inclination_deg", "raan_deg", "argument_of_latitude_deg"):
            object.__setattr__(self, key, finite_number(key, getattr(self, key)))
        if self.altitude_km <= 0.0:
            raise InvalidProblemError(
                "altitude_km", f"expected a height above 0 km, got {self.altitude_km:g}"
            )

    def position_velocity(self, epoch: datetime, seconds: Array) -> tuple[Array, Array]:
        """Positions [km] and velocities [km/s] (n, 3), seconds (n,) after time 0."""
        radius = EARTH_RADIUS + self.altitude_km
        rate = math.sqrt(MU / radius**3)
        u = math.radians(self.argument_of_latitude_deg) + rate * np.asarray(seconds, dtype=float)
        plane = so3.exp([0.0, 0.0, math.radians(self.raan_deg)]) @ so3.exp(
            [math.radians(self.inclination_deg), 0.0, 0.0]
        )
        along = np.column_stack([np.cos(u), np.sin(u), np.zeros_like(u)]) @ plane.T
        across = np.column_stack([-np.sin(u), np.cos(u), np.zeros_like(u)]) @ plane.T
        return radius * along, radius * rate * across

    def notes(self, epoch: datetime) -> list[str]:
        """What a user should know: nothing."""
        return []


Orbit = Tle | Inertial | Circular
