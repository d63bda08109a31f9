# SPDX-License-Identifier: Apache-2.0
"""What a spacecraft can do: largest rate, acceleration, torque, momentum, jerk; its wheels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_array, frozen, positive_number, unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.limit_rows import KEYS, QUANTITIES, WHEELS

Array = NDArray[np.float64]

_NEED_INERTIA = ("torque", "momentum", "torque_rate", WHEELS)
_SYMMETRY = 1e-9  # relative, of an inertia matrix
_LEAST_SPREAD = 1e-6  # of wheels' axes, the least singular value over the greatest


@dataclass(frozen=True, eq=False)
class Wheel:
    """A reaction wheel.

    Parameters
    ----------
    axis : (3,)
        Its spin axis in body axes; any length but zero.
    torque
        The most that its motor gives [N m].
    momentum
        The most that it stores [N m s].
    """

    axis: ArrayLike
    torque: float
    momentum: float

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(self, "axis", unit_vector("axis", self.axis))
        for key in ("torque", "momentum"):
            object.__setattr__(self, key, positive_number(key, getattr(self, key)))


class LimitTable(NamedTuple):
    """Limits as arrays, which compiled code reads: the part used of quantity f is the greatest of
    `norms[i] |f|` and `|rows[k] . f|`, k from `first[i]` to `first[i + 1]`.

    Attributes
    ----------
    norms : (8,)
        Reciprocal of the limit of a quantity's norm; 0 without one.
    rows : (n, 3)
        Directions over limits.
    first : (9,)
        First row of each quantity.
    """  # noqa: D205 (a formula)

    norms: Array
    rows: Array
    first: NDArray[np.int64]


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
    jerk
        Of `a'` [rad/s^3].
    torque_rate
        Of the derivative of the control torque [N m/s]; needs the inertia.
    wheels
        Reaction wheels, at least three, whose axes span space; needs the inertia. With P the
        pseudo-inverse of the matrix of their axes and h the total angular momentum in body axes,
        wheel i gives `(P (J a + v x h))_i` and stores `(P (h - J v))_i`.
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
    jerk: float | ArrayLike | None = None
    torque_rate: float | ArrayLike | None = None
    wheels: tuple[Wheel, ...] = ()

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(self, WHEELS, _checked_wheels(self.wheels))
        if not self.keys:
            raise InvalidProblemError(
                "limits", f"expected at least one of {', '.join(KEYS[:-1])}, got none"
            )
        for key in (key for key in self.keys if key != WHEELS):
            object.__setattr__(self, key, _bound(f"limits.{key}", getattr(self, key)))
        if self.inertia is not None:
            object.__setattr__(self, "inertia", checked_inertia(self.inertia))
            return
        for key in _NEED_INERTIA:
            if key in self.keys:
                raise InvalidProblemError(
                    "inertia",
                    f"missing; limits.{key} needs it: a 3x3 matrix, row by row, in kg m^2",
                )

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Keys of the limits that there are."""
        return tuple(
            key
            for key in KEYS[:-1]
            if (self.wheels if key == WHEELS else getattr(self, key) is not None)
        )

    @property
    def smooth(self) -> bool:
        """Whether changes of acceleration are limited, so that a quickest slew begins with none."""
        return self.jerk is not None or self.torque_rate is not None

    @cached_property
    def inertia_matrix(self) -> Array:
        """J (3, 3) [kg m^2]; the identity where no limit needs it."""
        return frozen(np.eye(3) if self.inertia is None else np.array(self.inertia))

    @cached_property
    def largest_moment(self) -> float:
        """Greatest principal moment of inertia [kg m^2]."""
        return float(np.linalg.eigvalsh(self.inertia_matrix)[-1])

    @cached_property
    def wheel_distribution(self) -> Array:
        """P (n, 3): the pseudo-inverse of the matrix of the wheels' axes."""
        axes = np.reshape([wheel.axis for wheel in self.wheels], (-1, 3))
        return frozen(np.linalg.pinv(axes.T) if self.wheels else axes)

    @cached_property
    def table(self) -> LimitTable:
        """The limits as arrays."""
        norms, rows = np.zeros(len(KEYS)), []
        for i, key in enumerate(QUANTITIES):
            value = getattr(self, key)
            rows.append(np.zeros((0, 3)))
            if isinstance(value, float):
                norms[i] = 1.0 / value
            elif value is not None:
                rows[i] = np.diag(1.0 / value)
        for most in ("torque", "momentum"):
            limits = np.array([getattr(wheel, most) for wheel in self.wheels])
            rows.append(self.wheel_distribution / limits[:, None])
        first = np.cumsum([0, *(len(each) for each in rows)], dtype=np.int64)
        first.setflags(write=False)
        return LimitTable(frozen(norms), frozen(np.concatenate(rows)), first)

    def parts(
        self, v: ArrayLike, a: ArrayLike, j: ArrayLike | None = None, h: ArrayLike = (0, 0, 0)
    ) -> Array:
        """Part of each limit that a motion uses at its worst, by row of a table; NaN without one.

        Parameters
        ----------
        v, a, j : (..., 3)
            Body rates [rad/s], accelerations [rad/s^2] and their derivatives [rad/s^3]; without
            the last, parts of limits on it are NaN.
        h : (..., 3)
            Total angular momentum in body axes [N m s].
        """
        J = self.inertia_matrix
        v, a, h = (np.asarray(x, dtype=float) for x in (v, a, h))
        stored = v @ J
        values = [v, a, a @ J + np.cross(v, stored), stored]
        if j is None:
            values += [np.full(3, np.nan)] * 2
        else:
            j = np.asarray(j, dtype=float)
            values += [j, j @ J + np.cross(a, stored) + np.cross(v, a @ J)]
        values += [a @ J + np.cross(v, h), h - stored]
        norms, rows, first = self.table
        parts = np.full(len(KEYS), np.nan)
        for i, value in enumerate(values):
            if norms[i] > 0.0:
                parts[i] = np.max(norms[i] * np.linalg.norm(value, axis=-1))
            elif first[i + 1] > first[i]:
                parts[i] = np.max(np.abs(value @ rows[first[i] : first[i + 1]].T))
        return parts

    def used(
        self, v: ArrayLike, a: ArrayLike, j: ArrayLike | None = None, h: ArrayLike = (0, 0, 0)
    ) -> dict[str, float]:
        """As `parts`, by the key of each limit that there is; above 1 the limit is broken."""
        return by_key(self.parts(v, a, j, h))


def by_key(parts: Array) -> dict[str, float]:
    """Parts (8,) of the rows of a table by the key of the limit; of wheels the greatest."""
    used: dict[str, float] = {}
    for key, part in zip(KEYS, parts.tolist(), strict=True):
        if part == part:
            used[key] = max(part, used.get(key, part))
    return used


def _checked_wheels(value: Any) -> tuple[Wheel, ...]:
    try:
        wheels = tuple(value)
    except TypeError:
        wheels = (value,)
    for i, wheel in enumerate(wheels):
        if not isinstance(wheel, Wheel):
            raise InvalidProblemError(f"limits.wheels[{i}]", f"expected a Wheel, got {wheel!r}")
    if not wheels:
        return wheels
    spread = np.linalg.svd(np.array([wheel.axis for wheel in wheels]), compute_uv=False)
    if len(wheels) < 3 or spread[2] < _LEAST_SPREAD * spread[0]:
        raise InvalidProblemError(
            "limits.wheels",
            f"expected at least three wheels whose axes span space, got {len(wheels)}"
            + (" with axes in one plane; tilt one" if len(wheels) >= 3 else "; add the others"),
        )
    return wheels


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
