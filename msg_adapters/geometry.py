# SPDX-License-Identifier: Apache-2.0
"""Attitudes, directions, rates and stamps: messages to NumPy and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Quaternion, QuaternionStamped, Vector3, Vector3Stamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import Imu
from std_msgs.msg import Header

from msg_adapters.errors import MessageError

Array = NDArray[np.float64]

UNIT_TOLERANCE = 1e-3  # a quaternion this far from unit length is a mistake, not rounding
FASTEST = 1e3  # rad/s; no spacecraft turns faster, so a larger rate is a mistake of units
SECOND = 1_000_000_000


class Attitude(NamedTuple):
    """A state that came in a message.

    Attributes
    ----------
    quaternion : (4,)
        Unit, x, y, z, w, body to reference frame.
    rate : (3,)
        Body rate [rad/s].
    stamp : int
        Time of the message [ns]; 0 means now.
    """

    quaternion: Array
    rate: Array
    stamp: int


class Direction(NamedTuple):
    """A direction that came in a message: unit vector (3,) and stamp [ns]."""

    vector: Array
    stamp: int


def nanoseconds_from_time(message: Time, field: str = "header.stamp") -> int:
    """Nanoseconds since the clock's epoch; a negative or malformed stamp is refused."""
    if message.sec < 0 or not 0 <= message.nanosec < SECOND:
        value = f"{message.sec} s {message.nanosec} ns"
        raise MessageError(field, value, "a stamp from zero on with less than 1e9 ns")
    return int(message.sec * SECOND + message.nanosec)


def time_from_nanoseconds(nanoseconds: int) -> Time:
    """Stamp of a time [ns]."""
    seconds, rest = divmod(int(nanoseconds), SECOND)
    return Time(sec=seconds, nanosec=rest)


def header(nanoseconds: int, frame: str) -> Header:
    """Header with a stamp [ns] and a frame."""
    return Header(stamp=time_from_nanoseconds(nanoseconds), frame_id=frame)


def check_frame(field: str, frame: str, expected: str) -> None:
    """Refuse a frame that is not the one expected, an empty one included."""
    if frame != expected:
        raise MessageError(field, repr(frame), f"the frame {expected!r}")


def check_numbers(field: str, values: Sequence[float]) -> None:
    """Refuse NaN and infinity, and what is not a number at all."""
    if not all(isinstance(value, float) and math.isfinite(value) for value in values):
        raise MessageError(field, list(values), "finite numbers")


def quaternion_from_message(message: Quaternion, field: str = "orientation") -> Array:
    """Unit quaternion (4,), x, y, z, w; refused if its norm is off by more than 1e-3."""
    values = (message.x, message.y, message.z, message.w)
    check_numbers(field, values)
    norm = math.hypot(*values)
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:
        shown = f"{list(values)} (norm {norm:.6g})"
        raise MessageError(field, shown, "a unit quaternion x, y, z, w; normalise it")
    return np.array(values) / norm


def quaternion_to_message(quaternion: Array) -> Quaternion:
    """Message of a quaternion (4,) in the order x, y, z, w."""
    x, y, z, w = np.asarray(quaternion, dtype=float).tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def vector_to_message(vector: Array) -> Vector3:
    """Message of a vector (3,)."""
    x, y, z = np.asarray(vector, dtype=float).tolist()
    return Vector3(x=x, y=y, z=z)


def rate_from_message(message: Vector3, field: str) -> Array:
    """Body rate (3,) [rad/s]; refused if it is faster than anything turns."""
    values = (message.x, message.y, message.z)
    check_numbers(field, values)
    if max(map(abs, values)) > FASTEST:
        raise MessageError(field, list(values), f"less than {FASTEST:g} rad/s")
    return np.array(values)


