# SPDX-License-Identifier: Apache-2.0
"""The published manoeuvres, planned by us and flown by Basilisk's spacecraft."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmark.basilisk.measures import between_samples, disagreement, effort, margins
from benchmark.basilisk.plant import STEP, Craft, fly
from benchmark.basilisk.reference import streamed
from benchmark.report import Table
from riem_planner import Problem, certify, plan
from riem_planner.files.problem_files import read_problem
from riem_planner.geometry import so3

PROBLEMS = Path(__file__).resolve().parents[2] / "config/problems"

HOLD = 20.0  # s at rest after the end, so that a lag at the end is seen
TRACKING_BAR = 0.05  # degrees
AGREEMENT_BAR = 1e-9  # rad, between boreAngCalc's angles and ours

# Jackson's source has four wheels; the others fly with one along each body axis.
_SINE, _COSINE = np.sin(np.radians(15.0)), np.cos(np.radians(15.0))
_WHEELS = {
    "jackson_tracy_manchester_keepout": np.array(
        [
            [_COSINE, _SINE, 0.0],
            [0.0, -_SINE, _COSINE],
            [-_COSINE, _SINE, 0.0],
            [0.0, -_SINE, -_COSINE],
        ]
    ),
}


def craft_of(problem: Problem) -> Craft:
    """What flies a published manoeuvre, by the limits that it states."""
    limits = problem.limits
    torque, momentum = (float(np.ravel(value)[0]) for value in (limits.torque, limits.momentum))
    wheels = _WHEELS.get(problem.name, np.eye(3))
    return Craft(limits.inertia_matrix, wheels, torque, momentum)


def published() -> tuple[list[Table], list[str]]:
    """Tables of the flights and of their clearances, and the bars that they miss."""
    flights = Table(
        "The published manoeuvres, flown by Basilisk's spacecraft",
        "Tracking error: largest angle between the true and the planned attitude. u is the torque"
        f" of the wheels on the body, until {HOLD:g} s after the end.",
    )
    zones = Table(
        "Clearance per zone",
        "Planned: certified. Achieved: of the true attitudes, lowered by what may lie between two"
        f" samples {STEP:g} s apart. boreAngCalc: largest difference of its angles from ours.",
    )
    missed: list[str] = []
    for path in sorted(PROBLEMS.glob("*.yaml")):
        missed += _flown(read_problem(path), flights, zones)
    return [flights, zones], missed


def _flown(problem: Problem, flights: Table, zones: Table) -> list[str]:
    """Fly one manoeuvre, add its rows, and name the bars that it misses."""
    trajectory = plan(problem)
    planned = certify(trajectory, problem).clearance
    flown = fly(craft_of(problem), problem, streamed(trajectory, STEP, hold=HOLD))
    wanted = trajectory.evaluate_quaternion(np.minimum(flown.times, trajectory.duration))[0]
    error = float(np.degrees(np.max(so3.quaternion_distance(flown.quaternions, wanted))))
    spent = effort(flown.torques, STEP)
    apart = disagreement(problem, flown.quaternions, flown.zone_angles)
    flights.rows.append(
        {
            "manoeuvre": problem.name,
            "duration [s]": trajectory.duration,
            "tracking error [deg]": error,
            "peak wheel torque [N m]": float(np.max(np.abs(flown.wheel_torques))),
            "∫\\|u\\| dt [N m s]": spent.norm,
            "∫\\|u\\|² dt [(N m)² s]": spent.square,
            "boreAngCalc [deg]": float(np.degrees(apart)),
        }
    )
    slack = between_samples(flown.rates, STEP)
    achieved = {
        name: margin - slack for name, margin in margins(problem, flown.quaternions).items()
    }
    for name, margin in achieved.items():
        zones.rows.append(
            {
                "manoeuvre": problem.name,
                "zone": name,
                "planned [deg]": float(np.degrees(planned[name])),
                "achieved [deg]": float(np.degrees(margin)),
            }
        )
    missed = [f"{problem.name}: {name} is entered" for name in achieved if achieved[name] <= 0.0]
    if error >= TRACKING_BAR:
        missed.append(f"{problem.name}: the tracking error is {error:.3g} degrees")
    if apart >= AGREEMENT_BAR:
        missed.append(f"{problem.name}: boreAngCalc's angles differ from ours by {apart:.3g} rad")
    return missed
