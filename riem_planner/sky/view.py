# SPDX-License-Identifier: Apache-2.0
"""The view from a spacecraft: directions of bodies as paths that a planner follows."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import sphere
from riem_planner.geometry.paths import Path, evaluate_spline, spline_through
from riem_planner.sky.bodies import (
    BODIES,
    RADII,
    Body,
    Fixed,
    Satellite,
    Site,
    Star,
    aberrated,
    apparent,
    barycentric,
)
from riem_planner.sky.ephemeris import parsed_epoch
from riem_planner.sky.orbits import EARTH_RADIUS, Orbit

Array = NDArray[np.float64]

_TOLERANCE = np.radians(1e-6)  # that a path is off half-way between its samples
_FEWEST, _GROWTH, _MOST = 7, 1.3, 50_000  # intervals of a path
_WIDEST = 0.5  # rad between its samples


class Limb(NamedTuple):
    """A disc in the sky: where its centre is, and how far it reaches.

    Attributes
    ----------
    path
        Direction of the centre.
    half_angles : (n,)
        Of the disc, with what was added [rad], at the path's times.
    """

    path: Path
    half_angles: Array


class Sky:
    """What a spacecraft sees from its orbit.

    Parameters
    ----------
    epoch
        Time 0: UTC as text that ends in `Z` or an offset, or a datetime with a time zone.
    orbit
        Of the spacecraft.
    bodies
        Those of the user by name, besides `BODIES`.

    Raises
    ------
    InvalidProblemError
        The epoch is wrong, or the libraries of the sky are not installed.
    """

    def __init__(
        self, epoch: str | datetime, orbit: Orbit, bodies: Mapping[str, Body] | None = None
    ) -> None:
        self.epoch = parsed_epoch(epoch)
        self.orbit = orbit
        self.bodies = dict(bodies or {})

    def position_velocity(self, seconds: Array) -> tuple[Array, Array]:
        """Positions [km] and velocities [km/s] (n, 3) of the spacecraft, by times (n,) [s]."""
        return self.orbit.position_velocity(self.epoch, np.asarray(seconds, dtype=float))

    def places(self, name: str, seconds: Array) -> Array:
        """Where a body is from the spacecraft, (n, 3) [km]; of a star or a fixed one unit vectors.

        Parameters
        ----------
        name
            Of `BODIES`, or one of the user's.
        seconds : (n,)
            Times from the epoch on [s].

        Raises
        ------
        InvalidProblemError
            The body is unknown (key `body`), or its elements give no place.
        """
        t = np.asarray(seconds, dtype=float)
        body = self.bodies.get(name)
        if body is None:
            check_known(name, self.bodies)
        if isinstance(body, Fixed):
            return body.direction.direction_at(t)
        position, velocity = self.position_velocity(t)
        if isinstance(body, Site):
            return body.position(self.epoch, t) - position
        if isinstance(body, Satellite):
            return body.orbit.position_velocity(self.epoch, t)[0] - position
        if name == "earth":
            return -position
        earth, earth_velocity = barycentric("earth", self.epoch, t)
        if isinstance(body, Star):
            return aberrated(np.tile(body.direction, (t.size, 1)), earth_velocity + velocity)
        return apparent(name, self.epoch, t, earth + position, earth_velocity + velocity)

    def directions(self, name: str, seconds: Array) -> Array:
        """Unit vectors (n, 3) to a body, by times (n,) [s]; raises as `places`."""
        places = self.places(name, seconds)
        return np.asarray(places / np.linalg.norm(places, axis=1, keepdims=True))

    def path(self, name: str, begin: float, end: float) -> Path:
        """Direction of a body from one time to another [s], right to 1e-6 degrees.

        Raises as `places`.
        """
        return _fitted(lambda t: self.directions(name, t), begin, end)

    def limb(self, name: str, begin: float, end: float, limb_angle: float = 0.0) -> Limb:
        """Disc of a body from one time to another [s].

        Parameters
        ----------
        name
            `sun`, `moon` or `earth`.
        limb_angle
            What is added to the half-angle of the disc [rad].

        Raises
        ------
        InvalidProblemError
            The body has no limb, or a disc reaches 180 degrees or more, or none is left.
        """
        if name not in RADII or name in self.bodies:
            raise InvalidProblemError(
                "limb_angle_deg", f"of sun, moon or earth only, not of {name}; give half_angle_deg"
            )

        def sizes(t: Array) -> Array:
            distance = np.linalg.norm(self.places(name, t), axis=1)
            return np.asarray(np.arcsin(np.minimum(RADII[name] / distance, 1.0)) + limb_angle)

        path = _fitted(lambda t: self.directions(name, t), begin, end, sizes)
        half_angles = sizes(path.times)
        if not (half_angles.min() > 0.0 and half_angles.max() < np.pi):
            raise InvalidProblemError(
                "limb_angle_deg",
                f"makes a half-angle from {np.degrees(half_angles.min()):.4g} to"
                f" {np.degrees(half_angles.max()):.4g} degrees; expected above 0 and below 180",
            )
        return Limb(path, half_angles)

    def lvlh(self, begin: float, end: float) -> tuple[Path, Path]:
        """Axes z (nadir) and y (against the orbit's normal) of the local frame.

        `z = -r / |r|`, `y = -(r x v) / |r x v|`, `x = y x z`.
        """

        def against_normal(t: Array) -> Array:
            normal = np.cross(*self.position_velocity(t))
            return np.asarray(-normal / np.linalg.norm(normal, axis=1, keepdims=True))

        return self.path("earth", begin, end), _fitted(against_normal, begin, end)

    def hidden(self, name: str, seconds: Array) -> Array:
        """Angle (n,) [rad] by which a body is behind the Earth's limb; negative: it is seen."""
        places = self.places(name, seconds)
        position = self.position_velocity(seconds)[0]
        radius = np.linalg.norm(position, axis=1)
        behind = np.arcsin(EARTH_RADIUS / radius) - sphere.angle(places, -position)
        body = self.bodies.get(name)
        if isinstance(body, Site):
            # It is hidden where the spacecraft is below its horizon.
            up = position + places
            behind = np.sum(places * up, axis=1) / np.linalg.norm(places, axis=1)
            return np.asarray(np.arcsin(np.clip(behind / np.linalg.norm(up, axis=1), -1.0, 1.0)))
        if isinstance(body, Satellite):
            # One that is nearer than the horizon is before the Earth.
            near = np.linalg.norm(places, axis=1) < np.sqrt(radius**2 - EARTH_RADIUS**2)
            return np.asarray(np.where(near, -np.abs(behind), behind))
        return np.asarray(behind)

    def notes(self) -> list[str]:
        """What a user should know: elements that are far from the epoch."""
        return self.orbit.notes(self.epoch)


def check_known(name: str, bodies: Mapping[str, object]) -> None:
    """Refuse a body that nobody knows.

    Raises
    ------
    InvalidProblemError
        With the key `body`.
    """
    known = [*BODIES, *bodies]
    if name not in known:
        close = difflib.get_close_matches(str(name), known, n=1, cutoff=0.6)
        remedy = f"did you mean {close[0]}?" if close else f"known are {', '.join(known)}"
        raise InvalidProblemError("body", f"unknown body {name!r}; {remedy}")


def _fitted(
    directions: Callable[[Array], Array],
    begin: float,
    end: float,
    sizes: Callable[[Array], Array] | None = None,
) -> Path:
    """The path with the fewest samples that is right half-way between them, and so sizes are."""
    intervals = _FEWEST
    while True:
        times = np.linspace(begin, end, intervals + 1)
        samples = directions(times)
        if float(np.max(sphere.angle(samples[1:], samples[:-1]))) > _WIDEST and intervals < _MOST:
            intervals *= 2
            continue
        path = Path(times, samples)
        middles = 0.5 * (times[1:] + times[:-1])
        error = float(np.max(sphere.angle(path.direction_at(middles), directions(middles))))
        if sizes is not None:
            spline = spline_through(times, sizes(times)[:, None])
            found = evaluate_spline(times, spline, middles)[0][:, 0]
            error = max(error, float(np.max(np.abs(found - sizes(middles)))))
        if error <= _TOLERANCE or intervals >= _MOST:
            return path
        intervals = int(_GROWTH * intervals) + 1
