# SPDX-License-Identifier: Apache-2.0
"""The command `sky_node`: tells where bodies are until SIGINT or SIGTERM; then code 0.

It ends with code 2 where a parameter is wrong, or the libraries of the sky are not installed.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

from riem_planner.errors import InvalidProblemError

LOOK = 0.1
"""Longest time between two looks whether a signal has come [s]."""
WRONG = 2
"""Exit code where a parameter is wrong."""


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

    from riem_planner.sky_node.sky_node import SkyNode

    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        try:
            node = SkyNode()
        except InvalidProblemError as error:
            sys.stderr.write(f"sky_node: {error}\n")
            return WRONG
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            while not stop.is_set():
                executor.spin_once(timeout_sec=LOOK)
        finally:
            executor.shutdown()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
