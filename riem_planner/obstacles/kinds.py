# SPDX-License-Identifier: Apache-2.0
"""The obstacles a user states: an attitude, or a zone about a direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import (
    finite_array,
    frozen,
    non_negative_number,
    rotation_matrix,
    unit_vector,
)
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3, sphere
from riem_planner.geometry.paths import (
    Path,
    Turning,
    as_direction,
    bernstein,
    bernstein_slopes,
    evaluate_spline,
    spline_through,
)
from riem_planner.obstacles.repelling import (
    Repelling,
    check_range,
    check_strength,
    checked_windows,
)

Array = NDArray[np.float64]


def first_axis() -> Array:
    """The body axis of zones that name none, (1, 0, 0)."""
    return frozen(np.array([1.0, 0.0, 0.0]))


@dataclass(frozen=True, eq=False)
class OrientationObstacle(Repelling):
    """An attitude to keep away from, on SO(3).

    Parameters
    ----------
    orientation : (3, 3)
        Rotation matrix Q, body to reference frame, at time 0.
    strength
        tau of the potential `tau / (d - r)^2` [rad^4/s^4]; give it or `normalized_strength`.
    normalized_strength
        `tau T^4`, so that the path does not depend on the duration T; 0.01 where neither is
        given.
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

    if TYPE_CHECKING:  # what may be given, where the fields are what comes of it

        def __init__(
            self,
            orientation: ArrayLike,
            strength: float | None = None,
            normalized_strength: float | None = None,
            radius: float = 0.0,
            rate: ArrayLike = ...,
            range: tuple[float, float] | None = None,
            name: str | None = None,
        ) -> None: ...

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
        check_strength(self)
        check_range(self, self.radius)

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

    def radius_at(self, times: ArrayLike) -> Array:
        """Its radius [rad], the same at all times (...)."""
        return np.full(np.shape(times), self.radius)


