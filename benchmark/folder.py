# SPDX-License-Identifier: Apache-2.0
"""A folder of case files planned as `riem_plan` does: what is certified, and at which cost.

Each line may state a `best_known_cost` or a `best_known_duration`; the excess over it is told.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmark.report import Table
from riem_planner import Problem
from riem_planner.files.plans import Plan
from riem_planner.files.problem_files import parse_problem
from riem_planner.riem_plan.planning import plan_problem

EQUAL = 1e-6  # of the best known, relative: no worse than it


class Answer(NamedTuple):
    """What became of one line.

    Attributes
    ----------
    name
        The line's.
    plan
        What came.
    excess
        Cost or duration over the best known, less 1; NaN where none is known or none came.
    seconds
        Processor time.
    """

    name: str
    plan: Plan
    excess: float
    seconds: float


def answers(path: Path, count: int) -> Iterator[Answer]:
    """Plan up to `count` lines of a file."""
    for line in path.read_text().splitlines()[:count]:
        case = json.loads(line)
        problem = parse_problem(case)
        begin = time.process_time()
        plan = plan_problem(problem)
        seconds = time.process_time() - begin
        yield Answer(case.get("name", ""), plan, _excess(case, problem, plan), seconds)


def _excess(case: dict[str, object], problem: Problem, plan: Plan) -> float:
    if plan.trajectory is None:
        return math.nan
    automatic = problem.has_auto_duration
    best = case.get("best_known_duration" if automatic else "best_known_cost")
    if not isinstance(best, float):
        return math.nan
    return (plan.trajectory.duration if automatic else plan.solution.cost) / best - 1.0


def case_files(path: Path, count: int, only: list[str] | None, verbose: bool) -> list[Table]:
    """One table of sets, and, if `verbose`, one of the lines that miss a bar."""
    sets = Table("Case files", f"At most {count} lines each, planned as `riem_plan` does.")
    missed = Table("Lines refused, or over the best known")
    for file in sorted(path.glob("*.jsonl")):
        if only and file.stem not in only:
            continue
        done = list(answers(file, count))
        sets.rows.append(_row(file.stem, done))
        for answer in done:
            if not answer.plan.certified or answer.excess > EQUAL:
                missed.rows.append(
                    {
                        "set": file.stem,
                        "name": answer.name,
                        "excess": answer.excess,
                        "ms": 1e3 * answer.seconds,
                        "message": "" if answer.plan.certified else answer.plan.solution.message,
                    }
                )
    return [sets, missed] if verbose else [sets]


def _row(name: str, done: list[Answer]) -> dict[str, object]:
    excess = np.array([a.excess for a in done if math.isfinite(a.excess)])
    seconds = [a.seconds for a in done]
    return {
        "set": name,
        "lines": len(done),
        "certified": sum(a.plan.certified for a in done),
        "converged": sum(a.plan.solution.converged for a in done),
        "at the best": int(np.sum(excess <= EQUAL)),
        "over 1 %": int(np.sum(excess > 0.01)),
        "worst": float(excess.max()) if excess.size else None,
        "lower": int(np.sum(excess < -EQUAL)),
        "median ms": 1e3 * float(np.median(seconds)),
        "worst ms": 1e3 * max(seconds),
    }
