# SPDX-License-Identifier: Apache-2.0
"""Parameter files that were given: whether any of their sections is for this node."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

_FLAG = "--params-file"


def files_of(arguments: Sequence[str] | None) -> list[str]:
    """The parameter files among command-line arguments; None are those of the process."""
    words = list(sys.argv if arguments is None else arguments)
    return [after for word, after in pairwise(words) if word == _FLAG]


def _sections(tree: Any, name: str = "") -> Iterator[str]:
    """Names of nodes that a tree has parameters for, as they stand in it."""
    if not isinstance(tree, dict):
        return
    for key, value in tree.items():
        if key == "ros__parameters":
            yield name or "/"
        else:
            yield from _sections(value, f"{name}/{str(key).strip('/')}")


def _applies(section: str, full_name: str) -> bool:
    """Whether a section's name, with its wildcards, is one of a node."""
    pattern = ""
    for part in section.strip("/").split("/"):
        step = {"**": "(/[^/]+)*", "*": "/[^/]+"}.get(part, "/" + re.escape(part))
        pattern += step
    return re.fullmatch(pattern, full_name) is not None


def inapplicable(arguments: Sequence[str] | None, full_name: str) -> str:
    """A sentence about parameter files of which no section is for a node; empty if one is.

    Parameters
    ----------
    arguments
        Of the command line; None are those of the process.
    full_name
        Of the node, its namespace included.
    """
    files = files_of(arguments)
    found: list[str] = []
    for path in files:
        try:
            tree = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        except (OSError, yaml.YAMLError):
            return ""  # rcl says what is wrong with it
        found += _sections(tree)
    if not files or any(_applies(section, full_name) for section in found):
        return ""
    named = ", ".join(dict.fromkeys(found)) or "none"
    return (
        f"no section of {', '.join(files)} applies to {full_name}: there is {named};"
        f" call the section {full_name}, or /** for every node"
    )
