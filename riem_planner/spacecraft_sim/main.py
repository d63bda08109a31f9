# SPDX-License-Identifier: Apache-2.0
"""The command `spacecraft_sim`: a simulated spacecraft, until SIGINT or SIGTERM; then code 0."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import threading
from types import FrameType

from riem_planner.node.main import HUNG

LOOK = 0.1
"""Longest time between two looks whether a signal has come [s]."""


def main(arguments: list[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    stop = threading.Event()

    def on_signal(_: int, __: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)

    # As the planner does, and for its reason.
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

    # Here, so that a signal during the second that these imports take is answered as well.
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.logging import get_logger
    from rclpy.signals import SignalHandlerOptions

    from riem_planner.errors import InvalidProblemError
    from riem_planner.spacecraft_sim.spacecraft_node import SpacecraftNode

    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = SpacecraftNode()
    except InvalidProblemError as error:
        get_logger("spacecraft_sim").fatal(f"parameter {error}")
        rclpy.try_shutdown()
        return 2
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stop.is_set():
            executor.spin_once(timeout_sec=LOOK)
    finally:
        faulthandler.dump_traceback_later(HUNG, exit=True)
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
