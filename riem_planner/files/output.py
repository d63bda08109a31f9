# SPDX-License-Identifier: Apache-2.0
"""Writing a result so that nobody ever reads half of one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO


def partial_path(path: Path) -> Path:
    """Where the lines of an unfinished file stand, beside the file itself."""
    target = Path(os.path.realpath(path))
    return target.with_name(target.name + ".partial")


@contextmanager
def whole_file(path: Path, *, keep_partial: bool = False) -> Iterator[TextIO]:
    """Text file to write, which takes its place only when the body has ended well.

    Parameters
    ----------
    path
        The file. A device or a pipe is written to as it is.
    keep_partial
        Whether what was written stays, at `partial_path(path)`, when the body raises.
    """
    if path.exists() and not path.is_file():
        with path.open("w", encoding="utf-8") as stream:
            yield stream
        return
    partial = partial_path(path)
    try:
        with partial.open("w", encoding="utf-8") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(partial.with_name(partial.name.removesuffix(".partial")))
    except BaseException:
        if not keep_partial:
            partial.unlink(missing_ok=True)
        raise
