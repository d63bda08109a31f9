# SPDX-License-Identifier: Apache-2.0
"""The planner beside its peers, on the same problems in the same run."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark import own
from benchmark.cases import Case, problem_of
from benchmark.cost import clearances, cost_of, trajectory_cost
from benchmark.peers import PeerResult, shooting
from benchmark.peers.collocation import Collocation
from benchmark.report import Table
from benchmark.timing import Method, Timed, interleaved
from riem_planner import Problem, Solution, Trajectory, solve

Array = NDArray[np.float64]

OURS = "riem_planner, one class"
AT_BEST = 1e-3  # a discretised answer this near, relative, has found the best extremal

NO_CASADI = "CasADi is not installed (requirements-bench.txt): its rows are missing."


def _methods(problems: list[Problem], rounds: int, structures: set[str]) -> list[Method]:
    """Ours and the peers; compiled IPOPT only for problems of the given structures."""
    quick = max(1, rounds // 5)
    methods = [
        Method(OURS, [partial(solve, p, search="local") for p in problems], rounds),
        Method("riem_planner, all classes", [partial(solve, p) for p in problems], rounds),
    ]
    for tolerance in (1e-3, 1e-6):
        jobs = [partial(_collocation, p, tolerance) for p in problems]
        methods.append(Method(f"SciPy solve_bvp, tol {tolerance:g}", jobs, quick))
    if not shooting.available():
        return methods
    for intervals in (50, 200):
        programs = [shooting.Shooting(p, intervals) for p in problems]
        name = f"CasADi + IPOPT, N = {intervals}"
        methods.append(Method(name, [s.solve for s in programs], quick))
    compiled = [p for p in problems if shooting.structure(p) in structures]
    if compiled:
        programs = [shooting.Shooting(p, 50, compiled=True) for p in compiled]
        methods.append(
            Method("CasADi + IPOPT, N = 50, compiled C", [s.solve for s in programs], quick)
        )
    return methods


def _collocation(problem: Problem, tolerance: float) -> PeerResult:
    return Collocation(problem).solve(tolerance)


def _error(problem: Problem, answer: Any, reference: Trajectory) -> tuple[float, float]:
    """Cost, and distance [rad] to the reference, of a solution or a peer's result."""
    times = np.linspace(0.0, problem.duration, 1001)
    exact = reference.evaluate_quaternion(times)[0]
    if isinstance(answer, Solution):
        if answer.trajectory is None:
            return float("inf"), float("nan")
        q = answer.trajectory.evaluate_quaternion(times)[0]
        return trajectory_cost(problem, answer.trajectory), own.distance(problem, q, exact)
    if not answer.success:
        return float("inf"), float("nan")
    q = answer.curve(times)[0]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    gaps = clearances(problem, q, times)
    if (gaps.size and gaps.min() <= 0.0) or _misses_goal(problem, q[-1]):
        return float("inf"), float("nan")
    return cost_of(problem, answer.curve, answer.mesh), own.distance(problem, q, exact)


def _misses_goal(problem: Problem, quaternion: Array) -> bool:
    goal = problem.goal.quaternion_xyzw
    return own.distance(problem, quaternion[None], goal[None]) > 1e-3


def _row(timed: Timed, kept: list[tuple[Case, Problem, Trajectory]], ours: Timed) -> dict[str, Any]:
    found = []
    for (case, problem, reference), answer in zip(kept, timed.values, strict=True):
        cost, error = _error(problem, answer, reference)
        found.append((cost / case["best_known_cost"] - 1.0, error))
    best = [excess <= AT_BEST for excess, _ in found]
    errors = [error for (_, error), right in zip(found, best, strict=True) if right]
    return {
        "method": timed.name,
        "problems": len(kept),
        "at best cost %": own.share(best),
        "median ms": timed.median,
        "p99 ms": timed.p99,
        "error rad, median": float(np.median(errors)) if errors else None,
        "error rad, worst": max(errors, default=None),
        "times ours": timed.median / ours.median,
    }


def comparison(name: str, cases: list[Case], rounds: int, structures: set[str]) -> Table:
    """One table of all methods on one set."""
    table = Table(
        f"Beside the peers: {name}",
        "`error`: distance over time to the extremal solved to 1e-11, of the answers at the best"
        f" cost (within {AT_BEST:g}, relative); `times ours`: ratio of the medians to the first"
        " row's on the same problems.",
    )
    if not shooting.available():
        table.note += f" {NO_CASADI}"
    problems = [problem_of(case) for case in cases]
    solved = [
        (case, problem, reference)
        for case, problem, reference in zip(cases, problems, own.references(problems), strict=True)
        if reference is not None
    ]
    kept = [problem for _, problem, _ in solved]
    timings = interleaved(_methods(kept, rounds, structures))
    for timed in timings:
        if len(timed.values) == len(kept):
            table.rows.append(_row(timed, solved, timings[0]))
            continue
        some = [i for i, p in enumerate(kept) if shooting.structure(p) in structures]
        ours = Timed(OURS, timings[0].seconds[some], [])
        table.rows.append(_row(timed, [solved[i] for i in some], ours))
    return table
