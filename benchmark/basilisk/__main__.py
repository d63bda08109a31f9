# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmark.basilisk`, which is `make basilisk`: flights and the comparison.

Exit code 1 if a bar is missed; the bars that are missed are named.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import sys
from pathlib import Path

from benchmark.basilisk.compared import compared
from benchmark.basilisk.document import DOCUMENT, insert
from benchmark.basilisk.published import published
from benchmark.report import machine
from riem_planner import warm_up

RESULTS = Path(__file__).parent / "results.md"


def main(arguments: list[str] | None = None) -> int:
    """Fly, write the results, show them."""
    parser = argparse.ArgumentParser(prog="python -m benchmark.basilisk", description=__doc__)
    parser.add_argument("--published", action="store_true", help="only the published manoeuvres")
    parser.add_argument("--output", type=Path, default=RESULTS, help="file for the tables")
    parser.add_argument("--docs", action="store_true", help="put them into docs/basilisk.md too")
    options = parser.parse_args(sys.argv[1:] if arguments is None else arguments)
    warm_up(notify=lambda message: print(message, file=sys.stderr))
    tables, missed = published()
    if not options.published:
        more, faults = compared()
        tables, missed = tables + more, missed + faults
    facts = {**machine(), "bsk": importlib.metadata.version("bsk")}
    described = ", ".join(f"{key} {value}" for key, value in facts.items())
    text = "\n".join(table.markdown() for table in tables) + f"\nMachine: {described}.\n"
    options.output.write_text(text)
    if options.docs:
        DOCUMENT.write_text(insert(DOCUMENT.read_text(), text))
    print(text)
    for fault in missed:
        print(f"bar missed: {fault}", file=sys.stderr)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
