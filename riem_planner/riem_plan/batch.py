# SPDX-License-Identifier: Apache-2.0
"""Many problems: one JSON line in, one plan a line out, in the same order.

Lines are planned by worker processes and handed over a few at a time, so that a file of any
length takes bounded memory. Whatever is wrong with a line is told in its own plan.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_json
from riem_planner.files.end_states import StateInZoneError
from riem_planner.files.plan_files import encoded, plan_document, refused_document
from riem_planner.files.plans import Plan
from riem_planner.files.problem_files import parse_problem
from riem_planner.riem_plan.planning import plan_problem
from riem_planner.solution import Status
from riem_planner.solve import warm_up

INVALID = "INVALID_PROBLEM"
"""Status of a plan whose problem could not be read."""
FAULT = "INTERNAL_ERROR"
"""Status of a plan that a fault of the planner took away."""

_CHUNK = 8  # lines a worker is handed at once
_AHEAD = 3  # chunks per worker that are under way or wait to be written

_LAST_WORDS = 2.0  # s for a worker to end

Line = tuple[int, bytes]


class PlannedLine(NamedTuple):
    """One line of the result."""

    text: str
    status: str


def problem_lines(path: Path) -> Iterator[Line]:
    """Numbers, from 1, and contents of the lines of a file; blank ones are left out."""
    with path.open("rb") as stream:
        for number, line in enumerate(stream, start=1):
            if line.strip():
                yield number, line.strip()


class Attempt(NamedTuple):
    """What became of one document: a plan, or a status and a message that say why not."""

    name: str | None
    plan: Plan | None
    status: str
    message: str


def attempt(read: Callable[[], Any], samples: int, folder: Path | None = None) -> Attempt:
    """Plan of the document that `read` returns, of a file in a folder; it never raises."""
    name = None
    try:
        document = read()
        found = document.get("name") if isinstance(document, dict) else None
        name = found if isinstance(found, str) else None
        plan = plan_problem(parse_problem(document, folder), samples)
        return Attempt(name, plan, plan.solution.status.name, plan.solution.message)
    except StateInZoneError as error:
        start = error.key.startswith("start")
        status = (Status.START_IN_ZONE if start else Status.GOAL_IN_ZONE).name
        return Attempt(name, None, status, str(error))
    except InvalidProblemError as error:
        return Attempt(name, None, INVALID, str(error))
    except Exception as error:
        # A fault of the planner costs this document alone; the others are still wanted.
        return Attempt(name, None, FAULT, f"{type(error).__name__}: {error}")


def plan_line(number: int, line: bytes, samples: int, folder: Path | None = None) -> PlannedLine:
    """Plan of one line of a file in a folder; it never raises, whatever the line holds."""
    name, plan, status, message = attempt(lambda: parse_json(decoded(line)), samples, folder)
    if plan is not None:
        return PlannedLine(encoded(plan_document(plan)), status)
    return PlannedLine(encoded(refused_document(name, status, f"line {number}: {message}")), status)


def plan_lines(
    lines: Iterable[Line], *, samples: int, jobs: int, folder: Path | None = None
) -> Iterator[PlannedLine]:
    """Plans of the lines, in their order.

    Parameters
    ----------
    lines
        Numbers and contents.
    samples
        Of each plan.
    jobs
        Number of worker processes; with 1 the lines are planned in this one.
    folder
        Where the file of the lines is.
    """
    if jobs == 1:
        for number, line in lines:
            yield plan_line(number, line, samples, folder)
        return
    yield from _plan_in_processes(iter(lines), samples, jobs, folder)


def _plan_in_processes(
    lines: Iterator[Line], samples: int, jobs: int, folder: Path | None
) -> Iterator[PlannedLine]:
    others = multiprocessing.active_children()
    # Not by fork: threads of the numerical libraries would be copied in mid-flight.
    pool = ProcessPoolExecutor(
        jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_worker
    )
    waiting: deque[Future[list[PlannedLine]]] = deque()
    try:
        while True:
            while len(waiting) < _AHEAD * jobs and (chunk := list(islice(lines, _CHUNK))):
                waiting.append(pool.submit(_plan_chunk, chunk, samples, folder))
            if not waiting:
                break
            yield from waiting.popleft().result()
    except BaseException:
        # Nobody waits for the lines under way any more, nor for a kernel that is being compiled;
        # nor for the pool, which now and then never ends when its workers are ended beneath it.
        workers = [child for child in multiprocessing.active_children() if child not in others]
        for worker in workers:
            worker.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.join(_LAST_WORDS)
        raise
    else:
        pool.shutdown()


def _plan_chunk(chunk: list[Line], samples: int, folder: Path | None) -> list[PlannedLine]:
    return [plan_line(number, line, samples, folder) for number, line in chunk]


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends the pool
    threading.Thread(target=_end_with_parent, daemon=True).start()
    warm_up()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
