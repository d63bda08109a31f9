# SPDX-License-Identifier: Apache-2.0
"""The command `sky_node`: tells where bodies are until SIGINT or SIGTERM; then code 0.

It ends with code 2 where a parameter is wrong, or the libraries of the sky are not installed.
"""

from __future__ import annotations

import sys

from riem_planner.errors import InvalidProblemError
from riem_planner.serving import serve, until_signalled

WRONG = 2
"""Exit code where a parameter is wrong."""


def main(arguments: list[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    stop = until_signalled()
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from riem_planner.sky_node.sky_node import SkyNode

    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = SkyNode()
    except InvalidProblemError as error:
        sys.stderr.write(f"sky_node: {error}\n")
        rclpy.try_shutdown()
        return WRONG
    serve(node, stop)
    return 0


if __name__ == "__main__":
    sys.exit(main())
