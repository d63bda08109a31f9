# SPDX-License-Identifier: Apache-2.0
"""Trajectories and setpoints: NumPy to messages and back."""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Transform, Twist
from numpy.typing import NDArray
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from msg_adapters import cdr
from msg_adapters.errors import MessageError
from msg_adapters.geometry import (
    SECOND,
    check_frame,
    header,
    nanoseconds_from_time,
    quaternion_from_message,
    quaternion_to_message,
    rate_from_message,
    vector_to_message,
)

Array = NDArray[np.float64]


class Samples(NamedTuple):
    """States of a body over time.

    Attributes
    ----------
    times : (n,)
        From the stamp [s].
    quaternions : (n, 4)
        x, y, z, w, body to reference frame.
    rates, accelerations : (n, 3)
        Body rates [rad/s] and body accelerations [rad/s^2].
    """

    times: Array
    quaternions: Array
    rates: Array
    accelerations: Array


def _duration(seconds: float) -> Duration:
    whole, rest = divmod(round(seconds * SECOND), SECOND)
    return Duration(sec=int(whole), nanosec=int(rest))


def _point(
    time: float, quaternion: Array, rate: Array, acceleration: Array
) -> MultiDOFJointTrajectoryPoint:
    return MultiDOFJointTrajectoryPoint(
        transforms=[Transform(rotation=quaternion_to_message(quaternion))],
        velocities=[Twist(angular=vector_to_message(rate))],
        accelerations=[Twist(angular=vector_to_message(acceleration))],
        time_from_start=_duration(time),
    )


def reference_from_samples(
    samples: Samples, nanoseconds: int, frames: tuple[str, str]
) -> MultiDOFJointTrajectory:
    """Message of a trajectory that begins at a stamp [ns]; frames = (reference, body).

    The one joint is called by the body frame. Rates and accelerations are in the body frame.
    """
    return MultiDOFJointTrajectory(
        header=header(nanoseconds, frames[0]),
        joint_names=[frames[1]],
        points=[_point(*state) for state in zip(*samples, strict=True)],
    )


# One point as it stands behind the number of its transforms, one of each: the numbers of its
# velocities and accelerations, and that of the next point's transforms, with four bytes to align.
_POINT = np.dtype(
    [
        ("translation", "<f8", 3),
        ("rotation", "<f8", 4),
        ("velocities", "<u4", 2),
        ("linear_velocity", "<f8", 3),
        ("rate", "<f8", 3),
        ("accelerations", "<u4", 2),
        ("linear_acceleration", "<f8", 3),
        ("acceleration", "<f8", 3),
        ("time", [("sec", "<i4"), ("nanosec", "<u4")]),
        ("next", "<u4", 2),
    ]
)


def cdr_from_samples(samples: Samples, nanoseconds: int, frames: tuple[str, str]) -> bytes:
    """The message of `reference_from_samples`, serialised, at once.

    To build it from Python objects, and to publish those, stops the stream for milliseconds.
    """
    count = len(samples.times)
    head = cdr.padded(cdr.header(nanoseconds, frames[0]), 4) + struct.pack("<I", 1)
    head = cdr.padded(head + cdr.string(frames[1]), 4) + struct.pack("<I", count)
    if count == 0:
        return head
    points = np.zeros(count, dtype=_POINT)
    points["rotation"] = samples.quaternions
    points["rate"], points["acceleration"] = samples.rates, samples.accelerations
    for number in ("velocities", "accelerations", "next"):
        points[number][:, 0] = 1
    points["time"]["sec"], points["time"]["nanosec"] = np.divmod(
        np.round(samples.times * SECOND).astype(np.int64), SECOND
    )
    return cdr.padded(head + struct.pack("<I", 1), 8) + points.tobytes()[:-8]


