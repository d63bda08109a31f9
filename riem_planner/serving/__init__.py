# SPDX-License-Identifier: Apache-2.0
"""How a small node is run as a command: until SIGINT or SIGTERM, with one thread.

Knows nothing of the planner, so that what judges it from outside can be run by it as well.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
from types import FrameType
from typing import Any

LOOK = 0.1
"""Longest time between two looks whether a signal has come [s]."""


def until_signalled() -> threading.Event:
    """What SIGINT or SIGTERM will set; to be called before rclpy is imported.

    So a signal during the second that this import takes is answered as well.
    """
    stop = threading.Event()

    def on_signal(_: int, __: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    # As the planner does: other processes that come and go must not hold up a publisher.
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    return stop


def serve(node: Any, stop: threading.Event, *, cut_off: float | None = None) -> None:
    """Spin a node until it is to stop, then take it and rclpy down.

    Parameters
    ----------
    node
        Of rclpy.
    stop
        From `until_signalled`.
    cut_off
        Time after which an end that hangs is cut off, and where it hangs is told [s].
    """
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stop.is_set():
            executor.spin_once(timeout_sec=LOOK)
    finally:
        if cut_off is not None:
            faulthandler.dump_traceback_later(cut_off, exit=True)
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
