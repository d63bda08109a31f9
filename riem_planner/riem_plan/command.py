# SPDX-License-Identifier: Apache-2.0
"""The `riem_plan` command: plans of problem files, without ROS.

Exit codes: 0 solved and certified (of a batch: all), 2 a file is wrong, 3 no certified
trajectory was found, 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from tqdm import tqdm

from riem_planner import kernel_cache
from riem_planner.errors import InvalidProblemError
from riem_planner.files.output import partial_path, whole_file
from riem_planner.files.plan_files import degrees, encoded, plan_document
from riem_planner.files.plans import Plan
from riem_planner.files.problem_files import read_problem
from riem_planner.files.section import of_file
from riem_planner.riem_plan import batch
from riem_planner.riem_plan.checking import check_files
from riem_planner.riem_plan.planning import DEFAULT_SAMPLES, plan_problem
from riem_planner.riem_plan.resolve import resolved_lines
from riem_planner.solution import Status
from riem_planner.solve import warm_up

SOLVED, WRONG_FILE, NO_TRAJECTORY, INTERRUPTED = 0, 2, 3, 130
# What makes a file a wrong one; where zones move, that may show only once the duration is found.
_WRONG = (batch.INVALID, Status.START_IN_ZONE.name, Status.GOAL_IN_ZONE.name)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    code = _answered(arguments)
    if code == INTERRUPTED and arguments is None:
        # A pool whose workers were ended beneath it may keep the interpreter from ending.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def _answered(arguments: Sequence[str] | None) -> int:
    parser = _parser()
    options = parser.parse_args(arguments)
    _check_options(parser, options)
    try:
        return _run(options)
    except InvalidProblemError as error:
        _say(str(error))
        return WRONG_FILE
    except BrokenPipeError:
        # Whoever read the standard output has left; nothing more can be told there.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        _say(str(error))
        return WRONG_FILE
    except KeyboardInterrupt:
        _say("interrupted")
        return INTERRUPTED
    finally:
        kernel_cache.tell(_say)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="riem_plan",
        description="Plan certified attitude trajectories around obstacles.",
        epilog="exit codes: 0 solved and certified (of a batch: all); 2 a file is wrong; 3 no"
        " certified trajectory was found",
    )
    parser.add_argument(
        "problem",
        type=Path,
        nargs="?",
        metavar="PROBLEM",
        help="a problem (.yaml, .json), or many, one a line (.jsonl)",
    )
    parser.add_argument(
        "--output", type=Path, metavar="PLAN", help="where to write; default: standard output"
    )
    parser.add_argument("--plot", type=Path, metavar="PNG", help="write a figure of the plan")
    parser.add_argument(
        "--html",
        type=Path,
        metavar="PAGE",
        help="write a page that shows the plan, or what was refused, in a browser",
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=DEFAULT_SAMPLES,
        metavar="N",
        help="samples in a plan (default %(default)s)",
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="worker processes for a .jsonl file"
    )
    parser.add_argument(
        "--warm-up",
        action="store_true",
        help="compile the solver where it is not yet, for an image; a PROBLEM may be left out",
    )
    parser.add_argument(
        "--least-torque",
        action="store_true",
        help="minimise torque instead of acceleration (so3; the problem gives an inertia)",
    )
    parser.add_argument(
        "--resolve",
        action="store_true",
        help="write the problem with its bodies, orbit and spacecraft replaced by directions, as"
        " JSON; solve nothing",
    )
    parser.add_argument(
        "--certificate-only",
        type=Path,
        metavar="PLAN",
        help="check an existing plan file against PROBLEM (without it: the problem that the plan"
        " itself states); solve nothing",
    )
    return parser


def _check_options(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    if options.problem is None and options.certificate_only is None and not options.warm_up:
        parser.error("a PROBLEM is required")
    if options.samples < 2:
        parser.error(f"--samples: expected at least 2, got {options.samples}")
    if options.jobs < 1:
        parser.error(f"--jobs: expected at least 1, got {options.jobs}")
    if options.certificate_only is not None and (options.output or options.plot or options.html):
        parser.error("--certificate-only writes nothing: leave out --output, --plot and --html")
    for option in ("plot", "html"):
        if _is_batch(options.problem) and getattr(options, option):
            parser.error(f"--{option} shows one plan: give it a single problem")
    if options.least_torque and (_is_batch(options.problem) or options.certificate_only):
        parser.error("--least-torque plans one problem: give it a single one, and nothing to check")
    if options.resolve and (options.plot or options.html or options.certificate_only):
        parser.error("--resolve writes the problem alone: leave out --plot, --html and the check")
    for path in (options.output, options.plot, options.html):
        if path is not None and not path.absolute().parent.is_dir():
            parser.error(f"{path}: there is no folder {path.parent}")


def _is_batch(path: Path | None) -> bool:
    return path is not None and path.suffix.lower() == ".jsonl"


def _run(options: argparse.Namespace) -> int:
    if options.warm_up:
        warm_up(notify=_say)
        if options.problem is None and options.certificate_only is None:
            return SOLVED
    if options.certificate_only is not None:
        lines, certified = check_files(options.certificate_only, options.problem)
        print("\n".join(lines))
        return SOLVED if certified else NO_TRAJECTORY
    if options.resolve:
        return _resolve(options)
    if _is_batch(options.problem):
        return _plan_batch(options)
    return _plan_one(options)


def _resolve(options: argparse.Namespace) -> int:
    lines = resolved_lines(options.problem)
    if options.output is None:
        for line in lines:
            print(line)
    else:
        with whole_file(options.output) as stream:
            stream.writelines(f"{line}\n" for line in lines)
    return SOLVED


def _plan_one(options: argparse.Namespace) -> int:
    with of_file(options.problem):
        stated = read_problem(options.problem)
    warm_up(notify=_say)
    with of_file(options.problem):
        plan = plan_problem(stated, options.samples, least_torque=options.least_torque)
    text = encoded(plan_document(plan)) + "\n"
    if options.output is None:
        sys.stdout.write(text)
        sys.stdout.flush()
    else:
        with whole_file(options.output) as stream:
            stream.write(text)
    if options.plot is not None and plan.trajectory is not None:
        # Loading Matplotlib takes half a second, which only a figure is worth.
        from riem_planner.plots.plots import plot_plan

        plot_plan(plan.problem, plan.trajectory, options.plot, plan.certificate)
    if options.html is not None:
        with whole_file(options.html) as stream:
            stream.write(_page(plan))
    _say(f"{options.problem}: {_summary(plan)}")
    if plan.solution.status.name in _WRONG:
        return WRONG_FILE
    return SOLVED if plan.certified else NO_TRAJECTORY


def _page(plan: Plan) -> str:
    from riem_planner.page import plan_page
    from riem_planner.version import __version__

    return plan_page(
        plan.problem, plan.solution, plan.trajectory, plan.certificate, version=__version__
    )


def _summary(plan: Plan) -> str:
    solution = plan.solution
    if plan.certificate is None or not plan.certified:
        return solution.message
    clearance = ", ".join(
        f"{name} {angle:.3g} deg" for name, angle in degrees(plan.certificate.clearance).items()
    )
    parts = [
        f"certified in {1e3 * solution.solve_time:.1f} ms",
        f"duration {plan.problem.duration:.6g} s",
        f"cost {solution.cost:.6g}",
        f"clearance {clearance}" if clearance else "no obstacles",
        *solution.notes,
    ]
    return "; ".join(parts)


def _plan_batch(options: argparse.Namespace) -> int:
    total = sum(1 for _ in batch.problem_lines(options.problem))
    if total == 0:
        raise InvalidProblemError(str(options.problem), "holds no problem: every line is blank")
    warm_up(notify=_say)
    if options.output is None:
        return _stream_batch(options, sys.stdout, total)
    try:
        with whole_file(options.output, keep_partial=True) as stream:
            return _stream_batch(options, stream, total)
    except KeyboardInterrupt:
        _say(f"interrupted; the plans so far are in {partial_path(options.output)}")
        return INTERRUPTED


def _stream_batch(options: argparse.Namespace, stream: TextIO, total: int) -> int:
    statuses: Counter[str] = Counter()
    lines = batch.problem_lines(options.problem)
    planned = batch.plan_lines(
        lines, samples=options.samples, jobs=options.jobs, folder=options.problem.parent
    )
    # Where nobody watches, a line in a log every ten seconds will do.
    interval = 0.1 if sys.stderr.isatty() else 10.0
    with tqdm(total=total, unit="plan", file=sys.stderr, mininterval=interval) as bar:
        for line in planned:
            stream.write(line.text + "\n")
            statuses[line.status] += 1
            bar.update()
    stream.flush()
    _say(", ".join(f"{count} {status}" for status, count in sorted(statuses.items())))
    if any(statuses[status] for status in _WRONG):
        return WRONG_FILE
    return SOLVED if statuses[Status.SOLVED.name] == total else NO_TRAJECTORY


def _say(message: str) -> None:
    """Tell a person; the standard output is for plans."""
    print(f"riem_plan: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
