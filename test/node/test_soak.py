# SPDX-License-Identifier: Apache-2.0
"""Long operation: memory, threads and descriptors stay as they are."""

import gc
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from episode import Episode
from simulation import SECOND

from riem_planner.geometry import so3


def _resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def _live(episode, seconds):
    """Let a mission live that long, and throw away what an observer keeps."""
    for _ in range(round(seconds / 20.0)):
        episode.run(20.0)
        assert not episode.faults
        episode.forget()
    gc.collect()


def _grown(seconds, seed):
    episode = Episode(seed)
    _live(episode, 60.0)
    before = _resident()
    _live(episode, seconds)
    assert len(episode.simulation.mission.timeline.segments) < 10
    return _resident() - before


def test_minutes_of_simulated_operation_leave_no_trace():
    assert _grown(120.0, 3) < 8e6


@pytest.mark.soak
def test_an_hour_of_simulated_operation_leaves_no_trace():
    assert _grown(3600.0, 4) < 16e6


@pytest.mark.soak
def test_an_hour_of_the_node_at_twenty_times_the_speed_leaves_no_trace(ros):
    from rosgraph_msgs.msg import Clock

    from msg_adapters import geometry

    bench = ros(["sun"], use_sim_time=True, sun__direction=[0.0, 0.0, 1.0], duration=20.0)
    clock = bench.client.create_publisher(Clock, "/clock", 10)
    bench.wait(lambda: clock.get_subscription_count() > 0)
    rng = np.random.default_rng(1)
    now_ns = 100 * SECOND
    figures = []
    for minute in range(60):
        bench.goal(so3.quaternion_exp(rng.normal(size=3)))
        bench.zone("sun", rng.normal(size=3))
        for _ in range(300):
            now_ns += SECOND // 5
            clock.publish(Clock(clock=geometry.time_from_nanoseconds(now_ns)))
            time.sleep(0.01)
        for heard in bench.heard.values():
            heard.clear()
        gc.collect()
        files = len(list(Path("/proc/self/fd").iterdir()))
        figures.append((_resident(), threading.active_count(), files))
        assert bench.state() == "active", minute
    settled, last = figures[10], figures[-1]
    assert last[0] - settled[0] < 20e6
    assert last[1:] == settled[1:]
