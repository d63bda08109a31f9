"""The command `planner_node`: runs the node until SIGINT or SIGTERM, then ends with code 0."""

from __future__ import annotations

import faulthandler
import gc
import os
import signal
import sys
import threading
from types import FrameType

STOP_WITHIN = 0.5
"""Time given to the executor to end [s]."""
HUNG = 4.0
"""Time after which an end that hangs is cut off, and where it hangs is told [s]."""
SWITCH_INTERVAL = 1e-4
"""How long a thread may keep the interpreter from the stream [s]."""


def _settle() -> None:
    """Keep the collector off what is there by now.

    The compiler leaves a million objects; to look through them again and again would stop the
    stream for a tenth of a second each time.
    """
    gc.collect()
    gc.freeze()


def main(arguments: list[str] | None = None) -> int:
    """Run the node; returns the exit code.

    The main thread only waits for a signal: no exception is ever thrown into the middle of a
    callback, and a signal is answered whatever the other threads are doing.
    """
    stop = threading.Event()

    def on_signal(_: int, __: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    sys.setswitchinterval(SWITCH_INTERVAL)

    # Fast DDS's shared memory waits for peers that come and go, with the lock held that setpoints
    # need: a third of a second, now and then. (Where discovery is limited to this machine the
    # middleware chooses its transports itself.)
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

    # Here, so that a signal during the second that these imports take is answered as well.
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.logging import get_logger
    from rclpy.signals import SignalHandlerOptions

    from riem_planner.errors import InvalidProblemError
    from riem_planner.node.executor import NodeExecutor
    from riem_planner.node.planner_node import PlannerNode

    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = PlannerNode(settle=_settle)
    except InvalidProblemError as error:
        get_logger("riem_planner").fatal(f"parameter {error}")
        rclpy.try_shutdown()
        return 2
    executor = NodeExecutor(node.fault)
    executor.add_node(node)

    faults: list[BaseException] = []

    def spin() -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            pass
        except BaseException as error:
            # While it is being shut down an executor may stumble over what is gone already.
            if not stop.is_set():
                faults.append(error)
                get_logger("riem_planner").fatal(f"{type(error).__name__}: {error}")
        finally:
            stop.set()

    spinning = threading.Thread(target=spin, name="executor", daemon=True)
    spinning.start()
    while not stop.wait(0.5):
        pass
    faulthandler.dump_traceback_later(HUNG, exit=True)
    # All that is left is to end: looking through what the compiler left would take seconds.
    gc.disable()
    gc.freeze()
    executor.shutdown(timeout_sec=STOP_WITHIN)
    spinning.join(STOP_WITHIN)
    ended = node.close()
    rclpy.try_shutdown()
    code = 1 if faults else 0
    if not ended or spinning.is_alive():
        # A compilation can't be interrupted, and tearing down beneath it would crash.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
