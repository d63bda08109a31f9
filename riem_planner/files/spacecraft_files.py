# SPDX-License-Identifier: Apache-2.0
"""Spacecraft files: what many problems share.

    inertia: [..]
    limits: {..}
    instruments:
      tracker_1: {boresight: [..], zones: [{kind: keep_out, body: sun, half_angle_deg: 30, ..}]}
    any_of: {trackers: [tracker_1, tracker_2]}

Each zone becomes an obstacle `tracker_1.sun`; instruments of an `any_of` are the members of a
group, of which at least one is kept. In the problem an instrument's name stands for its boresight.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_json, parse_yaml
from riem_planner.files.section import Section, joined, shown, within

_KEYS = ("name", "inertia", "limits", "instruments", "any_of")
_INSTRUMENT_KEYS = ("boresight", "zones")
_SHARED = ("inertia", "limits")


def with_spacecraft(document: Mapping[str, Any], folder: Path | None) -> dict[str, Any]:
    """A problem's document with what its spacecraft's file says; as it is without one.

    Raises
    ------
    InvalidProblemError
        The file is wrong or not there; or the problem says something of its own beside it.
    """
    result = dict(document)
    if "spacecraft" not in document:
        return result
    name = result.pop("spacecraft")
    if not isinstance(name, str):
        raise InvalidProblemError(
            "spacecraft", f"expected the name of a file beside this one, got {shown(name)}"
        )
    content = _content(name, folder)
    with within(f"spacecraft {name}"):
        parse = parse_json if name.lower().endswith(".json") else parse_yaml
        spacecraft = Section("", parse(decoded(content)), _KEYS)
        instruments = _instruments(spacecraft)
        zones = _zones(instruments, _groups(spacecraft, instruments))
    for key in _SHARED:
        if key in spacecraft:
            if key in result:
                raise InvalidProblemError(key, f"given beside spacecraft {name}; remove one")
            result[key] = spacecraft.value(key)
    axes = {name: instrument["boresight"] for name, instrument in instruments.items()}
    own = result.get("obstacles", [])
    if isinstance(own, list):
        result["obstacles"] = [
            *zones,
            *(_with_axis(z, axes, f"obstacles[{i}]") for i, z in enumerate(own)),
        ]
    result["goal"] = _goal_with_axes(result.get("goal"), axes, "goal")
    return result


def _content(name: str, folder: Path | None) -> bytes:
    path = Path(name) if folder is None else folder / name
    try:
        return path.read_bytes()
    except OSError as error:
        raise InvalidProblemError(
            "spacecraft", f"{path} can't be read: {error.strerror}; it stands beside the problem"
        ) from None


def _instruments(spacecraft: Section) -> dict[str, dict[str, Any]]:
    entries = spacecraft.value("instruments", {})
    if not isinstance(entries, dict):
        raise InvalidProblemError("instruments", f"expected them by name, got {shown(entries)}")
    for name, entry in entries.items():
        section = Section(f"instruments.{name}", entry, _INSTRUMENT_KEYS)
        section.numbers("boresight", 3, expected="a body axis, a list of 3 numbers")
        if not isinstance(section.value("zones", []), list):
            raise InvalidProblemError(
                section.key("zones"), f"expected a list, got {shown(section.value('zones'))}"
            )
    return entries


def _groups(spacecraft: Section, instruments: Mapping[str, Any]) -> dict[str, str]:
    """Group of each instrument that is in one."""
    entries = spacecraft.value("any_of", {})
    if not isinstance(entries, dict):
        raise InvalidProblemError("any_of", f"expected groups by name, got {shown(entries)}")
    groups: dict[str, str] = {}
    for group, members in entries.items():
        if not isinstance(members, list) or not members:
            raise InvalidProblemError(
                f"any_of.{group}", f"expected a list of instruments, got {shown(members)}"
            )
        for member in members:
            if member not in instruments:
                raise InvalidProblemError(
                    f"any_of.{group}",
                    f"unknown instrument {member!r}; known are {', '.join(instruments)}",
                )
            if member in groups:
                raise InvalidProblemError(
                    f"any_of.{group}", f"{member} is in {groups[member]} already; remove one"
                )
            groups[member] = group
    return groups


def _zones(instruments: Mapping[str, Any], groups: Mapping[str, str]) -> list[dict[str, Any]]:
    """Obstacles of all instruments, named after instrument and body."""
    zones: list[dict[str, Any]] = []
    for name, instrument in instruments.items():
        for i, zone in enumerate(instrument.get("zones", [])):
            path = f"instruments.{name}.zones[{i}]"
            if not isinstance(zone, dict):
                raise InvalidProblemError(path, f"expected a zone, got {shown(zone)}")
            if "boresight" in zone:
                raise InvalidProblemError(f"{path}.boresight", "is the instrument's; remove it")
            own = zone.get("name", zone.get("body", str(i)))
            entry = {**zone, "name": f"{name}.{own}", "boresight": instrument["boresight"]}
            if name in groups:
                entry |= {"group": groups[name], "member": name}
            zones.append(entry)
    return zones


def _with_axis(value: Any, axes: Mapping[str, Any], path: str) -> Any:
    """A mapping whose `boresight` may be an instrument's name."""
    if not isinstance(value, dict) or not isinstance(value.get("boresight"), str):
        return value
    name = value["boresight"]
    if name not in axes:
        raise InvalidProblemError(
            joined(path, "boresight"),
            f"unknown instrument {name!r}; known are {', '.join(axes)}",
        )
    return {**value, "boresight": axes[name]}


def _goal_with_axes(goal: Any, axes: Mapping[str, Any], path: str) -> Any:
    if not isinstance(goal, dict):
        return goal
    result = dict(_with_axis(goal, axes, path))
    if "second" in goal:
        result["second"] = _with_axis(goal["second"], axes, f"{path}.second")
    if isinstance(goal.get("any_of"), list):
        result["any_of"] = [
            _goal_with_axes(each, axes, f"{path}.any_of[{i}]")
            for i, each in enumerate(goal["any_of"])
        ]
    return result
