# SPDX-License-Identifier: Apache-2.0
"""Directions that move: at a constant rate, or along samples.

A sampled direction is `s = p / |p|` with the not-a-knot cubic spline p through the unit vectors,
component by component; so it is C^2. With `n = |p|` and `n' = s . p'`

    s'  = (p' - n' s) / n
    s'' = (p'' - n'' s - 2 n' s') / n,      n'' = s . p'' + n |s'|^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_array, frozen, unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3

Array = NDArray[np.float64]

LEAST_SAMPLES = 4
"""Of a path: what a not-a-knot cubic spline needs."""
_WIDEST = np.pi / 3
"""Angle between neighbouring samples [rad]; wider, they hardly say how the direction moves."""
_COVER = 1e-9
"""Of its length, how far beyond its ends a path may be looked at: rounding."""


@dataclass(frozen=True, eq=False)
class Turning:
    """A direction that turns at a constant rate.

    Parameters
    ----------
    direction : (3,)
        At time 0, in the reference frame; any length but zero.
    rate : (3,)
        Angular velocity in the reference frame [rad/s]: at time t the direction is
        `exp(hat(rate t)) direction`. Zero: it is fixed.
    """

    direction: Array
    rate: Array = field(default_factory=lambda: np.zeros(3))

    if TYPE_CHECKING:

        def __init__(self, direction: ArrayLike, rate: ArrayLike = ...) -> None: ...

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(self, "direction", unit_vector("direction", self.direction))
        object.__setattr__(self, "rate", finite_array("rate", self.rate, (3,)))

    @property
    def greatest_speed(self) -> float:
        """Upper bound of the angular speed [rad/s]."""
        return float(np.linalg.norm(self.rate))

    def direction_at(self, times: ArrayLike) -> Array:
        """Unit vectors (..., 3) at times (...) [s]."""
        turn = np.asarray(times, dtype=float)[..., None] * self.rate
        return np.asarray(so3.exp(turn) @ self.direction)

    def motion_at(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Unit vectors (..., 3) at times (...) [s], with first and second time derivatives."""
        s = self.direction_at(times)
        velocity = np.cross(self.rate, s)
        return s, velocity, np.cross(self.rate, velocity)


