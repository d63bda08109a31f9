# SPDX-License-Identifier: Apache-2.0
"""Orbits and bodies of problem files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from riem_planner.errors import InvalidProblemError
from riem_planner.files.places import PLACE_KEYS, read_place
from riem_planner.files.section import Section, shown, within
from riem_planner.sky import Body, Circular, Inertial, Orbit, Satellite, Site, Star, Tle

_CIRCULAR = ("altitude_km", "inclination_deg", "raan_deg", "argument_of_latitude_deg")
_STATE = ("position_km", "velocity_km_s")
_ORBITS = ("tle", "state", "circular")


class Bodies(NamedTuple):
    """Bodies of a file by name.

    Attributes
    ----------
    seen
        Those whose direction depends on where the spacecraft is.
    fixed
        Those that are a place of their own, as the file states it.
    """

    seen: dict[str, Body]
    fixed: dict[str, dict[str, Any]]


def read_orbit(document: Mapping[str, Any]) -> Orbit | None:
    """The spacecraft's orbit; None where the document has none."""
    if "orbit" not in document:
        return None
    return _orbit(Section("orbit", document["orbit"], _ORBITS))


def _orbit(section: Section) -> Orbit:
    given = section.given(*_ORBITS)
    if len(given) != 1:
        raise InvalidProblemError(
            section.path,
            f"expected exactly one of {', '.join(_ORBITS)}, got {', '.join(given) or 'none'}",
        )
    if given == ["tle"]:
        return _tle(section)
    with within(section.key(given[0])):
        inner = Section("", section.value(given[0]), _KEYS[given[0]])
        if given == ["state"]:
            return Inertial(*(inner.numbers(key, 3) for key in _STATE))
        return Circular(*(inner.number(key) for key in _CIRCULAR))


_KEYS = {"state": _STATE, "circular": _CIRCULAR}


def _tle(section: Section) -> Tle:
    lines = section.value("tle")
    if not isinstance(lines, list) or len(lines) != 2:
        raise InvalidProblemError(section.key("tle"), f"expected two lines, got {shown(lines)}")
    if not section.path:
        return Tle(*lines)
    with within(section.path):
        return Tle(*lines)


def read_bodies(document: Mapping[str, Any]) -> Bodies:
    """The bodies of a document, by name."""
    entries = document.get("bodies", {})
    if not isinstance(entries, dict):
        raise InvalidProblemError("bodies", f"expected bodies by name, got {shown(entries)}")
    bodies = Bodies({}, {})
    for name, entry in entries.items():
        path = f"bodies.{name}"
        section = Section(path, entry, (*_STAR, *_SITE, "tle", *PLACE_KEYS))
        kinds = [kind for kind, keys in _KINDS.items() if section.given(*keys)]
        if len(kinds) != 1:
            raise InvalidProblemError(
                path,
                "expected one of a star (ra_deg, dec_deg), a site (latitude_deg, longitude_deg,"
                " altitude_m), a satellite (tle) or a direction, got"
                f" {' and '.join(kinds) or 'none'}",
            )
        if kinds == ["direction"]:
            read_place(section)
            bodies.fixed[name] = dict(entry)
        else:
            with within(path):
                bodies.seen[name] = _READERS[kinds[0]](Section("", entry, tuple(entry)))
    return bodies


def _star(section: Section) -> Body:
    return Star(section.number("ra_deg"), section.number("dec_deg"))


def _site(section: Section) -> Body:
    altitude = section.number("altitude_m", 0.0)
    return Site(section.number("latitude_deg"), section.number("longitude_deg"), altitude)


def _satellite(section: Section) -> Body:
    return Satellite(_tle(section))


_STAR = ("ra_deg", "dec_deg")
_SITE = ("latitude_deg", "longitude_deg", "altitude_m")
_KINDS = {"star": _STAR, "site": _SITE, "satellite": ("tle",), "direction": PLACE_KEYS}
_READERS: dict[str, Callable[[Section], Body]] = {
    "star": _star,
    "site": _site,
    "satellite": _satellite,
}
