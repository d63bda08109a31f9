# SPDX-License-Identifier: Apache-2.0
"""The published manoeuvres, planned and flown in closed loop by the simulated spacecraft."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmark.report import Table
from riem_planner import certify, plan
from riem_planner.files.problem_files import read_problem
from riem_planner.simulation.dynamics import Spacecraft
from riem_planner.simulation.flight import fly

PROBLEMS = Path(__file__).resolve().parents[1] / "config/problems"


def flights() -> Table:
    """Tracking error and clearance, planned and achieved, of every published manoeuvre."""
    table = Table(
        "Published manoeuvres, flown",
        "At their published durations; setpoints at 10 Hz. Clearance of the closest zone.",
    )
    for path in sorted(PROBLEMS.glob("*.yaml")):
        problem = read_problem(path)
        limits = problem.limits
        spacecraft = Spacecraft(limits.inertia_matrix, limits.torque, limits.momentum)
        trajectory = plan(problem)
        flight = fly(trajectory, problem, spacecraft)
        closest = min(flight.clearance, key=lambda name: flight.clearance[name])
        planned = certify(trajectory, problem).clearance[closest]
        table.rows.append(
            {
                "manoeuvre": path.stem,
                "tracking error [deg]": float(np.degrees(flight.tracking_error)),
                "closest zone": closest,
                "planned [deg]": float(np.degrees(planned)),
                "achieved [deg]": float(np.degrees(flight.clearance[closest])),
            }
        )
    return table
