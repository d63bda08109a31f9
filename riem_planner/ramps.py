# SPDX-License-Identifier: Apache-2.0
"""Motion at a limit: accelerations that rise to it in a short time, stay there, and fall again.

A piecewise linear acceleration is integrated exactly, and quintics through its corners are it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

RISE = 0.15
"""Part of a ramp of the rate in which the acceleration rises, and in which it falls."""
BETWEEN = 3
"""Times between two corners, at least, at which a motion is sampled, and looked at."""
STEP = 0.5
"""A turn from sample to sample [rad]."""


class Corners(NamedTuple):
    """A motion along a line, or of vectors: accelerations that are linear between times.

    Attributes
    ----------
    times : (n,)
        From 0 [s].
    accelerations : (n, ...)
        At those times.
    """

    times: Array
    accelerations: Array


def evaluate(corners: Corners, rate: ArrayLike, times: Array) -> tuple[Array, Array, Array]:
    """Place, rate and acceleration (m, ...) at times (m,), from place 0 and a rate at time 0."""
    knots, levels = corners
    shape = (-1,) + (1,) * (levels.ndim - 1)
    step = np.diff(knots).reshape(shape)
    slope = np.diff(levels, axis=0) / step
    rates = np.concatenate(
        [[np.asarray(rate, dtype=float)], levels[:-1] * step + slope * step**2 / 2]
    )
    rates = np.cumsum(rates, axis=0)
    moved = rates[:-1] * step + levels[:-1] * step**2 / 2 + slope * step**3 / 6
    places = np.concatenate([np.zeros_like(rates[:1]), np.cumsum(moved, axis=0)])
    index = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(step) - 1)
    since = (times - knots[index]).reshape(shape)
    acceleration = levels[index] + slope[index] * since
    velocity = rates[index] + levels[index] * since + slope[index] * since**2 / 2
    place = places[index] + rates[index] * since
    place = place + levels[index] * since**2 / 2 + slope[index] * since**3 / 6
    return place, velocity, acceleration


def to_rest(corners: Corners, rate: ArrayLike, times: Array) -> tuple[Array, Array, Array]:
    """As `evaluate`, of a motion that ends at rest, without the rounding of its end."""
    place, velocity, acceleration = evaluate(corners, rate, times)
    velocity[-1], acceleration[-1] = 0.0, 0.0
    return place, velocity, acceleration


def sample_times(corners: Corners, length: float) -> Array:
    """The corners' times, and some between each two, closer than `STEP` on a way so long [rad]."""
    steps = np.linspace(0.0, 1.0, max(BETWEEN, int(length / STEP)) + 1, endpoint=False)
    between = corners.times[:-1, None] + np.diff(corners.times)[:, None] * steps
    return np.append(between.ravel(), corners.times[-1])


def brake(rate: Array, acceleration: Array, duration: float) -> Corners:
    """From a rate and an acceleration (3,) to rest in a duration [s], as evenly as can be.

    The acceleration goes over to a constant one within a part RISE of the duration, and to zero
    in as long a time at the end.
    """
    rise = RISE * duration
    level = -(rate + 0.5 * rise * acceleration) / (duration - rise)
    times = np.array([0.0, rise, duration - rise, duration])
    return Corners(times, np.array([acceleration, level, level, np.zeros(3)]))


def turn(length: float, fastest: float, hardest: float) -> Corners:
    """From rest to rest over a length, in the least time of this form within two limits.

    Parameters
    ----------
    length
        [rad].
    fastest, hardest
        Largest rate [rad/s] and acceleration [rad/s^2]; infinite if there is none, not both.
    """
    # A ramp to the rate v lasts v / (h (1 - RISE)) and covers half of what v covers in that time.
    speed = min(fastest, float(np.sqrt(length * hardest * (1.0 - RISE))))
    ramp = speed / (hardest * (1.0 - RISE))
    coast = max(length / speed - ramp, 0.0)
    rise = RISE * ramp
    hardest = speed / (ramp - rise)
    up = [0.0, rise, ramp - rise, ramp]
    down = [coast + ramp + time for time in up]
    levels = [0.0, hardest, hardest, 0.0]
    if coast < 1e-9 * ramp:
        return Corners(np.array(up + down[1:]), np.array(levels + [-h for h in levels[1:]]))
    return Corners(np.array(up + down), np.array(levels + [-h for h in levels]))
