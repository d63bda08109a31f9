# SPDX-License-Identifier: Apache-2.0
"""Potentials of an obstacle: functions of the distance with two derivatives.

`Barrier` is the paper's, unbounded at the obstacle, so that no curve of finite cost touches it.
`Plateau` is the family of Goodman and Colombo, bounded everywhere, which keeps a curve off by its
height. `OwnPotential` wraps any function.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from riem_planner.checks import finite_number, non_negative_number, positive_number
from riem_planner.errors import InvalidProblemError
from riem_planner.manifolds.matrices import Real

Derivatives = tuple[Real, Real, Real]


class Potential(ABC):
    """A potential V(d) of the distance d >= 0 to an obstacle, in lengths^2 / s^4."""

    @property
    def radius(self) -> float:
        """Distance that is never reached: V is infinite there. 0 where V is bounded."""
        return 0.0

    @property
    def excludes(self) -> bool:
        """Whether no curve of finite cost touches the ball of the radius."""
        return False

    @abstractmethod
    def derivatives(self, d: Real) -> Derivatives:
        """V, V' and V'' (...) at distances (...) beyond the radius."""

    @abstractmethod
    def slope_bound(self, least: Real) -> Real:
        """A bound (...) of |V'| at all distances of at least `least` (...), or infinity.

        It proves the clearance between samples; infinity says that nothing is known.
        """

    @abstractmethod
    def check(self, key: str) -> None:
        """Raise `InvalidProblemError` where a value is wrong."""

    def softened_root(self, d: Real, margin: float) -> tuple[Real, Real]:
        """Square root of V (...), finite everywhere, and its derivative by d.

        Parameters
        ----------
        d : (...)
            Distances, inside of the radius as well.
        margin
            Distance from the radius within which an unbounded V is softened.
        """
        V, slope, _ = self.derivatives(d)
        root = np.sqrt(np.maximum(V, 0.0))
        return root, 0.5 * slope / np.maximum(root, 1e-150)


@dataclass(frozen=True)
class Barrier(Potential):
    """`tau / (d - r)^2`.

    Parameters
    ----------
    strength
        tau, lengths^4 / s^4.
    inner
        r, the radius.
    """

    strength: float
    inner: float = 0.0

    @property
    def radius(self) -> float:
        """R."""
        return self.inner

    @property
    def excludes(self) -> bool:
        """Yes: the potential grows without bound."""
        return True

    def check(self, key: str) -> None:
        """Raise where the strength is not positive or the radius negative."""
        positive_number(f"{key}.strength", self.strength)
        non_negative_number(f"{key}.radius", self.inner)

    def derivatives(self, d: Real) -> Derivatives:
        """V, V', V'': infinite and without meaning inside."""
        gap = d - self.inner
        with np.errstate(divide="ignore", invalid="ignore"):
            V = np.where(gap > 0.0, self.strength / gap**2, np.inf)
            return V, np.where(gap > 0.0, -2.0 * V / gap, np.nan), 6.0 * V / gap**2

    def slope_bound(self, least: Real) -> Real:
        """|V'| at the nearest distance, where it is steepest."""
        gap = np.maximum(least - self.inner, 0.0)
        with np.errstate(divide="ignore"):
            return np.asarray(2.0 * self.strength / gap**3)

    def softened_root(self, d: Real, margin: float) -> tuple[Real, Real]:
        """`sqrt(tau) / (d - r)`, below the margin its tangent, which pushes outward everywhere."""
        gap = d - self.inner
        near = np.maximum(gap, margin)
        size = math.sqrt(self.strength)
        return size * np.where(gap >= margin, 1.0 / near, (2.0 * margin - gap) / margin**2), (
            -size / near**2
        )


