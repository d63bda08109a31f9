# SPDX-License-Identifier: Apache-2.0
"""Timing of several ways to do the same jobs, interleaved so that all meet the same machine."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Method:
    """A way to do jobs.

    Attributes
    ----------
    name
        What tables call it.
    jobs
        One callable a problem; its value is kept.
    rounds
        How often each job is timed, after one run that is not.
    """

    name: str
    jobs: Sequence[Callable[[], Any]]
    rounds: int = 5


@dataclass(frozen=True)
class Timed:
    """Times of one method.

    Attributes
    ----------
    name
        Of the method.
    seconds : (jobs, rounds)
        Every time taken.
    values
        What each job returned at last.
    """

    name: str
    seconds: Array
    values: list[Any]

    @property
    def median(self) -> float:
        """Median over the jobs of each one's median time [ms]."""
        return 1e3 * float(np.median(np.median(self.seconds, axis=1)))

    @property
    def p99(self) -> float:
        """99th percentile over the jobs of each one's median time [ms]."""
        return 1e3 * float(np.percentile(np.median(self.seconds, axis=1), 99.0))


def interleaved(methods: Sequence[Method]) -> list[Timed]:
    """Time all methods: one warm-up of every job, then rounds in which each takes its turn."""
    values = [[job() for job in method.jobs] for method in methods]
    seconds = [np.zeros((len(method.jobs), method.rounds)) for method in methods]
    gc.collect()
    gc.disable()
    try:
        for turn in range(max(method.rounds for method in methods)):
            for m, method in enumerate(methods):
                if turn < method.rounds:
                    for i, job in enumerate(method.jobs):
                        begin = time.perf_counter()
                        values[m][i] = job()
                        seconds[m][i, turn] = time.perf_counter() - begin
    finally:
        gc.enable()
    return [Timed(method.name, seconds[m], values[m]) for m, method in enumerate(methods)]
