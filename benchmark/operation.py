# SPDX-License-Identifier: Apache-2.0
"""The node in operation: how even its stream is under load, and how soon it answers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark.report import Table
from riem_planner.geometry import so3

Array = NDArray[np.float64]

RATE = 100.0  # Hz of the stream
# Messages a second: obstacles, goals.
LOADS = {"idle": (0.0, 0.0), "replanning": (100.0, 5.0), "flood": (1000.0, 50.0)}
_ROOT = Path(__file__).resolve().parent.parent
_PATIENCE = 300.0  # s, for a node that compiles


def _process(*arguments: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", *arguments], cwd=_ROOT, stderr=subprocess.DEVNULL
    )


class _Listener:
    """Stamps [ns] of the setpoints of a node, as they come."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from trajectory_msgs.msg import MultiDOFJointTrajectory

        rclpy.init()
        self._node = rclpy.create_node("listener")
        self.stamps: list[int] = []
        # Unread: the listener must not compete with the node for the processor.
        self._node.create_subscription(
            MultiDOFJointTrajectory, "/riem_planner/setpoint", self._hear, 100, raw=True
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def _hear(self, data: bytes) -> None:
        seconds, nanoseconds = (int.from_bytes(data[i : i + 4], "little") for i in (4, 8))
        self.stamps.append(1_000_000_000 * seconds + nanoseconds)

    def listen(self, seconds: float, enough: Callable[[], bool] = lambda: False) -> Array:
        """Intervals between the setpoints [ms] that come in a time."""
        self.stamps.clear()
        end = time.monotonic() + seconds
        while time.monotonic() < end and not enough():
            self._executor.spin_once(timeout_sec=0.1)
        return 1e-6 * np.diff(self.stamps)

    def close(self) -> None:
        """End."""
        import rclpy

        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown()


def stream(seconds: float, rounds: int) -> Table:
    """Intervals of the stream, idle and under load, in turn."""
    table = Table(
        f"The stream at {RATE:g} Hz",
        f"Intervals between the stamps of setpoints, {rounds} interleaved runs of {seconds:g} s"
        " each, median of the runs; obstacles and goals a second come from another process. The"
        " ratios are to the idle stream.",
    )
    node = _process(
        "riem_planner.node.main", "--ros-args",
        "-p", f"setpoint_rate:={RATE}", "-p", "duration:=20.0", "-p", "obstacle_radius:=0.1",
    )  # fmt: skip
    listener = _Listener()
    try:
        first = _process("benchmark.flood", "2", "0", "5")
        listener.listen(_PATIENCE, lambda: len(listener.stamps) > 0)
        first.wait()
        intervals: dict[str, list[Array]] = {name: [] for name in LOADS}
        for _ in range(rounds):
            for name, rates in LOADS.items():
                flood = None
                if any(rates):
                    flood = _process("benchmark.flood", f"{seconds + 3.0}", *map(str, rates))
                listener.listen(2.0)
                intervals[name].append(listener.listen(seconds))
                if flood is not None:
                    flood.wait()
    finally:
        listener.close()
        node.send_signal(signal.SIGINT)
        node.wait()
    tails = {
        name: np.median([np.percentile(run, (99.0, 99.9)) for run in runs], axis=0)
        for name, runs in intervals.items()
    }
    for name, (p99, p999) in tails.items():
        obstacles, goals = LOADS[name]
        table.rows.append(
            {
                "load": name,
                "obstacles/s": obstacles,
                "goals/s": goals,
                "p99 ms": float(p99),
                "p99.9 ms": float(p999),
                "p99 ratio": float(p99 / tails["idle"][0]),
                "p99.9 ratio": float(p999 / tails["idle"][1]),
                "longest ms": float(max(run.max() for run in intervals[name])),
            }
        )
    return table


@contextmanager
def _planner(**values: Any) -> Iterator[Any]:
    """An active planner node, spun in a thread of this process."""
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.parameter import Parameter

    from riem_planner.node.main import SWITCH_INTERVAL
    from riem_planner.node.planner_node import PlannerNode

    sys.setswitchinterval(SWITCH_INTERVAL)  # as the command does
    context = Context()
    context.init()
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    node = PlannerNode(context=context, parameter_overrides=overrides)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        while not node.mission.active:
            time.sleep(0.01)
        yield node
    finally:
        executor.shutdown(timeout_sec=2.0)
        thread.join(2.0)
        node.close()
        context.try_shutdown()


class _Client:
    """Sends to a node and waits for what comes of it, in the same process."""

    def __init__(self, context: Any) -> None:
        import rclpy
        from geometry_msgs.msg import PoseArray, PoseStamped
        from rclpy.executors import SingleThreadedExecutor
        from trajectory_msgs.msg import MultiDOFJointTrajectory

        self._node = rclpy.create_node("client", context=context)
        self.heard = {"trajectory": 0, "setpoint": 0}
        for kind, name in ((PoseArray, "trajectory"), (MultiDOFJointTrajectory, "setpoint")):
            self._node.create_subscription(
                kind, f"/riem_planner/{name}", lambda _, n=name: self._hear(n), 10, raw=True
            )
        self._publishers = {
            name: self._node.create_publisher(kind, f"/riem_planner/{name}", 1)
            for kind, name in ((PoseStamped, "goal"), (PoseArray, "obstacles"))
        }
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        while not all(p.get_subscription_count() for p in self._publishers.values()):
            time.sleep(0.01)

    def _hear(self, name: str) -> None:
        self.heard[name] += 1

    def timed(self, topic: str, message: Any, answer: str) -> float:
        """Milliseconds from a message to the next one on a topic; infinite after 5 s."""
        before = self.heard[answer]
        begin = time.perf_counter()
        self._publishers[topic].publish(message)
        while self.heard[answer] == before:
            self._executor.spin_once(timeout_sec=0.1)
            if time.perf_counter() - begin > 5.0:
                return float("inf")
        return 1e3 * (time.perf_counter() - begin)

    def rest(self, seconds: float) -> None:
        """Let time pass."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.01)

    def close(self) -> None:
        """End."""
        self._executor.shutdown()
        self._node.destroy_node()


def answers(count: int) -> Table:
    """From a message to what comes of it, in one process."""
    table = Table(
        "How soon the node answers",
        "In one process. The obstacle appears in the middle of what is left of the slew, so that"
        " it has to be planned anew.",
    )
    rng = np.random.default_rng(0)
    with _planner(duration=10.0, obstacle_radius=0.1) as node:
        client = _Client(node.context)
        turns = rng.normal(size=(count + 1, 3)) * 0.3  # so that an obstacle midway hides no goal
        turns[:, 2] += np.where(np.arange(count + 1) % 2, 1.0, -1.0)
        client.rest(1.0)
        first = client.timed("goal", _goal(turns[0]), "setpoint")
        goals, obstacles = [], []
        for turn in turns[1:]:
            client._publishers["obstacles"].publish(_obstacles(np.zeros((0, 4))))
            client.rest(0.05)
            goals.append(client.timed("goal", _goal(turn), "trajectory"))
            client.rest(0.6)
            last = node.mission.timeline.last
            middle = last.at((max(last.start_ns, node.now_ns()) + last.end_ns) // 2).quaternion
            obstacles.append(client.timed("obstacles", _obstacles(middle[None]), "trajectory"))
        client.close()
    for what, times in (
        ("goal at rest to the first setpoint", [first]),
        ("goal in mid-slew to the new trajectory", goals),
        ("obstacle to the new trajectory", obstacles),
    ):
        median, p99 = np.percentile(times, (50.0, 99.0))
        table.rows.append(
            {"from, to": what, "times": len(times), "median ms": median, "p99 ms": p99}
        )
    return table


def _goal(turn: Array) -> Any:
    from msg_adapters.geometry import pose_from_attitude

    return pose_from_attitude(so3.quaternion_exp(turn), 0, "inertial")


def _obstacles(quaternions: Array) -> bytes:
    from msg_adapters.pose_array import cdr_from_orientations

    data: bytes = cdr_from_orientations(quaternions, 0, "inertial")
    return data


def operation(quick: bool) -> list[Table]:
    """Everything about the node in operation."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if quick:
        return [stream(3.0, 1), answers(5)]
    return [stream(60.0, 5), answers(100)]
