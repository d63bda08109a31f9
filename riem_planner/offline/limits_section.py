"""The `limits` and `inertia` of a problem file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.offline.section import Section, number_at, shown

_QUANTITIES = {
    "rate": "rad/s",
    "acceleration": "rad/s^2",
    "torque": "N m",
    "momentum": "N m s",
}
_NEED_INERTIA = ("torque", "momentum")


@dataclass(frozen=True, eq=False)
class StatedLimits:
    """Limits of a spacecraft as a file gives them; None where it gives none.

    Parameters
    ----------
    rate, acceleration, torque, momentum
        A bound of the norm, or three of the body axes [rad/s, rad/s^2, N m, N m s].
    inertia : (3, 3)
        Inertia in body axes [kg m^2].
    """

    rate: float | tuple[float, ...] | None = None
    acceleration: float | tuple[float, ...] | None = None
    torque: float | tuple[float, ...] | None = None
    momentum: float | tuple[float, ...] | None = None
    inertia: NDArray[np.float64] | None = None

    def document(self) -> dict[str, Any]:
        """The keys `limits` and `inertia` that state it."""
        limits = {
            name: list(value) if isinstance(value, tuple) else value
            for name in _QUANTITIES
            if (value := getattr(self, name)) is not None
        }
        document: dict[str, Any] = {"limits": limits} if limits else {}
        if self.inertia is not None:
            document["inertia"] = self.inertia.ravel().tolist()
        return document


def read_limits(top: Section) -> StatedLimits | None:
    """Limits of a document; None if it gives none.

    Raises
    ------
    InvalidProblemError
        A limit is not positive, or the inertia it needs is missing or impossible.
    """
    inertia = _inertia(top) if "inertia" in top else None
    if "limits" not in top:
        return None
    section = Section("limits", top.value("limits"), tuple(_QUANTITIES))
    values = {name: _bound(section, name) for name in section.given(*_QUANTITIES)}
    if not values:
        raise InvalidProblemError(
            "limits", f"expected at least one of {', '.join(_QUANTITIES)}, got none"
        )
    for name in _NEED_INERTIA:
        if name in values and inertia is None:
            raise InvalidProblemError(
                "inertia", f"missing; limits.{name} needs it: nine numbers in kg m^2, row by row"
            )
    return StatedLimits(**values, inertia=inertia)


def _bound(section: Section, name: str) -> float | tuple[float, ...]:
    expected = f"a number above 0 or three of them [{_QUANTITIES[name]}]"
    value = section.value(name)
    entries = value if isinstance(value, list) else [value]
    if len(entries) not in (1, 3):
        raise InvalidProblemError(section.key(name), f"expected {expected}, got {shown(value)}")
    numbers = tuple(number_at(section.key(name), entry, expected) for entry in entries)
    if min(numbers) <= 0.0:
        raise InvalidProblemError(section.key(name), f"expected {expected}, got {shown(value)}")
    return numbers if isinstance(value, list) and len(numbers) == 3 else numbers[0]


def _inertia(top: Section) -> NDArray[np.float64]:
    value = top.value("inertia")
    rows = value if isinstance(value, list) else []
    flat = [entry for row in rows for entry in (row if isinstance(row, list) else [row])]
    if len(flat) != 9:
        raise InvalidProblemError(
            "inertia", f"expected nine numbers in kg m^2, row by row, got {shown(value)}"
        )
    matrix = np.array([number_at("inertia", entry, "nine numbers") for entry in flat])
    matrix = matrix.reshape(3, 3)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0):
        raise InvalidProblemError("inertia", f"expected a symmetric matrix, got {shown(value)}")
    moments = np.linalg.eigvalsh(matrix)
    if moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        raise InvalidProblemError(
            "inertia",
            "expected positive principal moments, none above the sum of the others, got"
            f" {moments.tolist()} kg m^2; check the products of inertia",
        )
    return matrix
