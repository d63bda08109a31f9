# SPDX-License-Identifier: Apache-2.0
"""A thread that calls the stream at its times, whatever the executor is doing.

An executor looks through all its entities before it calls a timer, which takes a millisecond
while messages pour in; this thread has nothing else to do. Where the system allows it, it runs
before all ordinary threads of the machine. With a simulated clock it looks at that clock every
few milliseconds, so that it follows a pause, a jump, or any speed.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress

LOOK = 0.002
"""Time between two looks at a simulated clock [s]."""
PRIORITY = 1
"""Of the thread among real-time ones, the least: those of others go first."""
LONGEST = 0.1
"""How long it sleeps at a time, so that it ends soon when told to [s]."""


class Streamer:
    """Calls `publish` once a period while it is on.

    Parameters
    ----------
    publish
        What to call.
    period_ns
        Gives the time between two calls [ns].
    simulated_ns
        Gives the time of a simulated clock [ns]; None if the clock is the machine's.
    fault
        Called with a sentence about anything that went wrong.

    Attributes
    ----------
    realtime
        Whether the system lets it run before ordinary threads.
    """

    def __init__(
        self,
        publish: Callable[[], None],
        period_ns: Callable[[], int],
        simulated_ns: Callable[[], int | None],
        fault: Callable[[str], None],
    ) -> None:
        self._publish = publish
        self._period_ns = period_ns
        self._simulated_ns = simulated_ns
        self._fault = fault
        self._on = threading.Event()
        self._closed = False
        self.realtime = False
        self._thread = threading.Thread(target=self._run, name="stream", daemon=True)
        self._thread.start()

    def start(self) -> None:
        """Begin to call."""
        self._on.set()

    def stop(self) -> None:
        """Call no more; a call that has begun goes on."""
        self._on.clear()

    def close(self, timeout: float) -> bool:
        """End the thread; whether it has ended within a time [s]."""
        self._closed = True
        self._on.set()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        with suppress(AttributeError, OSError):  # another system, or no right to
            policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
            self.realtime = True
        while not self._closed:
            self._on.wait()
            due = None
            while self._on.is_set() and not self._closed:
                try:
                    due = self._once(due)
                except Exception as error:  # a fault must not end the stream
                    self._fault(f"{type(error).__name__}: {error}")
                    time.sleep(self._period_ns() * 1e-9)

    def _once(self, due: int | None) -> int:
        """Call if the time that is due [ns] has come, else sleep; gives the time due next [ns]."""
        period = self._period_ns()
        simulated = self._simulated_ns()
        now = time.monotonic_ns() if simulated is None else simulated
        if due is None or abs(due - now) > 2 * period + 1_000_000_000:
            due = now  # the beginning, a jump, or a change to or from a simulated clock
        if now < due:
            left = (due - now) * 1e-9
            time.sleep(min(left, LONGEST) if simulated is None else LOOK)
            return due
        self._publish()
        return due + period if now < due + period else now + period  # a missed one is missed
