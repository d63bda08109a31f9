# SPDX-License-Identifier: Apache-2.0
"""The obstacles of a problem file: attitudes, and zones that are fixed, move or change."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.files.attitudes import ATTITUDE_KEYS, read_attitude
from riem_planner.files.places import PLACE_KEYS, read_direction, read_place
from riem_planner.files.section import Section, number_at, shown, within
from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path, Turning
from riem_planner.obstacles import Obstacle, OrientationObstacle, Zone

_COMMON = ("name", "kind", "strength", "normalized_strength")
_ZONE = (
    *_COMMON, *PLACE_KEYS, "boresight", "half_angle_deg", "half_angles_deg", "group", "member",
    "active",
)  # fmt: skip
_KEYS = {
    "orientation": (*_COMMON, *ATTITUDE_KEYS, "rate", "radius_deg", "range_deg"),
    "keep_out": (*_ZONE, "range_deg"),
    "keep_in": _ZONE,
}
_WINDOW = "expected [start, end] with start < end"


def read_obstacles(top: Section) -> list[Obstacle]:
    """Everything that a document says to keep away from, or inside of."""
    entries = top.value("obstacles", [])
    if not isinstance(entries, list):
        raise InvalidProblemError("obstacles", f"expected a list, got {shown(entries)}")
    return [read_obstacle(f"obstacles[{i}]", entry) for i, entry in enumerate(entries)]


def read_obstacle(path: str, entry: Any) -> Obstacle:
    """One obstacle, which stands at a path in the document.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names its key by the whole path.
    """
    every_key = sorted({key for keys in _KEYS.values() for key in keys})
    kind = Section(path, entry, every_key).choice("kind", tuple(_KEYS))
    section = Section(path, entry, _KEYS[kind])
    common: dict[str, Any] = {"name": section.text("name", None), **_strength(section)}
    if kind == "orientation":
        radius_deg = _angle(section, "radius_deg", positive=False)
        return OrientationObstacle(
            so3.quaternion_to_matrix(read_attitude(section)),
            radius=math.radians(radius_deg),
            rate=section.numbers("rate", 3, [0.0, 0.0, 0.0]),
            range=_range(section, radius_deg, "radius_deg"),
            **common,
        )
    place = read_place(section)
    sizes_deg = _sizes(section, place, positive=kind == "keep_in")
    if kind == "keep_out":
        common["range"] = _range(section, float(np.max(sizes_deg)), "half_angle_deg")
    common |= {
        "boresight": read_direction(section, "boresight") if "boresight" in section else None,
        "group": section.text("group", None),
        "member": section.text("member", None),
        "active": _windows(section),
    }
    half_angle = np.radians(sizes_deg) if np.ndim(sizes_deg) else math.radians(float(sizes_deg))
    with within(path):
        return Zone(
            place, half_angle, kind="keep_in" if kind == "keep_in" else "keep_out", **common
        )


def _strength(section: Section) -> dict[str, float]:
    """What is stated; nothing where nothing is, so that the usual strength counts."""
    given = section.given("strength", "normalized_strength")
    if len(given) == 2:
        raise InvalidProblemError(
            section.key("strength"),
            "expected at most one of strength, normalized_strength, got both; remove one",
        )
    numbers = {key: section.number(key) for key in given}
    for key, number in numbers.items():
        if number <= 0.0:
            raise InvalidProblemError(
                section.key(key),
                f"expected a number above 0, got {number:g}; an obstacle that is not to count is"
                " left out",
            )
    return numbers


def _sizes(
    section: Section, place: Turning | Path, *, positive: bool
) -> float | NDArray[np.float64]:
    """Half-angle of a zone [degrees], or half-angles (n,) at the times of its directions."""
    if "half_angles_deg" not in section:
        return _angle(section, "half_angle_deg", positive=positive)
    key = section.key("half_angles_deg")
    if "half_angle_deg" in section:
        raise InvalidProblemError(key, "given beside half_angle_deg; remove one")
    if not isinstance(place, Path):
        raise InvalidProblemError(key, "needs directions and times; give half_angle_deg")
    count = place.times.size
    sizes = section.numbers(
        "half_angles_deg", count, expected=f"a list of {count} angles, one for each of times"
    )
    for i, size in enumerate(sizes):
        _check_angle(f"{key}[{i}]", size, positive=positive)
    return np.array(sizes)


def _angle(section: Section, name: str, *, positive: bool) -> float:
    if positive and name not in section:
        raise InvalidProblemError(
            section.key(name), "missing; give an angle above 0 and below 180 degrees"
        )
    degrees: float = section.number(name, 0.0)
    return _check_angle(section.key(name), degrees, positive=positive)


def _check_angle(key: str, degrees: float, *, positive: bool) -> float:
    if not 0.0 <= degrees < 180.0 or (positive and degrees == 0.0):
        least = "above 0" if positive else "of at least 0"
        raise InvalidProblemError(
            key, f"expected an angle {least} and below 180 degrees, got {degrees:g}"
        )
    return degrees


def _range(section: Section, radius_deg: float, size: str) -> tuple[float, float] | None:
    if "range_deg" not in section:
        return None
    on, off = section.numbers("range_deg", 2, expected="[on, off], two angles in degrees")
    if not radius_deg < on < off < 180.0:
        raise InvalidProblemError(
            section.key("range_deg"),
            f"expected {size} < on < off < 180, got {size} {radius_deg:g}, on {on:g}, off {off:g}",
        )
    return math.radians(on), math.radians(off)


def _windows(section: Section) -> tuple[tuple[float, float], ...]:
    """When a zone is active: a list of windows, or one alone."""
    key = section.key("active")
    given = section.value("active", [])
    if not isinstance(given, list):
        raise InvalidProblemError(key, f"{_WINDOW}, or a list of them, got {shown(given)}")
    alone = bool(given) and not isinstance(given[0], list)
    windows = []
    for window in [given] if alone else given:
        if not isinstance(window, list) or len(window) != 2:
            raise InvalidProblemError(key, f"{_WINDOW}, got {shown(window)}")
        start, end = (number_at(key, time, "a time [s]") for time in window)
        if not start < end:
            raise InvalidProblemError(key, f"{_WINDOW}, got {shown(window)}")
        windows.append((start, end))
    return tuple(windows)
