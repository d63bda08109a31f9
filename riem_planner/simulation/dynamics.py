# SPDX-License-Identifier: Apache-2.0
"""A rigid spacecraft that turns itself by three reaction wheels, and the controller that flies it.

Attitude R (body to reference), body rate v, momentum h of the wheels about their axes, which are
the body's. Without outside torques the total momentum is constant in the reference frame:

    R (J v + h) = const,    h' = -u,    R' = R hat(v),

where u is the torque of the wheels on the body; J is the inertia without the wheels' own about
their axes, and h counts the body's turn as well (Hughes, Spacecraft Attitude Dynamics, 1986,
section 3.4). While u is constant, h is known, and v follows from R: the attitude alone is
integrated, by a Runge-Kutta-Munthe-Kaas step of order 4 through the quaternion's exponential.
So the norm of the quaternion and the total momentum hold to rounding, at any step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import (
    finite_array,
    frozen,
    non_negative_number,
    positive_number,
    unit_quaternion,
)
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.limits import checked_inertia

Array = NDArray[np.float64]


def _three_limits(key: str, value: Any) -> Array:
    """Positive numbers (3,), of one or three; infinity means no limit."""
    limits = np.array(value, dtype=float)
    if limits.shape not in ((), (3,)) or not np.all(limits > 0.0):
        raise InvalidProblemError(key, f"expected one or three numbers above 0, got {value!r}")
    return frozen(np.array(np.broadcast_to(limits, 3)))


@dataclass(frozen=True, eq=False)
class BodyState:
    """How a spacecraft moves at one time.

    Parameters
    ----------
    quaternion : (4,)
        Unit, x, y, z, w, body to reference frame.
    rate : (3,)
        Body rate v [rad/s].
    wheel_momentum : (3,)
        h of the wheels about the body axes [N m s].
    """

    quaternion: Array
    rate: Array = field(default_factory=lambda: np.zeros(3))
    wheel_momentum: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Validate and freeze."""
        set_field = object.__setattr__
        set_field(self, "quaternion", unit_quaternion("quaternion", self.quaternion))
        set_field(self, "rate", finite_array("rate", self.rate, (3,)))
        momentum = finite_array("wheel_momentum", self.wheel_momentum, (3,))
        set_field(self, "wheel_momentum", momentum)


@dataclass(frozen=True, eq=False)
class Spacecraft:
    """A rigid body with a reaction wheel along each body axis.

    Parameters
    ----------
    inertia : (3, 3)
        J in body axes [kg m^2], symmetric and positive definite.
    torque_limit, momentum_limit
        Of each wheel, one number or three [N m], [N m s]; infinity: none.

    Raises
    ------
    InvalidProblemError
        A value is wrong; the error names it.
    """

    inertia: Array
    torque_limit: ArrayLike = np.inf
    momentum_limit: ArrayLike = np.inf
    _inverse: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(self, "inertia", checked_inertia(self.inertia))
        inverse = np.asarray(np.linalg.inv(self.inertia), dtype=np.float64)
        object.__setattr__(self, "_inverse", frozen(inverse))
        for key in ("torque_limit", "momentum_limit"):
            object.__setattr__(self, key, _three_limits(key, getattr(self, key)))

    def total_momentum(self, state: BodyState) -> Array:
        """`R (J v + h)` (3,) in the reference frame [N m s]."""
        momentum = self.inertia @ state.rate + state.wheel_momentum
        return np.asarray(so3.quaternion_to_matrix(state.quaternion) @ momentum)

    def kinetic_energy(self, state: BodyState) -> float:
        """`v . J v / 2` of the body [J]; wheels that are not driven leave it as it is."""
        return float(0.5 * (state.rate @ self.inertia @ state.rate))

    def acceleration(self, state: BodyState, torque: ArrayLike) -> Array:
        """`v' = J^-1 (u - v x (J v + h))` (3,) [rad/s^2] under a torque u (3,) [N m]."""
        momentum = self.inertia @ state.rate + state.wheel_momentum
        return np.asarray(self._inverse @ (np.asarray(torque) - so3.hat(state.rate) @ momentum))

    def applied_torque(self, state: BodyState, torque: ArrayLike, step: float) -> Array:
        """What the wheels give (3,) [N m] of a torque asked for, over a step [s].

        No wheel passes its momentum limit within the step; none gives more than its torque.
        """
        h = state.wheel_momentum
        wheel, motor = np.asarray(self.momentum_limit), np.asarray(self.torque_limit)
        within = np.maximum(np.minimum(np.asarray(torque), (h + wheel) / step), (h - wheel) / step)
        return np.asarray(np.maximum(np.minimum(within, motor), -motor))

    def step(self, state: BodyState, torque: ArrayLike, step: float) -> BodyState:
        """State a step [s] later, under what the wheels give of a constant torque (3,) [N m].

        Error of order `step^5`; momentum to rounding. The step must be above 0.
        """
        positive_number("step", step)
        u = self.applied_torque(state, torque, step)
        h = state.wheel_momentum
        body_momentum = self.inertia @ state.rate + h

        def rate(turn: Array, skew: Array, time: float) -> Array:
            """Body rate where the body has turned by a rotation vector since the step began."""
            x = math.sqrt(turn @ turn)
            once = skew @ body_momentum
            # exp(-hat(turn)) applied to the momentum (Rodrigues).
            first = math.sin(x) / x if x > 0.0 else 1.0
            second = 2.0 * (math.sin(0.5 * x) / x) ** 2 if x > 0.0 else 0.5
            seen = body_momentum - first * once + second * (skew @ once)
            return np.asarray(self._inverse @ (seen - h + u * time))

        def slope(turn: Array, time: float) -> Array:
            """`xi' = J_r^-1(xi) v`, to the terms that order 4 needs."""
            skew = so3.hat(turn)
            v = rate(turn, skew, time)
            once = skew @ v
            return np.asarray(v + 0.5 * once + (skew @ once) / 12.0)

        k1 = state.rate
        k2 = slope(0.5 * step * k1, 0.5 * step)
        k3 = slope(0.5 * step * k2, 0.5 * step)
        k4 = slope(step * k3, step)
        turn = step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        quaternion = so3.quaternion_multiply(state.quaternion, so3.quaternion_exp(turn))
        return BodyState(quaternion, rate(turn, so3.hat(turn), step), h - u * step)


