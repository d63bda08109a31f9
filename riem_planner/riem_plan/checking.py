# SPDX-License-Identifier: Apache-2.0
"""The check of existing plan files: what `riem_plan --certificate-only` says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

from riem_planner.certificate import Certificate
from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_json
from riem_planner.files.plan_files import check_plan, parsed_plan, read_plan
from riem_planner.files.problem_files import parse_problem, read_problem
from riem_planner.files.section import of_file, within
from riem_planner.problem import Problem
from riem_planner.riem_plan.batch import problem_lines


def check_files(plan: Path, problem: Path | None) -> tuple[list[str], bool]:
    """Judge a plan file, or a `.jsonl` file of them, against its problem or problems.

    Parameters
    ----------
    plan
        The plan file; nothing that it says of itself is believed.
    problem
        The problem file; None for the problem that the plan itself states.

    Returns
    -------
    lines
        The verdict in words.
    certified
        Whether all of it is certified.

    Raises
    ------
    InvalidProblemError
        A file is wrong.
    """
    if plan.suffix.lower() != ".jsonl":
        stated: Problem | None = None
        if problem is not None:
            with of_file(problem):
                stated = read_problem(problem)
        with of_file(plan):
            return _check_one(str(plan), read_plan(plan), stated)
    lines: list[str] = []
    every = True
    for number, planned, stated in _pairs(plan, problem):
        with of_file(plan), within(f"line {number}"):
            document = parsed_plan(decoded(planned))
            words, certified = _check_one(f"{plan}, line {number}", document, stated)
        lines += words
        every = every and certified
    return lines, every


def _pairs(plan: Path, problem: Path | None) -> Iterator[tuple[int, bytes, Problem | None]]:
    if problem is None:
        yield from ((number, line, None) for number, line in problem_lines(plan))
        return
    for planned, line in zip_longest(problem_lines(plan), problem_lines(problem)):
        if planned is None or line is None:
            raise InvalidProblemError(str(plan), f"expected one plan for each line of {problem}")
        with of_file(problem), within(f"line {line[0]}"):
            stated = parse_problem(parse_json(decoded(line[1])), problem.parent)
        yield *planned, stated


def _check_one(
    title: str, document: dict[str, Any], stated: Problem | None
) -> tuple[list[str], bool]:
    if not document["times"]:
        return [f"{title}: holds no trajectory; its message: {document.get('message')}"], False
    if stated is None:
        if document.get("problem") is None:
            raise InvalidProblemError("problem", "missing; name the problem file as well")
        with within("problem"):
            stated = parse_problem(document["problem"])
    certificate, claims = check_plan(document, stated)
    faults = [*certificate.reasons, *claims]
    verdict = "not certified" if faults else "certified"
    return [f"{title}: {verdict}", *(f"  {text}" for text in faults), *_figures(certificate)], (
        not faults
    )


def _figures(certificate: Certificate) -> list[str]:
    attitude, rate = certificate.boundary_error
    lines = [
        f"  {name}: at least {math.degrees(angle):.6g} deg clear, least at"
        f" {certificate.least_clearance_times[name]:.6g} s"
        for name, angle in certificate.clearance.items()
    ]
    for name, part in certificate.limits_left.items():
        lines.append(f"  limits.{name}: {100.0 * part:.3g} % left")
    lines.append(f"  ends met to {attitude:.2g} rad and {rate:.2g} rad/s")
    lines.append(f"  rate below {certificate.rate_bound:.6g} rad/s throughout")
    return lines
