# SPDX-License-Identifier: Apache-2.0
"""Bodies: what the spacecraft sees, and where it is from there."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import finite_number
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry.paths import Path, Turning
from riem_planner.sky.ephemeris import ephemeris, times_after
from riem_planner.sky.orbits import EARTH_RADIUS, Orbit

Array = NDArray[np.float64]

BODIES = ("sun", "moon", "earth", "mercury", "venus", "mars", "jupiter", "saturn")
"""Names that are known without an entry of their own."""
RADII = {"sun": 695700.0, "moon": 1737.4, "earth": EARTH_RADIUS}
"""Radii of the bodies that have a limb [km]."""

_SEGMENTS = {"jupiter": "jupiter barycenter", "saturn": "saturn barycenter"}
_LIGHT = 299792.458  # km/s
_LIGHT_STEPS = 4  # of the iteration for the light's way; each leaves 1e-4 of the last error


@dataclass(frozen=True)
class Star:
    """A star, without parallax or motion of its own: its place in the ICRF [deg]."""

    ra_deg: float
    dec_deg: float

    def __post_init__(self) -> None:
        """Validate."""
        for key in ("ra_deg", "dec_deg"):
            object.__setattr__(self, key, finite_number(key, getattr(self, key)))
        if not -90.0 <= self.dec_deg <= 90.0:
            raise InvalidProblemError("dec_deg", f"expected from -90 to 90, got {self.dec_deg:g}")

    @property
    def direction(self) -> Array:
        """Unit vector (3,) in the ICRF."""
        ra, dec = np.radians([self.ra_deg, self.dec_deg])
        return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


@dataclass(frozen=True)
class Site:
    """A point on the Earth, by geodetic coordinates of WGS 84."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0

    def __post_init__(self) -> None:
        """Validate."""
        for key in ("latitude_deg", "longitude_deg", "altitude_m"):
            object.__setattr__(self, key, finite_number(key, getattr(self, key)))
        if not -90.0 <= self.latitude_deg <= 90.0:
            raise InvalidProblemError(
                "latitude_deg", f"expected from -90 to 90, got {self.latitude_deg:g}"
            )

    def position(self, epoch: datetime, seconds: Array) -> Array:
        """Positions (n, 3) in the GCRS [km], seconds (n,) after an epoch."""
        times = times_after(epoch, seconds)
        from skyfield.api import wgs84

        site = wgs84.latlon(self.latitude_deg, self.longitude_deg, self.altitude_m)
        return np.asarray(site.at(times).position.km.T)


@dataclass(frozen=True)
class Satellite:
    """Another satellite, by its orbit."""

    orbit: Orbit


@dataclass(frozen=True, eq=False)
class Fixed:
    """A direction of its own in the reference frame, which needs no ephemeris."""

    direction: Turning | Path


Body = Star | Site | Satellite | Fixed


def barycentric(name: str, epoch: datetime, seconds: Array) -> tuple[Array, Array]:
    """Positions [km] and velocities [km/s] (n, 3) of a body about the solar system's barycentre."""
    placed = ephemeris()[_SEGMENTS.get(name, name)].at(times_after(epoch, seconds))
    return placed.position.km.T, placed.velocity.km_per_s.T


def apparent(name: str, epoch: datetime, seconds: Array, position: Array, velocity: Array) -> Array:
    """Apparent place (n, 3) [km] of a body of the solar system, at its retarded distance.

    Parameters
    ----------
    position, velocity : (n, 3)
        Of the observer, about the barycentre [km], [km/s].
    """
    delay = np.zeros(seconds.size)
    for _ in range(_LIGHT_STEPS):
        way = barycentric(name, epoch, seconds - delay)[0] - position
        delay = np.linalg.norm(way, axis=1) / _LIGHT
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(distance * aberrated(way / distance, velocity))


def aberrated(directions: Array, velocity: Array) -> Array:
    """Directions (n, 3) as an observer of velocity (n, 3) [km/s] sees them.

    `(u / g + (1 + u . b / (1 + 1/g)) b) / (1 + u . b)` with `b = v / c`, g the Lorentz factor
    (Explanatory Supplement to the Astronomical Almanac, 2013, equation 7.40).
    """
    b = velocity / _LIGHT
    along = np.sum(directions * b, axis=-1, keepdims=True)
    slow = np.sqrt(1.0 - np.sum(b * b, axis=-1, keepdims=True))
    return np.asarray((slow * directions + (1.0 + along / (1.0 + slow)) * b) / (1.0 + along))
