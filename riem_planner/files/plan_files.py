# SPDX-License-Identifier: Apache-2.0
"""Plan files: what `riem_plan` writes, and the check of one that exists.

Between its evenly spaced samples a plan means the quintic Hermite interpolant of `Trajectory`.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from riem_planner.certificate import Certificate, certify
from riem_planner.errors import InvalidProblemError
from riem_planner.files.documents import decoded, parse_json
from riem_planner.files.plans import Plan, with_duration_of
from riem_planner.files.problem_writing import problem_document
from riem_planner.files.section import shown, within
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

_CLAIM_TOLERANCE_DEG = 1e-6  # rounding of degrees in the file
_SAMPLES = ("times", "orientations_xyzw", "angular_velocities", "angular_accelerations")


def plan_document(plan: Plan) -> dict[str, Any]:
    """Document of a plan; without a certified trajectory its samples are empty."""
    solution, certificate = plan.solution, plan.certificate
    document: dict[str, Any] = {
        "name": plan.problem.name,
        "status": solution.status.name,
        "message": solution.message,
        "certified": plan.certified,
        "cost": solution.cost if plan.certified else None,
        "duration": plan.problem.duration,
        "clearance_deg": {},
        "local_minimum": solution.local_minimum,
        "iterations": solution.iterations,
        "solve_time_s": solution.solve_time,
        "trajectory_error": solution.trajectory_error,
        "cost_error": solution.cost_error,
        "notes": list(solution.notes),
        "alternatives": [
            {"cost": other.cost, "clearance_deg": degrees(other.clearance)}
            for other in solution.alternatives
        ],
    }
    if plan.certified and certificate is not None:
        document["clearance_deg"] = degrees(certificate.clearance)
        document["least_clearance_time"] = certificate.least_clearance_times
        document["boundary_error"] = list(certificate.boundary_error)
        document["rate_bound"] = certificate.rate_bound
        document["limits_left"] = certificate.limits_left
    if not plan.certified:
        document["wall"] = list(solution.wall)
    if solution.goal_index is not None:
        document["goal_index"] = solution.goal_index
    if solution.level:
        document["level"] = solution.level
        document["least_possible_duration"] = solution.least_possible_duration
    document["problem"] = problem_document(plan.stated or plan.problem)
    document.update(_samples(plan.trajectory))
    if plan.hold is not None and plan.trajectory is not None:
        document["hold"] = _samples(plan.hold, plan.trajectory.duration)
    return document


def refused_document(name: str | None, status: str, message: str) -> dict[str, Any]:
    """Document of a plan that there is not, because its problem could not even be read."""
    document: dict[str, Any] = dict.fromkeys(
        ("cost", "duration", "local_minimum", "trajectory_error", "cost_error", "problem")
    )
    document |= {"name": name, "status": status, "message": message, "certified": False}
    document |= {"clearance_deg": {}, "iterations": 0, "solve_time_s": 0.0, "wall": []}
    return document | {"notes": [], "alternatives": []} | _samples(None)


def encoded(document: dict[str, Any]) -> str:
    """One line of JSON; what is not a finite number is null."""
    # A trajectory's samples are finite already; they are most of the numbers.
    plain = {key: v if key in _SAMPLES else _finite(v) for key, v in document.items()}
    return json.dumps(plain, allow_nan=False)


def degrees(angles: dict[str, float]) -> dict[str, float]:
    """The same angles in degrees."""
    return {name: math.degrees(angle) for name, angle in angles.items()}


def _samples(trajectory: Trajectory | None, begin: float = 0.0) -> dict[str, list[Any]]:
    if trajectory is None:
        return {name: [] for name in _SAMPLES}
    values = (
        begin + trajectory.times,
        trajectory.quaternions_xyzw,
        trajectory.angular_velocities,
        trajectory.angular_accelerations,
    )
    return {name: array.tolist() for name, array in zip(_SAMPLES, values, strict=True)}


def _finite(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return value


def read_plan(path: Path) -> dict[str, Any]:
    """Document of a plan file.

    Raises
    ------
    InvalidProblemError
        It is no plan file.
    """
    return parsed_plan(decoded(path.read_bytes()))


def parsed_plan(text: str) -> dict[str, Any]:
    """Document of the text of a plan; raises as `read_plan`."""
    document = parse_json(text)
    if not isinstance(document, dict):
        raise InvalidProblemError("plan", f"expected a mapping, got {shown(document)}")
    for name in _SAMPLES:
        if not isinstance(document.get(name), list):
            raise InvalidProblemError(name, "missing; this is no file that riem_plan wrote")
    return document


def planned_trajectory(document: dict[str, Any]) -> Trajectory | None:
    """Trajectory that a plan's document means; None if it holds none.

    Raises
    ------
    InvalidProblemError
        Its samples are no trajectory.
    """
    return _trajectory_of(document) if document["times"] else None


def planned_hold(document: dict[str, Any]) -> Trajectory | None:
    """The hold of a plan's document, its time counted from the arrival; None if it has none.

    Raises
    ------
    InvalidProblemError
        Its samples are no trajectory.
    """
    hold = document.get("hold")
    if hold is None:
        return None
    if not isinstance(hold, dict) or any(name not in hold for name in _SAMPLES):
        raise InvalidProblemError("hold", f"expected the samples {', '.join(_SAMPLES)}")
    with within("hold"):
        return _trajectory_of(hold, float(document["times"][-1]))


def _trajectory_of(document: dict[str, Any], begin: float = 0.0) -> Trajectory:
    arrays = []
    for name in _SAMPLES:
        try:
            arrays.append(np.array(document[name], dtype=float))
        except (TypeError, ValueError, OverflowError):
            raise InvalidProblemError(name, "expected rows of numbers of one length") from None
    times, *values = arrays
    return Trajectory(times - begin, *values)


def check_plan(document: dict[str, Any], problem: Problem) -> tuple[Certificate, list[str]]:
    """Certificate of the trajectory in a plan's document, and what it claims beyond that.

    Parameters
    ----------
    document
        A plan with a trajectory.
    problem
        What it has to solve; with `duration: auto` the plan's duration is taken.

    Returns
    -------
    certificate
        Verdict on the samples, whatever the file says of itself.
    claims
        Sentences for each claim of the file that the certificate does not bear out.
    """
    trajectory = planned_trajectory(document)
    if trajectory is None:
        raise InvalidProblemError("times", "the plan holds no trajectory")
    timed = with_duration_of(problem, trajectory)
    hold = planned_hold(document)
    if hold is None and timed.hold > 0.0:
        raise InvalidProblemError("hold", f"missing; the problem asks for {timed.hold:g} s of it")
    certificate = certify(trajectory, timed, hold=hold)
    return certificate, _unproven_claims(document, certificate)


def _unproven_claims(document: dict[str, Any], certificate: Certificate) -> list[str]:
    claimed = document.get("clearance_deg")
    if not isinstance(claimed, dict):
        return ["clearance_deg: expected the clearance by name"]
    claims = []
    proven = degrees(certificate.clearance)
    for name, value in claimed.items():
        if name not in proven:
            claims.append(f"clearance_deg.{name}: the problem has no such zone")
        elif not isinstance(value, int | float) or value > proven[name] + _CLAIM_TOLERANCE_DEG:
            claims.append(
                f"clearance_deg.{name}: claims {shown(value)}, proven are {proven[name]:.6g}"
            )
    return claims
