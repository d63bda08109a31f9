# SPDX-License-Identifier: Apache-2.0
"""The rows of a campaign, a batch at a time: lines of JSON, or a table beside a template.

Whatever a row holds is handed on as it is; what is wrong with it is told in its own result.
"""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_json, parse_yaml
from riem_planner.files.end_states import StateInZoneError
from riem_planner.files.problem_files import parse_problem
from riem_planner.files.section import of_file
from riem_planner.files.tables import KINDS, ecsv_delimiter

_ENDS = {key: tuple(f"{key}_{part}" for part in "xyzw") for key in ("start", "goal")}
_OPTIONAL = ("duration_s", "name")
_BLOCK = 1 << 20  # bytes read at once where a file is hashed


@dataclass(frozen=True)
class Batch:
    """Some rows one after the other.

    Parameters
    ----------
    first
        Number of the first, from 0.
    rows
        Each as a line of JSON.
    """

    first: int
    rows: tuple[bytes, ...]


def batches(path: Path, size: int) -> Iterator[Batch]:
    """The rows of a file in batches of `size`."""
    rows = _lines(path) if path.suffix.lower() == ".jsonl" else _table_rows(path)
    first = 0
    while taken := tuple(islice(rows, size)):
        yield Batch(first, taken)
        first += len(taken)


def check_input(path: Path, template: Path | None) -> None:
    """Refuse an input that is of no known kind, or lacks columns or a template."""
    kind = path.suffix.lower()
    if kind == ".jsonl":
        if template is not None:
            raise InvalidProblemError("--problem", "lines of a .jsonl hold whole problems; drop it")
        next(_lines(path), None)
        return
    if kind not in KINDS:
        known = ", ".join((".jsonl", *KINDS))
        raise InvalidProblemError(
            "file name", f"expected one ending in {known}, got {path.name}; rename it"
        )
    if template is None:
        raise InvalidProblemError(
            "--problem", "missing; a table gives starts and goals: name a problem file for the rest"
        )
    names = _column_names(path)
    for name in (*_ENDS["start"], *_ENDS["goal"]):
        if name not in names:
            raise InvalidProblemError(
                f"{path}: {name}", f"missing; the columns are {', '.join(names) or 'none'}"
            )


def read_template(path: Path) -> str:
    """Text of a template problem, as JSON with sorted keys; it must be a problem but for ends.

    Raises
    ------
    InvalidProblemError
        It is none; the error names file and key.
    """
    with of_file(path):
        document = parse_yaml(decoded(path.read_bytes()))
        if not isinstance(document, dict):
            raise InvalidProblemError("document", "expected a problem")
        ends = {"start": [0.0, 0.0, 0.0, 1.0], "goal": [0.0, 0.0, 0.6, 0.8]}
        with suppress(StateInZoneError):  # these ends are none of the campaign's
            parse_problem(merged(document, {key: {"orientation": q} for key, q in ends.items()}))
    return json.dumps(document, sort_keys=True)


def merged(template: dict[str, Any], row: dict[str, Any]) -> dict[str, Any]:
    """The template with the ends, duration and name of a row."""
    document = dict(template)
    for key, value in row.items():
        if key in _ENDS and isinstance(template.get(key), dict):
            kept = {k: v for k, v in template[key].items() if k == "angular_velocity"}
            value = kept | value
        document[key] = value
    return document


def document_of(row: bytes, template: str | None) -> Any:
    """The problem's document of a row."""
    document = parse_json(decoded(row))
    return document if template is None else merged(parse_json(template), document)


def count_and_hash(path: Path) -> tuple[int, str]:
    """About how many rows a file has, and the SHA-256 of its contents."""
    digest, lines = hashlib.sha256(), 0
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
            lines += block.count(b"\n")
    if path.suffix.lower() == ".parquet":
        from pyarrow import parquet

        lines = parquet.ParquetFile(path).metadata.num_rows
    return lines, digest.hexdigest()


def _lines(path: Path) -> Iterator[bytes]:
    with path.open("rb") as stream:
        for line in stream:
            if line.strip():
                yield line.strip()


def _column_names(path: Path) -> list[str]:
    if path.suffix.lower() == ".parquet":
        import pyarrow
        from pyarrow import parquet

        try:
            return list(parquet.ParquetFile(path).schema_arrow.names)
        except pyarrow.ArrowInvalid as error:
            raise InvalidProblemError(str(path), f"not a .parquet table: {error}") from None
    with path.open(encoding="utf-8-sig", newline="") as stream:
        return next(_records(path, stream), [])


def _records(path: Path, stream: Iterable[str]) -> Iterator[list[str]]:
    """Rows of text of a CSV or ECSV file, the names first."""
    delimiter = ecsv_delimiter(path) if path.suffix.lower() == ".ecsv" else ","
    lines = (line for line in stream if line.strip() and not line.startswith("#"))
    return csv.reader(lines, delimiter=delimiter)


def _table_rows(path: Path) -> Iterator[bytes]:
    wanted = (*_ENDS["start"], *_ENDS["goal"], *_OPTIONAL)
    if path.suffix.lower() == ".parquet":
        from pyarrow import parquet

        file = parquet.ParquetFile(path)
        names = [name for name in wanted if name in file.schema_arrow.names]
        for batch in file.iter_batches(4096, columns=names):
            yield from (_row(values) for values in batch.to_pylist())
        return
    with path.open(encoding="utf-8-sig", newline="") as stream:
        records = _records(path, stream)
        names = next(records)
        for record in records:
            given = dict(zip(names, record, strict=False))
            yield _row({name: _value(name, given[name]) for name in wanted if name in given})


def _value(name: str, text: str) -> Any:
    if name == "name":
        return text
    try:
        return float(text)
    except ValueError:
        return text


def _row(values: dict[str, Any]) -> bytes:
    document: dict[str, Any] = {
        key: {"orientation": [values.get(name) for name in names]} for key, names in _ENDS.items()
    }
    if values.get("duration_s") not in (None, ""):
        document["duration"] = values["duration_s"]
    if values.get("name") not in (None, ""):
        document["name"] = str(values["name"])
    return json.dumps(document).encode()
