"""The obstacles a user states: an attitude, or a zone about a direction."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import (
    finite_array,
    finite_number,
    frozen,
    non_negative_number,
    positive_number,
    rotation_matrix,
    unit_vector,
)
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3, sphere

Array = NDArray[np.float64]


def first_axis() -> Array:
    """The body axis of zones that name none, (1, 0, 0)."""
    return frozen(np.array([1.0, 0.0, 0.0]))


class _Repelling:
    """The strength that all obstacles have, stated for their problem's units or for a slew."""

    strength: float | None
    normalized_strength: float | None

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


def _check_strength(obstacle: Obstacle) -> None:
    given = [
        key for key in ("strength", "normalized_strength") if getattr(obstacle, key) is not None
    ]
    if len(given) != 1:
        raise InvalidProblemError(
            "strength",
            "expected exactly one of strength, normalized_strength, got "
            + (" and ".join(given) or "neither"),
        )
    value = positive_number(given[0], getattr(obstacle, given[0]))
    object.__setattr__(obstacle, given[0], value)


def _check_range(obstacle: Obstacle, least: float) -> None:
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


@dataclass(frozen=True, eq=False)
class OrientationObstacle(_Repelling):
    """An attitude to keep away from, on SO(3).

    Parameters
    ----------
    orientation : (3, 3)
        Rotation matrix Q, body to reference frame, at time 0.
    strength
        tau of the potential `tau / (d - r)^2` [rad^4/s^4]; give it or `normalized_strength`.
    normalized_strength
        `tau T^4`, so that the path does not depend on the duration T.
    radius
        r, the distance never to fall below [rad].
    rate : (3,)
        Angular velocity in the reference frame [rad/s]: at time t the attitude is
        `exp(hat(rate t)) Q`.
    range
        `(on, off)` [rad]: the potential is tapered to zero between these distances.
    name
        What results call it; by default its index in the problem.
    """

    orientation: Array
    strength: float | None = None
    normalized_strength: float | None = None
    radius: float = 0.0
    rate: Array = field(default_factory=lambda: np.zeros(3))
    range: tuple[float, float] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        """Validate and freeze."""
        set_field = object.__setattr__
        set_field(self, "orientation", rotation_matrix("orientation", self.orientation))
        set_field(self, "radius", non_negative_number("radius", self.radius))
        if self.radius >= math.pi:
            raise InvalidProblemError(
                "radius", f"expected less than pi rad, got {self.radius:.6g}: no attitude is left"
            )
        set_field(self, "rate", finite_array("rate", self.rate, (3,)))
        _check_strength(self)
        _check_range(self, self.radius)

    @property
    def kind(self) -> str:
        """Its kind, as a problem file calls it."""
        return "orientation"

    def orientation_at(self, times: ArrayLike) -> Array:
        """Rotation matrices (..., 3, 3) of the obstacle at times (...) [s]."""
        turn = np.asarray(times, dtype=float)[..., None] * self.rate
        return np.asarray(so3.exp(turn) @ self.orientation)

    def distance(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> Array:
        """Rotation angle (...) [rad] from attitudes (..., 3, 3) to the obstacle at times (...)."""
        return so3.distance(attitudes, self.orientation_at(times))

    def margin(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> Array:
        """Distance (...) [rad] from attitudes (..., 3, 3) to what is forbidden; negative inside."""
        return self.distance(attitudes, times) - self.radius


@dataclass(frozen=True, eq=False)
class Zone(_Repelling):
    """A cone about a direction that a body axis is kept out of, or in.

    Parameters
    ----------
    direction : (3,)
        Axis s of the cone in the reference frame at time 0; any length but zero.
    half_angle
        r, the half-angle of the cone [rad]; 0 for a point obstacle.
    boresight : (3,)
        Body axis b that is kept out (in); any length but zero. On S^2 the space's own.
    kind
        `keep_out` or `keep_in`.
    group
        Name of a keep-in group: the attitude is inside at least one of its members.
    strength, normalized_strength, rate, range, name
        As for `OrientationObstacle`.
    """

    direction: Array
    half_angle: float
    boresight: Array | None = None
    strength: float | None = None
    normalized_strength: float | None = None
    kind: Literal["keep_out", "keep_in"] = "keep_out"
    group: str | None = None
    rate: Array = field(default_factory=lambda: np.zeros(3))
    range: tuple[float, float] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        """Validate and freeze."""
        set_field = object.__setattr__
        if self.kind not in ("keep_out", "keep_in"):
            raise InvalidProblemError("kind", f"expected keep_out or keep_in, got {self.kind!r}")
        set_field(self, "direction", unit_vector("direction", self.direction))
        if self.boresight is not None:
            set_field(self, "boresight", unit_vector("boresight", self.boresight))
        set_field(self, "half_angle", non_negative_number("half_angle", self.half_angle))
        if self.kind == "keep_in" and self.half_angle == 0.0:
            raise InvalidProblemError("half_angle", "expected above 0 for keep_in, got 0")
        if self.half_angle >= math.pi:
            raise InvalidProblemError(
                "half_angle", f"expected less than pi rad, got {self.half_angle:.6g}"
            )
        if self.group is not None and self.kind != "keep_in":
            raise InvalidProblemError("group", "only keep_in zones form groups")
        if self.range is not None and self.kind == "keep_in":
            raise InvalidProblemError("range", "a keep_in zone has no range: it acts everywhere")
        set_field(self, "rate", finite_array("rate", self.rate, (3,)))
        _check_strength(self)
        _check_range(self, self.half_angle)

    @property
    def body_axis(self) -> Array:
        """The boresight (3,), or what stands for none."""
        return first_axis() if self.boresight is None else self.boresight

    @property
    def radius(self) -> float:
        """The half-angle [rad], under the name all obstacles share."""
        return self.half_angle

    def direction_at(self, times: ArrayLike) -> Array:
        """Unit vectors (..., 3) of the cone's axis at times (...) [s]."""
        turn = np.asarray(times, dtype=float)[..., None] * self.rate
        return np.asarray(so3.exp(turn) @ self.direction)

    def distance(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> Array:
        """Angle (...) [rad] between the boresight under attitudes (..., 3, 3) and the axis."""
        return sphere.angle(np.asarray(attitudes) @ self.body_axis, self.direction_at(times))

    def margin(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> Array:
        """Distance (...) [rad] from attitudes (..., 3, 3) to what is forbidden; negative inside."""
        outside = self.distance(attitudes, times) - self.half_angle
        return -outside if self.kind == "keep_in" else outside


Obstacle = OrientationObstacle | Zone