@dataclass(frozen=True, eq=False)
class Zone(Repelling):
    """A cone about a direction that a body axis is kept out of, or in.

    Parameters
    ----------
    direction : (3,)
        Axis s of the cone in the reference frame at time 0; any length but zero. Or how it moves:
        a `Turning` (which becomes `direction` and `rate`) or a `Path`.
    half_angle
        r, the half-angle of the cone [rad]; 0 for a point obstacle. Or (n,) at the samples of the
        direction's `Path`, between which the same spline goes.
    boresight : (3,)
        Body axis b that is kept out (in); any length but zero. On S^2 the space's own.
    kind
        `keep_out` or `keep_in`.
    group
        Name of a group: at least one of its members is kept.
    member
        Name of a member of the group, all of whose zones are kept together; by default the zone
        is a member by itself.
    active
        Windows `(start, end)` of time [s]: the zone exists only then. Empty: always.
    strength, normalized_strength, rate, range, name
        As for `OrientationObstacle`.
    """

    direction: Array | Turning | Path
    half_angle: float | Array
    boresight: Array | None = None
    strength: float | None = None
    normalized_strength: float | None = None
    kind: Literal["keep_out", "keep_in"] = "keep_out"
    group: str | None = None
    rate: Array = field(default_factory=lambda: np.zeros(3))
    range: tuple[float, float] | None = None
    name: str | None = None
    active: tuple[tuple[float, float], ...] = ()
    member: str | None = None
    size_coefficients: Array = field(init=False, repr=False)

    if TYPE_CHECKING:

        def __init__(
            self,
            direction: ArrayLike | Turning | Path,
            half_angle: ArrayLike,
            boresight: ArrayLike | None = None,
            strength: float | None = None,
            normalized_strength: float | None = None,
            kind: Literal["keep_out", "keep_in"] = "keep_out",
            group: str | None = None,
            rate: ArrayLike = ...,
            range: tuple[float, float] | None = None,
            name: str | None = None,
            active: Sequence[tuple[float, float]] = (),
            member: str | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Validate and freeze."""
        set_field = object.__setattr__
        if self.kind not in ("keep_out", "keep_in"):
            raise InvalidProblemError("kind", f"expected keep_out or keep_in, got {self.kind!r}")
        set_field(self, "rate", finite_array("rate", self.rate, (3,)))
        self._check_place()
        if self.boresight is not None:
            set_field(self, "boresight", unit_vector("boresight", self.boresight))
        self._check_size()
        if self.member is not None and self.group is None:
            raise InvalidProblemError(
                "member", f"expected a group beside it, got {self.member!r} alone; give group"
            )
        set_field(self, "active", checked_windows(self.active))
        if self.range is not None and self.kind == "keep_in":
            raise InvalidProblemError("range", "a keep_in zone has no range: it acts everywhere")
        check_strength(self)
        check_range(self, self.radius)

    def _check_place(self) -> None:
        place = as_direction("direction", self.direction)
        if isinstance(self.direction, Turning | Path) and np.any(self.rate):
            raise InvalidProblemError(
                "rate", f"given beside a {type(place).__name__}, which says how it moves; remove it"
            )
        if isinstance(place, Path):
            object.__setattr__(self, "direction", place)
            return
        object.__setattr__(self, "direction", place.direction)
        if np.any(place.rate):
            object.__setattr__(self, "rate", place.rate)

    def _check_size(self) -> None:
        set_field = object.__setattr__
        least = "above 0 for keep_in" if self.kind == "keep_in" else "of at least 0"
        sizes: Array | float
        if isinstance(self.direction, Path) and np.ndim(self.half_angle) == 1:
            times = self.direction.times
            samples = finite_array("half_angle", self.half_angle, times.shape)
            coefficients = spline_through(times, samples)
            between = bernstein(coefficients[..., None], np.diff(times))
            if not np.all((between > -0.5) & (between < math.pi)):
                raise InvalidProblemError(
                    "half_angle",
                    "the spline through the samples leaves what an angle can be; give more samples",
                )
            sizes = samples
        else:
            if np.ndim(self.half_angle) != 0:
                raise InvalidProblemError(
                    "half_angle", "expected a number; samples of it need a Path as the direction"
                )
            sizes = non_negative_number("half_angle", self.half_angle)
            coefficients = np.array([sizes, 0.0, 0.0, 0.0])
        smallest, greatest = float(np.min(sizes)), float(np.max(sizes))
        if smallest < 0.0 or (self.kind == "keep_in" and smallest == 0.0):
            raise InvalidProblemError("half_angle", f"expected {least}, got {smallest:.6g}")
        if greatest >= math.pi:
            raise InvalidProblemError(
                "half_angle", f"expected less than pi rad, got {greatest:.6g}"
            )
        set_field(self, "half_angle", sizes)
        set_field(self, "size_coefficients", frozen(coefficients))

    @cached_property
    def place(self) -> Turning | Path:
        """Where its axis is over time."""
        if isinstance(self.direction, Path):
            return self.direction
        return Turning(np.asarray(self.direction), self.rate)

    @property
    def path(self) -> Path | None:
        """How its axis moves along samples; None where it has a rate, or none."""
        return self.direction if isinstance(self.direction, Path) else None

    @property
    def body_axis(self) -> Array:
        """The boresight (3,), or what stands for none."""
        return first_axis() if self.boresight is None else self.boresight

    @property
    def radius(self) -> float:
        """The half-angle [rad], of samples the greatest, under the name all obstacles share."""
        return float(np.max(self.half_angle))

    @property
    def greatest_speed(self) -> float:
        """Upper bound of the angular speed of its axis [rad/s]."""
        return self.place.greatest_speed

    @property
    def greatest_growth(self) -> float:
        """Upper bound of the speed at which its half-angle changes [rad/s]."""
        path = self.path
        if path is None or np.ndim(self.half_angle) == 0:
            return 0.0
        return float(np.max(np.abs(bernstein_slopes(self.size_coefficients, np.diff(path.times)))))

    @property
    def moves(self) -> bool:
        """Whether its place, its size or its existence depends on time."""
        return self.path is not None or bool(np.any(self.rate)) or bool(self.active)

    def direction_at(self, times: ArrayLike) -> Array:
        """Unit vectors (..., 3) of the cone's axis at times (...) [s]."""
        return self.place.direction_at(times)

    def radius_at(self, times: ArrayLike) -> Array:
        """Half-angles (...) [rad] at times (...) [s]."""
        path = self.path
        if path is None or np.ndim(self.half_angle) == 0:
            return np.full(np.shape(times), self.half_angle)
        pieces = self.size_coefficients[..., None]
        return np.asarray(evaluate_spline(path.times, pieces, times)[0][..., 0])

    def distance(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> Array:
        """Angle (...) [rad] between the boresight under attitudes (..., 3, 3) and the axis."""
        return sphere.angle(np.asarray(attitudes) @ self.body_axis, self.direction_at(times))

    def margin(self, attitudes: ArrayLike, times: ArrayLike = 0.0) -> Array:
        """Distance (...) [rad] from attitudes (..., 3, 3) to what is forbidden; negative inside.

        Where it does not exist pi, as far as can be.
        """
        outside = self.distance(attitudes, times) - self.radius_at(times)
        margin = -outside if self.kind == "keep_in" else outside
        return np.where(self.active_at(times), margin, math.pi) if self.active else margin


Obstacle = OrientationObstacle | Zone
