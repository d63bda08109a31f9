# SPDX-License-Identifier: Apache-2.0
"""The `riem_export` command: CCSDS AEM and SPICE CK of a plan or a timeline.

Exit codes: 0 written, 2 a wrong file or option.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

from riem_planner.errors import InvalidProblemError
from riem_planner.extras import require
from riem_planner.files.output import whole_file
from riem_planner.riem_export.aem import aem_text
from riem_planner.riem_export.ck import spacecraft_code, write_ck
from riem_planner.riem_export.epochs import parse_epoch
from riem_planner.riem_export.knots import read_flight

WRITTEN, WRONG_FILE = 0, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    options = _parser().parse_args(arguments)
    try:
        _export(options)
    except (InvalidProblemError, OSError) as error:
        _say(str(error))
        return WRONG_FILE
    return WRITTEN


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="riem_export",
        description="Write a plan or a timeline as an attitude ephemeris.",
        epilog="exit codes: 0 written; 2 a wrong file or option",
    )
    parser.add_argument(
        "source", type=Path, metavar="PLAN_OR_FOLDER",
        help="a plan of riem_plan (.json), or the output folder of riem_timeline",
    )  # fmt: skip
    parser.add_argument("--format", choices=("aem", "ck"), required=True)
    parser.add_argument("--output", type=Path, required=True, metavar="FILE")
    parser.add_argument("--epoch", required=True, metavar="UTC", help="of the first attitude")
    parser.add_argument("--object-name", required=True, metavar="NAME")
    parser.add_argument(
        "--object-id", required=True, metavar="ID", help="international, or of NAIF for a CK"
    )
    parser.add_argument(
        "--tolerance", type=float, default=1e-6, metavar="RAD",
        help="greatest error between records (default %(default)s)",
    )  # fmt: skip
    parser.add_argument("--originator", default="RIEM_PLANNER", metavar="NAME")
    return parser


def _export(options: argparse.Namespace) -> None:
    if not 1e-9 <= options.tolerance <= 1e-2:
        raise InvalidProblemError(
            "--tolerance", f"expected from 1e-9 to 1e-2 rad, got {options.tolerance:g}"
        )
    epoch = parse_epoch(options.epoch)
    if options.source.is_dir():
        require("pyarrow")
    if options.format == "ck":
        require("spiceypy")
        spacecraft_code(options.object_id)
    flight = read_flight(options.source)
    if options.format == "ck":
        clock = write_ck(
            flight, epoch, options.output, name=options.object_name, identity=options.object_id,
            tolerance=options.tolerance,
        )  # fmt: skip
        _say(f"{options.output}, with its clock {clock}")
        return
    text = aem_text(
        flight, epoch, datetime.now(timezone.utc), name=options.object_name,
        identity=options.object_id, originator=options.originator, tolerance=options.tolerance,
    )  # fmt: skip
    with whole_file(options.output) as stream:
        stream.write(text)
    _say(str(options.output))


def _say(message: str) -> None:
    print(f"riem_export: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
