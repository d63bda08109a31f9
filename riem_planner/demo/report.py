# SPDX-License-Identifier: Apache-2.0
"""What the demonstration says: the plan, and planned beside achieved clearance."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from riem_planner.certificate import certify
from riem_planner.demo.listener import Flown
from riem_planner.geometry import so3
from riem_planner.plots.straight import straight_slew
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

ACHIEVED = "achieved"


def headline(problem: Problem, trajectory: Trajectory, values: Mapping[str, str]) -> str:
    """What was planned, from the values of its status, and whether it is certified here."""
    certificate = certify(trajectory, problem)
    angle = math.degrees(
        float(so3.distance(problem.start.orientation, problem.shown_arrival().orientation))
    )
    verdict = "certified" if certificate.certified else "; ".join(certificate.reasons)
    return (
        f"a turn by {angle:.1f} deg in {trajectory.duration:g} s, cost"
        f" {values.get('cost', '?')} rad^2/s^3, solved in {values.get('solve_time_ms', '?')} ms\n"
        f"checked here, from the messages: {verdict}"
    )


def achieved_clearance(problem: Problem, flown: Flown) -> dict[str, float]:
    """Least distance [rad] to each forbidden set over the attitudes that were told."""
    least: dict[str, float] = {}
    attitudes = so3.quaternion_to_matrix(flown.quaternions)
    for time, attitude in zip(flown.times, attitudes, strict=True):
        for name, margin in problem.margins(attitude, float(time)).items():
            least[name] = min(least.get(name, math.inf), margin)
    return least


def tracking_error(trajectory: Trajectory, flown: Flown) -> float:
    """Largest angle [rad] between an attitude that was told and the plan at its time."""
    planned = trajectory.evaluate_quaternion(flown.times)[0]
    return float(np.max(so3.quaternion_distance(flown.quaternions, planned)))


def clearance_table(problem: Problem, trajectory: Trajectory, flown: Flown | None) -> str:
    """Clearance per zone: planned, achieved where something flew, and of the straight slew."""
    columns = {"planned": certify(trajectory, problem).clearance}
    if flown is not None and flown.times.size:
        columns[ACHIEVED] = achieved_clearance(problem, flown)
    columns["straight slew"] = certify(straight_slew(problem), problem).clearance
    rows = [f"{'clearance [deg]':24}" + "".join(f"{title:>15}" for title in columns)]
    for name in columns["planned"]:
        figures = (math.degrees(column[name]) for column in columns.values())
        rows.append(f"{name:24}" + "".join(f"{figure:15.2f}" for figure in figures))
    if flown is not None and flown.times.size:
        error = math.degrees(tracking_error(trajectory, flown))
        rows.append(
            f"tracking error at most {error:.2g} deg in {flown.times.size} states, until"
            f" {flown.times[-1]:.1f} s of {trajectory.duration:g} s"
        )
    return "\n".join(rows)
