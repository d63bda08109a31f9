# SPDX-License-Identifier: Apache-2.0
"""One mapping of a document, read key by key; every error names the key by its whole path."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import Mapping

_FOREIGN_PREFIX = "best_known_"  # results that case files carry along

_REQUIRED: Any = object()


@contextmanager
def within(path: str) -> Iterator[None]:
    """Put a path before the key of an InvalidProblemError that the body raises."""
    try:
        yield
    except InvalidProblemError as error:
        raise InvalidProblemError(joined(path, error.key), error.problem) from None


@contextmanager
def of_file(path: Path) -> Iterator[None]:
    """Put a file's name before the key of an InvalidProblemError that the body raises."""
    try:
        yield
    except InvalidProblemError as error:
        raise InvalidProblemError(f"{path}: {error.key}", error.problem) from None


def joined(path: str, key: str) -> str:
    """Path of a key within the mapping at `path`."""
    return f"{path}.{key}" if path else key


def shown(value: Any) -> str:
    """Return a value as a message shows it: short, and nothing where nothing was given."""
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


class Section:
    """A mapping with a known set of keys.

    Parameters
    ----------
    path
        Where it stands in the document, `obstacles[1]`; empty for the whole document.
    value
        What the document holds there.
    keys
        The keys it may have.

    Raises
    ------
    InvalidProblemError
        It is no mapping, or it has an unknown or a duplicate key.
    """

    def __init__(self, path: str, value: Any, keys: Sequence[str]) -> None:
        self.path = path
        if not isinstance(value, dict):
            raise InvalidProblemError(
                path or "document",
                f"expected a mapping with the keys {', '.join(keys)}, got {shown(value)}",
            )
        self._values = value
        if isinstance(value, Mapping) and value.duplicates:
            raise InvalidProblemError(
                self.key(value.duplicates[0]), "given more than once; keep one"
            )
        for key in value:
            if key not in keys and not str(key).startswith(_FOREIGN_PREFIX):
                self._refuse_unknown(key, keys)

    def _refuse_unknown(self, key: str, keys: Sequence[str]) -> None:
        close = difflib.get_close_matches(str(key), keys, n=1, cutoff=0.6)
        remedy = f"did you mean {close[0]}?" if close else f"remove it; known are {', '.join(keys)}"
        raise InvalidProblemError(
            self.key(str(key)), f"unknown key (its value is {shown(self._values[key])}); {remedy}"
        )

    def key(self, name: str) -> str:
        """Whole path of a key."""
        return joined(self.path, name)

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def given(self, *names: str) -> list[str]:
        """Those of the names that the mapping has."""
        return [name for name in names if name in self._values]

    def value(self, name: str, default: Any = _REQUIRED, *, expected: str = "a value") -> Any:
        """The value of a key as it stands; without a default the key must be there."""
        if name in self._values:
            return self._values[name]
        if default is _REQUIRED:
            raise InvalidProblemError(self.key(name), f"missing; give {expected}")
        return default

    def text(self, name: str, default: Any = _REQUIRED) -> Any:
        """A non-empty text."""
        value = self.value(name, default, expected="a name")
        if name in self._values and (not isinstance(value, str) or not value.strip()):
            raise InvalidProblemError(
                self.key(name), f"expected text, got {shown(value)}; put it in quotes"
            )
        return value

    def choice(self, name: str, options: Sequence[str]) -> str:
        """One of some words."""
        value = self.value(name, expected=" or ".join(options))
        if value not in options:
            raise InvalidProblemError(
                self.key(name), f"expected {' or '.join(options)}, got {shown(value)}"
            )
        return str(value)

    def number(self, name: str, default: Any = _REQUIRED, *, expected: str = "a number") -> Any:
        """A finite number."""
        value = self.value(name, default, expected=expected)
        return number_at(self.key(name), value, expected) if name in self._values else value

    def numbers(
        self,
        name: str,
        count: int,
        default: Any = _REQUIRED,
        *,
        expected: str = "",
    ) -> Any:
        """A list of `count` finite numbers."""
        expected = expected or f"a list of {count} numbers"
        value = self.value(name, default, expected=expected)
        if name not in self._values:
            return value
        if not isinstance(value, list) or len(value) != count:
            raise InvalidProblemError(self.key(name), f"expected {expected}, got {shown(value)}")
        return [
            number_at(f"{self.key(name)}[{i}]", entry, "a number") for i, entry in enumerate(value)
        ]

    def rows(self, name: str, count: int | None, width: int, *, expected: str) -> list[list[float]]:
        """A list of `count` rows (None: any number) of `width` finite numbers each."""
        value = self.value(name, expected=expected)
        lists = isinstance(value, list) and (count is None or len(value) == count)
        if not lists or not all(isinstance(row, list) and len(row) == width for row in value):
            raise InvalidProblemError(self.key(name), f"expected {expected}, got {shown(value)}")
        return [
            [number_at(f"{self.key(name)}[{i}][{j}]", x, "a number") for j, x in enumerate(row)]
            for i, row in enumerate(value)
        ]


def number_at(key: str, value: Any, expected: str) -> float:
    """A finite number as a float; the error names the key, the value and what was expected."""
    number = math.nan
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    if not math.isfinite(number):
        raise InvalidProblemError(key, f"expected {_finite(expected)}, got {shown(value)}")
    return number


def _finite(expected: str) -> str:
    return "a finite number" if expected == "a number" else expected