def samples_from_reference(message: MultiDOFJointTrajectory) -> tuple[Samples, int]:
    """States and stamp [ns] of a trajectory message of one joint.

    Raises
    ------
    MessageError
        A value is wrong; a point has not one transform, one velocity and one acceleration.
    """
    rows: list[tuple[float, Array, Array, Array]] = []
    for index, point in enumerate(message.points):
        field = f"points[{index}]"
        counts = (len(point.transforms), len(point.velocities), len(point.accelerations))
        if counts != (1, 1, 1):
            raise MessageError(field, counts, "one transform, one velocity, one acceleration")
        rows.append(
            (
                point.time_from_start.sec + point.time_from_start.nanosec / SECOND,
                quaternion_from_message(point.transforms[0].rotation, f"{field}.rotation"),
                rate_from_message(point.velocities[0].angular, f"{field}.velocities"),
                rate_from_message(point.accelerations[0].angular, f"{field}.accelerations"),
            )
        )
    if not rows:
        raise MessageError("points", "none", "at least one point")
    samples = Samples(*(np.array(column) for column in zip(*rows, strict=True)))
    return samples, nanoseconds_from_time(message.header.stamp)


class BodyStates(NamedTuple):
    """Attitudes and rates of several bodies at one time.

    Attributes
    ----------
    quaternions : (n, 4)
        x, y, z, w, body to reference frame.
    rates : (n, 3)
        In each body's own axes [rad/s].
    """

    quaternions: Array
    rates: Array


def states_from_point(
    message: MultiDOFJointTrajectory, reference_frame: str, most: int
) -> tuple[tuple[str, ...], BodyStates, int]:
    """Names, attitudes and rates of the joints of a trajectory of one point, and its stamp [ns].

    Parameters
    ----------
    message
        One transform and one velocity for each joint; none at all where there is no joint.
    reference_frame
        That its header must name.
    most
        Joints that it may have.

    Raises
    ------
    MessageError
        A value is wrong, a name is used twice, or there is not one point.
    """
    check_frame("header.frame_id", message.header.frame_id, reference_frame)
    names = tuple(message.joint_names)
    if len(names) > most:
        raise MessageError("joint_names", f"{len(names)} names", f"at most {most}")
    if len(set(names)) != len(names) or not all(names):
        raise MessageError("joint_names", list(names), "names, each once")
    stamp_ns = nanoseconds_from_time(message.header.stamp)
    if not names:
        return names, BodyStates(np.zeros((0, 4)), np.zeros((0, 3))), stamp_ns
    if len(message.points) != 1:
        raise MessageError("points", f"{len(message.points)} points", "one point")
    point = message.points[0]
    counts = len(point.transforms), len(point.velocities)
    if counts != (len(names), len(names)):
        raise MessageError("points[0]", counts, f"{len(names)} transforms and velocities")
    quaternions = [
        quaternion_from_message(each.rotation, f"points[0].transforms[{i}].rotation")
        for i, each in enumerate(point.transforms)
    ]
    rates = [
        rate_from_message(each.angular, f"points[0].velocities[{i}].angular")
        for i, each in enumerate(point.velocities)
    ]
    return names, BodyStates(np.array(quaternions), np.array(rates)), stamp_ns


class SetpointMessage:
    """One setpoint message, built once and filled anew for every setpoint."""

    def __init__(self, reference_frame: str, body_frame: str) -> None:
        zero = np.zeros(3)
        samples = Samples(np.zeros(1), np.array([[0.0, 0.0, 0.0, 1.0]]), zero[None], zero[None])
        self.message = reference_from_samples(samples, 0, (reference_frame, body_frame))
        point = self.message.points[0]
        self._stamp = self.message.header.stamp
        self._rotation = point.transforms[0].rotation
        self._rate = point.velocities[0].angular
        self._acceleration = point.accelerations[0].angular

    def filled(
        self, nanoseconds: int, quaternion: Array, rate: Array, acceleration: Array
    ) -> MultiDOFJointTrajectory:
        """The message of a state: quaternion (4,), body rate (3,), body acceleration (3,)."""
        self._stamp.sec, self._stamp.nanosec = divmod(nanoseconds, SECOND)
        rotation, turn, change = self._rotation, self._rate, self._acceleration
        rotation.x, rotation.y, rotation.z, rotation.w = quaternion.tolist()
        turn.x, turn.y, turn.z = rate.tolist()
        change.x, change.y, change.z = acceleration.tolist()
        return self.message
