"""The problem a user states: end states, duration, tension, obstacles. Frozen and validated."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import (
    finite_array,
    frozen,
    non_negative_number,
    positive_number,
    rotation_matrix,
    unit_quaternion,
    unit_vector,
)
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.limits import Limits
from riem_planner.obstacles import Forbidden, Obstacle

Array = NDArray[np.float64]

AUTO = "auto"
"""The duration that asks for the least within the limits."""

DURATIONS = (1e-9, 1e12)
"""Least and greatest duration [s]; beyond, its powers leave the range of numbers."""

_HORIZONTAL_TOLERANCE = 1e-6  # rad/s of roll that still counts as rounding on S^2


@dataclass(frozen=True)
class Space:
    """A space that trajectories live in, by its name in problem files."""

    name: str


SO3 = Space("so3")
"""Attitudes of a rigid body: the rotation group with its bi-invariant metric."""

S2 = Space("s2")
"""Pointing directions of a boresight: the unit sphere, lifted to attitudes that never roll."""


@dataclass(frozen=True, eq=False)
class State:
    """An attitude and its rate.

    Parameters
    ----------
    orientation : (3, 3)
        Rotation matrix R, body to reference frame.
    angular_velocity : (3,)
        Body rate v [rad/s], `R' = R hat(v)`; by default at rest.
    """

    orientation: Array
    angular_velocity: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Validate and freeze."""
        set_field = object.__setattr__
        set_field(self, "orientation", rotation_matrix("orientation", self.orientation))
        set_field(
            self,
            "angular_velocity",
            finite_array("angular_velocity", self.angular_velocity, (3,)),
        )

    @classmethod
    def from_quaternion_xyzw(
        cls, quaternion: ArrayLike, angular_velocity: ArrayLike = (0.0, 0.0, 0.0)
    ) -> State:
        """State of a unit quaternion (4,) in the order x, y, z, w and a body rate (3,) [rad/s]."""
        unit = unit_quaternion("orientation", quaternion)
        return cls(so3.quaternion_to_matrix(unit), np.asarray(angular_velocity, dtype=float))

    @classmethod
    def from_direction(
        cls,
        direction: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        boresight: ArrayLike = (1.0, 0.0, 0.0),
    ) -> State:
        """Roll-free state of a pointing direction, by the least rotation from the boresight.

        Parameters
        ----------
        direction : (3,)
            Where the boresight points, in the reference frame; any length but zero.
        velocity : (3,)
            Velocity of that unit vector [rad/s], tangent to the sphere there.
        boresight : (3,)
            Body axis; any length but zero.
        """
        x = unit_vector("direction", direction)
        b = unit_vector("boresight", boresight)
        R = so3.quaternion_to_matrix(so3.minimal_rotation(b, x))
        return cls(R, horizontal_rate(R, x, finite_array("velocity", velocity, (3,)), b))

    @cached_property
    def quaternion_xyzw(self) -> Array:
        """Unit quaternion (4,) of the attitude, x, y, z, w."""
        return frozen(so3.matrix_to_quaternion(self.orientation))