@dataclass(frozen=True)
class Plateau(Potential):
    """`tau / (1 + (d / D)^(2 N))`: about tau within D of the obstacle, about 0 beyond.

    Parameters
    ----------
    strength
        tau, lengths^2 / s^4.
    width
        D.
    order
        N, at least 1: how steep the edge is.

    Notes
    -----
    Source: J. R. Goodman and L. J. Colombo, "Variational obstacle avoidance with applications to
    interpolation problems in hybrid systems". Such a potential does not exclude anything by
    itself; `clearance` says what it guarantees.
    """

    strength: float
    width: float
    order: int = 2

    def check(self, key: str) -> None:
        """Raise where a value is not positive or the order no whole number."""
        positive_number(f"{key}.strength", self.strength)
        positive_number(f"{key}.width", self.width)
        if finite_number(f"{key}.order", self.order) != int(self.order) or self.order < 1:
            raise InvalidProblemError(
                f"{key}.order", f"expected a whole number of at least 1, got {self.order!r}"
            )

    def derivatives(self, d: Real) -> Derivatives:
        """V, V', V''."""
        p = 2 * self.order
        x = d / self.width
        with np.errstate(over="ignore", invalid="ignore"):
            power = np.minimum(x**p, 1e150)
            V = self.strength / (1.0 + power)
            share = power / (1.0 + power)  # 1 - V / tau
        safe = np.maximum(d, 1e-150)
        slope = -p * V * share / safe
        bend = p * V * share * (p * (2.0 * share - 1.0) + 1.0) / safe**2
        if p == 2:  # at the obstacle itself
            bend = np.where(d > 1e-8 * self.width, bend, -2.0 * self.strength / self.width**2)
        return V, slope, bend

    def slope_bound(self, least: Real) -> Real:
        """The largest |V'|, where V'' is zero: at `D ((2 N - 1) / (2 N + 1))^(1 / (2 N))`."""
        p = 2 * self.order
        x = ((p - 1.0) / (p + 1.0)) ** (1.0 / p)
        largest = abs(float(self.derivatives(np.array(x * self.width))[1]))
        return np.full(np.shape(least), largest * (1.0 + 1e-12))

    def clearance(self, cost: float, start_speed: float, duration: float) -> float:
        """A distance that no curve of at most a given cost comes closer than; 0 if none.

        A curve's speed is at most `L = |v(0)| + sqrt(2 C T)`. One that comes within r < D of the
        obstacle stays within D for at least `min((D - r) / L, T / 2)`, where V >= tau / 2, which
        costs at least tau / 4 times that. So for `C < tau T / 8` it keeps `d >= D - 4 L C / tau`.

        Parameters
        ----------
        cost
            C.
        start_speed
            |v(0)|.
        duration
            T [s].
        """
        if cost >= self.strength * duration / 8.0:
            return 0.0
        speed = start_speed + math.sqrt(2.0 * cost * duration)
        return max(self.width - 4.0 * speed * cost / self.strength, 0.0)


@dataclass(frozen=True)
class OwnPotential(Potential):
    """A potential of the user's own.

    Parameters
    ----------
    function
        Takes distances (...) above 0 and returns V >= 0, V' and V'' (...); C^2.
    steepest
        A bound of |V'| at all distances, if there is one: with it clearances are proven between
        samples, and without it they are sampled.
    """

    function: Callable[[Real], Derivatives]
    steepest: float = math.inf

    def check(self, key: str) -> None:
        """Raise where the function is none, or its derivatives do not fit."""
        d, h = np.array([0.1, 0.35, 0.8, 1.5]), 1e-5
        try:
            V, slope, bend = (np.asarray(x, dtype=float) for x in self.function(d))
            above, below = (self.function(d + s * h) for s in (1.0, -1.0))
        except (TypeError, ValueError) as error:
            raise InvalidProblemError(
                key, f"expected a function of distances that returns V, V', V'': {error}"
            ) from None
        if np.any(V < 0.0) or not np.all(np.isfinite(V)):
            raise InvalidProblemError(key, f"expected V >= 0 and finite, got {V.tolist()} at {d}")
        for what, stated, pair in (
            ("V'", slope, (above[0], below[0])),
            ("V''", bend, (above[1], below[1])),
        ):
            found = (np.asarray(pair[0]) - np.asarray(pair[1])) / (2.0 * h)
            if not np.allclose(stated, found, rtol=1e-4, atol=1e-6 * (1.0 + np.abs(found).max())):
                raise InvalidProblemError(
                    key,
                    f"expected {what} = {found.tolist()} at d = {d.tolist()} (by differences),"
                    f" got {stated.tolist()}",
                )

    def derivatives(self, d: Real) -> Derivatives:
        """As the function says."""
        V, slope, bend = self.function(np.maximum(d, 1e-12))
        return np.asarray(V), np.asarray(slope), np.asarray(bend)

    def slope_bound(self, least: Real) -> Real:
        """The stated bound."""
        return np.full(np.shape(least), self.steepest)
