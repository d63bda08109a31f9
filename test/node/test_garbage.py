# SPDX-License-Identifier: Apache-2.0
"""Garbage on every input: the node lives, the good data stays, the memory does not grow."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import Pose, PoseArray
from spoiled import FRAME, ODD, spoiled

from msg_adapters import geometry
from riem_planner.geometry import so3

Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.2]))


def _resident():
    fields = Path("/proc/self/statm").read_text().split()
    return int(fields[1]) * 4096


def _descriptors():
    return len(list(Path("/proc/self/fd").iterdir()))


def _fly(ros):
    bench = ros(["sun"], sun__direction=[0.0, 0.0, 1.0], sun__half_angle=0.3, obstacle_radius=0.1)
    bench.goal(Z_TURN)
    bench.wait(lambda: "FLYING" in bench.codes())
    return bench


def _throw(bench, count, seed):
    """Spoiled messages at the node, as fast as it takes them; how many it refused."""
    rng = np.random.default_rng(seed)
    names = ["goal", "goal_state", "state", "imu", "zones/sun", "obstacles"]
    counts = bench.node.outputs.rejections.counts
    for k in range(count):
        name = names[k % len(names)]
        message = spoiled(name, rng, bench.node.now_ns())
        before = counts.get(f"~/{name}", 0)
        bench.send(name, message)
        bench.wait(lambda n=name, b=before: counts.get(f"~/{n}", 0) > b)
    return sum(counts.values())


def _forget(bench):
    """Throw away what the client has heard of the stream, which would look like a leak."""
    for heard in bench.heard.values():
        heard.clear()


def _unharmed(bench, flown):
    mission = bench.node.mission
    # The same plan; its start moves where this machine stalls for long enough to count as a jump.
    assert mission.timeline.last.trajectory is flown.trajectory
    assert mission.measured is None
    assert so3.quaternion_distance(mission.goal.quaternion, Z_TURN) < 1e-12
    assert np.array_equal(mission.world.obstacles(0)[0].direction, [0.0, 0.0, 1.0])
    assert len(mission.world.obstacles(0)) == 1


def test_every_spoiled_message_is_refused_and_changes_nothing(ros):
    bench = _fly(ros)
    flown = bench.node.mission.timeline.last
    assert _throw(bench, 300, 5) == 300
    _unharmed(bench, flown)
    assert bench.state() == "active"


def test_a_hundred_thousand_poses_are_refused_beside_the_stream(ros):
    bench = _fly(ros)
    flown = bench.node.mission.timeline.last
    poses = [Pose(orientation=geometry.quaternion_to_message(ODD))] * 100_000
    bench.send("obstacles", PoseArray(header=geometry.header(0, FRAME), poses=poses))
    bench.wait(lambda: bench.node.outputs.rejections.counts.get("~/obstacles", 0) == 1, 20.0)
    _unharmed(bench, flown)


@pytest.mark.soak
def test_a_flood_of_goals_and_obstacles_leaves_the_stream_on_time(ros):
    bench = _fly(ros)
    bench.wait(lambda: len(bench.heard["setpoint"]) > 10)
    from msg_adapters.pose_array import cdr_from_orientations

    rng = np.random.default_rng(2)
    end = time.monotonic() + 2.0
    begin = len(bench.heard["setpoint"])
    sent = 0
    while time.monotonic() < end:
        turn = so3.quaternion_exp(np.array([0.0, 0.0, 1.2 + 0.1 * rng.random()]))
        q = so3.quaternion_exp(rng.normal(size=(5, 3)))
        bench.publishers["obstacles"].publish(cdr_from_orientations(q, 0, FRAME))
        if sent % 20 == 0:
            bench.publishers["goal"].publish(geometry.pose_from_attitude(turn, 0, FRAME))
        sent += 1
        time.sleep(0.001)
    heard = bench.setpoints()[begin:]
    intervals = np.diff([s.stamp_ns for s in heard]) * 1e-9
    # Sender and receiver hold the interpreter here as well, so this is no measure of jitter.
    assert np.median(intervals) < 0.03
    assert np.quantile(intervals, 0.9) < 0.1
    bench.check_continuity()


@pytest.mark.soak
def test_twenty_thousand_spoiled_messages_leave_no_trace(ros):
    bench = _fly(ros)
    flown = bench.node.mission.timeline.last
    _throw(bench, 2000, 6)
    _forget(bench)
    memory, threads, files = _resident(), threading.active_count(), _descriptors()
    for seed in range(7, 16):
        _throw(bench, 2000, seed)
        _forget(bench)
    _unharmed(bench, flown)
    assert _resident() - memory < 2e6
    assert threading.active_count() <= threads
    assert _descriptors() <= files
