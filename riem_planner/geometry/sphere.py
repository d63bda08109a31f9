# SPDX-License-Identifier: Apache-2.0
"""The unit sphere S^2 of pointing directions, batched over leading dimensions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def cross(x: Array, y: Array) -> Array:
    """Cross product of vectors (..., 3); several times faster than NumPy's for a single one."""
    result = np.empty(np.broadcast_shapes(x.shape, y.shape))
    result[..., 0] = x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1]
    result[..., 1] = x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2]
    result[..., 2] = x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]
    return result


def angle(first: ArrayLike, second: ArrayLike) -> Array:
    """Angle in [0, pi] [rad] between vectors (..., 3) of any non-zero length."""
    x, y = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(x, y), axis=-1), np.sum(x * y, axis=-1)))


def exp(point: ArrayLike, tangent: ArrayLike) -> Array:
    """End (..., 3) of the great-circle arc from a point along a tangent vector (..., 3) [rad]."""
    x, u = np.asarray(point, dtype=float), np.asarray(tangent, dtype=float)
    length = np.linalg.norm(u, axis=-1, keepdims=True)
    return np.asarray(np.cos(length) * x + np.sinc(length / np.pi) * u)


def log(point: ArrayLike, end: ArrayLike) -> Array:
    """Tangent vector (..., 3) [rad] at a point of the shortest arc to another point.

    At the antipode the direction is not determined, and the result is zero.
    """
    x, y = np.asarray(point, dtype=float), np.asarray(end, dtype=float)
    # The double cross product is tangent at x to the last digit, unlike y - (x . y) x.
    tangent = np.cross(np.cross(x, y), x)
    sine = np.linalg.norm(tangent, axis=-1, keepdims=True)
    safe = np.where(sine > 0.0, sine, 1.0)
    return np.where(sine > 0.0, angle(x, y)[..., None] / safe, 1.0) * tangent
