# SPDX-License-Identifier: Apache-2.0
"""Coverage-guided fuzzing of what is read from outside: `python -m trust.fuzz problem|plan|proof`.

It needs atheris, in an environment of its own (requirements-fuzz.txt): whatever the bytes, a reader
answers with a value or with the error that it promises, never with another one.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable


def problem(data: bytes) -> None:
    """A problem file, as YAML and as JSON."""
    from riem_planner.errors import InvalidProblemError
    from riem_planner.files.documents import decoded, parse_json, parse_yaml
    from riem_planner.files.problem_files import parse_problem

    for parse in (parse_json, parse_yaml):
        with contextlib.suppress(InvalidProblemError):
            parse_problem(parse(decoded(data)))


def plan(data: bytes) -> None:
    """A plan file."""
    from riem_planner.errors import InvalidProblemError
    from riem_planner.files.documents import decoded
    from riem_planner.files.plan_files import parsed_plan, planned_trajectory

    with contextlib.suppress(InvalidProblemError):
        planned_trajectory(parsed_plan(decoded(data)))


def proof(data: bytes) -> None:
    """A pair of files for the checker, parted by a zero byte."""
    from riem_planner.proof import check

    check.BUDGET = 50
    first, _, second = data.decode("utf-8", "replace").partition("\0")
    with contextlib.suppress(check.Verdict):
        check.examine(first, second)


READERS: dict[str, Callable[[bytes], None]] = {"problem": problem, "plan": plan, "proof": proof}


def main() -> int:
    """Run the command; the other arguments are libFuzzer's."""
    if len(sys.argv) < 2 or sys.argv[1] not in READERS:
        print(f"usage: python -m trust.fuzz {'|'.join(READERS)} [-max_total_time=SECONDS] ...")
        return 2
    import atheris

    reader = READERS[sys.argv.pop(1)]
    with atheris.instrument_imports(include=["riem_planner.files", "riem_planner.proof"]):
        reader(b"{}")
    atheris.Setup(sys.argv, reader)
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main())
