# SPDX-License-Identifier: Apache-2.0
"""Messages with one thing wrong with each, for every input of the node."""

import math

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray, Quaternion, Vector3

from msg_adapters import geometry

FRAME, BODY = "inertial", "base_link"
ODD = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
BAD_NUMBERS = [math.nan, math.inf, -math.inf, 1e308, -1e300, 1e150, 7.0]
BAD_FRAMES = ["", "map", "x" * 300, "inertial\n", "base_link/inertial"]


def _bad_quaternion(rng):
    values = ODD.tolist()
    values[rng.integers(4)] = float(rng.choice(BAD_NUMBERS))
    kind = rng.integers(4)
    if kind == 0:
        values = [0.0] * 4
    elif kind == 1:
        values = [5e-324] * 4
    elif kind == 2:
        values = (1.01 * ODD).tolist()
    return Quaternion(**dict(zip("xyzw", values, strict=True)))


def _bad_vector(rng):
    values = [0.1, 0.2, 0.3]
    values[rng.integers(3)] = float(rng.choice(BAD_NUMBERS[:3]))
    x, y, z = values if rng.integers(3) else (0.0, 0.0, 0.0)
    return Vector3(x=x, y=y, z=z)


def _bad_stamp(rng, now_ns, kinds):
    kind = rng.integers(kinds)
    if kind == 0:
        return Time(sec=-int(rng.integers(1, 2**31 - 1)), nanosec=0)
    offset = int(rng.integers(10, 10**6)) * 10**9
    return geometry.time_from_nanoseconds(max(now_ns + (offset if kind == 1 else -offset), 1))


def spoiled(name, rng, now_ns):
    """A message on an input with one thing wrong with it."""
    rest = np.zeros(3)
    makers = {
        "goal": lambda: geometry.pose_from_attitude(ODD, 0, FRAME),
        "goal_state": lambda: geometry.odometry_from_attitude(ODD, rest, 0, (FRAME, BODY)),
        "state": lambda: geometry.odometry_from_attitude(ODD, rest, 0, (FRAME, BODY)),
        "imu": lambda: geometry.imu_from_attitude(ODD, rest, 0, BODY),
        "zones": lambda: geometry.vector_from_direction(np.eye(3)[0], 0, FRAME),
        "obstacles": lambda: PoseArray(
            header=geometry.header(0, FRAME),
            poses=[Pose(orientation=geometry.quaternion_to_message(ODD))] * 3,
        ),
    }
    topic = name.partition("/")[0]  # of zones/<name> too
    message = makers[topic]()
    kind = rng.integers(3)
    if kind == 0:
        message.header.frame_id = str(rng.choice(BAD_FRAMES))
    elif kind == 1:
        ages = 2 if topic in ("zones", "obstacles") else 3  # data about the world may be old
        message.header.stamp = _bad_stamp(rng, now_ns, ages)
    elif topic == "zones":
        message.vector = _bad_vector(rng)
    elif name == "imu":
        message.orientation = _bad_quaternion(rng)
    elif name == "goal":
        message.pose.orientation = _bad_quaternion(rng)
    elif name == "obstacles":
        message.poses[1] = Pose(orientation=_bad_quaternion(rng))
    else:
        message.pose.pose.orientation = _bad_quaternion(rng)
    return message
