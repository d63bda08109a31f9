# SPDX-License-Identifier: Apache-2.0
"""What all obstacles have in common: their strength, their taper, and when they exist."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_number, positive_number
from riem_planner.errors import InvalidProblemError

Array = NDArray[np.float64]

USUAL_STRENGTH = 0.01
"""Normalised strength [rad^4] of an obstacle that states none."""


class Repelling:
    """What all obstacles have in common: their strength, and when they exist."""

    strength: float | None
    normalized_strength: float | None
    rate: Array
    range: tuple[float, float] | None
    active: tuple[tuple[float, float], ...] = ()
    group: str | None = None
    member: str | None = None

    def strength_in(self, duration: float) -> float:
        """Strength tau [rad^4/s^4] in a slew of a duration T [s]."""
        if self.normalized_strength is not None:
            return self.normalized_strength / duration**4
        assert self.strength is not None  # checked when the obstacle was made
        return self.strength

    def normalized_in(self, duration: float) -> float:
        """Strength `tau T^4` [rad^4] in a slew of a duration T [s]."""
        if self.normalized_strength is not None:
            return self.normalized_strength
        assert self.strength is not None  # checked when the obstacle was made
        return self.strength * duration**4

    def active_at(self, times: ArrayLike) -> NDArray[np.bool_]:
        """Whether it exists at times (...) [s]; the ends of a window belong to it."""
        t = np.asarray(times, dtype=float)
        if not self.active:
            return np.ones(t.shape, dtype=bool)
        return np.asarray(np.any([(a <= t) & (t <= b) for a, b in self.active], axis=0))

    @property
    def windows(self) -> tuple[tuple[float, float], ...]:
        """When it exists [s]: one window without ends where it always does."""
        return self.active or ((-math.inf, math.inf),)

    @property
    def greatest_speed(self) -> float:
        """Upper bound of the angular speed of its place [rad/s]."""
        return float(np.linalg.norm(self.rate))

    @property
    def greatest_growth(self) -> float:
        """Upper bound of the speed at which its size changes [rad/s]."""
        return 0.0

    @property
    def moves(self) -> bool:
        """Whether its place, its size or its existence depends on time."""
        return bool(np.any(self.rate)) or bool(self.active)


def check_strength(obstacle: Repelling) -> None:
    """Refuse two strengths, or one that is not above zero; the usual one where none is stated."""
    given = [
        key for key in ("strength", "normalized_strength") if getattr(obstacle, key) is not None
    ]
    if not given:
        object.__setattr__(obstacle, "normalized_strength", USUAL_STRENGTH)
        return
    if len(given) == 2:
        raise InvalidProblemError(
            "strength",
            f"expected at most one of strength, normalized_strength, got {' and '.join(given)}",
        )
    value = positive_number(given[0], getattr(obstacle, given[0]))
    object.__setattr__(obstacle, given[0], value)


def check_range(obstacle: Repelling, least: float) -> None:
    """Refuse a taper that does not begin outside of a radius and end before pi [rad]."""
    if obstacle.range is None:
        return
    on, off = (finite_number("range", value) for value in obstacle.range)
    if not least < on < off < math.pi:
        raise InvalidProblemError(
            "range",
            f"expected radius < on < off < pi [rad], got radius {least:.6g}, on {on:.6g},"
            f" off {off:.6g}",
        )
    object.__setattr__(obstacle, "range", (on, off))


def checked_windows(windows: Any) -> tuple[tuple[float, float], ...]:
    """Windows of time [s] in increasing order, those that touch made one."""
    try:
        pairs = [(float(start), float(end)) for start, end in windows]
    except (TypeError, ValueError):
        raise InvalidProblemError(
            "active", f"expected windows (start, end) of time, got {windows!r}"
        ) from None
    for start, end in pairs:
        if not (start < end and math.isfinite(start) and math.isfinite(end)):
            raise InvalidProblemError(
                "active", f"expected [start, end] with start < end, got [{start:g}, {end:g}]"
            )
    merged: list[tuple[float, float]] = []
    for start, end in sorted(pairs):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return tuple(merged)
