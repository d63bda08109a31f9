"""Deadline and cancellation, looked at between iterations."""

from __future__ import annotations

import time
from collections.abc import Callable

from riem_planner.solution import Status

_FREE_RUN = 1000  # iterations a kernel may run at once where nobody watches


class InterruptedSolveError(Exception):
    """The solve was asked to stop; carries the status to report."""

    def __init__(self, status: Status) -> None:
        self.status = status
        super().__init__(status.advice)


class Watch:
    """Tells when to stop.

    Parameters
    ----------
    deadline
        Seconds from now by a steady clock; None for none.
    should_stop
        Called between iterations; true to stop.
    """

    def __init__(self, deadline: float | None, should_stop: Callable[[], bool] | None) -> None:
        self._begin = time.monotonic()
        self._end = None if deadline is None else self._begin + deadline
        self._should_stop = should_stop
        self.iterations = 0

    @property
    def stride(self) -> int:
        """Iterations that a kernel may run before the next look."""
        return _FREE_RUN if self._end is None and self._should_stop is None else 1

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
        self.iterations += iterations
        if self._should_stop is not None and self._should_stop():
            raise InterruptedSolveError(Status.CANCELLED)
        if self._end is not None and time.monotonic() >= self._end:
            raise InterruptedSolveError(Status.OUT_OF_TIME)