@dataclass(frozen=True)
class SensorNoise:
    """White noise of the measured state.

    Parameters
    ----------
    attitude
        Standard deviation about each body axis [rad].
    rate
        Standard deviation of each component of the body rate [rad/s].
    """

    attitude: float = 0.0
    rate: float = 0.0

    def __post_init__(self) -> None:
        """Validate."""
        non_negative_number("attitude", self.attitude)
        non_negative_number("rate", self.rate)

    def measured(self, state: BodyState, random: np.random.Generator) -> BodyState:
        """The state as the sensors tell it; wheels know their own momentum."""
        turn = self.attitude * random.standard_normal(3)
        return BodyState(
            so3.quaternion_multiply(state.quaternion, so3.quaternion_exp(turn)),
            state.rate + self.rate * random.standard_normal(3),
            state.wheel_momentum,
        )


@dataclass(frozen=True, eq=False)
class Target:
    """Attitude to be in, and how it moves.

    Parameters
    ----------
    quaternion : (4,)
        Unit, x, y, z, w, body to reference frame.
    rate, acceleration : (3,)
        In the frame of the target's own body [rad/s], [rad/s^2].
    """

    quaternion: Array
    rate: Array = field(default_factory=lambda: np.zeros(3))
    acceleration: Array = field(default_factory=lambda: np.zeros(3))

    def after(self, time: float) -> Target:
        """The target a time [s] later (or, if negative, earlier), its acceleration held.

        The rotation vector is that of the Magnus series to third order,
        `v t + a t^2/2 + v x a t^3/12`.
        """
        v, a = self.rate, self.acceleration
        turn = time * v + 0.5 * time**2 * a + time**3 / 12.0 * (so3.hat(v) @ a)
        quaternion = so3.quaternion_multiply(self.quaternion, so3.quaternion_exp(turn))
        return Target(quaternion / np.linalg.norm(quaternion), v + time * a, a)

    def at_rest(self) -> Target:
        """The same attitude, held."""
        return Target(self.quaternion)


@dataclass(frozen=True, eq=False)
class Controller:
    """Proportional and derivative control on SO(3), with feed-forward of the target's motion.

    With the attitude error `e = log(R_d^T R)` and the rate error `w = v - Q v_d`,
    `Q = R^T R_d`, the torque is

        u = J (Q a_d - v x Q v_d - omega^2 e - 2 zeta omega w) + v x (J v + h).

    Where J is exact and no wheel is at its limit, `w' = -omega^2 e - 2 zeta omega w` and
    `|w|^2 + omega^2 |e|^2` falls at any error below pi (after Bullo and Murray, Automatica 35(8),
    1999; the logarithm's gradient is e itself).

    Parameters
    ----------
    inertia : (3, 3)
        J as the controller believes it to be [kg m^2].
    natural_frequency
        omega [rad/s].
    damping_ratio
        zeta [1].
    """

    inertia: Array
    natural_frequency: float = 1.0
    damping_ratio: float = 1.0

    def __post_init__(self) -> None:
        """Validate and freeze."""
        object.__setattr__(self, "inertia", checked_inertia(self.inertia))
        positive_number("natural_frequency", self.natural_frequency)
        positive_number("damping_ratio", self.damping_ratio)

    def torque(self, state: BodyState, target: Target) -> Array:
        """Torque u (3,) [N m] to ask of the wheels."""
        v = state.rate
        error = so3.quaternion_multiply(
            so3.quaternion_conjugate(target.quaternion), state.quaternion
        )
        back = so3.quaternion_to_matrix(error).T  # Q = R^T R_d
        rate = back @ target.rate
        omega = self.natural_frequency
        acceleration = (
            back @ target.acceleration
            - so3.hat(v) @ rate
            - omega**2 * so3.quaternion_log(error)
            - 2.0 * self.damping_ratio * omega * (v - rate)
        )
        gyroscopic = so3.hat(v) @ (self.inertia @ v + state.wheel_momentum)
        return np.asarray(self.inertia @ acceleration + gyroscopic)
