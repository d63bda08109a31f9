# SPDX-License-Identifier: Apache-2.0
"""The page of the documentation that holds the tables."""

from __future__ import annotations

from pathlib import Path

DOCUMENT = Path(__file__).resolve().parents[2] / "docs/basilisk.md"

_BEGIN = "<!-- written by `make basilisk ARGS=--docs`, from here -->\n"
_END = "<!-- to here -->\n"


def insert(page: str, tables: str) -> str:
    """The page with the tables between its two markers.

    Raises
    ------
    ValueError
        The page has not each marker once.
    """
    for marker in (_BEGIN, _END):
        if page.count(marker) != 1:
            raise ValueError(f"expected {marker.strip()!r} once in the page")
    before, rest = page.split(_BEGIN)
    return f"{before}{_BEGIN}\n{tables}\n{_END}{rest.split(_END)[1]}"
