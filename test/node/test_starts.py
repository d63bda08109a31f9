# SPDX-License-Identifier: Apache-2.0
"""What is told once, at any moment of a start, by any sender, is honoured."""

import signal
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import PoseStamped, Vector3Stamped
from processes import Client, start
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from msg_adapters import geometry
from msg_adapters.trajectory import samples_from_reference
from riem_planner.geometry import so3

HALF_ANGLE = 0.35
TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.6]))
SUN = so3.exp(np.array([0.0, 0.0, 0.8])) @ np.array([1.0, 0.0, 0.0])  # on the straight way


def _sender(rng):
    latched = rng.random() < 0.3
    weak = not latched and rng.random() < 0.5
    return QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.BEST_EFFORT if weak else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _honoured(client, rng):
    """One start: the Sun and a goal are told once each; whether both counted."""
    client.statuses.clear()
    client.setpoints.clear()
    zone = ("-p", "zone_names:=[sun]", "-p", f"zones.sun.half_angle:={HALF_ANGLE}")
    node = start(*zone, "-p", "duration:=2.0")
    publishers = [
        client.node.create_publisher(kind, f"/riem_planner/{topic}", _sender(rng))
        for kind, topic in ((Vector3Stamped, "zones/sun"), (PoseStamped, "goal"))
    ]
    try:
        for publisher in publishers:
            client.wait(lambda p=publisher: p.get_subscription_count() > 0, 120.0)
        client.executor.spin_once(timeout_sec=float(rng.uniform(0.0, 1.5)))
        stamp_ns = client.now_ns()
        publishers[0].publish(geometry.vector_from_direction(SUN, 0, "inertial"))
        publishers[1].publish(geometry.pose_from_attitude(TURN, stamp_ns, "inertial"))
        client.wait(lambda: client.told("ARRIVED"), 120.0)
    finally:
        node.send_signal(signal.SIGINT)
        _, log = node.communicate(timeout=60.0)
        assert node.returncode == 0, log
        for publisher in publishers:
            client.node.destroy_publisher(publisher)
        time.sleep(0.2)
    depths = []
    for message in client.setpoints:
        q = samples_from_reference(message)[0].quaternions[0]
        axis = so3.quaternion_to_matrix(q)[:, 0]
        depths.append(HALF_ANGLE - float(np.arccos(np.clip(axis @ SUN, -1.0, 1.0))))
    stamps = {stamp for _, stamp in client.events() if stamp}
    return max(depths) < 1e-7 and len(stamps) == 1


@pytest.mark.parametrize("count", [2, pytest.param(200, marks=pytest.mark.soak)])
def test_it_is_honoured_in_every_start(count):
    client, rng = Client(), np.random.default_rng(count)
    try:
        assert [k for k in range(count) if not _honoured(client, rng)] == []
    finally:
        client.close()
