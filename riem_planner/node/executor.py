"""An executor that calls one thing at a time, and gives what may take long a thread of its own.

rclpy's `MultiThreadedExecutor` hands a callback that still waits for a thread out again and again,
without a pause; while messages pour in it keeps a core busy with that, and the interpreter's lock
from the stream. Here a callback has begun before the next is looked for.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import (
    ConditionReachedException,
    Executor,
    ShutdownException,
    TimeoutException,
)

LOOK = 1e-4
"""Time between two looks whether a thread has begun [s]."""


class BesideGroup(MutuallyExclusiveCallbackGroup):
    """Callbacks that may take long: called one after the other, beside all others."""


class NodeExecutor(Executor):
    """Calls callbacks in the thread that spins, those of a `BesideGroup` in one of their own.

    Parameters
    ----------
    fault
        Called with a sentence about an exception that a callback let escape; spinning goes on.
    options
        Those of an executor.
    """

    def __init__(self, fault: Callable[[str], None], **options: Any) -> None:
        super().__init__(**options)
        self._fault = fault

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for one callback and call it; a timeout [s] of None waits for ever."""
        self._once(timeout_sec)

    def spin_once_until_future_complete(self, future: Any, timeout_sec: Any = None) -> None:
        """As `spin_once`, but also returns when a future is done."""
        future.add_done_callback(lambda _: self.wake())
        self._once(timeout_sec, future.done)

    def _once(self, timeout_sec: Any, condition: Callable[[], bool] = lambda: False) -> None:
        try:
            task, entity, _ = self.wait_for_ready_callbacks(timeout_sec, None, condition)
        except (ShutdownException, TimeoutException, ConditionReachedException):
            return
        if entity is not None and isinstance(entity.callback_group, BesideGroup):
            thread = threading.Thread(target=self._call, args=(task,), name="beside", daemon=True)
            thread.start()
            while thread.is_alive() and not task.executing():
                time.sleep(LOOK)
        else:
            self._call(task)

    def _call(self, task: Any) -> None:
        task()
        error = task.exception() if task.done() else None
        if error is not None:
            self._fault(f"{type(error).__name__}: {error}")
