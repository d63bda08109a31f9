"""What a spacecraft can do: largest body rate, acceleration, torque and wheel momentum."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_array, frozen, positive_number
from riem_planner.errors import InvalidProblemError

Array = NDArray[np.float64]

QUANTITIES = ("rate", "acceleration", "torque", "momentum")
UNITS = ("rad/s", "rad/s^2", "N m", "N m s")

_SYMMETRY = 1e-9  # relative, of an inertia matrix


@dataclass(frozen=True, eq=False)
class Limits:
    """Largest values along a slew, each one number (of the norm) or three (per body axis).

    Parameters
    ----------
    rate
        Of the body rate v [rad/s].
    acceleration
        Of the body acceleration `a = v'` [rad/s^2].
    torque
        Of the control torque `J a + v x J v` [N m]; needs the inertia.
    momentum
        Of the angular momentum `J v` that the wheels store [N m s]; needs the inertia.
    inertia : (3, 3)
        J in body axes [kg m^2], symmetric and positive definite.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names it.
    """

    rate: float | ArrayLike | None = None
    acceleration: float | ArrayLike | None = None
    torque: float | ArrayLike | None = None
    momentum: float | ArrayLike | None = None
    inertia: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Validate and freeze."""
        stated = [key for key in QUANTITIES if getattr(self, key) is not None]
        if not stated:
            raise InvalidProblemError(
                "limits", f"expected at least one of {', '.join(QUANTITIES)}, got none"
            )
        for key in stated:
            object.__setattr__(self, key, _bound(f"limits.{key}", getattr(self, key)))
        if self.inertia is not None:
            object.__setattr__(self, "inertia", checked_inertia(self.inertia))
            return
        for key in ("torque", "momentum"):
            if getattr(self, key) is not None:
                raise InvalidProblemError(
                    "inertia",
                    f"missing; limits.{key} needs it: a 3x3 matrix, row by row, in kg m^2",
                )

    @cached_property
    def inertia_matrix(self) -> Array:
        """J (3, 3) [kg m^2]; the identity where no limit needs it."""
        return frozen(np.eye(3) if self.inertia is None else np.array(self.inertia))

    @cached_property
    def largest_moment(self) -> float:
        """Greatest principal moment of inertia [kg m^2]."""
        return float(np.linalg.eigvalsh(self.inertia_matrix)[-1])

    @cached_property
    def reciprocals(self) -> Array:
        """Reciprocals (4, 4) of the limits: per quantity of the norm, then of each axis.

        0 where there is no limit, so that products are the part of a limit that is used.
        """
        table = np.zeros((4, 4))
        for row, key in enumerate(QUANTITIES):
            value = getattr(self, key)
            if isinstance(value, float):
                table[row, 0] = 1.0 / value
            elif value is not None:
                table[row, 1:] = 1.0 / value
        return frozen(table)

    def used(self, v: ArrayLike, a: ArrayLike) -> dict[str, float]:
        """Part of each limit that a motion uses at its worst; above 1 the limit is broken.

        Parameters
        ----------
        v, a : (..., 3)
            Body rates [rad/s] and accelerations [rad/s^2].
        """
        J = self.inertia_matrix
        v, a = np.asarray(v, dtype=float), np.asarray(a, dtype=float)
        momentum = v @ J
        values = (v, a, a @ J + np.cross(v, momentum), momentum)
        parts = {}
        for key, value, row in zip(QUANTITIES, values, self.reciprocals, strict=True):
            if getattr(self, key) is not None:
                norms = row[0] * np.linalg.norm(value, axis=-1)
                axes = np.max(row[1:] * np.abs(value), axis=-1)
                parts[key] = float(np.max(np.maximum(norms, axes)))
        return parts


def _bound(key: str, value: Any) -> float | Array:
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return positive_number(key, value)
    array = finite_array(key, value, (3,))
    if np.any(array <= 0.0):
        raise InvalidProblemError(key, f"expected numbers above 0, got {array.tolist()}")
    return array


def checked_inertia(value: Any) -> Array:
    """Inertia matrix (3, 3) [kg m^2] that some rigid body can have, read-only.

    Raises
    ------
    InvalidProblemError
        It is not symmetric, or no body has its principal moments.
    """
    matrix = finite_array("inertia", value, (3, 3))
    skew = np.abs(matrix - matrix.T)
    if float(np.max(skew)) > _SYMMETRY * float(np.max(np.abs(matrix))):
        i, j = (int(k) for k in np.unravel_index(np.argmax(skew), (3, 3)))
        raise InvalidProblemError(
            "inertia",
            f"expected a symmetric matrix, got {matrix[i, j]:g} in row {i + 1}, column {j + 1} and"
            f" {matrix[j, i]:g} in row {j + 1}, column {i + 1}; make them equal",
        )
    moments = np.linalg.eigvalsh(matrix)
    shown = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0.0:
        raise InvalidProblemError(
            "inertia",
            f"expected positive principal moments, got {shown}; check the signs of its entries",
        )
    if moments[0] + moments[1] < moments[2] * (1.0 - 1e-6):
        raise InvalidProblemError(
            "inertia",
            "no body has these principal moments: the largest exceeds the sum of the others,"
            f" {shown}; check the entries of its diagonal",
        )
    return frozen(0.5 * (matrix + matrix.T))
