# SPDX-License-Identifier: Apache-2.0
"""A part of a campaign's result: one batch planned, written whole under a name of its content."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import uuid
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from riem_planner import __version__
from riem_planner.riem_campaign.rows import Batch, document_of
from riem_planner.riem_plan.batch import FAULT, Attempt, attempt

_PARTIAL = ".partial"
# The one part of a message that depends on a clock.
_SOLVE_TIME = re.compile(r" in [0-9.e+-]+ ms\b")


@dataclass(frozen=True)
class Options:
    """What changes a result.

    Parameters
    ----------
    samples
        Of each plan.
    trajectories
        Whether parts hold the samples.
    template
        The template problem as JSON; None where rows are whole problems.
    """

    samples: int
    trajectories: bool
    template: str | None


def part_name(batch: Batch, options: Options) -> str:
    """Name of a batch's part: its first row, and a hash of all that its content depends on."""
    digest = hashlib.sha256()
    stated = json.dumps({"version": __version__, **asdict(options)}, sort_keys=True)
    digest.update(stated.encode())
    for row in batch.rows:
        digest.update(b"\n" + row)
    return f"part-{batch.first:012d}-{digest.hexdigest()[:16]}.parquet"


def compute_part(folder: str, batch: Batch, options: Options) -> Counter[str]:
    """Plan a batch and write its part; returns how often each status came."""
    attempts = [
        attempt(lambda row=row: document_of(row, options.template), options.samples)  # type: ignore[misc]
        for row in batch.rows
    ]
    return write_part(Path(folder), batch, options, attempts)


def failed_part(folder: Path, batch: Batch, options: Options, why: str) -> Counter[str]:
    """Write a part of nothing but faults."""
    lost = [Attempt(None, None, FAULT, why)] * len(batch.rows)
    return write_part(folder, batch, options, lost)


def write_part(
    folder: Path, batch: Batch, options: Options, attempts: list[Attempt]
) -> Counter[str]:
    """Write the part of a batch, whole or not at all."""
    import pyarrow
    from pyarrow import parquet

    columns = _columns(batch.first, attempts)
    if options.trajectories:
        columns |= _samples(attempts)
    table = pyarrow.table(columns)
    target = folder / part_name(batch, options)
    partial = folder / f".{target.name}.{uuid.uuid4().hex}{_PARTIAL}"
    try:
        with partial.open("wb") as stream:
            parquet.write_table(table, stream)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(target)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    return Counter(each.status for each in attempts)


def remove_partial(folder: Path) -> None:
    """Remove what an interrupted run left half written."""
    for path in folder.glob(f".part-*{_PARTIAL}"):
        path.unlink(missing_ok=True)


def _columns(first: int, attempts: list[Attempt]) -> dict[str, Any]:
    import pyarrow

    number, text = pyarrow.float64(), pyarrow.string()
    rows = [_row(each) for each in attempts]
    kinds = {
        "name": text, "status": text, "certified": pyarrow.bool_(), "duration": number,
        "cost": number, "clearance_deg": number, "zone": text, "message": text,
    }  # fmt: skip
    columns = {key: pyarrow.array([row[key] for row in rows], kind) for key, kind in kinds.items()}
    return {"row": pyarrow.array(range(first, first + len(rows)), pyarrow.int64())} | columns


def _row(each: Attempt) -> dict[str, Any]:
    row: dict[str, Any] = {
        "name": each.name, "status": each.status, "certified": False, "duration": None,
        "cost": None, "clearance_deg": None, "zone": None,
        "message": _SOLVE_TIME.sub("", each.message),
    }  # fmt: skip
    plan = each.plan
    if plan is None:
        return row
    row["name"] = plan.problem.name or each.name
    if not plan.certified or plan.certificate is None:
        return row
    row |= {"certified": True, "duration": plan.problem.duration}
    row["cost"] = plan.solution.cost if math.isfinite(plan.solution.cost) else None
    if plan.certificate.clearance:
        zone, angle = min(plan.certificate.clearance.items(), key=lambda item: item[1])
        row |= {"zone": zone, "clearance_deg": math.degrees(angle)}
    return row


def _samples(attempts: list[Attempt]) -> dict[str, Any]:
    import pyarrow

    numbers = pyarrow.list_(pyarrow.float64())
    kinds = {
        "times": numbers,
        "orientations_xyzw": pyarrow.list_(numbers),
        "angular_velocities": pyarrow.list_(numbers),
        "angular_accelerations": pyarrow.list_(numbers),
    }
    fields = ("times", "quaternions_xyzw", "angular_velocities", "angular_accelerations")
    columns = {}
    for (name, kind), field in zip(kinds.items(), fields, strict=True):
        values = [
            None
            if each.plan is None or each.plan.trajectory is None
            else getattr(each.plan.trajectory, field).tolist()
            for each in attempts
        ]
        columns[name] = pyarrow.array(values, kind)
    return columns
