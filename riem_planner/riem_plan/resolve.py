# SPDX-License-Identifier: Apache-2.0
"""What `riem_plan --resolve` writes: problems without anything of the sky, unsolved."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from riem_planner.files.documents import decoded, parse_json
from riem_planner.files.problem_files import read_document
from riem_planner.files.resolving import resolved
from riem_planner.files.section import of_file, within
from riem_planner.riem_plan.batch import problem_lines


def resolved_lines(path: Path) -> Iterator[str]:
    """The problem of a file, or one a line of a `.jsonl` file, as lines of JSON.

    Raises
    ------
    InvalidProblemError
        What a problem names of the sky is wrong; the error names file, line and key.
    """
    if path.suffix.lower() != ".jsonl":
        with of_file(path):
            yield json.dumps(resolved(read_document(path), path.parent))
        return
    for number, line in problem_lines(path):
        with of_file(path), within(f"line {number}"):
            yield json.dumps(resolved(parse_json(decoded(line)), path.parent))
