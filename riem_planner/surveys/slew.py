# SPDX-License-Identifier: Apache-2.0
"""One slew of a matrix: its attitude, rate and acceleration at any time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipj

from riem_planner.geometry import so3
from riem_planner.surveys.profiles import (
    LEMNISCATE,
    POLYNOMIAL,
    Capacity,
    lemniscate_times,
    pace_of,
)
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pace:
    """The parameter s of a path over time, from 0 to 1, and its two derivatives.

    Parameters
    ----------
    duration
        [s].
    shape
        TRAPEZOID, LEMNISCATE or POLYNOMIAL of `profiles`.
    numbers
        Three; see `profiles.pace_of`.
    """

    duration: float
    shape: int
    numbers: tuple[float, float, float]

    @cached_property
    def rise(self) -> float:
        """Time [s] until s' is greatest and its acceleration jumps; 0 if it begins so."""
        first, second, square = self.numbers
        if self.shape == POLYNOMIAL:
            return 0.0
        if self.shape == LEMNISCATE:
            levels_off = float(lemniscate_times(np.array([square**0.5]))[0]) / first
        else:
            levels_off = first / second  # 0 where the acceleration has no limit
        # A top without a level is reached in the middle, but for rounding.
        middle = 0.5 * self.duration
        return middle if levels_off > (1.0 - 1e-9) * middle else levels_off

    @property
    def jumps(self) -> Array:
        """Times inside (0, duration) at which the acceleration may jump [s]."""
        if not 0.0 < self.rise < 0.5 * self.duration:
            return np.array([self.rise] if self.rise > 0.0 else [])
        return np.array([self.rise, self.duration - self.rise])

    def at(self, t: Array, within: float | None = None) -> tuple[Array, Array, Array]:
        """s, s' and s'' at times (n,) [s].

        Parameters
        ----------
        within
            A time inside the part between two jumps that the times belong to: at a jump the
            acceleration is that of this part.
        """
        T = self.duration
        if T == 0.0:
            return np.ones_like(t), np.zeros_like(t), np.zeros_like(t)
        if self.shape == POLYNOMIAL:
            u = t / T
            return (
                u**3 * (10.0 - 15.0 * u + 6.0 * u**2),
                30.0 * u**2 * (1.0 - u) ** 2 / T,
                60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / T**2,
            )
        part = t if within is None else np.full_like(t, within)
        late = part > 0.5 * T
        level = np.where(late, T - part, part) > self.rise
        s, rate, acceleration = self._first_half(np.where(late, T - t, t), level)
        return (
            np.where(late, 1.0 - s, s),
            rate,
            np.where(late, -acceleration, acceleration),
        )

    def _first_half(self, t: Array, level: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """The same until s = 1/2, from where on it goes back as it came."""
        rising = np.minimum(t, self.rise)
        first, second, square = self.numbers
        if self.shape == LEMNISCATE:
            # sl x = sd(sqrt 2 x | 1/2) / sqrt 2 (the inverse of arcsl).
            sn, _, dn, _ = ellipj(np.sqrt(2.0) * first * rising, 0.5)
            q = np.minimum(sn / (np.sqrt(2.0) * dn), 1.0)
            covered = 0.5 * second / first * np.arcsin(q * q)
            rate, top = second * q, second * np.sqrt(square)
            acceleration = first * second * np.sqrt(1.0 - q**4)
        elif self.rise > 0.0:
            covered, rate, top = 0.5 * second * rising**2, second * rising, first
            acceleration = np.full_like(t, second)
        else:
            covered, rate, top = np.zeros_like(t), np.full_like(t, first), first
            acceleration = np.zeros_like(t)
        s = covered + np.where(level, top * (t - self.rise), 0.0)
        return s, np.where(level, top, rate), np.where(level, 0.0, acceleration)


@dataclass(frozen=True, eq=False)
class Slew:
    """A turn about a fixed axis of the reference frame with a roll about the boresight.

    The attitude is `exp(s phi hat(e)) R_0 exp(s psi hat(b))`, with s from 0 to 1.

    Parameters
    ----------
    duration
        [s].
    start : (4,)
        Unit quaternion of R_0, x, y, z, w.
    axis : (3,)
        e, a unit vector in the reference frame.
    turn
        phi [rad].
    boresight : (3,)
        b, a unit vector in the body.
    roll
        psi [rad].
    pace
        s over time.
    """

    duration: float
    start: Array
    axis: Array
    turn: float
    boresight: Array
    roll: float
    pace: Pace

    @property
    def jumps(self) -> Array:
        """Times inside (0, duration) at which the acceleration may jump [s]."""
        scale = self.duration / self.pace.duration if self.pace.duration > 0.0 else 1.0
        return scale * self.pace.jumps

    def evaluate_quaternion(
        self, t: ArrayLike, *, within: float | None = None
    ) -> tuple[Array, Array, Array]:
        """Quaternions (..., 4), rates (..., 3) [rad/s], accelerations (..., 3) [rad/s^2].

        Parameters
        ----------
        t : (...)
            Times in [0, duration] [s]. Where the acceleration jumps, its value is that of one
            side, ...
        within
            ... which a time inside that part of the slew says.

        Raises
        ------
        ValueError
            A time is outside [0, duration].
        """
        t = np.asarray(t, dtype=float)
        if not (t.size == 0 or (t.min() >= 0.0 and t.max() <= self.duration)):
            raise ValueError(
                f"t must lie in [0, {self.duration:.9g}] s, got [{t.min():.9g}, {t.max():.9g}]"
            )
        # The two durations are one but for the last digit.
        scale = self.pace.duration / self.duration if self.duration > 0.0 else 1.0
        s, rate, acceleration = self.pace.at(
            np.minimum(scale * t, self.pace.duration).ravel(),
            None if within is None else scale * within,
        )
        rolled = so3.quaternion_exp((self.roll * s)[:, None] * self.boresight)
        turned = so3.quaternion_exp((self.turn * s)[:, None] * self.axis)
        q = so3.quaternion_multiply(
            so3.quaternion_multiply(turned, np.broadcast_to(self.start, turned.shape)), rolled
        )
        axis = np.einsum("nij,i->nj", so3.quaternion_to_matrix(q), self.axis)
        p = self.turn * axis + self.roll * self.boresight
        slope = -self.roll * self.turn * np.cross(self.boresight, axis)
        v = rate[:, None] * p
        a = acceleration[:, None] * p + rate[:, None] ** 2 * slope
        return q.reshape(*t.shape, 4), v.reshape(*t.shape, 3), a.reshape(*t.shape, 3)

    def pieces(self, samples: int) -> list[Trajectory]:
        """The slew between its jumps of acceleration, as trajectories one after the other.

        Those of a turn about a fixed axis are exact: their rotation vectors are quadratic.

        Parameters
        ----------
        samples
            Of each piece, at least 2 and no more than 2.5 rad apart.
        """
        ends = np.array([0.0, *self.jumps, self.duration])
        pieces = []
        for first, last in pairwise(ends):
            if last > first:
                times = np.linspace(first, last, samples)
                rows = self.evaluate_quaternion(times, within=0.5 * (first + last))
                pieces.append(Trajectory(times - first, *rows))
        return pieces

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Rotation matrices (..., 3, 3), rates (..., 3), accelerations (..., 3) at times (...).

        As `evaluate_quaternion`.
        """
        q, v, a = self.evaluate_quaternion(t)
        return so3.quaternion_to_matrix(q), v, a


def slew_of(
    duration: float,
    start: Array,
    path: tuple[Array, float, float],
    boresight: Array,
    capacity: Capacity,
    profile: int,
) -> Slew:
    """The slew of a path: its axis (3,), turn and roll [rad].

    Parameters
    ----------
    duration
        As `slew_times` told it [s].
    """
    axis, turn, roll = path
    body = np.asarray(turn * (so3.quaternion_to_matrix(start).T @ axis))
    time, shape, *numbers = pace_of(capacity, profile, body, roll, np.array(boresight))
    first, second, third = (float(number) for number in numbers)
    pace = Pace(float(time), int(shape), (first, second, third))
    return Slew(duration, start, axis, turn, np.asarray(boresight), roll, pace)
