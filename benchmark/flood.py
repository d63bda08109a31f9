# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmark.flood SECONDS OBSTACLES GOALS`: messages to a node, at rates [Hz]."""

from __future__ import annotations

import sys
import time

import numpy as np
import rclpy
from geometry_msgs.msg import PoseArray, PoseStamped

from msg_adapters.geometry import pose_from_attitude
from msg_adapters.pose_array import cdr_from_orientations
from riem_planner.geometry import so3

_VARIETY = 200


def main() -> int:
    """Publish until the time is over: obstacles beside the slews, goals near each other."""
    seconds, obstacle_rate, goal_rate = map(float, sys.argv[1:4])
    rng = np.random.default_rng(0)
    obstacles = [
        cdr_from_orientations(
            so3.quaternion_exp(np.array([0.0, 0.0, 3.0]) + 0.1 * rng.normal(size=(5, 3))),
            0,
            "inertial",
        )
        for _ in range(_VARIETY)
    ]
    turns = [[0.0, 0.2 * rng.random(), 1.2 + 0.5 * rng.random()] for _ in range(_VARIETY)]
    goals = [pose_from_attitude(so3.quaternion_exp(np.array(t)), 0, "inertial") for t in turns]
    rclpy.init()
    node = rclpy.create_node("flood")
    streams = [
        (node.create_publisher(PoseArray, "/riem_planner/obstacles", 1), obstacles, obstacle_rate),
        (node.create_publisher(PoseStamped, "/riem_planner/goal", 1), goals, goal_rate),
    ]
    while not all(publisher.get_subscription_count() for publisher, _, _ in streams):
        time.sleep(0.05)
    begin = time.monotonic()
    sent = [0, 0]
    while (now := time.monotonic() - begin) < seconds:
        for i, (publisher, messages, rate) in enumerate(streams):
            if sent[i] < now * rate:
                publisher.publish(messages[sent[i] % _VARIETY])
                sent[i] += 1
        time.sleep(2e-4)
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
