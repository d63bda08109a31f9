# SPDX-License-Identifier: Apache-2.0
"""The command `spacecraft_sim`: a simulated spacecraft, until SIGINT or SIGTERM; then code 0."""

from __future__ import annotations

import sys

from riem_planner.node.main import HUNG
from riem_planner.serving import serve, until_signalled


def main(arguments: list[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    stop = until_signalled()
    import rclpy
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
    serve(node, stop, cut_off=HUNG)
    return 0


if __name__ == "__main__":
    sys.exit(main())
