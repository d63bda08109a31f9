# SPDX-License-Identifier: Apache-2.0
"""Problem files: YAML documents and JSON lines to a `Problem`.

A file states what a `Problem` takes, in degrees where a key says `_deg` and in the units of
the Python interface otherwise; README.md lists the keys. Every error names the key by its
whole path, the value, and what to do.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_json, parse_yaml
from riem_planner.files.end_states import check_end_states, read_goal, read_state
from riem_planner.files.obstacles import read_obstacles
from riem_planner.files.places import read_direction
from riem_planner.files.resolving import resolved
from riem_planner.files.section import Section, number_at, shown
from riem_planner.limit_rows import QUANTITIES, UNITS, WHEELS
from riem_planner.limits import Limits, Wheel, checked_inertia
from riem_planner.problem import AUTO, LEAST_ACCELERATION, OBJECTIVES, S2, SO3, Problem

_SPACES = {space.name: space for space in (SO3, S2)}
_TOP = (
    "name", "space", "boresight", "duration", "tension", "normalized_tension", "start", "goal",
    "hold", "notes", "obstacles", "limits", "inertia", "total_momentum", "objective",
)  # fmt: skip
_LIMIT = "a number above 0, or three of them"


def read_problem(path: Path) -> Problem:
    """Problem of a `.yaml`, `.yml` or `.json` file.

    Raises
    ------
    InvalidProblemError
        The file is wrong; the error names the key, the value and the remedy.
    OSError
        The file can't be read.
    """
    return parse_problem(read_document(path), path.parent)


def read_document(path: Path) -> Any:
    """Values of a `.yaml`, `.yml` or `.json` file; raises as `read_problem`."""
    parse = {".yaml": parse_yaml, ".yml": parse_yaml, ".json": parse_json}.get(path.suffix.lower())
    if parse is None:
        raise InvalidProblemError(
            "file name",
            f"expected one ending in .yaml, .json or .jsonl, got {path.name}; rename it",
        )
    return parse(decoded(path.read_bytes()))


def parse_problem(document: Any, folder: Path | None = None) -> Problem:
    """Problem that a parsed document states; raises as `read_problem`.

    Parameters
    ----------
    document
        Values of a file.
    folder
        Where the file is, which a spacecraft's file is beside; by default where we are.
    """
    document = resolved(document, folder)
    top = Section("", document, _TOP)
    space = _SPACES[top.choice("space", tuple(_SPACES))]
    name = top.text("name", "")
    boresight = read_direction(top, "boresight", [1.0, 0.0, 0.0])
    limits = read_limits(top)
    objective = top.choice("objective", OBJECTIVES) if "objective" in top else LEAST_ACCELERATION
    problem = Problem(
        start=read_state(top, "start", space, boresight),
        goal=read_goal(top, space, boresight),
        duration=_duration(top, limits),
        space=space,
        tension=top.number("tension", None),
        normalized_tension=top.number("normalized_tension", None),
        obstacles=tuple(read_obstacles(top)),
        boresight=boresight,
        name=name,
        limits=limits,
        total_momentum=top.numbers("total_momentum", 3, [0.0, 0.0, 0.0]),
        hold=top.number("hold", 0.0),
        objective=objective,
        notes=_notes(top),
    )
    check_end_states(problem, top)
    return problem


def _notes(top: Section) -> tuple[str, ...]:
    notes = top.value("notes", [])
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise InvalidProblemError("notes", f"expected a list of sentences, got {shown(notes)}")
    return tuple(notes)


def _duration(top: Section, limits: Limits | None) -> float:
    expected = f"a number of seconds above 0, or {AUTO} with limits"
    value = top.value("duration", expected=expected)
    if value == AUTO:
        if limits is None:
            raise InvalidProblemError(
                "limits",
                f"missing; duration: {AUTO} is the least within limits, so give them, such as"
                " {rate: 0.02} in rad/s",
            )
        return math.inf
    number: float = top.number("duration", expected=expected)
    if number <= 0.0:
        raise InvalidProblemError("duration", f"expected {expected}, got {shown(value)}")
    return number


def read_limits(top: Section) -> Limits | None:
    """Limits of a mapping with the keys `limits` and `inertia`; None where it states none."""
    inertia = _inertia(top) if "inertia" in top else None
    if "limits" not in top:
        return None
    values = top.value("limits")
    if isinstance(values, dict) and "inertia" in values:
        raise InvalidProblemError("limits.inertia", "move it out: inertia stands beside limits")
    section = Section("limits", values, (*QUANTITIES, WHEELS))
    bounds = {
        name: _bound(section, name, unit)
        for name, unit in zip(QUANTITIES, UNITS, strict=True)
        if name in section
    }
    return Limits(**bounds, inertia=inertia, wheels=_wheels(section))


def _wheels(section: Section) -> tuple[Wheel, ...]:
    entries = section.value(WHEELS, [])
    key = section.key(WHEELS)
    expected = "a list of wheels, each with an axis, a torque [N m] and a momentum [N m s]"
    if not isinstance(entries, list) or (WHEELS in section and not entries):
        raise InvalidProblemError(key, f"expected {expected}, got {shown(entries)}")
    wheels = []
    for i, entry in enumerate(entries):
        wheel = Section(f"{key}[{i}]", entry, ("axis", "torque", "momentum"))
        most = {
            name: _positive(
                wheel.key(name),
                wheel.value(name, expected=f"a number above 0 [{unit}]"),
                f"a number above 0 [{unit}]",
            )
            for name, unit in (("torque", "N m"), ("momentum", "N m s"))
        }
        wheels.append(Wheel(read_direction(wheel, "axis"), **most))
    return tuple(wheels)


def _bound(section: Section, name: str, unit: str) -> float | list[float]:
    key, value = section.key(name), section.value(name)
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if not isinstance(value, list):
        return _positive(key, value, f"{_LIMIT} [{unit}]")
    if len(value) != 3:
        raise InvalidProblemError(key, f"expected {_LIMIT} [{unit}], got {shown(value)}")
    return [
        _positive(f"{key}[{i}]", entry, f"a number above 0 [{unit}]")
        for i, entry in enumerate(value)
    ]


def _positive(key: str, value: Any, expected: str) -> float:
    number = number_at(key, value, expected)
    if number <= 0.0:
        raise InvalidProblemError(key, f"expected {expected}, got {shown(value)}")
    return number


def _inertia(top: Section) -> Any:
    value = top.value("inertia")
    rows = value if isinstance(value, list) else []
    if len(rows) == 3 and all(isinstance(row, list) and len(row) == 3 for row in rows):
        rows = [entry for row in rows for entry in row]
    if len(rows) != 9:
        raise InvalidProblemError(
            "inertia",
            "expected nine numbers in kg m^2, row by row ([2, 0, 0, 0, 2, 0, 0, 0, 3] for principal"
            f" moments of 2, 2, 3), got {shown(value)}",
        )
    numbers = [number_at(f"inertia[{i}]", entry, "a number") for i, entry in enumerate(rows)]
    return checked_inertia(np.reshape(numbers, (3, 3)))
