# SPDX-License-Identifier: Apache-2.0
"""Cases: problems in the form of problem files, one a line, and where this room keeps them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from riem_planner import S2, SO3, OrientationObstacle, Problem, State, Zone

Case = dict[str, Any]
"""One problem as a problem file states it; `best_known_cost` is beside it where it is known."""

DATA = Path(__file__).parent / "data"

SETS = ("textbook", "random-so3", "random-s2", "random-cones")


def load(name: str) -> list[Case]:
    """Cases of one of the `SETS`, or of a `.jsonl` file."""
    path = Path(name) if name.endswith(".jsonl") else DATA / f"{name}.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines() if line.strip()]


def save(cases: list[Case], path: Path) -> None:
    """Write cases one a line."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(case) + "\n" for case in cases))


def problem_of(case: Case) -> Problem:
    """The problem that a case states."""
    boresight = case.get("boresight", [1.0, 0.0, 0.0])
    on_sphere = case["space"] == "s2"
    return Problem(
        start=_state(case["start"], boresight, on_sphere),
        goal=_state(case["goal"], boresight, on_sphere),
        duration=case["duration"],
        space=S2 if on_sphere else SO3,
        tension=case.get("tension", 0.0),
        obstacles=tuple(_obstacle(obstacle) for obstacle in case["obstacles"]),
        boresight=boresight,
        name=case["name"],
    )


def _state(state: Case, boresight: list[float], on_sphere: bool) -> State:
    if on_sphere:
        velocity = state.get("velocity", (0.0, 0.0, 0.0))
        return State.from_direction(state["direction"], velocity, boresight)
    return State.from_quaternion_xyzw(
        state["orientation"], state.get("angular_velocity", (0.0, 0.0, 0.0))
    )


def _obstacle(obstacle: Case) -> OrientationObstacle | Zone:
    strengths = {
        key: obstacle[key] for key in ("strength", "normalized_strength") if key in obstacle
    }
    if obstacle["kind"] == "orientation":
        state = State.from_quaternion_xyzw(obstacle["orientation"])
        return OrientationObstacle(
            state.orientation,
            radius=math.radians(obstacle.get("radius_deg", 0.0)),
            name=obstacle.get("name"),
            **strengths,
        )
    return Zone(
        obstacle["direction"],
        math.radians(obstacle["half_angle_deg"]),
        boresight=obstacle.get("boresight"),
        kind=obstacle["kind"],
        group=obstacle.get("group"),
        name=obstacle.get("name"),
        **strengths,
    )