@dataclass(frozen=True, eq=False)
class Path:
    """A direction along samples, by a cubic spline through their unit vectors, normalised.

    Parameters
    ----------
    times : (n,)
        Increasing [s]; n of at least 4.
    directions : (n, 3)
        In the reference frame; any length but zero, neighbours less than 60 degrees apart.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names `times` or `directions`.
    """

    times: Array
    directions: Array
    _coefficients: Array = field(init=False, repr=False)

    if TYPE_CHECKING:

        def __init__(self, times: ArrayLike, directions: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        """Validate, freeze, and fit the spline."""
        times = sample_times("times", self.times)
        rows = finite_array("directions", self.directions, (times.size, 3))
        units = np.array([unit_vector(f"directions[{i}]", row) for i, row in enumerate(rows)])
        far = np.flatnonzero(np.sum(units[:-1] * units[1:], axis=1) < np.cos(_WIDEST))
        if far.size:
            raise InvalidProblemError(
                f"directions[{far[0] + 1}]",
                "expected less than 60 degrees from the sample before, which else leaves open how"
                " the direction moves; give more samples",
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "directions", frozen(units))
        object.__setattr__(self, "_coefficients", spline_through(times, units))
        if not math.isfinite(self.greatest_speed):
            raise InvalidProblemError(
                "times", "too uneven for a spline through the directions; give more samples"
            )

    @property
    def start(self) -> float:
        """Time of the first sample [s]."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return float(self.times[-1])

    def later(self, time: float) -> Path:
        """The same path where a time [s] is called 0."""
        return Path(self.times - time, self.directions)

    @property
    def coefficients(self) -> Array:
        """Pieces (n - 1, 4, 3) of p: `sum_m coefficients[k, m] (t - times[k])^m`."""
        return self._coefficients

    @property
    def greatest_speed(self) -> float:
        """Upper bound of the angular speed [rad/s]."""
        h = np.diff(self.times)
        # p' and p lie in the convex hulls of their Bernstein coefficients.
        most = np.max(np.linalg.norm(bernstein_slopes(self._coefficients, h), axis=-1), axis=0)
        hull = bernstein(self._coefficients, h)
        middle = hull[0] + hull[-1]
        middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
        least = np.min(np.sum(hull * middle, axis=-1), axis=0)
        return float(np.max(most / least)) if np.all(least > 0.0) else np.inf

    def direction_at(self, times: ArrayLike) -> Array:
        """Unit vectors (..., 3) at times (...) [s].

        Raises
        ------
        ValueError
            A time is before the first sample or after the last.
        """
        p = evaluate_spline(self.times, self._coefficients, times)[0]
        return np.asarray(p / np.linalg.norm(p, axis=-1, keepdims=True))

    def motion_at(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Unit vectors (..., 3) at times (...) [s], with first and second time derivatives."""
        p, p_1, p_2 = evaluate_spline(self.times, self._coefficients, times)
        n = np.linalg.norm(p, axis=-1, keepdims=True)
        s = p / n
        n_1 = np.sum(s * p_1, axis=-1, keepdims=True)
        s_1 = (p_1 - n_1 * s) / n
        n_2 = np.sum(s * p_2, axis=-1, keepdims=True)
        n_2 = n_2 + n * np.sum(s_1 * s_1, axis=-1, keepdims=True)
        return s, s_1, (p_2 - n_2 * s - 2.0 * n_1 * s_1) / n


def as_direction(key: str, value: Any) -> Turning | Path:
    """A direction as it may be given: three numbers (fixed), a `Turning` or a `Path`."""
    return value if isinstance(value, Turning | Path) else Turning(unit_vector(key, value))


def sample_times(key: str, value: Any) -> Array:
    """Increasing times (n,) of samples [s], at least four."""
    count = len(value) if hasattr(value, "__len__") else 0
    if count < LEAST_SAMPLES:
        raise InvalidProblemError(key, f"expected at least {LEAST_SAMPLES} times, got {count}")
    times = finite_array(key, value, (count,))
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if late.size:
        k = int(late[0])
        raise InvalidProblemError(
            f"{key}[{k + 1}]",
            f"expected increasing times, got {times[k + 1]:.9g} s after {times[k]:.9g} s",
        )
    return times


def spline_through(times: Array, values: Array) -> Array:
    """Pieces (n - 1, 4, ...) of the not-a-knot cubic spline through values (n, ...).

    Piece k is `sum_m pieces[k, m] (t - times[k])^m`.
    """
    from scipy.interpolate import CubicSpline  # slow to load, and seldom needed

    highest_first = CubicSpline(times, values, bc_type="not-a-knot").c
    return frozen(np.ascontiguousarray(np.moveaxis(highest_first[::-1], 0, 1)))


def bernstein(pieces: Array, lengths: Array) -> Array:
    """Bernstein coefficients (4, n, ...) of cubic pieces (n, 4, ...) of lengths (n,)."""
    h = lengths.reshape(-1, *[1] * (pieces.ndim - 2))
    c_0, c_1, c_2, c_3 = (pieces[:, m] * h**m for m in range(4))
    return np.array([c_0, c_0 + c_1 / 3, c_0 + (2 * c_1 + c_2) / 3, c_0 + c_1 + c_2 + c_3])


def bernstein_slopes(pieces: Array, lengths: Array) -> Array:
    """Bernstein coefficients (3, n, ...) of the derivatives of cubic pieces."""
    h = lengths.reshape(-1, *[1] * (pieces.ndim - 2))
    return np.asarray(3.0 * np.diff(bernstein(pieces, lengths), axis=0) / h)


def evaluate_spline(breaks: Array, pieces: Array, times: ArrayLike) -> tuple[Array, Array, Array]:
    """Values (..., m) of a spline at times (...) [s], with first and second derivatives.

    Parameters
    ----------
    breaks : (n,)
        Where the pieces meet [s].
    pieces : (n - 1, 4, m)
        As of `spline_through`.

    Raises
    ------
    ValueError
        A time is outside the breaks.
    """
    t = np.asarray(times, dtype=float)
    slack = _COVER * (breaks[-1] - breaks[0])
    if not np.all((t >= breaks[0] - slack) & (t <= breaks[-1] + slack)):
        raise ValueError(
            f"times must lie in [{breaks[0]:.9g}, {breaks[-1]:.9g}] s, which the samples cover; got"
            f" from {t.min():.9g} to {t.max():.9g} s"
        )
    k = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, breaks.size - 2)
    c_0, c_1, c_2, c_3 = np.moveaxis(pieces[k], -2, 0)
    x = (t - breaks[k])[..., None]
    return (
        c_0 + x * (c_1 + x * (c_2 + x * c_3)),
        c_1 + x * (2.0 * c_2 + x * 3.0 * c_3),
        2.0 * c_2 + x * 6.0 * c_3,
    )
