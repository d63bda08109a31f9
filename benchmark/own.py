# SPDX-License-Identifier: Apache-2.0
"""What is measured of the planner alone: speed, warm starts, scaling, throughput."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark import random_cases as draw
from benchmark.cases import Case, problem_of
from benchmark.cost import trajectory_cost
from benchmark.report import Table
from benchmark.timing import Method, Timed, interleaved
from riem_planner import Problem, Solution, Trajectory, solve, solve_many
from riem_planner.geometry import so3, sphere

Array = NDArray[np.float64]

REFERENCE_TOLERANCE = 1e-11
BEST = 1e-6  # a cost this near, relative, is the best known one
_STEP = np.radians(1.0)  # how far a goal or an obstacle moves before a warm re-solve


def share(truths: list[bool]) -> float:
    """Per cent."""
    return 100.0 * float(np.mean(truths)) if truths else float("nan")


def distance(problem: Problem, first: Array, second: Array) -> float:
    """Largest angle [rad] between attitudes (m, 4), on S^2 between their boresights."""
    if problem.space.name == "so3":
        return float(so3.quaternion_distance(first, second).max())
    b = problem.boresight
    x, y = (so3.quaternion_to_matrix(q) @ b for q in (first, second))
    return float(sphere.angle(x, y).max())


def references(problems: list[Problem]) -> list[Trajectory | None]:
    """Converged trajectories, None where there is none."""
    return [solve(problem, tolerance=REFERENCE_TOLERANCE).trajectory for problem in problems]


def true_error(problem: Problem, answer: Trajectory, reference: Trajectory | None) -> float:
    """Distance [rad] to the converged trajectory of the same class; NaN if there is none."""
    same = solve(problem, tolerance=REFERENCE_TOLERANCE, warm_start=answer, search="local")
    converged = same.trajectory if same.trajectory is not None else reference
    if converged is None:
        return float("nan")
    times = np.linspace(0.0, problem.duration, 1001)
    return distance(
        problem, answer.evaluate_quaternion(times)[0], converged.evaluate_quaternion(times)[0]
    )


def at_best(case: Case, solution: Solution) -> bool:
    """Whether a solution costs at most the best known cost times (1 + BEST)."""
    return solution.solved and solution.cost <= case["best_known_cost"] * (1.0 + BEST)


def speed(sets: dict[str, list[Case]], rounds: int) -> Table:
    """Both searches on whole sets."""
    table = Table(
        "The planner on whole sets",
        "`true error`: largest distance over time to the same extremal solved to 1e-11, its 99th"
        " percentile over the problems; `cost off` the largest relative difference between the"
        " cost told and the cost of the published trajectory by quadrature.",
    )
    for name, cases in sets.items():
        problems = [problem_of(case) for case in cases]
        methods = [
            Method(search, [partial(solve, p, search=search) for p in problems], rounds)
            for search in ("local", "global")
        ]
        for timed in interleaved(methods):
            table.rows.append(_speed_row(name, cases, problems, timed))
    return table


def _speed_row(
    name: str, cases: list[Case], problems: list[Problem], timed: Timed
) -> dict[str, Any]:
    answers: list[Solution] = timed.values
    pairs = [(p, s.trajectory, s.cost) for p, s in zip(problems, answers, strict=True)]
    solved = [(p, t, c) for p, t, c in pairs if t is not None]
    errors = [true_error(p, t, None) for p, t, _ in solved]
    offs = [abs(trajectory_cost(p, t) / c - 1.0) for p, t, c in solved]
    best = [at_best(c, s) for c, s in zip(cases, answers, strict=True)]
    return {
        "set": name,
        "search": timed.name,
        "problems": len(cases),
        "certified %": share([s.solved for s in answers]),
        "at best cost %": share(best),
        "median ms": timed.median,
        "p99 ms": timed.p99,
        "true error rad": float(np.nanpercentile(errors, 99.0)) if errors else None,
        "cost off": max(offs, default=None),
    }


def moved(case: Case, what: str, seed: int) -> Case:
    """The case with its goal, or one of its obstacles, moved by 1 degree."""
    rng = np.random.default_rng(seed)
    turn = _STEP * draw.random_direction(rng)
    changed = {**case, "goal": dict(case["goal"]), "obstacles": [*case["obstacles"]]}
    if what == "goal":
        target = changed["goal"]
    else:
        chosen = int(rng.integers(len(case["obstacles"])))
        target = changed["obstacles"][chosen] = dict(case["obstacles"][chosen])
    if "orientation" in target:
        target["orientation"] = so3.quaternion_multiply(
            target["orientation"], so3.quaternion_exp(turn)
        ).tolist()
        return changed
    # The part of the turn along the direction would not move it.
    direction = np.array(target["direction"])
    square = np.cross(direction, turn)
    rotation = so3.exp(_STEP * square / np.linalg.norm(square))
    target["direction"] = (rotation @ direction).tolist()
    if "velocity" in target:
        target["velocity"] = (rotation @ np.array(target["velocity"])).tolist()
    return changed


def warm(cases: list[Case], rounds: int) -> Table:
    """Re-solve from the flying trajectory after a goal or an obstacle has moved."""
    table = Table(
        "Warm re-solve, moved by 1 degree",
        "`same or better %`: cost at most that of a cold solve of one class.",
    )
    for what in ("obstacle", "goal"):
        jobs, cold = [], []
        for seed, case in enumerate(cases):
            flying = solve(problem_of(case)).trajectory
            if flying is None:
                continue
            problem = problem_of(moved(case, what, seed))
            jobs.append(partial(solve, problem, warm_start=flying, search="local"))
            cold.append(solve(problem, search="local"))
        (timed,) = interleaved([Method(what, jobs, rounds)])
        same = [
            (s.solved and s.cost <= c.cost * (1.0 + BEST)) or not c.solved
            for s, c in zip(timed.values, cold, strict=True)
        ]
        table.rows.append(
            {
                "moved": what,
                "problems": len(jobs),
                "certified %": share([s.solved for s in timed.values]),
                "same or better %": share(same),
                "median ms": timed.median,
                "p99 ms": timed.p99,
            }
        )
    return table


def scaling(counts: tuple[int, ...], problems: int, rounds: int) -> Table:
    """Time against the number of obstacles."""
    table = Table("Number of obstacles", "Random SO(3) problems, obstacles about the slew.")
    for count in counts:
        cases = [draw.random_case("so3", 11, index, count) for index in range(problems)]
        stated = [problem_of(case) for case in cases]
        methods = [
            Method(search, [partial(solve, p, search=search) for p in stated], rounds)
            for search in ("local", "global")
        ]
        local, wide = interleaved(methods)
        table.rows.append(
            {
                "obstacles": count,
                "certified %": share([s.solved for s in local.values]),
                "local median ms": local.median,
                "local p99 ms": local.p99,
                "global median ms": wide.median,
                "global p99 ms": wide.p99,
            }
        )
    return table


def throughput(cases: list[Case], rounds: int) -> Table:
    """Problems a second of one core through `solve_many`."""
    table = Table("Throughput of one core", "`solve_many` with one job.")
    problems = [problem_of(case) for case in cases]
    for search in ("local", "global"):
        solve_many(problems[:2], jobs=1, search=search)
        seconds = []
        for _ in range(rounds):
            begin = time.perf_counter()
            solve_many(problems, jobs=1, search=search)
            seconds.append(time.perf_counter() - begin)
        table.rows.append(
            {
                "search": search,
                "problems": len(problems),
                "problems/s": len(problems) / float(np.median(seconds)),
            }
        )
    return table
