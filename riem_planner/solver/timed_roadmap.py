# SPDX-License-Identifier: Apache-2.0
"""Last resort where something moves: a cheapest path over a grid of space and time.

A door that opens later is passed when it is open: each point of the grid is allowed at just the
layers of time at which no zone is there. From layer to layer the path goes to a neighbour or
stays; it pays for its speed squared, and for nearness to an edge (dynamic programming).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from riem_planner.obstacles.potential import margins_along
from riem_planner.solver.roadmap import NODES, attitudes_of, curve_at, ends_of, sphere_points
from riem_planner.solver.setup import Setup
from riem_planner.solver.watch import Watch

Array = NDArray[np.float64]

_POINTS = {3: 10_000, 4: 40_000}
_NEIGHBOURS = {3: 64, 4: 60}  # the point itself included
_LAYERS = {3: 120, 4: 60}
_NEAR = 0.05  # rad: a margin at which a layer costs as much as to move at `_PACE`
_PACE = 1.0  # rad in the whole time
_SMOOTHING = 3


def timed_curves(setup: Setup, watch: Watch) -> tuple[Array, list[Array]]:
    """Curves along cheapest paths through what is allowed at its time.

    Returns
    -------
    times : (NODES + 1,)
    curves
        Attitudes (NODES + 1, 4), one for each way round that is open.
    """
    dimension = 3 if setup.pointing else 4
    points, neighbours, squares = _net(dimension)
    layers = _LAYERS[dimension]
    attitudes = attitudes_of(setup, points)
    start, goals = ends_of(setup)
    free = np.where(margins_along(setup.table, 0.0, attitudes) > 0.0, 0.0, -4.0)
    cost = np.full(points.shape[0], np.inf)
    cost[np.argmax(points @ start + free)] = 0.0
    choices = np.empty((layers, points.shape[0]), dtype=np.int8)
    margins = np.empty(points.shape[0])
    for layer in range(layers):
        watch.count(0)
        margins = margins_along(setup.table, (layer + 1) / layers, attitudes)
        ways = cost[neighbours] + layers * squares
        choices[layer] = np.argmin(ways, axis=1)
        cost = np.take_along_axis(ways, choices[layer, :, None].astype(np.int64), axis=1)[:, 0]
        near = np.maximum(margins, 1e-3)
        cost = np.where(margins > 0.0, cost + (_PACE * _NEAR / near) ** 2 / layers, np.inf)
    times = np.linspace(0.0, 1.0, NODES + 1)
    found = []
    for goal in goals:
        node = int(np.argmax(points @ goal + np.where(margins > 0.0, 0.0, -4.0)))
        if np.isfinite(cost[node]):
            path = points[_traced(choices, neighbours, node)]
            path[0], path[-1] = start, goal
            found.append(_curve(setup, path, times))
    return times, found


def _traced(choices: NDArray[np.int8], neighbours: NDArray[np.int64], node: int) -> list[int]:
    """Points from the first layer to a node of the last one."""
    path = [node]
    for choice in choices[::-1]:
        path.append(int(neighbours[path[-1], choice[path[-1]]]))
    return path[::-1]


def _curve(setup: Setup, path: Array, times: Array) -> Array:
    """Attitudes along a path of unit vectors at even times, smoothed."""
    for _ in range(_SMOOTHING):
        path[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
        path /= np.linalg.norm(path, axis=1)[:, None]
    return curve_at(setup, np.linspace(0.0, 1.0, path.shape[0]), path, times)


@lru_cache(maxsize=2)
def _net(dimension: int) -> tuple[Array, NDArray[np.int64], Array]:
    """Points (n, d), the nearest points to each (n, m), and their squared angles (n, m)."""
    points, _ = sphere_points(dimension, _POINTS[dimension])
    chords, neighbours = cKDTree(points).query(points, k=_NEIGHBOURS[dimension])
    scale = 1.0 if dimension == 3 else 2.0  # rotations turn twice as far as quaternions
    squares = (scale * 2.0 * np.arcsin(0.5 * chords)) ** 2
    return points, neighbours.astype(np.int64), squares
