# SPDX-License-Identifier: Apache-2.0
"""The two tables of a timeline: its segments and the reference that is flown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.files.tables import names_of, write_table
from riem_planner.riem_timeline.inputs import SkyZone
from riem_planner.riem_timeline.schedule import Segment

Array = NDArray[np.float64]

SEGMENTS, REFERENCE = "segments.parquet", "reference.parquet"


def write_segments(segments: Sequence[Segment], sky: Sequence[SkyZone], folder: Path) -> None:
    """Write one row a segment."""
    columns: dict[str, Any] = {
        "kind": [segment.kind for segment in segments],
        "observation": np.array([segment.observation for segment in segments], dtype=np.int64),
        "start_s": np.array([segment.start for segment in segments]),
        "duration_s": np.array([segment.duration for segment in segments]),
        "verdict": _texts([segment.verdict for segment in segments]),
        "certified": [segment.reason is None for segment in segments],
        "reason": _texts([segment.reason for segment in segments]),
        "late_s": np.array([segment.late for segment in segments]),
    }
    for i, zone in enumerate(sky):
        margins = np.degrees([segment.margins[i] for segment in segments])
        columns[f"clearance_deg_{zone.zone.name}"] = margins
    columns["remedy"] = _texts([segment.remedy or None for segment in segments])
    write_table(columns, folder / SEGMENTS)


def _texts(values: list[str | None]) -> Any:
    import pyarrow

    return pyarrow.array(values, pyarrow.string())


def reference_rows(segments: Sequence[Segment]) -> tuple[Array, Array, Array, Array]:
    """Times (n,), quaternions (n, 4), rates and accelerations (n, 3) of the whole timeline.

    Two rows of one time mark a jump of acceleration; quaternions keep their sign.
    """
    pieces = [
        (begin + piece.times, piece.quaternions_xyzw, piece.angular_velocities,
         piece.angular_accelerations)
        for segment in segments
        for begin, piece in segment.motion.beginning_at(segment.start)
    ]  # fmt: skip
    kept: list[tuple[Array, Array, Array, Array]] = []
    for times, q, v, a in pieces:
        if kept:
            before = kept[-1]
            q = q if np.dot(before[1][-1], q[0]) >= 0.0 else -q
            times = np.concatenate([[before[0][-1]], times[1:]])  # joined to the last digit
            if np.array_equal(before[3][-1], a[0]):
                times, q, v, a = times[1:], q[1:], v[1:], a[1:]
        kept.append((times, q, v, a))
    t, q, v, a = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    return t, q, v, a


def write_reference(segments: Sequence[Segment], folder: Path) -> None:
    """Write the reference, row by row."""
    times, *vectors = reference_rows(segments)
    columns: dict[str, Any] = {"time_s": times}
    stems = (("orientation", "xyzw"), ("angular_velocity", "xyz"), ("angular_acceleration", "xyz"))
    for (stem, parts), array in zip(stems, vectors, strict=True):
        for name, column in zip(names_of(stem, parts), array.T, strict=True):
            columns[name] = np.ascontiguousarray(column)
    write_table(columns, folder / REFERENCE)
