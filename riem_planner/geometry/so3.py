# SPDX-License-Identifier: Apache-2.0
"""The rotation group SO(3), by rotation matrices and by unit quaternions, batched.

Conventions (Hamilton, ROS order): a quaternion is `(x, y, z, w)` and turns body components
into reference components, `p_ref = R @ p_body`. A rotation vector is an axis times an angle,
in radians. Every function takes leading batch dimensions and broadcasts them.

Angles come from `atan2`, never from `arccos`: between rounded attitudes they hold to
2e-15 rad absolute; where a relative rotation is given, to 1e-14 relative from 0 to pi.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.kernels import brief_kernel

Array = NDArray[np.float64]

# Below this angle [rad] the Taylor series of the coefficients are exact to the last digit.
_SERIES = 0.5


def hat(vector: ArrayLike) -> Array:
    """Skew matrix of a vector: `hat(v) @ p = v x p`.

    Parameters
    ----------
    vector : (..., 3)

    Returns
    -------
    (..., 3, 3)
    """
    v = np.asarray(vector, dtype=float)
    matrix = np.zeros((*v.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return matrix


def vee(matrix: ArrayLike) -> Array:
    """Vector of the skew part of a matrix, the inverse of `hat`.

    Parameters
    ----------
    matrix : (..., 3, 3)

    Returns
    -------
    (..., 3)
    """
    m = np.asarray(matrix, dtype=float)
    return 0.5 * np.stack(
        [
            m[..., 2, 1] - m[..., 1, 2],
            m[..., 0, 2] - m[..., 2, 0],
            m[..., 1, 0] - m[..., 0, 1],
        ],
        axis=-1,
    )


def quaternion_multiply(left: ArrayLike, right: ArrayLike) -> Array:
    """Hamilton product of quaternions (..., 4), the rotation `left` after `right`."""
    p, q = np.asarray(left, dtype=float), np.asarray(right, dtype=float)
    if p.shape != q.shape:
        p, q = np.broadcast_arrays(p, q)
    shape = p.shape
    # Copies, because code compiled for read-only arrays may round the last bit another way.
    p, q = np.array(p, order="C").reshape(-1, 4), np.array(q, order="C").reshape(-1, 4)
    product = _multiply(p, q)
    return np.asarray(product.reshape(shape))


@brief_kernel
def _multiply(p, q):  # type: ignore[no-untyped-def]
    out = np.empty(p.shape)
    for k in range(p.shape[0]):
        a, b, c, d = p[k, 0], p[k, 1], p[k, 2], p[k, 3]
        x, y, z, w = q[k, 0], q[k, 1], q[k, 2], q[k, 3]
        out[k, 0] = d * x + w * a + (b * z - c * y)
        out[k, 1] = d * y + w * b + (c * x - a * z)
        out[k, 2] = d * z + w * c + (a * y - b * x)
        out[k, 3] = d * w - (a * x + b * y + c * z)
    return out


def quaternion_conjugate(quaternion: ArrayLike) -> Array:
    """Inverse of a unit quaternion (..., 4)."""
    return np.asarray(np.asarray(quaternion, dtype=float) * np.array([-1.0, -1.0, -1.0, 1.0]))


def quaternion_exp(rotation_vector: ArrayLike) -> Array:
    """Unit quaternion (..., 4) of a rotation vector (..., 3) [rad]."""
    xi = np.asarray(rotation_vector, dtype=float)
    half = 0.5 * np.linalg.norm(xi, axis=-1, keepdims=True)
    return np.concatenate([0.5 * np.sinc(half / np.pi) * xi, np.cos(half)], axis=-1)


def quaternion_log(quaternion: ArrayLike) -> Array:
    """Rotation vector (..., 3) [rad] of a unit quaternion (..., 4), of length at most pi.

    A quaternion and its negative are the same rotation and have the same logarithm.
    """
    q = np.asarray(quaternion, dtype=float)
    sign = np.where(q[..., 3:] < 0.0, -1.0, 1.0)
    vector, scalar = sign * q[..., :3], sign * q[..., 3:]
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, scalar)
    safe = np.where(sine > 0.0, sine, 1.0)
    return np.asarray(np.where(sine > 0.0, angle / safe, 2.0) * vector)


def quaternion_to_matrix(quaternion: ArrayLike) -> Array:
    """Rotation matrix (..., 3, 3) of a unit quaternion (..., 4)."""
    q = np.asarray(quaternion, dtype=float)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    matrix = np.empty((*q.shape[:-1], 3, 3))
    matrix[..., 0, 0] = w * w + x * x - y * y - z * z
    matrix[..., 0, 1] = 2 * (x * y - w * z)
    matrix[..., 0, 2] = 2 * (x * z + w * y)
    matrix[..., 1, 0] = 2 * (x * y + w * z)
    matrix[..., 1, 1] = w * w - x * x + y * y - z * z
    matrix[..., 1, 2] = 2 * (y * z - w * x)
    matrix[..., 2, 0] = 2 * (x * z - w * y)
    matrix[..., 2, 1] = 2 * (y * z + w * x)
    matrix[..., 2, 2] = w * w - x * x - y * y + z * z
    return matrix


def matrix_to_quaternion(matrix: ArrayLike) -> Array:
    """Unit quaternion (..., 4) of a rotation matrix (..., 3, 3), with its largest part positive.

    Each column of `4 q q^T` is known from the matrix; the one with the largest diagonal is
    taken, so no precision is lost at any angle (Shepperd 1978).
    """
    m = np.asarray(matrix, dtype=float)
    flat = _shepperd(np.array(m, order="C").reshape(-1, 3, 3))
    return np.asarray(flat.reshape(*m.shape[:-2], 4))


@brief_kernel
def _shepperd(m):  # type: ignore[no-untyped-def]
    out = np.empty((m.shape[0], 4))
    for k in range(m.shape[0]):
        a, b, c = m[k, 0, 0], m[k, 1, 1], m[k, 2, 2]
        xy, xz, yz = m[k, 0, 1] + m[k, 1, 0], m[k, 0, 2] + m[k, 2, 0], m[k, 1, 2] + m[k, 2, 1]
        wx, wy, wz = m[k, 2, 1] - m[k, 1, 2], m[k, 0, 2] - m[k, 2, 0], m[k, 1, 0] - m[k, 0, 1]
        if a + b + c >= max(a, b, c):
            x, y, z, w = wx, wy, wz, 1.0 + a + b + c
        elif a >= b and a >= c:
            x, y, z, w = 1.0 + a - b - c, xy, xz, wx
        elif b >= c:
            x, y, z, w = xy, 1.0 - a + b - c, yz, wy
        else:
            x, y, z, w = xz, yz, 1.0 - a - b + c, wz
        scale = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = scale * x, scale * y, scale * z, scale * w
    return out


def exp(rotation_vector: ArrayLike) -> Array:
    """Rotation matrix (..., 3, 3) of a rotation vector (..., 3) [rad]."""
    return quaternion_to_matrix(quaternion_exp(rotation_vector))


def log(matrix: ArrayLike) -> Array:
    """Rotation vector (..., 3) [rad] of a rotation matrix (..., 3, 3), of length at most pi."""
    return quaternion_log(matrix_to_quaternion(matrix))


def quaternion_distance(first: ArrayLike, second: ArrayLike) -> Array:
    """Angle in [0, pi] [rad] of the rotation between two unit quaternions (..., 4)."""
    relative = quaternion_multiply(quaternion_conjugate(first), second)
    sine = np.linalg.norm(relative[..., :3], axis=-1)
    return np.asarray(2.0 * np.arctan2(sine, np.abs(relative[..., 3])))


def distance(first: ArrayLike, second: ArrayLike) -> Array:
    """Angle in [0, pi] [rad] of the rotation between two rotation matrices (..., 3, 3)."""
    return quaternion_distance(matrix_to_quaternion(first), matrix_to_quaternion(second))


def _jacobian_coefficients(angle: Array) -> tuple[Array, Array]:
    """`(1 - cos x) / x^2` and `(x - sin x) / x^3`, without cancellation near 0."""
    first = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    square = angle * angle
    series = 1 / 6 - square / 120 * (
        1 - square / 42 * (1 - square / 72 * (1 - square / 110 * (1 - square / 156)))
    )
    large = np.where(angle > _SERIES, angle, 1.0)
    second = np.where(angle > _SERIES, (large - np.sin(large)) / large**3, series)
    return first, second


def right_jacobian(rotation_vector: ArrayLike) -> Array:
    """Matrix J (..., 3, 3) with `v = J(xi) xi'` for the body rate v of `exp(xi(t))`.

    `J = I - (1 - cos x)/x^2 hat(xi) + (x - sin x)/x^3 hat(xi)^2`, `x = |xi|`.
    """
    xi = np.asarray(rotation_vector, dtype=float)
    first, second = _jacobian_coefficients(np.linalg.norm(xi, axis=-1))
    skew = hat(xi)
    identity = np.broadcast_to(np.eye(3), skew.shape)
    return identity - first[..., None, None] * skew + second[..., None, None] * (skew @ skew)


def right_jacobian_inverse(rotation_vector: ArrayLike) -> Array:
    """Inverse (..., 3, 3) of `right_jacobian`, for rotation vectors shorter than 2 pi.

    `J^-1 = I + hat(xi)/2 + (1 - (x/2) cot(x/2))/x^2 hat(xi)^2`, `x = |xi|`.
    """
    xi = np.asarray(rotation_vector, dtype=float)
    angle = np.linalg.norm(xi, axis=-1)
    square = angle * angle
    tail = 1 + square * 10 / 396 * (1 + square * 691 / 27300 * (1 + square * 35 / 1382))
    series = 1 / 12 + square / 720 * (1 + square / 42 * (1 + square / 40 * tail))
    large = np.where(angle > _SERIES, angle, 1.0)
    exact = (1.0 - 0.5 * large / np.tan(0.5 * large)) / large**2
    coefficient = np.where(angle > _SERIES, exact, series)
    skew = hat(xi)
    identity = np.broadcast_to(np.eye(3), skew.shape)
    return np.asarray(identity + 0.5 * skew + coefficient[..., None, None] * (skew @ skew))


def minimal_rotation(start: ArrayLike, end: ArrayLike) -> Array:
    """Quaternion (..., 4) of the least rotation that takes one unit vector (..., 3) to another.

    For opposite vectors the axis is not determined: the coordinate axis least aligned with
    `start`, made orthogonal to it, is taken.
    """
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    a, b = np.broadcast_arrays(a, b)
    # The half-way vector gives the half angle directly: exact near 0, and near pi as well
    # because |a - b| / 2 is then the sine and |a + b| / 2 the cosine.
    cosine = 0.5 * np.linalg.norm(a + b, axis=-1, keepdims=True)
    sine = 0.5 * np.linalg.norm(b - a, axis=-1, keepdims=True)
    axis = np.cross(a, b)
    norm = np.linalg.norm(axis, axis=-1, keepdims=True)
    least = np.eye(3)[np.argmin(np.abs(a), axis=-1)]
    fallback = least - np.sum(least * a, axis=-1, keepdims=True) * a
    fallback = fallback / np.linalg.norm(fallback, axis=-1, keepdims=True)
    degenerate = (norm < 1e-15) & (cosine < 0.5)
    axis = np.where(degenerate, fallback, axis / np.where(norm > 0.0, norm, 1.0))
    quaternion = np.concatenate([sine * axis, cosine], axis=-1)
    return np.asarray(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True))
