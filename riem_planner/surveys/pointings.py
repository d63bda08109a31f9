# SPDX-License-Identifier: Apache-2.0
"""Attitudes of a telescope that looks along body x: by the Sun, or by angles on the sky."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.geometry import so3, sphere

Array = NDArray[np.float64]

_SINGULAR = 1e-6  # rad from the Sun or its opposite, where its rule names no attitude


def pointings(directions: ArrayLike, *, sun: ArrayLike, roll: ArrayLike = 0.0) -> Array:
    """Attitudes that point body x at targets, rolled relative to the Sun.

    Body y lies along `sun x target`; then the body is turned about x by `roll`.

    Parameters
    ----------
    directions : (..., 3)
        Of the targets, in the reference frame; any length but zero.
    sun : (..., 3)
        Direction of the Sun.
    roll : (...)
        About body x [rad].

    Returns
    -------
    (..., 4)
        Unit quaternions x, y, z, w, body to reference; NaN within 1e-6 rad of the Sun or its
        opposite, where the rule names none, and where an input is not finite.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        target = _unit(directions)
        towards = _unit(sun)
        x, towards = np.broadcast_arrays(target, towards)
        across = np.cross(towards, x)
        y = across / np.linalg.norm(across, axis=-1, keepdims=True)
        off = sphere.angle(x, towards)
        defined = np.minimum(off, np.pi - off) >= _SINGULAR
        R = np.stack([x, y, np.cross(x, y)], axis=-1)
    R = np.where(defined[..., None, None], R, np.eye(3))
    half = 0.5 * np.asarray(roll, dtype=float)
    zero = np.zeros_like(half)
    about_x = np.stack([np.sin(half), zero, zero, np.cos(half)], axis=-1)
    q = so3.quaternion_multiply(so3.matrix_to_quaternion(R), about_x)
    return np.where(defined[..., None], q, np.nan)


def celestial_attitudes(
    right_ascension: ArrayLike, declination: ArrayLike, roll: ArrayLike = 0.0
) -> Array:
    """Attitudes (..., 4) of `R = Rz(ra) Ry(-dec) Rx(-roll)`, as m4opt means angles.

    Parameters
    ----------
    right_ascension, declination, roll : (...)
        [rad].
    """
    ra, dec, roll = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in (right_ascension, declination, roll))
    )
    first = so3.quaternion_exp(ra[..., None] * np.array([0.0, 0.0, 1.0]))
    second = so3.quaternion_exp(dec[..., None] * np.array([0.0, -1.0, 0.0]))
    third = so3.quaternion_exp(roll[..., None] * np.array([-1.0, 0.0, 0.0]))
    return so3.quaternion_multiply(so3.quaternion_multiply(first, second), third)


def _unit(vectors: ArrayLike) -> Array:
    v = np.asarray(vectors, dtype=float)
    scaled = v / np.max(np.abs(v), axis=-1, keepdims=True)
    return np.asarray(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))
