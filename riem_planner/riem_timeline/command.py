# SPDX-License-Identifier: Apache-2.0
"""The `riem_timeline` command: observations to one certified reference.

Exit codes: 0 everything is certified, 2 a file is wrong, 3 conflicts remain, 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from riem_planner.errors import InvalidProblemError
from riem_planner.extras import require
from riem_planner.riem_timeline.inputs import read_observations, read_sky, read_spacecraft
from riem_planner.riem_timeline.output import REFERENCE, write_reference, write_segments
from riem_planner.riem_timeline.remedies import with_remedies
from riem_planner.riem_timeline.schedule import Segment, conflicts, schedule, worst_degrees
from riem_planner.solve import warm_up

CERTIFIED, WRONG_FILE, CONFLICTS, INTERRUPTED = 0, 2, 3, 130
_NAMED = 10  # conflicts told on the standard error
_REMEDIED = 200  # conflicts that a remedy is looked for


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    options = _parser().parse_args(arguments)
    try:
        require("pyarrow")
        return _run(options)
    except (InvalidProblemError, OSError) as error:
        _say(str(error))
        return WRONG_FILE
    except KeyboardInterrupt:
        _say("interrupted")
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="riem_timeline",
        description="Join observations by certified slews into one reference.",
        epilog="exit codes: 0 everything is certified; 2 a file is wrong; 3 conflicts remain",
    )
    parser.add_argument(
        "observations", type=Path, metavar="OBSERVATIONS", help="a .csv, .ecsv or .parquet table"
    )
    for name, what in (
        ("spacecraft", "boresight, limits, settling time, zones (.yaml)"),
        ("sky", "directions to the bodies over time (.csv, .ecsv, .parquet)"),
        ("output", "folder to write segments.parquet and reference.parquet to"),
    ):
        parser.add_argument(f"--{name}", type=Path, required=True, metavar="PATH", help=what)
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="threads")
    parser.add_argument(
        "--strict", action="store_true", help="write no reference where a conflict remains"
    )
    parser.add_argument("--report", type=Path, metavar="PNG", help="draw sky, slews and conflicts")
    return parser


def _run(options: argparse.Namespace) -> int:
    if options.jobs < 1:
        raise InvalidProblemError("--jobs", f"expected at least 1, got {options.jobs}")
    spacecraft = read_spacecraft(options.spacecraft)
    observations = read_observations(options.observations)
    sky = read_sky(options.sky, spacecraft.zones)
    options.output.mkdir(parents=True, exist_ok=True)
    warm_up(notify=_say)
    interval = 0.1 if sys.stderr.isatty() else 10.0
    with tqdm(
        total=len(observations.start) - 1, unit="slew", file=sys.stderr, mininterval=interval
    ) as bar:
        segments = schedule(
            observations, spacecraft, sky, jobs=options.jobs, progress=lambda: bar.update() and None
        )
    segments = with_remedies(segments, observations, spacecraft, sky, _REMEDIED)
    write_segments(segments, sky, options.output)
    left = conflicts(segments)
    if options.strict and left:
        (options.output / REFERENCE).unlink(missing_ok=True)
    else:
        write_reference(segments, options.output)
    if options.report is not None:
        # Loading Matplotlib takes half a second, which only a figure is worth.
        from riem_planner.riem_timeline.report import draw_report, straight_times

        blind = straight_times(segments, observations.attitudes, spacecraft)
        draw_report(segments, blind, spacecraft, sky, options.report)
    _tell(segments, left)
    return CONFLICTS if left else CERTIFIED


def _tell(segments: Sequence[Segment], left: Sequence[Segment]) -> None:
    kinds = Counter(segment.kind for segment in segments)
    verdicts = Counter(segment.verdict for segment in segments if segment.verdict)
    _say(
        f"{kinds['slew']} slews ({', '.join(f'{n} {v}' for v, n in sorted(verdicts.items()))}),"
        f" {kinds['wait']} waits, {kinds['hold']} holds; {len(left)} conflicts"
    )
    for segment in left[:_NAMED]:
        late = f" by {segment.late:.3f} s" if segment.reason == "late" else ""
        margin = worst_degrees(segment)
        inside = f", {-margin:.3g} deg inside" if margin <= 0.0 else ""
        remedy = f"; {segment.remedy}" if segment.remedy else ""
        _say(
            f"observation {segment.observation}: {segment.kind} at {segment.start:.3f} s:"
            f" {segment.reason}{late}{inside}{remedy}"
        )
    if len(left) > _NAMED:
        _say(f"and {len(left) - _NAMED} more: see segments.parquet")


def _say(message: str) -> None:
    print(f"riem_timeline: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
