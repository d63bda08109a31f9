# SPDX-License-Identifier: Apache-2.0
"""The command `planner_node`: runs the node until SIGINT or SIGTERM, then ends with code 0."""

from __future__ import annotations

import faulthandler
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from riem_planner.node.planner_node import PlannerNode

STOP_WITHIN = 0.5
"""Time given to the executor to end [s]."""
HUNG = 4.0
"""Time after which an end that hangs is cut off, and where it hangs is told [s]."""
LOOK = 0.1
"""Longest time between two looks whether a signal has come [s]."""
SWITCH_INTERVAL = 1e-4
"""How long a thread may keep the interpreter from the stream [s]."""


def _settle() -> None:
    """Keep the collector off what is there by now.

    The compiler leaves a million objects; to look through them again and again would stop the
    stream for a tenth of a second each time.
    """
    gc.collect()
    gc.freeze()


def _spin(executor: Any, stop: threading.Event, fault: Callable[[str], None]) -> None:
    """Spin until it is shut down; an error that a callback lets escape is told, and ends there."""
    from rclpy.executors import ExternalShutdownException

    while not stop.is_set():
        try:
            executor.spin_once(timeout_sec=LOOK)
        except ExternalShutdownException:
            stop.set()
        except Exception as error:
            # While it is being shut down an executor may stumble over what is gone already.
            if not stop.is_set():
                fault(f"{type(error).__name__}: {error}")


def _come_to_rest(node: PlannerNode, again: threading.Event) -> None:
    """Fly a certified stop before the end, unless a second signal comes; say if it still turns."""
    settings = node.settings
    if settings.stop_on_shutdown:
        within = settings.shutdown_timeout
        stopping = threading.Thread(target=node.come_to_rest, args=(within,), daemon=True)
        stopping.start()
        while stopping.is_alive() and not again.is_set():
            stopping.join(LOOK)
    rate = node.streamed_rate()
    if rate > 0.0:
        node.get_logger().warning(f"the stream ends while it turns at {rate:.3g} rad/s")


def _log_arguments() -> list[str]:
    """What makes rclpy log to the terminal alone, where there is no folder for its files."""
    home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
    folder = os.environ.get("ROS_LOG_DIR") or os.path.join(home, "log")
    try:
        os.makedirs(folder, exist_ok=True)
        if os.access(folder, os.W_OK):
            return []
        why = "not writable"
    except OSError as error:
        why = str(error.strerror)
    sys.stderr.write(f"no folder for logs ({folder}: {why}); they go to the terminal only\n")
    return ["--ros-args", "--disable-external-lib-logs"]


def main(arguments: list[str] | None = None) -> int:
    """Run the node; returns the exit code.

    The main thread only waits for a signal: no exception is ever thrown into the middle of a
    callback, and a signal is answered whatever the other threads are doing.
    """
    stop, again = threading.Event(), threading.Event()

    def on_signal(_: int, __: FrameType | None) -> None:
        (again if stop.is_set() else stop).set()

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    sys.setswitchinterval(SWITCH_INTERVAL)

    # Fast DDS's shared memory waits for peers that come and go, with the lock held that setpoints
    # need: a third of a second, now and then. (Where discovery is limited to this machine the
    # middleware chooses its transports itself.)
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

    # Here, so that a signal during the second that these imports take is answered as well.
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.logging import get_logger
    from rclpy.signals import SignalHandlerOptions

    from riem_planner.errors import InvalidProblemError
    from riem_planner.node.planner_node import PlannerNode

    given = [*(sys.argv if arguments is None else arguments), *_log_arguments()]
    rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = PlannerNode(settle=_settle, strict=True, arguments=given)
    except InvalidProblemError as error:
        get_logger("riem_planner").fatal(f"parameter {error}")
        rclpy.try_shutdown()
        return 2
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    ended = threading.Event()
    spinning = threading.Thread(
        target=_spin, args=(executor, ended, node.fault), name="executor", daemon=True
    )
    spinning.start()
    while not (stop.wait(0.5) or ended.is_set()):
        pass
    if node.active and not ended.is_set():
        _come_to_rest(node, again)
    ended.set()
    faulthandler.dump_traceback_later(HUNG, exit=True)
    # All that is left is to end: looking through what the compiler left would take seconds.
    gc.disable()
    gc.freeze()
    executor.shutdown(timeout_sec=STOP_WITHIN)
    spinning.join(STOP_WITHIN)
    closed = node.close()
    rclpy.try_shutdown()
    if not closed or spinning.is_alive():
        # A compilation can't be interrupted, and tearing down beneath it would crash.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
