# SPDX-License-Identifier: Apache-2.0
"""The `riem_campaign` command: many problems to partitioned Parquet, resumed where it stopped.

Exit codes: 0 every row is there, 2 a wrong file or option, 130 interrupted.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from riem_planner import __version__
from riem_planner.errors import InvalidProblemError
from riem_planner.extras import require
from riem_planner.files.output import whole_file
from riem_planner.riem_campaign.engine import local_client, remote_client, run_batches
from riem_planner.riem_campaign.parts import Options, remove_partial
from riem_planner.riem_campaign.rows import (
    Batch,
    batches,
    check_input,
    count_and_hash,
    read_template,
)
from riem_planner.riem_plan.planning import DEFAULT_SAMPLES
from riem_planner.solve import warm_up

COMPLETE, WRONG_FILE, INTERRUPTED = 0, 2, 130
RECORD = "campaign.json"
_BATCH_ROWS = 256  # a second of work or more


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    options = _parser().parse_args(arguments)
    try:
        require("pyarrow", "distributed")
        return _run(options)
    except (InvalidProblemError, OSError) as error:
        _say(str(error))
        return WRONG_FILE
    except KeyboardInterrupt:
        _say("interrupted; the same command goes on from the parts that are there")
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="riem_campaign",
        description="Plan the problems of a table; the same command resumes what is missing.",
        epilog="exit codes: 0 every row is there; 2 a wrong file or option; 130 interrupted",
    )
    parser.add_argument(
        "table", type=Path, metavar="TABLE",
        help="problems (.jsonl), or starts and goals (.parquet, .csv, .ecsv)",
    )  # fmt: skip
    parser.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="for the parts"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, metavar="N",
        help="worker processes on this machine (default: one a core)",
    )  # fmt: skip
    where.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="of a Dask cluster")
    parser.add_argument(
        "--batch-rows", type=int, default=_BATCH_ROWS, metavar="N",
        help="rows of a part (default %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--samples", type=int, default=DEFAULT_SAMPLES, metavar="N",
        help="samples in a plan (default %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--problem", type=Path, metavar="TEMPLATE", help="problem file beside a table"
    )
    parser.add_argument("--trajectories", action="store_true", help="keep the samples of each plan")
    return parser


def _run(given: argparse.Namespace) -> int:
    for name, least in (("jobs", 1), ("batch_rows", 1), ("samples", 2)):
        if getattr(given, name) < least:
            raise InvalidProblemError(
                f"--{name.replace('_', '-')}",
                f"expected at least {least}, got {getattr(given, name)}",
            )
    check_input(given.table, given.problem)
    template = None if given.problem is None else read_template(given.problem)
    options = Options(given.samples, given.trajectories, template)
    rows, digest = count_and_hash(given.table)
    given.output.mkdir(parents=True, exist_ok=True)
    _keep_record(given.output / RECORD, _record(given, options, digest))
    remove_partial(given.output)
    statuses: Counter[str] = Counter()
    there = 0
    interval = 0.1 if sys.stderr.isatty() else 10.0
    with tqdm(total=rows, unit="row", file=sys.stderr, mininterval=interval) as bar:

        def done(batch: Batch, found: Counter[str]) -> None:
            nonlocal there
            there += len(batch.rows)
            statuses.update(found)
            bar.update(len(batch.rows))

        with _client(given) as client:
            run_batches(batches(given.table, given.batch_rows), given.output, options, client, done)
    told = ", ".join(f"{count} {status}" for status, count in sorted(statuses.items()))
    _say(f"{there} rows in {given.output}; planned now: {told or 'none'}")
    return COMPLETE


def _client(given: argparse.Namespace) -> Any:
    if given.scheduler is not None:
        return remote_client(given.scheduler)
    warm_up(notify=_say)  # so that no two workers compile side by side
    return local_client(given.jobs, _say)


def _record(given: argparse.Namespace, options: Options, digest: str) -> dict[str, Any]:
    template = (options.template or "").encode()
    return {
        "version": __version__,
        "input": given.table.name,
        "input_sha256": digest,
        "template": None if given.problem is None else given.problem.name,
        "template_sha256": hashlib.sha256(template).hexdigest() if template else None,
        "batch_rows": given.batch_rows,
        "samples": given.samples,
        "trajectories": given.trajectories,
    }  # fmt: skip


def _keep_record(path: Path, record: dict[str, Any]) -> None:
    """Write the record of a campaign, or refuse a folder that holds another's."""
    if not path.exists():
        with whole_file(path) as stream:
            stream.write(json.dumps(record, indent=2) + "\n")
        return
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InvalidProblemError(str(path), f"not the record of a campaign: {error}") from None
    for key, value in record.items():
        there = found.get(key) if isinstance(found, dict) else None
        if there != value:
            raise InvalidProblemError(
                f"{path}: {key}",
                f"the campaign in this folder has {there!r}, this one {value!r}; choose another"
                " folder, or the same input and options",
            )


def _say(message: str) -> None:
    print(f"riem_campaign: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
