# SPDX-License-Identifier: Apache-2.0
"""ROS for tests: loopback only, a private domain, a context for each test."""

import os
import time

import pytest

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(os.getpid() % 101 + 1))
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")


@pytest.fixture(autouse=True)
def _logs(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path_factory.getbasetemp() / "ros_log"))


@pytest.fixture
def ros():
    """A planner node and a client in a context of their own; see `bench.Bench`."""
    pytest.importorskip("rclpy")
    from bench import Bench

    benches = []

    def start(zones=(), *, active=True, before=None, **values):
        bench = Bench(zones, values, before)
        benches.append(bench)
        if active:
            bench.wait(lambda: bench.state() == "active", 300.0)
        return bench

    yield start
    for bench in benches:
        bench.close()
        time.sleep(0.01)
