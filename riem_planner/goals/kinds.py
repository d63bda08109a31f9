# SPDX-License-Identifier: Apache-2.0
"""The goals that a user states: an attitude, or where an axis points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_array, rotation_matrix, unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3, sphere
from riem_planner.geometry.paths import Path, Turning, as_direction
from riem_planner.goals.frames import frame_of_two, transported
from riem_planner.goals.state import State

Array = NDArray[np.float64]

_PARALLEL = 1e-6  # rad, within which two axes determine no attitude


@dataclass(frozen=True, eq=False)
class AttitudeGoal:
    """An attitude that turns at a constant rate, and is met with that rate.

    Parameters
    ----------
    orientation : (3, 3)
        Rotation matrix R, body to reference frame, at time 0.
    rate : (3,)
        Angular velocity in the reference frame [rad/s]: at time t the attitude is
        `exp(hat(rate t)) R`, as of an obstacle.
    """

    orientation: Array
    rate: Array = field(default_factory=lambda: np.zeros(3))

    if TYPE_CHECKING:
        # What the constructor takes; the fields say what is kept of it.
        def __init__(self, orientation: ArrayLike, rate: ArrayLike = ...) -> None: ...

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(self, "orientation", rotation_matrix("orientation", self.orientation))
        object.__setattr__(self, "rate", finite_array("rate", self.rate, (3,)))

    @property
    def roll_axis(self) -> None:
        """Body axis about which the attitude at the arrival is free: none."""
        return None

    @property
    def moves(self) -> bool:
        """Whether the goal is another one at another time."""
        return bool(np.any(self.rate))

    def arrival(self, time: float) -> State:
        """Attitude and body rate that the goal asks for at a time [s]."""
        R = so3.exp(time * self.rate) @ self.orientation
        return State(R, R.T @ self.rate)

    def tracked(self, arrival: float, times: ArrayLike) -> tuple[Array, Array, Array]:
        """How the attitude goes on after the arrival, in the reference frame.

        Parameters
        ----------
        arrival
            T [s].
        times : (...)
            From T on [s].

        Returns
        -------
        turns : (..., 3, 3)
            L: from the attitude R(T) at the arrival, whatever its roll, on to `L R(T)`.
        rates, accelerations : (..., 3)
            Angular velocity of L in the reference frame [rad/s], and its derivative [rad/s^2].
        """
        since = np.asarray(times, dtype=float) - arrival
        turns = so3.exp(since[..., None] * self.rate)
        rates = np.broadcast_to(self.rate, (*since.shape, 3))
        return turns, rates, np.zeros_like(rates)


@dataclass(frozen=True, eq=False)
class PointingGoal:
    """A body axis on a direction; the turn about it is free, or best for a second axis.

    Parameters
    ----------
    boresight : (3,)
        Body axis b; any length but zero.
    direction : (3,), Turning or Path
        Where it shall point, in the reference frame. A direction that moves is met with its
        velocity, without a rate about the boresight.
    second
        Another body axis and its direction, which it gets as near to as it can: they determine
        the turn about the first one.

    Raises
    ------
    InvalidProblemError
        A value is wrong, or the two axes, or directions, are parallel within 1e-6 rad.
    """

    boresight: Array
    direction: Turning | Path
    second: tuple[Array, Turning | Path] | None = None

    if TYPE_CHECKING:
        # What the constructor takes; the fields say what is kept of it.
        def __init__(
            self,
            boresight: ArrayLike,
            direction: ArrayLike | Turning | Path,
            second: tuple[ArrayLike, ArrayLike | Turning | Path] | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Validate and freeze."""
        set_field = object.__setattr__
        set_field(self, "boresight", unit_vector("boresight", self.boresight))
        set_field(self, "direction", as_direction("direction", self.direction))
        if self.second is not None:
            set_field(self, "second", self._checked_second(self.second))

    def _checked_second(self, second: Any) -> tuple[Array, Turning | Path]:
        if not isinstance(second, tuple | list) or len(second) != 2:
            raise InvalidProblemError(
                "second", f"expected a boresight and a direction, got {second!r}"
            )
        boresight = unit_vector("second.boresight", second[0])
        if _parallel(self.boresight, boresight):
            raise InvalidProblemError(
                "second.boresight",
                "parallel to goal.boresight: the roll is not determined; give another body axis",
            )
        direction = as_direction("second.direction", second[1])
        if not (is_moving(self.direction) or is_moving(direction)):
            self._check_directions(self.direction.direction_at(0.0), direction.direction_at(0.0))
        return boresight, direction

    @staticmethod
    def _check_directions(first: Array, second: Array) -> None:
        if _parallel(first, second):
            raise InvalidProblemError(
                "second.direction",
                "parallel to goal.direction: the roll is not determined; give another one",
            )

    @property
    def roll_axis(self) -> Array | None:
        """Body axis (3,) about which the attitude at the arrival is free; None with a second."""
        return self.boresight if self.second is None else None

    @property
    def moves(self) -> bool:
        """Whether the goal is another one at another time."""
        return is_moving(self.direction) or (self.second is not None and is_moving(self.second[1]))

    def arrival(self, time: float) -> State:
        """Attitude and body rate that the goal asks for at a time [s].

        Where the roll is free, some attitude with the boresight on its direction: that of the
        least rotation from the axes of the reference frame.
        """
        if self.second is None:
            d, d_1, _ = self.direction.motion_at(time)
            R = so3.quaternion_to_matrix(so3.minimal_rotation(self.boresight, d))
            return State(R, R.T @ np.cross(d, d_1))
        frames, rates, _ = self._frames(time)
        R = frames @ self._axes().T
        return State(R, R.T @ rates)

    def tracked(self, arrival: float, times: ArrayLike) -> tuple[Array, Array, Array]:
        """How the attitude goes on after the arrival; see `AttitudeGoal.tracked`."""
        if not self.moves:
            return State(np.eye(3)).tracked(arrival, times)
        t = np.asarray(times, dtype=float)
        if self.second is None:
            d, d_1, d_2 = self.direction.motion_at(t)
            return transported(self.direction, arrival, t), np.cross(d, d_1), np.cross(d, d_2)
        frames, rates, accelerations = self._frames(t)
        return frames @ self._frames(arrival)[0].T, rates, accelerations

    def remaining_angle(self, time: float) -> float:
        """Angle [rad] that is left between the second axis and its direction at a time [s]."""
        if self.second is None:
            return 0.0
        boresight, direction = self.second
        between = sphere.angle(self.direction.direction_at(time), direction.direction_at(time))
        return abs(float(sphere.angle(self.boresight, boresight) - between))

    def _axes(self) -> Array:
        assert self.second is not None
        still = Turning(self.boresight), Turning(self.second[0])
        return frame_of_two(*(axis.motion_at(0.0) for axis in still))[0]

    def _frames(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        assert self.second is not None
        first, second = self.direction.motion_at(times), self.second[1].motion_at(times)
        self._check_directions(first[0], second[0])
        return frame_of_two(first, second)


Goal = State | AttitudeGoal | PointingGoal


def is_moving(direction: Turning | Path) -> bool:
    """Whether a direction is another one at another time."""
    return isinstance(direction, Path) or bool(np.any(direction.rate))


def _parallel(first: Array, second: Array) -> bool:
    angle = sphere.angle(first, second)
    return bool(np.any(np.minimum(angle, np.pi - angle) <= _PARALLEL))
