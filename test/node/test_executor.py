"""The executor: an error is told and spinning goes on, and what takes long runs beside."""

import threading
import time

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from riem_planner.node.executor import BesideGroup, NodeExecutor


@pytest.fixture
def spinning():
    context = Context()
    rclpy.init(context=context)
    node = Node("callbacks", context=context)
    faults = []
    executor = NodeExecutor(faults.append, context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    yield node, executor, faults
    executor.shutdown(timeout_sec=2.0)
    thread.join(2.0)
    node.destroy_node()
    context.try_shutdown()


def _wait(condition):
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_an_error_that_escapes_a_callback_is_told_and_does_not_end_the_spinning(spinning):
    node, _, faults = spinning
    calls = []

    def fail():
        calls.append(1)
        raise ValueError("spoilt")

    node.create_timer(0.01, fail)
    _wait(lambda: len(calls) > 2)
    assert faults[0] == "ValueError: spoilt"


def test_a_long_callback_runs_beside_the_others_and_one_after_the_other(spinning):
    node, _, faults = spinning
    beside = BesideGroup()
    go, running, most, ticks = threading.Event(), [], [], []

    def long():
        running.append(1)
        most.append(len(running))
        assert go.wait(10.0)
        running.pop()

    node.create_timer(0.01, lambda: ticks.append(1))
    for _ in range(2):
        node.create_guard_condition(long, beside).trigger()
    _wait(lambda: running)
    seen = len(ticks)
    _wait(lambda: len(ticks) > seen + 10)
    go.set()
    _wait(lambda: len(most) == 2)
    assert most == [1, 1]
    assert not faults


def test_a_long_callback_does_not_keep_the_executor_busy(spinning):
    node, executor, _ = spinning
    go, turns = threading.Event(), []
    once = executor.spin_once
    executor.spin_once = lambda *a: (turns.append(1), once(*a))
    node.create_guard_condition(lambda: go.wait(10.0), BesideGroup()).trigger()
    time.sleep(0.5)
    assert 0 < len(turns) < 20
    go.set()
