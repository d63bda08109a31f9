# SPDX-License-Identifier: Apache-2.0
"""An attitude with its rate: the ends of a slew, and the simplest goal."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import (
    finite_array,
    frozen,
    rotation_matrix,
    unit_quaternion,
    unit_vector,
)
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3

Array = NDArray[np.float64]

HORIZONTAL_TOLERANCE = 1e-6
"""Roll on S^2 that still counts as rounding [rad/s]."""


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

    if TYPE_CHECKING:
        # What the constructor takes; the fields say what is kept of it.
        def __init__(self, orientation: ArrayLike, angular_velocity: ArrayLike = ...) -> None: ...

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

    @property
    def roll_axis(self) -> None:
        """Body axis about which the attitude at the arrival is free: none."""
        return None

    @property
    def moves(self) -> bool:
        """Whether the goal is another one at another time."""
        return False

    def arrival(self, time: float) -> State:
        """The state itself, whenever it is reached."""
        return self

    def tracked(self, arrival: float, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Stay where the slew ended; see `AttitudeGoal.tracked`."""
        shape = np.shape(times)
        still = np.zeros((*shape, 3))
        return np.broadcast_to(np.eye(3), (*shape, 3, 3)), still, still

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
    if abs(radial) > HORIZONTAL_TOLERANCE * max(1.0, float(np.linalg.norm(velocity))):
        raise InvalidProblemError(
            "velocity",
            "expected a velocity tangent to the sphere at the direction, got a radial part of"
            f" {radial:.6g} rad/s; subtract it",
        )
    rate = np.cross(boresight, attitude.T @ velocity)
    return frozen(np.asarray(rate))
