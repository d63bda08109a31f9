# SPDX-License-Identifier: Apache-2.0
"""The hard sets solved: what is certified, what is refused and why, what is wrong."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from benchmark.cases import Case, problem_of
from benchmark.cost import faults, trajectory_cost
from benchmark.hard_cases import SEALED, makers
from benchmark.report import Table
from riem_planner import Solution, solve

COST_OFF = 1e-6  # a cost told wrong by more, relative, is a wrong answer


@dataclass
class Outcome:
    """What became of one set.

    Attributes
    ----------
    seconds
        Time of each solve.
    refused
        Cases without a certified trajectory, each with the reason.
    wrong
        Cases whose answer claims to be right and is not, each with its faults.
    """

    seconds: list[float] = field(default_factory=list)
    refused: list[tuple[Case, str]] = field(default_factory=list)
    wrong: list[tuple[Case, str]] = field(default_factory=list)

    def row(self, name: str) -> dict[str, object]:
        """Row of a table."""
        count = len(self.seconds)
        reasons = Counter(reason.split(":")[0] for _, reason in self.refused)
        return {
            "set": name,
            "problems": count,
            "certified %": 100.0 * (count - len(self.refused)) / count,
            "wrong": len(self.wrong),
            "median ms": 1e3 * float(np.median(self.seconds)),
            "p99 ms": 1e3 * float(np.percentile(self.seconds, 99.0)),
            "worst ms": 1e3 * max(self.seconds),
            "refused": ", ".join(f"{r} {n}" for r, n in reasons.items()) or None,
        }


def judged(case: Case, solution: Solution) -> list[str]:
    """Faults of an answer that claims to be right."""
    problem = problem_of(case)
    if solution.trajectory is None:
        return ["claims to be solved, without a trajectory"]
    found = faults(problem, solution.trajectory)
    off = abs(trajectory_cost(problem, solution.trajectory) / solution.cost - 1.0)
    if not off <= COST_OFF:
        found.append(f"its cost is off by {off:.3g}")
    if case["name"].startswith(SEALED):
        found.append("there is no way to the goal")
    return found


def run(cases: list[Case], search: str = "global") -> Outcome:
    """Solve cases one by one."""
    outcome = Outcome()
    for case in cases:
        problem = problem_of(case)
        begin = time.perf_counter()
        solution = solve(problem, search=search)
        outcome.seconds.append(time.perf_counter() - begin)
        if not solution.solved:
            outcome.refused.append((case, f"{solution.status.name}: {solution.message}"))
        elif found := judged(case, solution):
            outcome.wrong.append((case, "; ".join(found)))
    return outcome


def hard(
    count: int, only: list[str] | None, told: Callable[[str, Outcome], None] | None = None
) -> Table:
    """One row a hard set; `told` is called after each."""
    table = Table(
        "Hard sets",
        f"{count} problems each from fixed seeds, all classes searched. `wrong`: answers that"
        " claim to be certified and are not, by dense sampling, or whose cost is off by more"
        f" than {COST_OFF:g}. Every problem of the sealed set must be refused.",
    )
    for name, make in makers().items():
        if only and name not in only:
            continue
        outcome = run([make(index) for index in range(count)])
        table.rows.append(outcome.row(name))
        if told is not None:
            told(name, outcome)
    return table
