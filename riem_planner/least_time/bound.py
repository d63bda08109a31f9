# SPDX-License-Identifier: Apache-2.0
"""A lower bound of the duration of any path within limits.

Along any path the speed `|v|` grows no faster than the greatest `|a|` that the limits admit, and
where the torque is limited no faster than the greatest torque over the least moment (the angular
momentum seen from the reference frame grows with the torque). With limits of jerk it begins with
no acceleration. So the way is no longer than that of the fastest growth from both ends, up to the
greatest `|v|`, and no shorter than the angle between the ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3, sphere
from riem_planner.limit_rows import (
    ACCELERATION,
    JERK,
    MOMENTUM,
    RATE,
    TORQUE,
    WHEEL_MOMENTUM,
    WHEEL_TORQUE,
)
from riem_planner.limits import Limits
from riem_planner.problem import S2, Problem

Array = NDArray[np.float64]

_HALVINGS = 45
_EDGE = 1e-9  # relative, by which a vertex may pass the other bounds


def least_possible_duration(problem: Problem) -> float:
    """No path needs less [s]; 0 where nothing is known."""
    limits = problem.limits
    assert limits is not None  # a problem of least time has them
    if problem.goals[0].moves:
        return 0.0
    start, goal = problem.start, problem.arrival
    axis = problem.boresight if problem.space == S2 else problem.roll_axis
    if axis is not None:
        angle = float(sphere.angle(start.orientation @ axis, goal.orientation @ axis))
    else:
        angle = float(so3.distance(start.orientation, goal.orientation))
    still = not np.any(problem.total_momentum)
    fastest, quickest, smoothest = _greatest(limits, still)
    ends = [_Growth(float(np.linalg.norm(state.angular_velocity)), fastest, quickest, smoothest)
            for state in (start, goal)]  # fmt: skip
    least = 0.0
    if math.isfinite(quickest) and axis is None:
        least = float(np.linalg.norm(goal.angular_velocity - start.angular_velocity)) / quickest
    high = max(1.0, least)
    while _way(ends, high) < angle:
        high *= 2.0
    low = 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _way(ends, middle) < angle else (low, middle)
    return max(least, low)


@dataclass(frozen=True)
class _Growth:
    """The fastest growth of the speed from an end on."""

    speed: float
    fastest: float
    quickest: float
    smoothest: float

    def speed_after(self, t: float) -> float:
        """The greatest speed [rad/s] a time [s] after the end."""
        rise = self._rise
        if math.isinf(self.quickest) and math.isinf(self.smoothest):
            return self.fastest if t > 0.0 else self.speed
        early = t <= rise
        gained = 0.5 * self.smoothest * t * t if early else self.quickest * (t - 0.5 * rise)
        return min(self.fastest, self.speed + gained)

    @cached_property
    def _rise(self) -> float:
        """How long the acceleration grows [s]."""
        if math.isinf(self.smoothest):
            return 0.0
        return self.quickest / self.smoothest

    def way_after(self, t: float) -> float:
        """The longest way [rad] in a time [s] after the end."""
        if math.isinf(self.quickest) and math.isinf(self.smoothest):
            return self.fastest * t
        capped = self._capped
        if t > capped:
            return self.way_after(capped) + self.fastest * (t - capped)
        rise = min(self._rise, t)
        way = self.speed * t
        if rise > 0.0:
            way += self.smoothest * rise**3 / 6.0
        if t > rise:
            late = t - rise
            way += late * (0.5 * self.quickest * rise + 0.5 * self.quickest * late)
        return way

    @cached_property
    def _capped(self) -> float:
        """When the greatest speed is reached [s]."""
        if math.isinf(self.fastest):
            return math.inf
        low, high = 0.0, 1.0
        while self.speed_after(high) < self.fastest:
            high *= 2.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.speed_after(middle) < self.fastest else (low, middle)
        return high


def _way(ends: list[_Growth], T: float) -> float:
    """The longest way between two ends in a time [s]."""
    before, after = ends
    low, high = 0.0, T
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if before.speed_after(middle) < after.speed_after(T - middle):
            low = middle
        else:
            high = middle
    return before.way_after(low) + after.way_after(T - low)


def _greatest(limits: Limits, still: bool) -> tuple[float, float, float]:
    """The greatest norms of rate, acceleration and jerk that limits admit."""
    norms, rows, first = limits.table
    J = limits.inertia_matrix
    least_moment = float(np.linalg.eigvalsh(J)[0])

    def block(i: int) -> Array:
        return rows[first[i] : first[i + 1]]

    def of_norm(i: int) -> float:
        return 1.0 / float(norms[i]) if norms[i] > 0.0 else math.inf

    rate_rows = [block(RATE), block(MOMENTUM) @ J]
    torque = min(of_norm(TORQUE), _greatest_norm(block(TORQUE)))
    if still:
        rate_rows.append(block(WHEEL_MOMENTUM) @ J)
        torque = min(torque, _greatest_norm(block(WHEEL_TORQUE)))
    fastest = min(
        of_norm(RATE), of_norm(MOMENTUM) / least_moment, _greatest_norm(np.concatenate(rate_rows))
    )
    quickest = min(
        of_norm(ACCELERATION), _greatest_norm(block(ACCELERATION)), torque / least_moment
    )
    return fastest, quickest, min(of_norm(JERK), _greatest_norm(block(JERK)))


def _greatest_norm(rows: Array) -> float:
    """The greatest |x| with `|rows x| <= 1`: that of a vertex; infinite without enough rows."""
    greatest = math.inf
    for some in combinations(range(len(rows)), 3):
        if abs(np.linalg.det(rows[list(some)])) < 1e-12 * np.max(np.abs(rows)) ** 3:
            continue
        vertices = np.array(
            [np.linalg.solve(rows[list(some)], signs) for signs in product((-1.0, 1.0), repeat=3)]
        )
        inside = np.all(np.abs(vertices @ rows.T) <= 1.0 + _EDGE, axis=1)
        if np.any(inside):
            longest = float(np.max(np.linalg.norm(vertices[inside], axis=1)))
            greatest = longest if math.isinf(greatest) else max(greatest, longest)
    return greatest
