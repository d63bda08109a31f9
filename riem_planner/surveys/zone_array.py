# SPDX-License-Identifier: Apache-2.0
"""Keep-out zones of many epochs at once, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import frozen
from riem_planner.errors import InvalidProblemError

Array = NDArray[np.float64]

_SAME = 1e-15  # difference of two boresights that are one


@dataclass(frozen=True, eq=False)
class ZoneArray:
    """Cones that body axes are kept out of: k zones, each at any number of epochs.

    Parameters
    ----------
    names
        One per zone (k); all different.
    boresights : (k, 3)
        Body axis that each zone concerns; any length but zero. One axis (3,) is that of all.
    directions : (..., k, 3)
        Axes of the cones in the reference frame; any length but zero. NaN marks what is not
        known: its pairs are INVALID.
    half_angles : (..., k)
        Of the cones [rad], from 0 to below pi. Leading dimensions broadcast with those of the
        directions; k numbers do for all epochs.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names it.
    """

    names: Sequence[str]
    boresights: ArrayLike
    directions: ArrayLike
    half_angles: ArrayLike

    def __post_init__(self) -> None:
        """Validate, normalise, freeze."""
        names = tuple(self.names)
        if len(set(names)) != len(names) or not all(isinstance(n, str) and n for n in names):
            raise InvalidProblemError(
                "names", f"expected a different text for each zone, got {names!r}"
            )
        k = len(names)
        boresights = _numbers("boresights", self.boresights)
        if boresights.shape == (3,):
            boresights = np.tile(boresights, (k, 1))
        directions = _numbers("directions", self.directions)
        half_angles = _numbers("half_angles", self.half_angles)
        _check_shape("boresights", boresights, (k, 3), boresights.shape)
        _check_shape("directions", directions, (k, 3), directions.shape[-2:])
        _check_shape("half_angles", half_angles, (k,), half_angles.shape[-1:])
        if not np.all(np.isfinite(boresights)):
            raise InvalidProblemError("boresights", "expected finite numbers")
        wrong = half_angles[(half_angles < 0.0) | (half_angles >= np.pi)]
        if wrong.size:
            raise InvalidProblemError(
                "half_angles", f"expected from 0 to below pi rad, got {wrong.flat[0]:.6g}"
            )
        try:
            np.broadcast_shapes(directions.shape[:-2], half_angles.shape[:-1])
        except ValueError:
            raise InvalidProblemError(
                "half_angles",
                f"leading dimensions {half_angles.shape[:-1]} do not broadcast with those of"
                f" directions, {directions.shape[:-2]}",
            ) from None
        set_field = object.__setattr__
        set_field(self, "names", names)
        set_field(self, "boresights", frozen(_units("boresights", boresights)))
        set_field(self, "directions", frozen(_units("directions", directions)))
        set_field(self, "half_angles", frozen(half_angles))

    @property
    def shape(self) -> tuple[int, ...]:
        """Leading dimensions: of the epochs, say."""
        directions, half_angles = np.asarray(self.directions), np.asarray(self.half_angles)
        return np.broadcast_shapes(directions.shape[:-2], half_angles.shape[:-1])

    def table(self) -> Array:
        """Axes, half-angles and their cosines (..., k, 5), contiguous."""
        directions, half_angles = np.asarray(self.directions), np.asarray(self.half_angles)
        table = np.empty((*self.shape, len(self.names), 5))
        table[..., :3] = directions
        table[..., 3] = half_angles
        table[..., 4] = np.cos(half_angles)
        return table

    def groups(self) -> NDArray[np.int64]:
        """Per zone (k,) the first zone that has its boresight."""
        b = np.asarray(self.boresights)
        same = np.abs(b[:, None] - b[None]).max(axis=-1, initial=0.0) <= _SAME
        return np.argmax(same, axis=1) if len(b) else np.zeros(0, dtype=np.int64)


def no_zones() -> ZoneArray:
    """No zone at all."""
    return ZoneArray((), np.empty((0, 3)), np.empty((0, 3)), np.empty(0))


def _numbers(key: str, value: ArrayLike) -> Array:
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidProblemError(key, "expected numbers in rows of one length") from None


def _check_shape(key: str, array: Array, expected: tuple[int, ...], got: tuple[int, ...]) -> None:
    if got != expected:
        stated = "x".join(map(str, expected))
        raise InvalidProblemError(
            key, f"expected shape (..., {stated}), one per name, got {array.shape}"
        )


def _units(key: str, vectors: Array) -> Array:
    # A zero is scaled to nothing and refused; NaN stays what it is.
    largest = np.max(np.abs(vectors), axis=-1, keepdims=True, initial=0.0)
    if np.any(largest == 0.0):
        raise InvalidProblemError(key, "expected directions, got a zero vector")
    with np.errstate(invalid="ignore"):
        scaled = vectors / largest
    return np.asarray(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))