def direction_from_message(message: Vector3, field: str = "vector") -> Array:
    """Unit vector (3,) of a direction of any length but zero."""
    values = (message.x, message.y, message.z)
    check_numbers(field, values)
    largest = max(map(abs, values))
    if largest == 0.0:
        raise MessageError(field, list(values), "a direction of any length but zero")
    scaled = np.array(values) / largest  # so that the norm neither overflows nor underflows
    return np.asarray(scaled / np.linalg.norm(scaled))


def attitude_from_pose(message: PoseStamped, reference_frame: str) -> Attitude:
    """Attitude at rest of a pose; its position is ignored."""
    check_frame("header.frame_id", message.header.frame_id, reference_frame)
    return Attitude(
        quaternion_from_message(message.pose.orientation, "pose.orientation"),
        np.zeros(3),
        nanoseconds_from_time(message.header.stamp),
    )


def pose_from_attitude(quaternion: Array, nanoseconds: int, frame: str) -> PoseStamped:
    """Pose of a quaternion (4,) at the origin."""
    message = PoseStamped(header=header(nanoseconds, frame))
    message.pose.orientation = quaternion_to_message(quaternion)
    return message


def attitude_from_odometry(message: Odometry, reference_frame: str, body_frame: str) -> Attitude:
    """Attitude and body rate; header frame = reference, child frame = body."""
    check_frame("header.frame_id", message.header.frame_id, reference_frame)
    check_frame("child_frame_id", message.child_frame_id, body_frame)
    return Attitude(
        quaternion_from_message(message.pose.pose.orientation, "pose.pose.orientation"),
        rate_from_message(message.twist.twist.angular, "twist.twist.angular"),
        nanoseconds_from_time(message.header.stamp),
    )


def odometry_from_attitude(
    quaternion: Array, rate: Array, nanoseconds: int, frames: tuple[str, str]
) -> Odometry:
    """Odometry of a quaternion (4,) and a body rate (3,); frames = (reference, body)."""
    message = Odometry(header=header(nanoseconds, frames[0]), child_frame_id=frames[1])
    message.pose.pose.orientation = quaternion_to_message(quaternion)
    message.twist.twist.angular = vector_to_message(rate)
    return message


def attitude_from_imu(message: Imu, body_frame: str) -> Attitude:
    """Attitude and body rate from an AHRS; header frame = body (REP 145)."""
    check_frame("header.frame_id", message.header.frame_id, body_frame)
    unknown = float(message.orientation_covariance[0])
    if unknown == -1.0:
        raise MessageError(
            "orientation_covariance[0]", unknown, "an orientation; -1 means that there is none"
        )
    return Attitude(
        quaternion_from_message(message.orientation),
        rate_from_message(message.angular_velocity, "angular_velocity"),
        nanoseconds_from_time(message.header.stamp),
    )


def imu_from_attitude(quaternion: Array, rate: Array, nanoseconds: int, body_frame: str) -> Imu:
    """Imu of a quaternion (4,) and a body rate (3,), without accelerations."""
    message = Imu(header=header(nanoseconds, body_frame))
    message.orientation = quaternion_to_message(quaternion)
    message.angular_velocity = vector_to_message(rate)
    message.linear_acceleration_covariance[0] = -1.0
    return message


def direction_from_vector(message: Vector3Stamped, reference_frame: str) -> Direction:
    """Direction of a body in the reference frame."""
    check_frame("header.frame_id", message.header.frame_id, reference_frame)
    return Direction(
        direction_from_message(message.vector), nanoseconds_from_time(message.header.stamp)
    )


def vector_from_direction(direction: Array, nanoseconds: int, frame: str) -> Vector3Stamped:
    """Message of a direction (3,)."""
    return Vector3Stamped(header=header(nanoseconds, frame), vector=vector_to_message(direction))


def quaternion_stamped(quaternion: Array, nanoseconds: int, frame: str) -> QuaternionStamped:
    """Message of an attitude setpoint."""
    return QuaternionStamped(
        header=header(nanoseconds, frame), quaternion=quaternion_to_message(quaternion)
    )
