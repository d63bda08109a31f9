# SPDX-License-Identifier: Apache-2.0
"""The stream's thread: on time beside everything else, with the priority it may have."""

import os
import threading
import time

import pytest

from riem_planner.node.streamer import Streamer


def _until(condition):
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def _streaming(publish):
    faults = []
    streamer = Streamer(publish, lambda: 2_000_000, lambda: None, faults.append)
    streamer.start()
    return streamer, faults


def _may_be_realtime():
    allowed = []

    def ask():
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
            allowed.append(True)
        except (AttributeError, OSError):
            pass

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    return bool(allowed)


def test_it_runs_before_ordinary_threads_where_it_may():
    if not _may_be_realtime():
        pytest.skip("this user may not ask for real-time priority")
    policies = []
    streamer, faults = _streaming(lambda: policies.append(os.sched_getscheduler(0)))
    _until(lambda: len(policies) > 3)
    assert streamer.close(1.0)
    assert streamer.realtime
    assert set(policies) == {os.SCHED_FIFO | os.SCHED_RESET_ON_FORK}
    assert os.sched_getscheduler(0) == os.SCHED_OTHER  # that thread, and no other
    assert not faults


@pytest.mark.parametrize("missing", [PermissionError("not allowed"), AttributeError("no such")])
def test_it_streams_all_the_same_where_it_may_not(monkeypatch, missing):
    def refuse(*_):
        raise missing

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    calls = []
    streamer, faults = _streaming(lambda: calls.append(1))
    _until(lambda: len(calls) > 3)
    assert streamer.close(1.0)
    assert not streamer.realtime
    assert not faults


def test_a_fault_is_told_and_the_stream_goes_on():
    calls = []

    def publish():
        calls.append(1)
        if len(calls) == 2:
            raise ValueError("spoilt")

    streamer, faults = _streaming(publish)
    _until(lambda: len(calls) > 5)
    assert streamer.close(1.0)
    assert faults == ["ValueError: spoilt"]
