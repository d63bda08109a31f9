# SPDX-License-Identifier: Apache-2.0
"""Setpoints for the controllers of others, and back: plain functions on arrays, no messages.

Here an attitude is a unit quaternion x, y, z, w that turns body axes into the reference frame, and
rates and accelerations are in body axes, as everywhere in this package. Each function makes new
arrays, and raises where a number is not finite or a quaternion is not of unit length.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

UNIT_TOLERANCE = 1e-3
"""A quaternion this far from unit length is a mistake, not rounding."""

# PX4's frames are turned by half a turn: north east down from east north up about (1, 1, 0), and
# front right down from front left up about x.
_HALF = np.sqrt(0.5)
_NED_FROM_ENU = np.array([_HALF, _HALF, 0.0, 0.0])
_FLU_FROM_FRD = np.array([1.0, 0.0, 0.0, 0.0])
_FLIP = np.array([1.0, -1.0, -1.0])

IGNORE_ROLL_RATE, IGNORE_PITCH_RATE, IGNORE_YAW_RATE = 1, 2, 4
IGNORE_THRUST, IGNORE_ATTITUDE = 64, 128
_IGNORE_RATES = IGNORE_ROLL_RATE | IGNORE_PITCH_RATE | IGNORE_YAW_RATE


def _unit(quaternion: ArrayLike) -> Array:
    q = _finite(quaternion, 4)
    norm = float(np.linalg.norm(q))
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise ValueError(f"expected a unit quaternion, got {q.tolist()} (norm {norm:.6g})")
    return np.asarray(q / norm)


def _finite(vector: ArrayLike, size: int = 3) -> Array:
    v = np.array(vector, dtype=float)
    if v.shape != (size,) or not np.all(np.isfinite(v)):
        raise ValueError(f"expected {size} finite numbers, got {np.asarray(vector).tolist()}")
    return v


def _product(p: Array, q: Array) -> Array:
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.asarray(np.append(vector, p[3] * q[3] - p[:3] @ q[:3]))


def _turned(q: Array, v: Array) -> Array:
    """A vector of body axes in the reference frame."""
    t = 2.0 * np.cross(q[:3], v)
    return np.asarray(v + q[3] * t + np.cross(q[:3], t))


def _conjugate(q: Array) -> Array:
    return np.asarray(q * np.array([-1.0, -1.0, -1.0, 1.0]))


class Px4Setpoint(NamedTuple):
    """What PX4 takes: px4_msgs VehicleAttitudeSetpoint and VehicleRatesSetpoint.

    Attributes
    ----------
    q_d : (4,)
        w, x, y, z; turns front-right-down body axes into north-east-down.
    rates : (3,)
        Roll, pitch, yaw rate in front-right-down axes [rad/s].
    """

    q_d: Array
    rates: Array


def px4_from_attitude(quaternion: ArrayLike, rate: ArrayLike) -> Px4Setpoint:
    """Setpoint for PX4, of an attitude of front-left-up axes in east-north-up (REP 103).

    Parameters
    ----------
    quaternion : (4,)
        x, y, z, w.
    rate : (3,)
        Body rate [rad/s].
    """
    q = _product(_product(_NED_FROM_ENU, _unit(quaternion)), _FLU_FROM_FRD)
    return Px4Setpoint(np.roll(q, 1), _FLIP * _finite(rate))


def attitude_from_px4(q_d: ArrayLike, rates: ArrayLike) -> tuple[Array, Array]:
    """The inverse of `px4_from_attitude`: quaternion x, y, z, w and body rate [rad/s]."""
    q = np.roll(_unit(q_d), -1)
    back = _product(_product(_conjugate(_NED_FROM_ENU), q), _conjugate(_FLU_FROM_FRD))
    return back, _FLIP * _finite(rates)


class MavrosTarget(NamedTuple):
    """Fields of mavros_msgs AttitudeTarget; mavros itself turns them into PX4's frames.

    Attributes
    ----------
    orientation : (4,)
        x, y, z, w; front-left-up axes in east-north-up.
    body_rate : (3,)
        In front-left-up axes [rad/s].
    thrust
        0 to 1.
    type_mask
        What is to be ignored.
    """

    orientation: Array
    body_rate: Array
    thrust: float
    type_mask: int


def mavros_from_attitude(
    quaternion: ArrayLike, rate: ArrayLike | None = None, thrust: float | None = None
) -> MavrosTarget:
    """Target for mavros; what is None is marked to be ignored.

    Parameters
    ----------
    quaternion : (4,)
        x, y, z, w.
    rate : (3,)
        Body rate [rad/s].
    thrust
        0 to 1.
    """
    if thrust is not None and not 0.0 <= thrust <= 1.0:
        raise ValueError(f"expected a thrust from 0 to 1, got {thrust}")
    mask = (_IGNORE_RATES if rate is None else 0) | (IGNORE_THRUST if thrust is None else 0)
    body_rate = np.zeros(3) if rate is None else _finite(rate)
    return MavrosTarget(_unit(quaternion), body_rate, thrust or 0.0, mask)


def attitude_from_mavros(target: MavrosTarget) -> tuple[Array, Array | None]:
    """The inverse of `mavros_from_attitude`: quaternion, and body rate if it is not ignored."""
    if target.type_mask & IGNORE_ATTITUDE:
        raise ValueError(f"expected an attitude, got one to be ignored ({target.type_mask})")
    ignored = target.type_mask & _IGNORE_RATES
    return _unit(target.orientation), None if ignored else _finite(target.body_rate)


class BasiliskReference(NamedTuple):
    """Fields of Basilisk's AttRefMsgPayload: the reference R relative to the inertial frame N.

    Attributes
    ----------
    sigma_RN : (3,)
        Modified Rodrigues parameters, of norm at most 1.
    omega_RN_N, domega_RN_N : (3,)
        Rate [rad/s] and its derivative [rad/s^2], in components of N.
    """

    sigma_RN: Array  # noqa: N815 (Basilisk's names)
    omega_RN_N: Array  # noqa: N815 (Basilisk's names)
    domega_RN_N: Array  # noqa: N815 (Basilisk's names)


def basilisk_from_setpoint(
    quaternion: ArrayLike, rate: ArrayLike, acceleration: ArrayLike
) -> BasiliskReference:
    """Reference for Basilisk (Schaub, Junkins: Analytical Mechanics of Space Systems, 3.5).

    Parameters
    ----------
    quaternion : (4,)
        x, y, z, w.
    rate, acceleration : (3,)
        Of the body, in its axes [rad/s], [rad/s^2].
    """
    q = _unit(quaternion)
    q = -q if q[3] < 0.0 else q  # the set within the unit ball
    sigma = q[:3] / (1.0 + q[3])
    # In N the derivative of R v is R a, since v x v vanishes.
    return BasiliskReference(sigma, _turned(q, _finite(rate)), _turned(q, _finite(acceleration)))


def setpoint_from_basilisk(reference: BasiliskReference) -> tuple[Array, Array, Array]:
    """The inverse of `basilisk_from_setpoint`: quaternion, body rate, body acceleration."""
    sigma = _finite(reference.sigma_RN)
    square = float(sigma @ sigma)
    q = np.append(2.0 * sigma, 1.0 - square) / (1.0 + square)
    back = _conjugate(q)
    return (
        q,
        _turned(back, _finite(reference.omega_RN_N)),
        _turned(back, _finite(reference.domega_RN_N)),
    )


CHAINED = tuple(
    f"{part}.{axis}"
    for part, axes in (
        ("orientation", "xyzw"),
        ("angular_velocity", "xyz"),
        ("angular_acceleration", "xyz"),
    )
    for axis in axes
)
"""Names of the reference interfaces that a chained controller exports for a setpoint."""


def references_from_setpoint(
    quaternion: ArrayLike, rate: ArrayLike, acceleration: ArrayLike, prefix: str = ""
) -> dict[str, float]:
    """Values of ros2_control's reference interfaces by name.

    Parameters
    ----------
    quaternion : (4,)
        x, y, z, w.
    rate, acceleration : (3,)
        Of the body, in its axes [rad/s], [rad/s^2].
    prefix
        The controller's name, `attitude_controller/`, or such.
    """
    values = np.concatenate([_unit(quaternion), _finite(rate), _finite(acceleration)])
    return {prefix + name: float(value) for name, value in zip(CHAINED, values, strict=True)}


def setpoint_from_references(
    references: Mapping[str, float], prefix: str = ""
) -> tuple[Array, Array, Array]:
    """The inverse of `references_from_setpoint`: quaternion, body rate, body acceleration."""
    missing = [prefix + name for name in CHAINED if prefix + name not in references]
    if missing:
        raise ValueError(f"expected the interface {missing[0]}, got {', '.join(references)}")
    values = np.array([references[prefix + name] for name in CHAINED], dtype=float)
    return _unit(values[:4]), _finite(values[4:7]), _finite(values[7:])
