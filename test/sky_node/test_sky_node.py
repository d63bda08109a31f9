# SPDX-License-Identifier: Apache-2.0
"""The node of the sky: what it publishes, with a sky that needs no ephemeris."""

import time

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Vector3Stamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from trajectory_msgs.msg import MultiDOFJointTrajectory

from riem_planner.errors import InvalidProblemError
from riem_planner.sky_node import sky_node


class StillSky:
    """Bodies that stand still, 63781.37 km away."""

    def __init__(self, epoch, orbit):
        self.epoch, self.orbit = epoch, orbit

    def directions(self, name, seconds):
        return np.tile([0.6, 0.0, -0.8], (seconds.size, 1))

    def places(self, name, seconds):
        return 63781.37 * self.directions(name, seconds)

    def notes(self):
        return []


@pytest.fixture
def context(monkeypatch):
    monkeypatch.setattr(sky_node, "Sky", StillSky)
    monkeypatch.setattr(sky_node, "ephemeris", lambda: None)
    rclpy.init()
    yield
    rclpy.try_shutdown()


def node(**parameters):
    values = {"orbit.circular.altitude_km": 600.0} | {
        name.replace("__", "."): value for name, value in parameters.items()
    }
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return sky_node.SkyNode(parameter_overrides=overrides)


def test_directions_and_paths_come_latched_under_the_planners_name(context):
    told = node(bodies=["sun", "earth"], horizon=60.0, step=10.0)
    other = rclpy.create_node("listener")
    heard = {}
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    for kind, topic in (
        (Vector3Stamped, "riem_planner/bodies/sun"),
        (MultiDOFJointTrajectory, "riem_planner/bodies/earth/path"),
    ):
        other.create_subscription(kind, topic, lambda m, t=topic: heard.update({t: m}), latched)
    executor = SingleThreadedExecutor()
    executor.add_node(told)
    executor.add_node(other)
    end = time.monotonic() + 20.0
    while len(heard) < 2 and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    sun, path = heard.values() if "sun" in next(iter(heard)) else reversed(heard.values())
    assert (sun.header.frame_id, sun.vector.x, sun.vector.z) == ("inertial", 0.6, -0.8)
    assert path.joint_names == ["earth"]
    assert [p.time_from_start.sec for p in path.points] == [0, 10, 20, 30, 40, 50, 60]
    # A unit direction times the distance in radii of the body.
    assert path.points[3].transforms[0].translation.z == pytest.approx(-8.0, rel=1e-12)
    told.destroy_node()
    other.destroy_node()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"bodies": ["snu"]}, "did you mean sun?"),
        ({"orbit__circular__altitude_km": 0.0}, "either orbit.tle or orbit.circular"),
        ({"orbit__tle": ["1 x", "2 x"]}, "either orbit.tle or orbit.circular"),
    ],
)
def test_wrong_parameter_is_refused_with_its_name(context, parameters, words):
    with pytest.raises(InvalidProblemError, match=words.replace("?", r"\?")):
        node(**parameters)
