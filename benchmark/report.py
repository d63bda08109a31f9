# SPDX-License-Identifier: Apache-2.0
"""Tables, as Markdown and as JSON, with a description of the machine."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PACKAGES = ("riem_planner", "numpy", "scipy", "numba", "casadi")


@dataclass
class Table:
    """Rows of one measurement; every row has the same keys.

    Attributes
    ----------
    title
        What was measured.
    note
        How, in a sentence or two.
    rows
        Of each row its values by column; a float is shown with three digits.
    """

    title: str
    note: str = ""
    rows: list[dict[str, Any]] = field(default_factory=list)

    def markdown(self) -> str:
        """The table under its title."""
        lines = [f"## {self.title}", ""]
        if self.note:
            lines += [self.note, ""]
        if not self.rows:
            return "\n".join([*lines, "Nothing was measured.", ""])
        columns = list(self.rows[0])
        lines.append("| " + " | ".join(columns) + " |")
        lines.append("|" + "---|" * len(columns))
        for row in self.rows:
            lines.append("| " + " | ".join(_shown(row[column]) for column in columns) + " |")
        return "\n".join([*lines, ""])


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
    return str(value)


def machine() -> dict[str, str]:
    """Processor, cores, system and versions; nothing that names the machine."""
    description = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            description[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return description


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def write(tables: list[Table], folder: Path, name: str) -> Path:
    """Write `name.md` and `name.json`; returns the Markdown's path."""
    folder.mkdir(parents=True, exist_ok=True)
    described = machine()
    facts = ", ".join(f"{key} {value}" for key, value in described.items())
    text = f"# Benchmark\n\nOne thread, warm, in one run. Machine: {facts}.\n\n"
    text += "\n".join(table.markdown() for table in tables)
    (folder / f"{name}.md").write_text(text)
    content = {
        "machine": described,
        "tables": [
            {"title": table.title, "note": table.note, "rows": table.rows} for table in tables
        ],
    }
    (folder / f"{name}.json").write_text(json.dumps(content, indent=1) + "\n")
    return folder / f"{name}.md"
