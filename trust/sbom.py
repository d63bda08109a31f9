# SPDX-License-Identifier: Apache-2.0
"""A bill of materials of the installed set, in CycloneDX 1.5: `python -m trust.sbom OUT.json`."""

from __future__ import annotations

import json
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from riem_planner.version import __version__


def components() -> list[dict[str, Any]]:
    """Every installed distribution but the planner itself: name, version, licence, address."""
    found = {}
    for distribution in metadata.distributions():
        name, version = distribution.metadata["Name"], distribution.version
        if not name or name.lower().replace("-", "_") == "riem_planner":
            continue
        entry: dict[str, Any] = {
            "type": "library",
            "name": name,
            "version": version,
            "purl": f"pkg:pypi/{name.lower()}@{version}",
        }
        licence = distribution.metadata["License-Expression"] or distribution.metadata["License"]
        if licence and len(licence) < 100:
            entry["licenses"] = [{"license": {"name": licence}}]
        found[name.lower()] = entry
    return [found[name] for name in sorted(found)]


def document() -> dict[str, Any]:
    """The bill."""
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "name": "riem_planner",
                "version": __version__,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
            }
        },
        "components": components(),
    }


def main() -> int:
    """Run the command."""
    if len(sys.argv) != 2:
        print("usage: python -m trust.sbom OUT.json")
        return 2
    text = json.dumps(document(), indent=1) + "\n"
    Path(sys.argv[1]).write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
