# SPDX-License-Identifier: Apache-2.0
"""Batches on workers: Dask distributed hands them out and keeps nothing.

A part is written by the worker that planned it, so that all that comes back is a count. What a
killed worker had under way is handed to another one.
"""

from __future__ import annotations

import importlib.util
import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from riem_planner.riem_campaign.parts import Options, compute_part, failed_part, part_name
from riem_planner.riem_campaign.rows import Batch

_AHEAD = 3  # batches per worker that are under way or wait for it
_DEATHS = 3  # workers that may die during one batch before it is given up


@contextmanager
def local_client(jobs: int, tell: Callable[[str], None]) -> Iterator[Any]:
    """Client of worker processes on this machine, which end with this one."""
    import dask
    from distributed import Client, LocalCluster

    has_dashboard = importlib.util.find_spec("bokeh") is not None
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": _DEATHS - 1}),
        LocalCluster(
            n_workers=jobs, threads_per_worker=1, processes=True, host="127.0.0.1", memory_limit=0,
            dashboard_address=":0" if has_dashboard else None, silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):  # fmt: skip
        if has_dashboard:
            tell(f"dashboard: {client.dashboard_link}")
        yield client


@contextmanager
def remote_client(address: str) -> Iterator[Any]:
    """Client of a scheduler that runs already."""
    from distributed import Client

    with Client(address, timeout="30s") as client:
        yield client


def run_batches(
    batches: Iterable[Batch],
    folder: Path,
    options: Options,
    client: Any,
    done: Callable[[Batch, Counter[str]], None],
) -> None:
    """Compute the parts that are missing.

    Parameters
    ----------
    done
        Called with each batch whose part is there, and its statuses; of those that were there
        before, none.
    """
    waiting: dict[Any, Batch] = {}
    workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    for batch in batches:
        name = part_name(batch, options)
        if (folder / name).exists():
            done(batch, Counter())
            continue
        while len(waiting) >= _AHEAD * workers:
            _collect(waiting, folder, options, done)
        future = client.submit(
            compute_part, str(folder.resolve()), batch, options, key=name, pure=False
        )
        waiting[future] = batch
    while waiting:
        _collect(waiting, folder, options, done)


def _collect(
    waiting: dict[Any, Batch],
    folder: Path,
    options: Options,
    done: Callable[[Batch, Counter[str]], None],
) -> None:
    """Take the batches that have ended, at least one."""
    from distributed import KilledWorker, wait

    for future in wait(list(waiting), return_when="FIRST_COMPLETED").done:
        batch = waiting.pop(future)
        try:
            statuses = future.result()
        except KilledWorker:
            why = f"{_DEATHS} workers died while they planned the rows of this part"
            statuses = failed_part(folder, batch, options, why)
        done(batch, statuses)
