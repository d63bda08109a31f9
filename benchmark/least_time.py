# SPDX-License-Identifier: Apache-2.0
"""One slew in least acceleration and in least time, and the price of smooth ends."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmark.report import Table
from riem_planner import Solution, Trajectory, solve
from riem_planner.files.problem_files import read_problem

SLEW = Path(__file__).parent.parent / "config" / "problems" / "bevo2_case2.yaml"
JERKS = (0.1, 0.03, 0.01)  # rad/s^3

_TIMES = 20_001


def effort(trajectory: Trajectory) -> float:
    """`int |a|^2 dt` [rad^2/s^3]."""
    times = np.linspace(0.0, trajectory.duration, _TIMES)
    a = trajectory.evaluate(times)[2]
    return float(np.trapezoid(np.sum(a * a, axis=1), times))


def largest_jerk(trajectory: Trajectory) -> float:
    """The greatest change of acceleration from sample to sample, over the time [rad/s^3]."""
    changes = np.diff(trajectory.angular_accelerations, axis=0)
    return float(np.max(np.linalg.norm(changes, axis=1) / np.diff(trajectory.times)))


def least_time() -> Table:
    """The table of `docs/least-time.md`."""
    stated = read_problem(SLEW)
    table = Table(
        "Least time",
        f"`{SLEW.name}` within the torque and the momentum of its wheels; 201 samples.",
    )
    assert stated.limits is not None  # the file has them
    first: float | None = None
    for name, jerk, objective in _asked():
        limits = replace(stated.limits, jerk=jerk)
        problem = replace(stated, duration=np.inf, limits=limits, objective=objective)
        solution = solve(problem)
        first = first or _duration(solution)
        table.rows.append(_row(name, solution, first))
    return table


def _asked() -> list[tuple[str, float | None, str]]:
    asked: list[tuple[str, float | None, str]] = [
        ("least acceleration (`auto`)", None, "least_acceleration"),
        ("least time", None, "least_time"),
    ]
    return asked + [(f"least time, jerk {jerk:g}", jerk, "least_time") for jerk in JERKS]


def _duration(solution: Solution) -> float:
    assert solution.trajectory is not None, solution.message
    return solution.trajectory.duration


def _row(name: str, solution: Solution, first: float) -> dict[str, str]:
    trajectory = solution.trajectory
    assert trajectory is not None, solution.message
    ends = trajectory.angular_accelerations[[0, -1]]
    clearance = min(solution.certificate.clearance.values()) if solution.certificate else np.nan
    return {
        "plan": name,
        "duration [s]": f"{trajectory.duration:.1f}",
        "of the first": f"{trajectory.duration / first:.3f}",
        "effort [1e-3 rad^2/s^3]": f"{1e3 * effort(trajectory):.2f}",
        "jerk [rad/s^3]": f"{largest_jerk(trajectory):.3f}",
        "acceleration at the ends [rad/s^2]": f"{np.linalg.norm(ends, axis=1).max():.4f}",
        "clearance [deg]": f"{np.degrees(clearance):.3f}",
        "solve [ms]": f"{1e3 * solution.solve_time:.0f}",
    }
