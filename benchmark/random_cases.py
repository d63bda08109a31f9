# SPDX-License-Identifier: Apache-2.0
"""Random problems drawn like those of the three case files, from seeds of one's own.

The distribution, read off the case files:

| quantity | SO(3) | S^2 | cones on SO(3) |
|---|---|---|---|
| duration T [s] | uniform 1 to 4 | same | same |
| tension | 0, 1 or 5 | same | same |
| angle of the slew [rad] | uniform 0.35 to 3 | 0.4 to 2.8 | 0.5 to 2.6 |
| end rates: half of them 0, half normal of deviation [rad/s] | 1.5 / T per axis | same | same |
| obstacles | 1 to 5 | 1 to 5 | 1 to 3 |
| place: on the straight slew at a fraction | 0 to 1 | 0.15 to 0.85 | 0.05 to 0.95 |
| and off it by [deg] | 2 to 30, any axis | 2 to 30, square to the arc | 2 to 30, any axis |
| strength | 10^-2 to 10^0.5, uniform in the logarithm | same | 10^-2 to 10^0.3 |
| no nearer to either end than [rad] | 0.04 | 0.1 | 0.15 |
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmark.cases import Case
from riem_planner.geometry import so3, sphere

Array = NDArray[np.float64]
Generator = np.random.Generator

RATE = 1.5  # standard deviation of one component of an end rate, times T [rad]


def random_quaternion(rng: Generator) -> Array:
    """Haar-random unit quaternion (4,)."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_direction(rng: Generator) -> Array:
    """Uniform unit vector (3,)."""
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


def random_rate(rng: Generator, duration: float) -> Array:
    """End rate (3,) [rad/s]: zero or normal, with equal chance."""
    rate = rng.normal(size=3) * RATE / duration
    return rate if rng.random() < 0.5 else np.zeros(3)


def random_strength(rng: Generator, top: float = 0.5) -> float:
    """Strength, uniform in its logarithm from 1e-2 to 10^top."""
    return float(10.0 ** rng.uniform(-2.0, top))


def so3_ends(rng: Generator, low: float = 0.35, high: float = 3.0) -> Case:
    """A case on SO(3) without obstacles: end states, duration, tension."""
    duration = float(rng.uniform(1.0, 4.0))
    start = random_quaternion(rng)
    turn = rng.uniform(low, high) * random_direction(rng)
    goal = so3.quaternion_multiply(start, so3.quaternion_exp(turn))
    return {
        "space": "so3",
        "duration": duration,
        "tension": float(rng.choice([0.0, 1.0, 5.0])),
        "start": _so3_state(start, random_rate(rng, duration)),
        "goal": _so3_state(goal, random_rate(rng, duration)),
        "obstacles": [],
    }


def s2_ends(rng: Generator, low: float = 0.4, high: float = 2.8) -> Case:
    """A case on S^2 without obstacles."""
    duration = float(rng.uniform(1.0, 4.0))
    start = random_direction(rng)
    square = np.cross(start, random_direction(rng))
    goal = sphere.exp(start, rng.uniform(low, high) * square / np.linalg.norm(square))
    goal = goal / np.linalg.norm(goal)
    return {
        "space": "s2",
        "duration": duration,
        "tension": float(rng.choice([0.0, 1.0, 5.0])),
        "start": _s2_state(start, random_rate(rng, duration)),
        "goal": _s2_state(goal, random_rate(rng, duration)),
        "obstacles": [],
    }


def _so3_state(quaternion: Array, rate: Array) -> Case:
    return {"orientation": quaternion.tolist(), "angular_velocity": rate.tolist()}


def _s2_state(direction: Array, velocity: Array) -> Case:
    tangent = velocity - (direction @ velocity) * direction
    return {"direction": direction.tolist(), "velocity": tangent.tolist()}


def straight_slew(case: Case, fraction: float) -> Array:
    """Quaternion (4,), or direction (3,) on S^2, at a fraction of the straight slew."""
    if case["space"] == "s2":
        turn = fraction * sphere_turn(case)
        return so3.exp(turn) @ np.array(case["start"]["direction"])
    start, goal = np.array(case["start"]["orientation"]), np.array(case["goal"]["orientation"])
    turn = so3.quaternion_log(so3.quaternion_multiply(so3.quaternion_conjugate(start), goal))
    return so3.quaternion_multiply(start, so3.quaternion_exp(fraction * turn))


