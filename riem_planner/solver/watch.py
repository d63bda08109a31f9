# SPDX-License-Identifier: Apache-2.0
"""Deadline and cancellation, looked at between iterations."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from riem_planner.solution import Status

_FREE_RUN = 1000  # iterations a kernel may run at once where nobody watches
_LOOK = 5e-4  # s that it may run at once where only the time is watched


class InterruptedSolveError(Exception):
    """The solve was asked to stop; carries the status to report."""

    def __init__(self, status: Status) -> None:
        self.status = status
        super().__init__(status.advice)


class StopFlag:
    """A `should_stop` that compiled code looks at by itself, without the interpreter.

    Any thread may set it. A solve with any other `should_stop` takes the interpreter's lock
    between all iterations, and where other threads want it too waits for it each time.
    """

    def __init__(self) -> None:
        self.memory: NDArray[np.uint8] = np.zeros(1, dtype=np.uint8)

    def set(self) -> None:
        """Withdraw the request."""
        self.memory[0] = 1

    def __call__(self) -> bool:
        """Whether the request was withdrawn."""
        return bool(self.memory[0])


class Watch:
    """Tells when to stop.

    Parameters
    ----------
    deadline
        Seconds from now by a steady clock; None for none.
    should_stop
        Called between iterations; true to stop.

    Attributes
    ----------
    flag
        That of a `StopFlag`; for compiled code to look at between iterations.
    """

    def __init__(self, deadline: float | None, should_stop: Callable[[], bool] | None) -> None:
        self._begin = time.monotonic()
        self._end = None if deadline is None else self._begin + deadline
        self._should_stop = should_stop
        flag = should_stop if isinstance(should_stop, StopFlag) else StopFlag()
        self._asks = should_stop is not None and should_stop is not flag
        self.flag = flag.memory
        self.iterations = 0
        self._pace, self._looked = 0.0, self._begin  # iterations a second since the last look

    @property
    def stride(self) -> int:
        """Iterations that a kernel may run before the next look."""
        if self._asks:
            return 1
        if self._end is None:
            return _FREE_RUN
        return 1 + int(_LOOK * self._pace)

    @property
    def limited(self) -> bool:
        """Whether there is a deadline."""
        return self._end is not None

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._begin

    def has_time_for(self, seconds: float) -> bool:
        """Whether the deadline is further off than that."""
        return self._end is None or time.monotonic() + seconds < self._end

    def count(self, iterations: int = 1) -> None:
        """Add iterations, and stop if it is time.

        Raises
        ------
        InterruptedSolveError
            The deadline has passed, or the caller asked to stop.
        """
        now = time.monotonic()
        self._pace, self._looked = iterations / max(now - self._looked, 1e-6), now
        self.iterations += iterations
        if self._should_stop is not None and self._should_stop():
            raise InterruptedSolveError(Status.CANCELLED)
        if self._end is not None and now >= self._end:
            raise InterruptedSolveError(Status.OUT_OF_TIME)
