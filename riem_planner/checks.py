# SPDX-License-Identifier: Apache-2.0
"""Checks of input values that more than one room needs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError

Array = NDArray[np.float64]

UNIT_TOLERANCE = 1e-3  # a quaternion this far from unit length is a mistake, not rounding
ROTATION_TOLERANCE = 1e-6


def frozen(array: Array) -> Array:
    """The same array, made read-only."""
    array.setflags(write=False)
    return array


def finite_array(key: str, value: Any, shape: tuple[int, ...]) -> Array:
    """A read-only float copy of `value` of the given shape; NaN and infinity are refused."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidProblemError(
            key, f"expected numbers of shape {shape}, got {value!r}"
        ) from None
    if array.shape != shape:
        raise InvalidProblemError(
            key, f"expected {'x'.join(map(str, shape))} numbers, got shape {array.shape}"
        )
    if not np.all(np.isfinite(array)):
        raise InvalidProblemError(key, f"expected finite numbers, got {array.tolist()}")
    return frozen(array)


def finite_number(key: str, value: Any) -> float:
    """A finite float; booleans and text are refused."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise InvalidProblemError(key, f"expected a number, got {value!r}")
    number = float(value)
    if not math.isfinite(number):
        raise InvalidProblemError(key, f"expected a finite number, got {number}")
    return number


def positive_number(key: str, value: Any) -> float:
    """A finite float above zero."""
    number = finite_number(key, value)
    if number <= 0.0:
        raise InvalidProblemError(key, f"expected a number above 0, got {number:g}")
    return number


def non_negative_number(key: str, value: Any) -> float:
    """A finite float of at least zero."""
    number = finite_number(key, value)
    if number < 0.0:
        raise InvalidProblemError(key, f"expected a number of at least 0, got {number:g}")
    return number


def unit_vector(key: str, value: Any) -> Array:
    """The direction of a vector of any length but zero, shape (3,)."""
    vector = finite_array(key, value, (3,))
    largest = float(np.max(np.abs(vector)))
    if largest == 0.0:
        raise InvalidProblemError(key, "expected a direction, got the zero vector")
    scaled = vector / largest  # so that the norm neither overflows nor underflows
    return frozen(scaled / np.linalg.norm(scaled))


def unit_quaternion(key: str, value: Any) -> Array:
    """A unit quaternion (4,) in the order x, y, z, w; normalised if within 1e-3 of unit."""
    quaternion = finite_array(key, value, (4,))
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise InvalidProblemError(
            key,
            f"expected a unit quaternion x, y, z, w, got {quaternion.tolist()} of norm {norm:.6g};"
            f" normalise it (a norm within {UNIT_TOLERANCE:g} of 1 is taken as rounding)",
        )
    return frozen(quaternion / norm)


def rotation_matrix(key: str, value: Any) -> Array:
    """A rotation matrix (3, 3)."""
    matrix = finite_array(key, value, (3, 3))
    error = float(np.max(np.abs(matrix @ matrix.T - np.eye(3))))
    if error > ROTATION_TOLERANCE or np.linalg.det(matrix) < 0.0:
        raise InvalidProblemError(
            key,
            "expected a rotation matrix (orthogonal, determinant +1), got one with"
            f" |R R^T - I| = {error:.3g} and determinant {np.linalg.det(matrix):.3g}",
        )
    return matrix
