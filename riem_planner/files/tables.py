# SPDX-License-Identifier: Apache-2.0
"""Tables with named columns: Parquet, CSV, and ECSV, the CSV of astronomers with a YAML header.

Reading them needs pyarrow, of the extra `surveys`.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_yaml

Array = NDArray[np.float64]

KINDS = (".csv", ".parquet", ".ecsv")


@dataclass(frozen=True)
class Table:
    """Columns of a file, by name.

    Parameters
    ----------
    path
        The file, as messages name it.
    data
        A `pyarrow.Table`.
    """

    path: Path
    data: Any

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return list(self.data.column_names)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.data.num_rows)

    def numbers(self, *names: str) -> Array:
        """Columns of finite numbers, as an array (rows, names).

        Raises
        ------
        InvalidProblemError
            A column is missing, or a value is no finite number; it names column and row.
        """
        columns = []
        for name in names:
            if name not in self.names:
                raise InvalidProblemError(
                    f"{self.path}: {name}",
                    f"missing; the columns are {', '.join(self.names) or 'none'}",
                )
            columns.append(self._numbers(name))
        return np.stack(columns, axis=-1)

    def _numbers(self, name: str) -> Array:
        column = self.data.column(name)
        try:
            values = np.asarray(column.cast("float64").to_numpy(), dtype=float)
        except (ValueError, NotImplementedError) as error:
            raise InvalidProblemError(
                f"{self.path}: {name}", f"expected a column of numbers: {error}"
            ) from None
        wrong = np.flatnonzero(~np.isfinite(values))
        if wrong.size:
            row = int(wrong[0])
            raise InvalidProblemError(
                f"{self.path}: {name}, row {row}",
                f"expected a finite number, got {column[row].as_py()!r}",
            )
        return values


def read_table(path: Path) -> Table:
    """Table of a `.parquet`, `.csv` or `.ecsv` file.

    Raises
    ------
    InvalidProblemError
        It is no such file; the error names it.
    OSError
        It can't be read.
    """
    import pyarrow
    from pyarrow import csv, parquet

    kind = path.suffix.lower()
    if kind not in KINDS:
        raise InvalidProblemError(
            "file name", f"expected one ending in {', '.join(KINDS)}, got {path.name}; rename it"
        )
    try:
        if kind == ".parquet":
            return Table(path, parquet.read_table(path))
        content, delimiter = path.read_bytes(), ","
        if kind == ".ecsv":
            content, delimiter = _without_header(decoded(content))
        options = csv.ParseOptions(delimiter=delimiter)
        return Table(path, csv.read_csv(io.BytesIO(content), parse_options=options))
    except pyarrow.ArrowInvalid as error:
        raise InvalidProblemError(str(path), f"not a {kind} table: {error}") from None


def _without_header(text: str) -> tuple[bytes, str]:
    """The rows of an ECSV text, and what parts their columns."""
    lines = text.splitlines()
    delimiter = _delimiter([line for line in lines if line.startswith("#")])
    rows = [line for line in lines if line.strip() and not line.startswith("#")]
    return "\n".join([*rows, ""]).encode(), delimiter


def ecsv_delimiter(path: Path) -> str:
    """What parts the columns of an ECSV file; raises as `read_table`."""
    with path.open(encoding="utf-8-sig") as stream:
        return _delimiter(list(takewhile(lambda line: line.startswith("#"), stream)))


def _delimiter(header: list[str]) -> str:
    plain = [line[1:].removeprefix(" ").rstrip() for line in header]
    stated: Any = None
    if plain and plain[0].startswith("%ECSV"):
        stated = parse_yaml("\n".join(line for line in plain[1:] if line != "---"))
    if not isinstance(stated, dict):
        raise InvalidProblemError("document", "expected the header of ECSV, '# %ECSV 1.0'")
    return str(stated.get("delimiter", " "))


def write_table(columns: dict[str, Any], path: Path) -> None:
    """Write columns as one Parquet file, which takes its name when it is whole."""
    import pyarrow
    from pyarrow import parquet

    partial = path.with_name(path.name + ".partial")
    try:
        parquet.write_table(pyarrow.table(columns), partial)
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def names_of(prefix: str, parts: Sequence[str]) -> list[str]:
    """Column names of a vector: `prefix_x` and so on."""
    return [f"{prefix}_{part}" for part in parts]
