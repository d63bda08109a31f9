# SPDX-License-Identifier: Apache-2.0
"""The command `riem_monitor`: judges the planner until SIGINT or SIGTERM; then code 0.

It ends with code 3 where a sentence was broken.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

LOOK = 0.1
"""Longest time between two looks whether a signal has come [s]."""
BROKEN = 3
"""Exit code where a sentence was broken."""


def main(arguments: list[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    stop = threading.Event()

    def on_signal(_: int, __: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    # As the planner does: other processes that come and go must not hold up a publisher.
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions

    from riem_planner.monitor_node.monitor_node import MonitorNode

    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    node = MonitorNode()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stop.is_set():
            executor.spin_once(timeout_sec=LOOK)
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0 if node.monitor.verdict is None else BROKEN


if __name__ == "__main__":
    sys.exit(main())