def horizontal_rate(attitude: Array, direction: Array, velocity: Array, boresight: Array) -> Array:
    """Body rate (3,) [rad/s] without roll that moves a direction (3,) with a velocity (3,).

    Raises
    ------
    InvalidProblemError
        The velocity is not tangent to the sphere at the direction.
    """
    radial = float(direction @ velocity)
    if abs(radial) > _HORIZONTAL_TOLERANCE * max(1.0, float(np.linalg.norm(velocity))):
        raise InvalidProblemError(
            "velocity",
            "expected a velocity tangent to the sphere at the direction, got a radial part of"
            f" {radial:.6g} rad/s; subtract it",
        )
    rate = np.cross(boresight, attitude.T @ velocity)
    return frozen(np.asarray(rate))


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise acceleration, tension and repulsion between two states.

    The cost is `1/2 int_0^T (|a|^2 + sigma |v|^2 + sum V_i) dt`.

    Parameters
    ----------
    start, goal
        End states. On S^2 only where the boresight points and how it moves is met at the goal;
        the rates must be orthogonal to the boresight.
    duration
        T [s]; `"auto"` for the least within the limits, which `solve` then finds (until then
        the duration is infinite).
    space
        `SO3` or `S2`.
    tension
        sigma [1/s^2]; or give `normalized_tension`, which is `sigma T^2`.
    obstacles
        What to keep away from or inside of.
    boresight : (3,)
        On S^2 the body axis that points; on SO(3) the axis of zones that name none.
    name
        What results call the problem.
    limits
        What the spacecraft can do; a trajectory is certified only within them.
    total_momentum : (3,)
        Angular momentum of body and wheels together, in the reference frame [N m s]; only the
        limits of wheels depend on it.

    Attributes
    ----------
    forbidden
        What the obstacles forbid, and how they repel.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names it.
    """

    start: State
    goal: State
    duration: float
    space: Space = SO3
    tension: float | None = None
    normalized_tension: float | None = None
    obstacles: tuple[Obstacle, ...] = ()
    boresight: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    name: str = ""
    limits: Limits | None = None
    total_momentum: Array = field(default_factory=lambda: np.zeros(3))
    forbidden: Forbidden = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Validate, freeze, and give every obstacle its name and boresight."""
        set_field = object.__setattr__
        if self.space not in (SO3, S2):
            raise InvalidProblemError("space", f"expected SO3 or S2, got {self.space!r}")
        if not isinstance(self.limits, Limits | None):
            raise InvalidProblemError("limits", f"expected Limits, got {self.limits!r}")
        set_field(self, "duration", self._checked_duration())
        momentum = finite_array("total_momentum", self.total_momentum, (3,))
        if np.any(momentum) and (self.limits is None or not self.limits.wheels):
            raise InvalidProblemError(
                "total_momentum", "only limits of wheels depend on it: give limits.wheels"
            )
        set_field(self, "total_momentum", momentum)
        if self.tension is not None and self.normalized_tension is not None:
            raise InvalidProblemError(
                "tension", "expected at most one of tension, normalized_tension, got both"
            )
        for key in ("tension", "normalized_tension"):
            if getattr(self, key) is not None:
                set_field(self, key, non_negative_number(key, getattr(self, key)))
        set_field(self, "boresight", unit_vector("boresight", self.boresight))
        forbidden = Forbidden(tuple(self.obstacles), self.boresight, self.space == S2)
        set_field(self, "forbidden", forbidden)
        set_field(self, "obstacles", forbidden.obstacles)
        if self.space == S2:
            self._check_horizontal("start", self.start)
            self._check_horizontal("goal", self.goal)

    def _checked_duration(self) -> float:
        given: object = self.duration
        if given == math.inf and self.limits is not None:
            return math.inf
        if given != AUTO:
            number = positive_number("duration", given)
            least, most = DURATIONS
            if not least <= number <= most:
                raise InvalidProblemError(
                    "duration", f"expected from {least:g} to {most:g} s, got {number:g}"
                )
            return number
        if self.limits is None:
            raise InvalidProblemError(
                "limits", "missing; an automatic duration is the least within limits: give them"
            )
        return math.inf

    def _check_horizontal(self, key: str, state: State) -> None:
        roll = float(self.boresight @ state.angular_velocity)
        scale = max(1.0, float(np.linalg.norm(state.angular_velocity)))
        if abs(roll) > _HORIZONTAL_TOLERANCE * scale:
            raise InvalidProblemError(
                f"{key}.angular_velocity",
                f"on s2 the rate must be orthogonal to the boresight, got a roll of {roll:.6g}"
                " rad/s; subtract it",
            )

    @property
    def has_auto_duration(self) -> bool:
        """Whether the duration is the least within the limits, yet to be found."""
        return math.isinf(self.duration)

    @property
    def sigma(self) -> float:
        """Tension sigma [1/s^2]."""
        if self.normalized_tension is not None:
            return self.normalized_tension / self.duration**2
        return self.tension or 0.0

    def strength_of(self, obstacle: Obstacle) -> float:
        """Strength tau of an obstacle [rad^4/s^4]."""
        return obstacle.strength_in(self.duration)

    def margins(self, attitude: ArrayLike, time: float = 0.0) -> dict[str, float]:
        """Distance [rad] of an attitude (3, 3) to each forbidden set; negative inside.

        Keys are the obstacles' names and, for a keep-in group, the group's: there the margin
        is that of its best member.
        """
        margins = self.forbidden.margins(attitude, time)
        return {name: float(margin) for name, margin in margins.items()}
