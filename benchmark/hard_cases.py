# SPDX-License-Identifier: Apache-2.0
"""The hard sets: problems that planners are known to fail on, from fixed seeds.

| set | what is hard |
|---|---|
| haar | orientation obstacles anywhere: paths pass their cut locus, 180 degrees away |
| strength x10, x100, x0.001 | the random SO(3) problems with other strengths |
| slew 179.5, slew 180 | the long way is as short as the short way, or nearly (a third on S^2) |
| on the path | an obstacle exactly on the straight slew: a saddle (SO(3), S^2 and cones in turn) |
| rates x5 | the random SO(3) problems, both end rates five times as large and none zero |
| 50 obstacles | the random SO(3) problems with 50 obstacles about the slew |
| zones 60 % | keep-out zones over 60 % of S^2, of those that a 1 degree grid connects |
| sealed | the goal is ringed by zones: to be refused |
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from benchmark import random_cases as draw
from benchmark.cases import Case
from riem_planner.geometry import so3, sphere

Array = NDArray[np.float64]

SEED = 20261122
SEALED = "sealed"

GRID_POINTS = 41253  # square degrees of the sphere: neighbours are about 1 degree apart
GRID_REACH = np.radians(1.5)
ZONE_COVER = 0.6
ZONE_HALF_ANGLES = (10.0, 35.0)  # degrees
ZONE_STRENGTH = 0.01  # normalised: the default of zones
ZONE_END_MARGIN = np.radians(1.0)


def _named(name: str, index: int, case: Case) -> Case:
    return {**case, "name": f"{name}-{index}"}


def _generator(salt: int, index: int) -> np.random.Generator:
    return np.random.default_rng([SEED, salt, index])


def haar(index: int) -> Case:
    """One to five Haar-random orientation obstacles."""
    rng = _generator(1, index)
    case = draw.so3_ends(rng)
    count = int(rng.integers(1, 6))
    while len(case["obstacles"]) < count:
        obstacle = {
            "name": f"o{len(case['obstacles']) + 1}",
            "kind": "orientation",
            "orientation": draw.random_quaternion(rng).tolist(),
            "strength": draw.random_strength(rng),
        }
        if draw.end_distance(case, obstacle) > 0.04:
            case["obstacles"].append(obstacle)
    return _named("haar", index, case)


def strength(factor: float) -> Callable[[int], Case]:
    """Random SO(3) problems with all strengths times a factor."""

    def make(index: int) -> Case:
        case = draw.random_case("so3", SEED, index)
        for obstacle in case["obstacles"]:
            obstacle["strength"] *= factor
        return _named(f"strength-x{factor:g}", index, case)

    return make


def slew(degrees: float) -> Callable[[int], Case]:
    """Slews of one angle; every third on S^2."""

    def make(index: int) -> Case:
        rng = _generator(2, index)
        angle, kind = np.radians(degrees), "s2" if index % 3 == 2 else "so3"
        case = draw.KINDS[kind][0](rng, angle, angle)
        if degrees == 180.0:
            _make_opposite(rng, case)
        return _named(
            f"slew-{degrees:g}", index, draw.add_obstacles(rng, case, kind, rng.integers(1, 6))
        )

    return make


def _make_opposite(rng: np.random.Generator, case: Case) -> None:
    """Replace the goal by one at exactly 180 degrees."""
    if case["space"] == "s2":
        case["goal"]["direction"] = [-x for x in case["start"]["direction"]]
        velocity, start = np.array(case["goal"]["velocity"]), case["start"]["direction"]
        tangent = velocity - (velocity @ start) * np.array(start)
        case["goal"]["velocity"] = tangent.tolist()
    else:
        half_turn = np.append(draw.random_direction(rng), 0.0)
        start = case["start"]["orientation"]
        case["goal"]["orientation"] = so3.quaternion_multiply(start, half_turn).tolist()


def on_path(index: int) -> Case:
    """An obstacle exactly on the straight slew, and up to two others; half start at rest."""
    rng = _generator(3, index)
    kind = ("so3", "s2", "cones")[index % 3]
    ends, make, _, _ = draw.KINDS[kind]
    case = ends(rng)
    if index % 2 == 0:
        key = "velocity" if kind == "s2" else "angular_velocity"
        case["start"][key] = case["goal"][key] = [0.0, 0.0, 0.0]
    obstacle = make(rng, case)
    place = draw.straight_slew(case, rng.uniform(0.2, 0.8))
    if kind == "so3":
        obstacle["orientation"] = place.tolist()
    elif kind == "s2":
        obstacle["direction"] = place.tolist()
    else:
        _put_cone_on_path(rng, case, obstacle, place)
    case["obstacles"] = [{"name": "o1", **obstacle}]
    count = 1 + int(rng.integers(0, 3))
    return _named("on-path", index, draw.add_obstacles(rng, case, kind, count))


def _put_cone_on_path(rng: np.random.Generator, case: Case, obstacle: Case, place: Array) -> None:
    """Let a body axis that keeps clear of it at both ends meet its direction on the way."""
    while True:
        boresight = draw.random_direction(rng)
        obstacle["boresight"] = boresight.tolist()
        obstacle["direction"] = (so3.quaternion_to_matrix(place) @ boresight).tolist()
        if draw.end_distance(case, obstacle) > 0.1:
            return


def rates(factor: float) -> Callable[[int], Case]:
    """Random SO(3) problems with end rates times a factor, none of them zero."""

    def make(index: int) -> Case:
        rng = _generator(4, index)
        case = draw.random_case("so3", SEED, index)
        for end in ("start", "goal"):
            rate = rng.normal(size=3) * draw.RATE / case["duration"]
            case[end]["angular_velocity"] = (factor * rate).tolist()
        return _named(f"rates-x{factor:g}", index, case)

    return make


def many_obstacles(count: int) -> Callable[[int], Case]:
    """Random SO(3) problems with a given number of obstacles."""

    def make(index: int) -> Case:
        return _named(f"obstacles-{count}", index, draw.random_case("so3", SEED, index, count))

    return make


def _grid() -> Array:
    """Fibonacci grid (GRID_POINTS, 3) on the sphere."""
    i = np.arange(GRID_POINTS) + 0.5
    z = 1.0 - 2.0 * i / GRID_POINTS
    longitude = np.pi * (1.0 + np.sqrt(5.0)) * i
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(longitude), radius * np.sin(longitude), z], axis=-1)


class SphereGrid:
    """A 1 degree grid of the sphere, for what zones leave free and what hangs together."""

    def __init__(self) -> None:
        self.points = _grid()
        self.tree = cKDTree(self.points)
        self.pairs = self.tree.query_pairs(2.0 * np.sin(GRID_REACH / 2.0), output_type="ndarray")

    def covered(self, zones: list[Case]) -> NDArray[np.bool_]:
        """Which points are in a zone."""
        inside = np.zeros(len(self.points), dtype=bool)
        for zone in zones:
            cosine = np.cos(np.radians(zone["half_angle_deg"]))
            inside |= self.points @ np.array(zone["direction"]) >= cosine
        return inside

    def connects(self, zones: list[Case], start: Array, goal: Array) -> bool:
        """Whether free points join the two directions."""
        free = ~self.covered(zones)
        a, b = self.pairs[free[self.pairs].all(axis=1)].T
        graph = coo_array((np.ones(len(a), dtype=bool), (a, b)), shape=(len(free), len(free)))
        labels = connected_components(graph, directed=False)[1]
        nearest = [np.flatnonzero(free)[self._nearest(free, x)] for x in (start, goal)]
        return bool(labels[nearest[0]] == labels[nearest[1]])

    def _nearest(self, free: NDArray[np.bool_], x: Array) -> int:
        return int(np.argmax(self.points[free] @ x))


def zones(grid: SphereGrid) -> Callable[[int], Case]:
    """Keep-out zones over 60 % of S^2 that the grid finds a way through."""

    def make(index: int) -> Case:
        rng = _generator(5, index)
        while True:
            case = draw.s2_ends(rng)
            case["obstacles"] = _cover(rng, case, grid)
            start, goal = case["start"]["direction"], case["goal"]["direction"]
            if grid.connects(case["obstacles"], np.array(start), np.array(goal)):
                return _named("zones-60", index, case)

    return make


def _cover(rng: np.random.Generator, case: Case, grid: SphereGrid) -> list[Case]:
    cover: list[Case] = []
    while grid.covered(cover).mean() < ZONE_COVER:
        zone = {
            "name": f"z{len(cover) + 1}",
            "kind": "keep_out",
            "direction": draw.random_direction(rng).tolist(),
            "half_angle_deg": float(rng.uniform(*ZONE_HALF_ANGLES)),
            "normalized_strength": ZONE_STRENGTH,
        }
        margin = draw.end_distance(case, zone) - np.radians(zone["half_angle_deg"])
        if margin > ZONE_END_MARGIN:
            cover.append(zone)
    return cover


def sealed(index: int) -> Case:
    """A goal ringed by twelve overlapping zones of 12 degrees at 30 degrees from it."""
    rng = _generator(6, index)
    case = draw.s2_ends(rng, np.radians(60.0), 2.8)
    goal = np.array(case["goal"]["direction"])
    across = sphere.log(goal, np.array(case["start"]["direction"]))
    across = across / np.linalg.norm(across)
    for k in range(12):
        turned = so3.exp(2.0 * np.pi * k / 12 * goal) @ across
        case["obstacles"].append(
            {
                "name": f"z{k + 1}",
                "kind": "keep_out",
                "direction": sphere.exp(goal, np.radians(30.0) * turned).tolist(),
                "half_angle_deg": 12.0,
                "normalized_strength": ZONE_STRENGTH,
            }
        )
    return _named(SEALED, index, case)


def makers() -> dict[str, Callable[[int], Case]]:
    """Of each hard set, the function that makes its case of an index."""
    return {
        "haar": haar,
        "strength x10": strength(10.0),
        "strength x100": strength(100.0),
        "strength x0.001": strength(1e-3),
        "slew 179.5": slew(179.5),
        "slew 180": slew(180.0),
        "on the path": on_path,
        "rates x5": rates(5.0),
        "50 obstacles": many_obstacles(50),
        "zones 60 %": zones(SphereGrid()),
        SEALED: sealed,
    }
