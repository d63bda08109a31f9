# SPDX-License-Identifier: Apache-2.0
"""What stays the same along extremals, and where they stop being minima: exact facts to test by."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import non_negative_number, positive_number

Array = NDArray[np.float64]


def hamiltonian(
    v: ArrayLike, a: ArrayLike, j: ArrayLike, tension: float = 0.0, potential: ArrayLike = 0.0
) -> Array:
    """`H = |v'|^2/2 + sigma |v|^2/2 - v'' . v - sum V_i / 2` (...), constant along extremals.

    Parameters
    ----------
    v, a, j : (..., n)
        Rate and its first two derivatives.
    tension
        sigma [1/s^2].
    potential : (...)
        `sum V_i`; the obstacles must be fixed.
    """
    v, a, j = (np.asarray(x, dtype=float) for x in (v, a, j))
    kinetic = 0.5 * np.sum(a * a, axis=-1) + 0.5 * tension * np.sum(v * v, axis=-1)
    return np.asarray(kinetic - np.sum(j * v, axis=-1) - 0.5 * np.asarray(potential))


def orientation_momentum(
    attitude: Array, v: Array, a: Array, j: Array, obstacle: Array, tension: float = 0.0
) -> Array:
    """`M = m - (Q^T R) m + v' x v`, `m = sigma v - v''` (..., 3): constant on SO(3).

    For one fixed orientation obstacle Q (3, 3), at attitudes (..., 3, 3).
    """
    m = tension * v - j
    turned = np.einsum("ji,...jk,...k->...i", obstacle, attitude, m)
    return np.asarray(m - turned + np.cross(a, v))


def attitude_momentum(attitude: Array, v: Array, j: Array, tension: float = 0.0) -> Array:
    """`R m`, `m = sigma v - v''` (..., 3): constant on SO(3) without obstacles."""
    return np.asarray(np.einsum("...ij,...j->...i", attitude, tension * v - j))


def pointing_momentum(attitude: Array, v: Array, a: Array, j: Array, tension: float = 0.0) -> Array:
    """`N = R (sigma v - v'' - v' x v)` (..., 3): constant on S^2 without obstacles.

    With one fixed obstacle of direction s, `s . N` is constant.
    """
    return np.asarray(np.einsum("...ij,...j->...i", attitude, tension * v - j - np.cross(a, v)))


def first_biconjugate_time(curvature: float, tension: float) -> float:
    """When a clamped geodesic stops being a local minimum, without obstacles.

    The second variation across a geodesic of speed c is
    `int ((y'' + k y)^2 + sigma (y'^2 - k y^2)) dt`. Its fields that vanish with their rates at
    both ends are even or odd about the middle, which splits the determinant of section 5 into
    two factors with simple zeros, `a = sqrt(k)` and `b = sqrt(|sigma - k|)`.

    Parameters
    ----------
    curvature
        k [rad^2/s^2]: `c^2` on S^2, `c^2 / 4` on SO(3).
    tension
        sigma [1/s^2].

    Returns
    -------
    float
        T* [s]; infinite for zero tension.
    """
    k, sigma = positive_number("curvature", curvature), non_negative_number("tension", tension)
    if sigma == 0.0:
        return math.inf
    a, b = math.sqrt(k), math.sqrt(abs(sigma - k))
    if b <= 1e-7 * a:
        return 2.0 * math.pi / a

    def even(T: float) -> float:
        S, C = math.sin(a * T / 2), math.cos(a * T / 2)
        if sigma > k:  # divided by cosh, which would overflow
            return a * S + b * C * math.tanh(b * T / 2)
        return a * S * math.cos(b * T / 2) - b * C * math.sin(b * T / 2)

    def odd(T: float) -> float:
        S, C = math.sin(a * T / 2), math.cos(a * T / 2)
        return a * C * math.sin(b * T / 2) - b * S * math.cos(b * T / 2)

    from scipy.optimize import brentq  # slow to load, and seldom needed

    # For sigma > k the odd ones come later: b tan x = a tanh(b x / a) has no root below pi.
    factors = (even,) if sigma > k else (even, odd)
    step = math.pi / (16.0 * (a + b))
    T = step
    while True:
        zeros = [
            float(brentq(factor, T, T + step, xtol=1e-15, rtol=1e-15))
            for factor in factors
            if factor(T) * factor(T + step) <= 0.0
        ]
        if zeros:
            return min(zeros)
        T += step
