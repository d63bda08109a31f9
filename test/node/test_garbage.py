"""Garbage on every input: the node lives, the good data stays, the memory does not grow."""

import math
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray, Quaternion, Vector3

from msg_adapters import geometry
from riem_planner.geometry import so3

FRAME, BODY = "inertial", "base_link"
ODD = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
Z_TURN = so3.quaternion_exp(np.array([0.0, 0.0, 1.2]))
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


def _bad_stamp(rng, now_ns):
    kind = rng.integers(3)
    if kind == 0:
        return Time(sec=-int(rng.integers(1, 2**31 - 1)), nanosec=0)
    offset = int(rng.integers(10, 10**6)) * 10**9
    return geometry.time_from_nanoseconds(max(now_ns + (offset if kind == 1 else -offset), 1))


def _spoiled(name, rng, now_ns):
    """A message on an input with one thing wrong with it."""
    rest = np.zeros(3)
    makers = {
        "goal": lambda: geometry.pose_from_attitude(ODD, 0, FRAME),
        "goal_state": lambda: geometry.odometry_from_attitude(ODD, rest, 0, (FRAME, BODY)),
        "state": lambda: geometry.odometry_from_attitude(ODD, rest, 0, (FRAME, BODY)),
        "imu": lambda: geometry.imu_from_attitude(ODD, rest, 0, BODY),
        "zones/sun": lambda: geometry.vector_from_direction(np.eye(3)[0], 0, FRAME),
        "obstacles": lambda: PoseArray(
            header=geometry.header(0, FRAME),
            poses=[Pose(orientation=geometry.quaternion_to_message(ODD))] * 3,
        ),
    }
    message = makers[name]()
    kind = rng.integers(3)
    if kind == 0:
        message.header.frame_id = str(rng.choice(BAD_FRAMES))
    elif kind == 1:
        message.header.stamp = _bad_stamp(rng, now_ns)
    elif name == "zones/sun":
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
    counts = bench.node._rejections.counts
    for k in range(count):
        name = names[k % len(names)]
        message = _spoiled(name, rng, bench.node.now_ns())
        before = counts.get(f"~/{name}", 0)
        bench.send(name, message)
        bench.wait(lambda n=name, b=before: counts.get(f"~/{n}", 0) > b)
    return sum(counts.values())


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
    bench.wait(lambda: bench.node._rejections.counts.get("~/obstacles", 0) == 1, 20.0)
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
    memory, threads, files = _resident(), threading.active_count(), _descriptors()
    _throw(bench, 18_000, 7)
    _unharmed(bench, flown)
    assert _resident() - memory < 20e6
    assert threading.active_count() <= threads
    assert _descriptors() <= files
