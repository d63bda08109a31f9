# SPDX-License-Identifier: Apache-2.0
"""The command `riem_monitor`: judges the planner until SIGINT or SIGTERM; then code 0.

It ends with code 3 where a sentence was broken.
"""

from __future__ import annotations

import sys

from riem_planner.serving import serve, until_signalled

BROKEN = 3
"""Exit code where a sentence was broken."""


def main(arguments: list[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    stop = until_signalled()
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from riem_planner.monitor_node.monitor_node import MonitorNode

    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    node = MonitorNode()
    serve(node, stop)
    return 0 if node.monitor.verdict is None else BROKEN


if __name__ == "__main__":
    sys.exit(main())
