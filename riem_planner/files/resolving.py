# SPDX-License-Identifier: Apache-2.0
"""Problem files that name the sky: bodies, limbs, frames and a spacecraft become plain places.

`resolved` turns a document with `epoch`, `orbit`, `bodies` and `spacecraft` into one without them:
each place of a body into samples that cover the arrival and the hold, each limb into a changing
half-angle, the local frame into two axes on two directions. Nothing else is changed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.files.attitudes import ATTITUDE_KEYS, read_attitude
from riem_planner.files.places import PLACE_KEYS
from riem_planner.files.section import Section, shown, within
from riem_planner.files.sky_files import read_bodies, read_orbit
from riem_planner.files.spacecraft_files import with_spacecraft
from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path
from riem_planner.problem import AUTO
from riem_planner.sky import Satellite, Sky
from riem_planner.sky.ephemeris import EXAMPLE, ephemeris
from riem_planner.sky.view import check_known

SKY_KEYS = ("epoch", "orbit", "bodies", "spacecraft")
"""Keys of a problem file that `resolved` takes away."""

_AUTO_HORIZON = 3600.0  # s that paths cover where the duration is yet to be found
_LOOKS = 61  # at whether a target is behind the Earth
_FRAMES = ("lvlh",)

Array = NDArray[np.float64]


def resolved(document: Any, folder: FilePath | None = None) -> Any:
    """The document without anything of the sky; one that names none of it as it is.

    Parameters
    ----------
    document
        Of a problem file.
    folder
        Where the file is, which a spacecraft's file is beside.

    Raises
    ------
    InvalidProblemError
        What it names is unknown or wrong, or a target is behind the Earth when it is needed.
    """
    if not isinstance(document, dict) or not _names_sky(document):
        return document
    document = with_spacecraft(document, folder)
    resolver = _Resolver(document)
    result = {key: value for key, value in document.items() if key not in SKY_KEYS}
    if isinstance(document.get("obstacles"), list):
        result["obstacles"] = [
            resolver.zone(f"obstacles[{i}]", entry) for i, entry in enumerate(document["obstacles"])
        ]
    if isinstance(document.get("goal"), dict):
        result["goal"] = resolver.goal("goal", document["goal"])
    if resolver.notes():
        result["notes"] = [*document.get("notes", []), *resolver.notes()]
    return result


def _names_sky(document: Mapping[str, Any]) -> bool:
    if any(key in document for key in SKY_KEYS):
        return True
    zones = document.get("obstacles")
    return _holds(document.get("goal")) or (
        isinstance(zones, list) and any(_holds(zone) for zone in zones)
    )


def _holds(value: Any) -> bool:
    """Whether a zone, or a goal or one of several, names a body or a frame."""
    if not isinstance(value, dict):
        return False
    several = value.get("any_of")
    parts = [value.get("second"), *(several if isinstance(several, list) else [])]
    return any(key in value for key in ("body", "frame", "limb_angle_deg")) or any(
        _holds(part) for part in parts
    )


class _Resolver:
    """Replaces bodies of one document, whose sky is looked at when the first one asks for it."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self._document = document
        self._bodies = read_bodies(document)
        self._orbit = read_orbit(document)
        self._sky: Sky | None = None
        self._begin, self._arrival, self._end = 0.0, 0.0, _AUTO_HORIZON
        # What is wrong with these keys is told by who reads the problem.
        duration: Any = document.get("duration")
        hold: Any = document.get("hold", 0.0)
        with suppress(TypeError, ValueError):
            H = max(float(hold), 0.0)
            if duration == AUTO:
                self._end, self._arrival = _AUTO_HORIZON + H, math.inf
            elif 0.0 < float(duration) + H < math.inf:
                self._arrival, self._end = float(duration), float(duration) + H

    def notes(self) -> list[str]:
        """Remarks on the sky that was looked at."""
        return [] if self._sky is None else self._sky.notes()

    def zone(self, path: str, entry: Any) -> Any:
        """An obstacle with its place."""
        if not isinstance(entry, dict) or not ("body" in entry or "limb_angle_deg" in entry):
            return entry
        zone = {k: v for k, v in entry.items() if k not in ("body", "limb_angle_deg")}
        if "limb_angle_deg" not in entry:
            return zone | self._place(path, entry)
        self._check_limb(path, entry)
        limb_deg = Section(path, entry, tuple(entry)).number("limb_angle_deg")
        sky = self._looked(path, entry["body"])
        with within(path):
            limb = sky.limb(entry["body"], self._begin, self._end, math.radians(limb_deg))
        half_angles = np.degrees(limb.half_angles)
        sizes = {"half_angles_deg": half_angles.tolist()}
        if np.ptp(half_angles) < 1e-9:  # of a circular orbit
            sizes = {"half_angle_deg": float(half_angles[0])}
        return zone | _samples(limb.path) | sizes

    def _check_limb(self, path: str, entry: Mapping[str, Any]) -> None:
        for other in ("half_angle_deg", "half_angles_deg"):
            if other in entry:
                raise InvalidProblemError(
                    f"{path}.limb_angle_deg", f"given beside {other}; remove one"
                )
        if "body" not in entry:
            raise InvalidProblemError(
                f"{path}.limb_angle_deg", "needs a body with a limb: sun, moon or earth"
            )

    def goal(self, path: str, goal: Any) -> Any:
        """A goal, or several, with its places."""
        if not isinstance(goal, dict):
            return goal
        if isinstance(goal.get("any_of"), list):
            several = [self.goal(f"{path}.any_of[{i}]", g) for i, g in enumerate(goal["any_of"])]
            return goal | {"any_of": several}
        if "frame" in goal:
            return self._local_frame(path, goal)
        result = {k: v for k, v in goal.items() if k != "body"}
        if "body" in goal:
            result |= self._place(path, goal)
            self._check_seen(path, goal["body"])
        if isinstance(goal.get("second"), dict) and "body" in goal["second"]:
            second = goal["second"]
            place = self._place(f"{path}.second", second)
            result["second"] = {k: v for k, v in second.items() if k != "body"} | place
        return result

    def _local_frame(self, path: str, goal: Mapping[str, Any]) -> dict[str, Any]:
        """Two axes on nadir and the orbit's normal: `R b = f` for axes f of the frame."""
        section = Section(path, goal, ("frame", *ATTITUDE_KEYS))
        section.choice("frame", _FRAMES)
        A = so3.quaternion_to_matrix(read_attitude(section))  # body to frame
        sky = self._looked(path, "earth", key="frame", what="frame lvlh")
        nadir, normal = (_samples(place) for place in sky.lvlh(self._begin, self._end))
        return {"boresight": A[2].tolist(), **nadir} | {
            "second": {"boresight": A[1].tolist(), **normal}
        }

    def _place(self, path: str, entry: Mapping[str, Any]) -> dict[str, Any]:
        """The keys of a place instead of a body."""
        others = [key for key in PLACE_KEYS if key in entry]
        if others:
            raise InvalidProblemError(
                path,
                "expected exactly one of direction, directions (with times), body, got"
                f" {others[0]} and body; remove one",
            )
        name = entry["body"]
        fixed = self._bodies.fixed.get(name) if isinstance(name, str) else None
        if fixed is not None:
            return dict(fixed)
        sky = self._looked(path, name)
        with within(path):
            return _samples(sky.path(name, self._begin, self._end))

    def _looked(self, path: str, name: Any, *, key: str = "body", what: str = "") -> Sky:
        """The sky, where epoch and orbit are there and the body is known."""
        if not isinstance(name, str):
            raise InvalidProblemError(f"{path}.{key}", f"expected a name, got {shown(name)}")
        with within(path):
            check_known(name, {**self._bodies.seen, **self._bodies.fixed})
        what = what or f"body {name}"
        if "epoch" not in self._document:
            raise InvalidProblemError("epoch", f"missing; {what} needs it ({EXAMPLE})")
        if self._orbit is None:
            raise InvalidProblemError(
                "orbit", f"missing; {what} is seen from it: give a tle, a state or a circular one"
            )
        if self._sky is None:
            ephemeris()  # so that libraries that are missing are told of here
            self._sky = Sky(self._document["epoch"], self._orbit, self._bodies.seen)
            with within("orbit"):
                self._orbit.position_velocity(self._sky.epoch, self._looks)
        seen = self._bodies.seen.get(name)
        if isinstance(seen, Satellite):
            with within(f"bodies.{name}"):
                seen.orbit.position_velocity(self._sky.epoch, self._looks)
        return self._sky

    @property
    def _looks(self) -> Array:
        """Times at which orbits must give a place, before anything asks for one."""
        return np.linspace(self._begin, self._end, _LOOKS)

    def _check_seen(self, path: str, name: str) -> None:
        """Refuse a target behind the Earth at the arrival or during the hold."""
        if name == "earth" or name in self._bodies.fixed or math.isinf(self._arrival):
            return
        assert self._sky is not None  # its place was asked for
        times = np.linspace(self._arrival, self._end, _LOOKS)
        behind = np.degrees(self._sky.hidden(name, times))
        late = np.flatnonzero(behind > 0.0)
        if late.size:
            k = int(late[0])
            when = "at the arrival" if k == 0 else "during the hold"
            raise InvalidProblemError(
                f"{path}.body",
                f"{name!r} is {behind[k]:.3g} degrees below the Earth's limb {when}, at"
                f" t = {times[k]:.6g} s; choose another epoch, duration, hold or target",
            )


def _samples(path: Path) -> dict[str, Any]:
    return {"times": path.times.tolist(), "directions": path.directions.tolist()}
