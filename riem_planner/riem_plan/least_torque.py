# SPDX-License-Identifier: Apache-2.0
"""The cheapest path by torque among those that a solve found."""

from __future__ import annotations

import math
import time
from dataclasses import replace

from riem_planner.errors import InvalidProblemError
from riem_planner.problem import LEAST_TIME, Problem
from riem_planner.solution import Solution


def check_least_torque(problem: Problem) -> None:
    """Refuse a problem whose torque can't be minimised, before it is solved.

    Raises
    ------
    InvalidProblemError
        The space is not so3, there is no inertia, or time is to be least.
    """
    if problem.objective == LEAST_TIME:
        raise InvalidProblemError(
            "objective",
            f"{LEAST_TIME} and --least-torque ask for different curves; leave out one of them",
        )
    if problem.space.name != "so3":
        raise InvalidProblemError("space", "--least-torque needs so3: on s2 the roll is free")
    if problem.limits is None or problem.limits.inertia is None:
        raise InvalidProblemError("inertia", "missing; --least-torque needs it, beside limits")


def with_least_torque(problem: Problem, solution: Solution) -> Solution:
    """The solution with each of its trajectories refined, the cheapest by torque first.

    Where the certificate refuses them all, the solution as it was; a note says so.

    Parameters
    ----------
    problem
        With the duration that was found.
    solution
        Solved.
    """
    from riem_planner.torque import refine_torque  # slow to load, and seldom needed

    begin = time.monotonic()
    paths = [solution.trajectory, *(other.trajectory for other in solution.alternatives)]
    every = [refine_torque(path, problem) for path in paths if path is not None]
    certified = [found for found in every if found.solved]
    if not certified:
        why = "; ".join(every[0].certificate.reasons)
        note = f"least torque was refused ({why}): this is the path of least acceleration"
        return replace(solution, notes=(*solution.notes, note))
    best = min(certified, key=lambda found: found.cost)
    note = (
        f"least torque: int |u|^2 dt {best.effort:.6g} N^2 m^2 s, by least acceleration"
        f" {every[0].effort_before:.6g}; the cost is that of torque; first-order residual"
        f" {best.first_order_residual:.1e}"
    )
    return replace(
        solution,
        trajectory=best.trajectory,
        certificate=best.certificate,
        cost=best.cost,
        trajectory_error=math.nan,
        cost_error=math.nan,
        local_minimum=best.local_minimum,
        alternatives=(),
        iterations=solution.iterations + sum(found.iterations for found in every),
        solve_time=solution.solve_time + time.monotonic() - begin,
        notes=(*solution.notes, note),
    )
