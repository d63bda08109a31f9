# SPDX-License-Identifier: Apache-2.0
"""One thread that plans beside the stream; the newest request wins."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from riem_planner.mission.planning import Request, Result, carry_out
from riem_planner.solution import Solution, Status
from riem_planner.solver.watch import StopFlag


class Worker:
    """Plans one request after the other, and does chores when there is none.

    Parameters
    ----------
    deliver
        Called from the worker's thread with each result.
    fault
        Called from it with a sentence about anything that went wrong.
    """

    def __init__(self, deliver: Callable[[Result], None], fault: Callable[[str], None]) -> None:
        self._deliver = deliver
        self._fault = fault
        self._condition = threading.Condition()
        self._request: Request | None = None
        self._stop = StopFlag()
        self._chores: dict[str, Callable[[], None]] = {}
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="planning", daemon=True)
        self._thread.start()

    def submit(self, request: Request) -> None:
        """Plan this, and give up what is being planned."""
        with self._condition:
            self._request = request
            self._stop.set()
            self._condition.notify()

    def withdraw(self) -> None:
        """Give up what is being planned."""
        with self._condition:
            self._request = None
            self._stop.set()

    def chore(self, name: str, do: Callable[[], None]) -> None:
        """Do this when nothing is to be planned; a newer chore of that name replaces it."""
        with self._condition:
            self._chores[name] = do
            self._condition.notify()

    def close(self, timeout: float) -> bool:
        """Give up everything; whether the thread has ended within a time [s]."""
        with self._condition:
            self._request, self._closed = None, True
            self._stop.set()
            self._chores.clear()
            self._condition.notify()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            with self._condition:
                while self._request is None and not self._chores and not self._closed:
                    self._condition.wait()
                if self._closed:
                    return
                request, self._request = self._request, None
                stop = self._stop = StopFlag()
                chore = None
                if request is None:
                    chore = self._chores.pop(next(iter(self._chores)))
            try:
                if request is not None:
                    self._plan(request, stop)
                elif chore is not None:
                    chore()
            except Exception as error:  # a fault here must never end the stream
                self._fault(f"{type(error).__name__}: {error}")

    def _plan(self, request: Request, should_stop: StopFlag) -> None:
        begin = time.monotonic()
        try:
            result = carry_out(request, should_stop)
        except Exception as error:
            solution = Solution(
                Status.NO_CERTIFIED_TRAJECTORY, f"planning failed: {type(error).__name__}: {error}"
            )
            problem = request.attempts[0].problem
            result = Result(request, solution, problem, time.monotonic() - begin)
        if not should_stop():
            self._deliver(result)
