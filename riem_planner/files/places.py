# SPDX-License-Identifier: Apache-2.0
"""Where something points or stands: a direction, fixed, turning or along samples."""

from __future__ import annotations

from typing import Any

import numpy as np

from riem_planner.checks import unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.files.section import Section, within
from riem_planner.geometry.paths import Path, Turning

PLACE_KEYS = ("direction", "rate", "directions", "times")
"""Keys of a place in a problem whose bodies are resolved."""

_ONE_OF = "expected exactly one of direction, directions (with times), body"


def read_direction(section: Section, name: str, default: Any = None) -> Any:
    """Unit vector (3,) under a key."""
    options = {} if default is None else {"default": default}
    vector = section.numbers(name, 3, expected="a direction, a list of 3 numbers", **options)
    with within(section.path):
        return unit_vector(name, vector)


def read_place(section: Section) -> Turning | Path:
    """The place that a mapping states: `direction` (with `rate`), or `directions` and `times`.

    Raises
    ------
    InvalidProblemError
        It states none, or more than one, or a wrong one.
    """
    given = section.given("direction", "directions")
    if len(given) != 1:
        raise InvalidProblemError(
            section.key("direction"),
            f"{_ONE_OF}, got both; remove one" if given else f"missing; {_ONE_OF}",
        )
    if given == ["direction"]:
        if "times" in section:
            raise InvalidProblemError(
                section.key("times"), "belongs to directions, samples of one that moves; remove it"
            )
        rate = section.numbers("rate", 3, [0.0, 0.0, 0.0])
        return Turning(read_direction(section, "direction"), rate)
    if "rate" in section:
        raise InvalidProblemError(
            section.key("rate"), "belongs to a direction; directions at times move by themselves"
        )
    rows = section.rows("directions", None, 3, expected="a list of directions, 3 numbers each")
    times = section.numbers("times", len(rows), expected=f"a list of {len(rows)} times [s]")
    with within(section.path):
        return Path(np.array(times), np.array(rows))