def sphere_turn(case: Case) -> Array:
    """Rotation vector (3,) in the reference frame of the straight arc on S^2.

    Between opposite directions it is one of the many straight arcs.
    """
    start, goal = case["start"]["direction"], case["goal"]["direction"]
    return so3.quaternion_log(so3.minimal_rotation(start, goal))


def _off(rng: Generator) -> float:
    return float(np.radians(rng.uniform(2.0, 30.0)))


def orientation_obstacle(rng: Generator, case: Case) -> Case:
    """An orientation obstacle near the straight slew."""
    place = straight_slew(case, rng.uniform(0.0, 1.0))
    turn = so3.quaternion_exp(_off(rng) * random_direction(rng))
    quaternion = so3.quaternion_multiply(place, turn)
    return {
        "kind": "orientation",
        "orientation": quaternion.tolist(),
        "strength": random_strength(rng),
    }


def sphere_obstacle(rng: Generator, case: Case) -> Case:
    """A point obstacle on S^2 to one side of the straight arc."""
    place = straight_slew(case, rng.uniform(0.15, 0.85))
    turn = sphere_turn(case)
    side = turn / np.linalg.norm(turn) * rng.choice([-1.0, 1.0])
    return {
        "kind": "keep_out",
        "direction": sphere.exp(place, _off(rng) * side).tolist(),
        "half_angle_deg": 0.0,
        "strength": random_strength(rng),
    }


def cone_obstacle(rng: Generator, case: Case) -> Case:
    """A direction that a random body axis passes near on the straight slew."""
    boresight = random_direction(rng)
    attitude = so3.quaternion_to_matrix(straight_slew(case, rng.uniform(0.05, 0.95)))
    direction = attitude @ boresight
    square = np.cross(direction, random_direction(rng))
    offset = _off(rng) * square / np.linalg.norm(square)
    return {
        "kind": "keep_out",
        "boresight": boresight.tolist(),
        "direction": sphere.exp(direction, offset).tolist(),
        "half_angle_deg": 0.0,
        "strength": random_strength(rng, 0.3),
    }


def end_distance(case: Case, obstacle: Case) -> float:
    """Distance [rad] of an obstacle to the nearer end of the slew."""
    return min(float(_distance(case, obstacle, case[end])) for end in ("start", "goal"))


def _distance(case: Case, obstacle: Case, state: Case) -> Array:
    if obstacle["kind"] == "orientation":
        return so3.quaternion_distance(obstacle["orientation"], state["orientation"])
    if case["space"] == "s2":
        return sphere.angle(obstacle["direction"], state["direction"])
    attitude = so3.quaternion_to_matrix(state["orientation"])
    return sphere.angle(obstacle["direction"], attitude @ np.array(obstacle["boresight"]))


KINDS: dict[str, tuple[Callable[..., Case], Callable[..., Case], int, float]] = {
    "so3": (so3_ends, orientation_obstacle, 5, 0.04),
    "s2": (s2_ends, sphere_obstacle, 5, 0.1),
    "cones": (lambda rng: so3_ends(rng, 0.5, 2.6), cone_obstacle, 3, 0.15),
}
"""Of each kind of case: its ends, its obstacle, the most of those, their least end distance."""


def add_obstacles(rng: Generator, case: Case, kind: str, count: int) -> Case:
    """The case with `count` obstacles of a kind that leave its ends free."""
    _, draw, _, least = KINDS[kind]
    while len(case["obstacles"]) < count:
        obstacle = draw(rng, case)
        if end_distance(case, obstacle) > least:
            case["obstacles"].append({"name": f"o{len(case['obstacles']) + 1}", **obstacle})
    return case


def random_case(kind: str, seed: int, index: int, count: int | None = None) -> Case:
    """Case `index` of a seed; `count` obstacles, or a random number of them."""
    rng = np.random.default_rng([seed, index])
    ends, _, most, _ = KINDS[kind]
    case = {"name": f"{kind}-{seed}-{index}", **ends(rng)}
    return add_obstacles(rng, case, kind, count or int(rng.integers(1, most + 1)))


def random_cases(kind: str, seed: int, count: int) -> list[Case]:
    """The first `count` cases of a seed."""
    return [random_case(kind, seed, index) for index in range(count)]
