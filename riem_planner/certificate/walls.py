# SPDX-License-Identifier: Apache-2.0
"""Walls: closed chains of zones between the start and the goal, which prove that no path exists.

Where neighbouring caps of one boresight overlap, the arc between their centres is forbidden. A
closed chain of such arcs that a way from the start to the goal crosses an odd number of times
parts the sphere with the start on one side and the goal on the other: closed curves on a sphere
meet an even number of times. `riem_planner.proof.check` proves a wall in ball arithmetic.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import sphere
from riem_planner.obstacles import Zone

if TYPE_CHECKING:
    from riem_planner.problem import Problem

Array = NDArray[np.float64]

_LEAST_ZONES = 3  # of a wall
_OVERLAP = 1e-12  # rad that neighbours overlap by at least, so that rounding decides nothing
_ANTIPODAL = 1e-6  # rad from pi, within which the arc between two centres is not determined
_DEGENERATE = 1e-12  # triple product below which three points count as lying on one great circle
# A way from the start to the goal leads over one of these, the first that no arc touches.
_VIAS = np.array([[3.0, 5.0, -7.0], [-5.0, 2.0, 3.0], [2.0, -7.0, -1.0]])


class _Caps(NamedTuple):
    """What the fixed single zones of one boresight forbid: caps about centres."""

    boresight: Array
    names: list[str]
    centres: Array
    angles: Array


def find_wall(problem: Problem) -> tuple[str, ...]:
    """Names of zones that part the start from the goal; empty where none are found.

    Only single zones that stay where they are and keep their size count, and only those of one
    boresight together. Nothing is found for several goals, nor for one that moves or leaves the
    boresight's direction free.

    Returns
    -------
    tuple of str
        At least three names, neighbours overlapping, the last with the first.
    """
    if len(problem.goals) != 1 or problem.goals[0].moves:
        return ()
    roll_axis = problem.roll_axis
    for caps in _caps(problem):
        if roll_axis is not None and not np.array_equal(roll_axis, caps.boresight):
            continue
        start = problem.start.orientation @ caps.boresight
        goal = problem.arrival.orientation @ caps.boresight
        chain = _parting_chain(caps, start, goal)
        if chain:
            return tuple(caps.names[i] for i in chain)
    return ()


def _caps(problem: Problem) -> list[_Caps]:
    """Caps by boresight, where there are enough for a wall."""
    by_boresight: dict[bytes, list[Zone]] = {}
    for zone in problem.forbidden.obstacles:
        if isinstance(zone, Zone) and _stays(zone):
            by_boresight.setdefault(np.asarray(zone.boresight).tobytes(), []).append(zone)
    return [
        _Caps(
            np.asarray(zones[0].boresight),
            [str(zone.name) for zone in zones],
            np.array([np.asarray(z.direction) * (1 if _out(z) else -1) for z in zones]),
            np.array([float(z.half_angle) if _out(z) else np.pi - z.half_angle for z in zones]),
        )
        for zones in by_boresight.values()
        if len(zones) >= _LEAST_ZONES
    ]


def _out(zone: Zone) -> bool:
    return zone.kind == "keep_out"


def _stays(zone: Zone) -> bool:
    """Whether a zone is there alone, at all times, at one place and of one size."""
    fixed = isinstance(zone.direction, np.ndarray) and isinstance(zone.half_angle, float)
    return fixed and zone.group is None and not np.any(zone.rate) and not _has_windows(zone)


def _has_windows(zone: Zone) -> bool:
    return bool(getattr(zone, "active", ()))


def _parting_chain(caps: _Caps, start: Array, goal: Array) -> list[int]:
    """Shortest closed chain of overlapping caps that a way crosses an odd number of times."""
    neighbours = _neighbours(caps)
    if sum(map(len, neighbours)) < 2 * _LEAST_ZONES:
        return []
    for via in _VIAS:
        way = (start, via / np.linalg.norm(via), goal)
        odd = _crossings(caps.centres, neighbours, way)
        if odd is not None:
            chains = (_closed_walk(neighbours, odd, i) for i in range(len(neighbours)))
            found = [chain for chain in chains if len(chain) >= _LEAST_ZONES]
            return min(found, key=len, default=[])
    return []


def _neighbours(caps: _Caps) -> list[list[int]]:
    """Indices of the caps that each one overlaps."""
    angle = sphere.angle(caps.centres[:, None], caps.centres[None])
    overlap = angle <= caps.angles[:, None] + caps.angles[None] - _OVERLAP
    overlap &= (angle < np.pi - _ANTIPODAL) & (angle > _ANTIPODAL)
    return [np.flatnonzero(row).tolist() for row in overlap]


def _crossings(
    centres: Array, neighbours: list[list[int]], way: tuple[Array, Array, Array]
) -> dict[tuple[int, int], int] | None:
    """Parity of the crossings of a way with each arc; None if one can't be told."""
    arcs = [(i, j) for i, others in enumerate(neighbours) for j in others if i < j]
    c, d = (centres[list(side)] for side in zip(*arcs, strict=True))
    parity = np.zeros(len(arcs), dtype=int)
    for a, b in ((way[0], way[1]), (way[1], way[2])):
        crossed = _crosses(a, b, c, d)
        if crossed is None:
            return None
        parity ^= crossed
    odd = dict(zip(arcs, parity.tolist(), strict=True))
    return odd | {(j, i): value for (i, j), value in odd.items()}


def _crosses(a: Array, b: Array, c: Array, d: Array) -> NDArray[np.bool_] | None:
    """Whether the arc ab of the sphere crosses arcs cd (n, 3); None where rounding would decide.

    It does where the triangles acb, cbd, bda and dac have one orientation.
    """
    turns = np.array(
        [
            np.sum(sphere.cross(*np.broadcast_arrays(x, y)) * z, axis=-1)
            for x, y, z in ((a, c, b), (c, b, d), (b, d, a), (d, a, c))
        ]
    )
    left, right = turns > _DEGENERATE, turns < -_DEGENERATE
    apart = left.any(axis=0) & right.any(axis=0)
    together: NDArray[np.bool_] = np.asarray(left.all(axis=0) | right.all(axis=0))
    return together if np.all(apart | together) else None


def _closed_walk(
    neighbours: list[list[int]], odd: dict[tuple[int, int], int], first: int
) -> list[int]:
    """Shortest walk from a cap back to itself over an odd number of crossings."""
    before: dict[tuple[int, int], tuple[int, int]] = {}
    queue = deque([(first, 0)])
    seen = {(first, 0)}
    while queue:
        here = queue.popleft()
        if here == (first, 1):
            chain = []
            while here != (first, 0):
                here = before[here]
                chain.append(here[0])
            return chain[::-1]
        for other in neighbours[here[0]]:
            there = (other, here[1] ^ odd[here[0], other])
            if there not in seen:
                seen.add(there)
                before[there] = here
                queue.append(there)
    return []
