# SPDX-License-Identifier: Apache-2.0
"""From a solution to the page: what is shown, as JSON, with the page's style and scripts."""

from __future__ import annotations

import html
import json
import math
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from riem_planner.certificate import Certificate, clearance_along
from riem_planner.geometry import so3
from riem_planner.obstacles import OrientationObstacle, Zone
from riem_planner.problem import Problem
from riem_planner.solution import Solution
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

MOST_BYTES = 1_000_000
"""The largest page; beyond, fewer samples are shown, and the page says so."""
_FEWEST = 26  # samples that a curve is shown with, however many alternatives there are
_PLACES = 201  # times at which the place of a moving zone is told
_SCRIPTS = ("view.js", "plots.js", "page.js")


def plan_page(
    problem: Problem,
    solution: Solution,
    trajectory: Trajectory | None = None,
    certificate: Certificate | None = None,
    *,
    version: str = "",
    proof: str = "",
) -> str:
    """The page of a plan, or of a problem that was refused.

    Parameters
    ----------
    problem
        What was planned; its zones are drawn.
    solution
        What came of it: message, alternatives.
    trajectory
        The plan as published; None if the problem was refused.
    certificate
        The verdict on that trajectory.
    version
        Of the planner, shown beside the certificate.
    proof
        The line of an independent check of the plan, if there was one.

    Returns
    -------
    str
        HTML of at most `MOST_BYTES` bytes that refers to nothing outside itself.
    """
    samples = 0 if trajectory is None else trajectory.times.size
    shown = samples
    while True:
        data = _data(problem, solution, trajectory, certificate, shown)
        data |= {"version": version, "proof": proof, "samples": samples, "shown": shown}
        page = _inlined(problem.name or "plan", data)
        if len(page.encode()) <= MOST_BYTES or shown <= _FEWEST:
            return page
        shown = max((shown + 1) // 2, _FEWEST)


def _inlined(title: str, data: dict[str, Any]) -> str:
    """The page with its parts; names from files enter it as JSON and as escaped text only."""
    folder = resources.files("riem_planner.page")

    def part(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    # `<` would let a name end the element; a separator of lines would end a line of script.
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "{{style}}": part("page.css"),
        "{{scripts}}": "\n".join(part(name) for name in _SCRIPTS),
        # What comes from files is put in last, the title before the data on the page: nothing in
        # either is taken for a placeholder.
        "{{data}}": text,
        "{{title}}": html.escape(title),
    }
    page = part("page.html")
    for placeholder, content in parts.items():
        page = page.replace(placeholder, content, 1)
    return page


def _data(
    problem: Problem,
    solution: Solution,
    trajectory: Trajectory | None,
    certificate: Certificate | None,
    samples: int,
) -> dict[str, Any]:
    duration = problem.duration if trajectory is None else trajectory.duration
    plans = []
    if trajectory is not None:
        clearance = {} if certificate is None else certificate.clearance
        plan = _curve(problem, trajectory, samples)
        plans.append({"label": "plan", **_figures(solution.cost, clearance), **plan})
        for index, other in enumerate(solution.alternatives, start=1):
            label = f"alternative {index}"
            curve = _curve(problem, other.trajectory.resampled(samples), samples)
            plans.append({"label": label, **_figures(other.cost, other.clearance), **curve})
    return {
        "name": problem.name,
        "space": problem.space.name,
        "boresight": problem.boresight.tolist(),
        "status": solution.status.name,
        "message": solution.message,
        "notes": list(solution.notes),
        "duration": duration if math.isfinite(duration) else 0.0,
        "start": problem.start.quaternion_xyzw.tolist(),
        "goal": problem.shown_arrival(_end(trajectory)).quaternion_xyzw.tolist(),
        "sets": [_forbidden(obstacle, duration) for obstacle in problem.obstacles],
        "wall": list(solution.wall),
        "limits": _limits(problem),
        "certificate": None if certificate is None else _verdict(certificate),
        "plans": plans,
    }


def _end(trajectory: Trajectory | None) -> NDArray[np.float64] | None:
    if trajectory is None:
        return None
    return so3.quaternion_to_matrix(trajectory.quaternions_xyzw[-1])


def _figures(cost: float, clearance: dict[str, float]) -> dict[str, Any]:
    return {
        "cost": cost if math.isfinite(cost) else None,
        "least": {name: math.degrees(angle) for name, angle in clearance.items()},
    }


def _curve(problem: Problem, trajectory: Trajectory, samples: int) -> dict[str, Any]:
    """Samples of a trajectory as in a plan file, and what is drawn over time."""
    if trajectory.times.size != samples:
        trajectory = trajectory.resampled(samples)
    v, a = trajectory.angular_velocities, trajectory.angular_accelerations
    margins = clearance_along(trajectory, problem, trajectory.times)
    drawn: dict[str, Any] = {
        "clearance": {name: _rounded(np.degrees(margin)) for name, margin in margins.items()},
    }
    if problem.limits is not None and problem.limits.inertia is not None:
        momentum = v @ problem.limits.inertia_matrix
        torque = a @ problem.limits.inertia_matrix + np.cross(v, momentum)
        drawn |= {"torque": _rounded(torque), "momentum": _rounded(momentum)}
    return {
        "times": trajectory.times.tolist(),
        "orientations": trajectory.quaternions_xyzw.tolist(),
        "rates": v.tolist(),
        "accelerations": a.tolist(),
        **drawn,
    }


def _rounded(values: Array) -> list[Any]:
    """Values to six digits, for curves of some hundred pixels; not finite ones as null."""
    if values.ndim > 1:
        return [_rounded(row) for row in values]
    return [float(f"{x:.6g}") if math.isfinite(x) else None for x in values.tolist()]


def _forbidden(obstacle: OrientationObstacle | Zone, duration: float) -> dict[str, Any]:
    """A zone with its places over time; of an orientation obstacle only its name and radius."""
    entry: dict[str, Any] = {"name": str(obstacle.name), "kind": obstacle.kind}
    if isinstance(obstacle, OrientationObstacle):
        return entry | {"set": str(obstacle.name), "radius_deg": math.degrees(obstacle.radius)}
    moves = obstacle.moves and math.isfinite(duration)
    times = np.linspace(0.0, duration, _PLACES) if moves else np.zeros(1)
    if obstacle.active:
        entry["active"] = [list(window) for window in obstacle.active]
    return entry | {
        "set": str(obstacle.name if obstacle.group is None else obstacle.group),
        "boresight": np.asarray(obstacle.boresight).tolist(),
        "times": _rounded(times),
        "directions": np.round(obstacle.direction_at(times), 7).tolist(),
        "half_angles": np.round(obstacle.radius_at(times), 7).tolist()
        if np.ndim(obstacle.half_angle)
        else [obstacle.half_angle],
    }


def _limits(problem: Problem) -> dict[str, Any]:
    limits = problem.limits
    if limits is None:
        return {}
    stated = {key: getattr(limits, key) for key in ("rate", "acceleration", "torque", "momentum")}
    return {key: np.asarray(v).tolist() for key, v in stated.items() if v is not None}


def _verdict(certificate: Certificate) -> dict[str, Any]:
    return {
        "certified": certificate.certified,
        "reasons": list(certificate.reasons),
        "clearance_deg": _degrees(certificate.clearance),
        "clearance_times": _finite(certificate.least_clearance_times),
        "limits_left": _finite(certificate.limits_left),
        "boundary_error": [float(x) for x in certificate.boundary_error],
        "rate_bound": certificate.rate_bound,
    }


def _degrees(angles: dict[str, float]) -> dict[str, float | None]:
    return _finite({name: math.degrees(angle) for name, angle in angles.items()})


def _finite(values: dict[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in values.items()}
