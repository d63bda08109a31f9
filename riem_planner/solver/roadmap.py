"""Last resort: a shortest path over a grid of the whole space, where every smooth guess failed.

The grid lives on the unit sphere that the descent works on: S^2 for pointing, S^3 for attitudes,
where both quaternions of an attitude are points of their own, so that either way round is found.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from riem_planner.geometry import so3
from riem_planner.obstacles.potential import margins_along
from riem_planner.solver.setup import Setup
from riem_planner.solver.watch import Watch

Array = NDArray[np.float64]

NODES = 400
"""Intervals of the curves made from paths."""

_POINTS = {3: 41_253, 4: 60_000}  # a degree apart on S^2; 13 degrees of rotation on S^3
_REACH = {3: 1.6, 4: 1.7}  # of the mean spacing, within which points are joined
_DETOUR = 0.05  # rad: a margin at which an edge counts twice its length
_SMOOTHING = 5
_TIMES = (0.0, 0.25, 0.5, 0.75, 1.0)  # a moving obstacle is where it is at any of these


def roadmap_curves(setup: Setup, watch: Watch) -> tuple[Array, list[Array]]:
    """Curves along shortest paths through what is allowed.

    Returns
    -------
    times : (NODES + 1,)
    curves
        Attitudes (NODES + 1, 4), one for each way round that is open; none where the zones seal
        the goal off, as far as the grid can tell.
    """
    dimension = 3 if setup.pointing else 4
    points, pairs = _grid(dimension)
    watch.count(0)
    attitudes = _attitudes(points) if setup.pointing else points
    moving = bool(np.any(setup.table[:, 8:11] != 0.0))
    margins = np.min(
        [margins_along(setup.table, time, attitudes) for time in (_TIMES if moving else (0.0,))],
        axis=0,
    )
    watch.count(0)
    margin = np.minimum(margins[pairs[:, 0]], margins[pairs[:, 1]])
    tail, head = pairs[margin > 0.0].T
    margin = margin[margin > 0.0]
    length = np.linalg.norm(points[tail] - points[head], axis=1) * (1.0 + (_DETOUR / margin) ** 2)
    size = (points.shape[0],) * 2
    graph = coo_array((length, (tail, head)), shape=size).tocsr()
    start, goals = _ends(setup)
    free = np.where(margins > 0.0, 0.0, -4.0)
    begin = int(np.argmax(points @ start + free))
    _, before = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
    watch.count(0)
    times = np.linspace(0.0, 1.0, NODES + 1)
    curves = []
    for goal in goals:
        node = int(np.argmax(points @ goal + free))
        path = [goal]
        while node >= 0:
            path.append(points[node])
            node = int(before[node])
        if len(path) < 3 or not np.array_equal(path[-1], points[begin]):
            continue
        path.append(start)
        curves.append(_curve(setup, np.array(path[::-1]), times))
    return times, curves


def _ends(setup: Setup) -> tuple[Array, list[Array]]:
    if setup.pointing:
        start, goal = (so3.quaternion_to_matrix(end[:4])[:, 2] for end in (setup.start, setup.goal))
        return start, [goal]
    return setup.start[:4], [setup.goal[:4], -setup.goal[:4]]


def _attitudes(directions: Array) -> Array:
    """Some attitude (n, 4) for each direction (n, 3) of e3."""
    return so3.minimal_rotation(np.array([0.0, 0.0, 1.0]), directions)


def _curve(setup: Setup, path: Array, times: Array) -> Array:
    """Attitudes along a path of unit vectors, smoothed, at even speed."""
    for _ in range(_SMOOTHING):
        path[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
        path /= np.linalg.norm(path, axis=1)[:, None]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    x = np.stack([np.interp(times * along[-1], along, column) for column in path.T], axis=1)
    x /= np.linalg.norm(x, axis=1)[:, None]
    q = setup.lifted(_attitudes(x)) if setup.pointing else x
    q[0] = setup.start[:4]
    return setup.with_goal(np.ascontiguousarray(q))


@lru_cache(maxsize=2)
def _grid(dimension: int) -> tuple[Array, NDArray[np.int64]]:
    """Nearly even points (n, d) on the unit sphere of R^d, and pairs (m, 2) of neighbours."""
    n = _POINTS[dimension]
    s = np.arange(n) + 0.5
    if dimension == 3:
        z = 1.0 - 2.0 * s / n
        longitude = np.pi * (1.0 + np.sqrt(5.0)) * s
        radius = np.sqrt(1.0 - z * z)
        points = np.stack([radius * np.cos(longitude), radius * np.sin(longitude), z], axis=1)
        spacing = np.sqrt(4.0 * np.pi / n)
    else:
        # Super-Fibonacci spirals (Alexa, CVPR 2022), on all of S^3.
        phi, psi = np.sqrt(2.0), 1.533751168755204288118041
        inner, outer = np.sqrt(s / n), np.sqrt(1.0 - s / n)
        alpha, beta = 2.0 * np.pi * s / phi, 2.0 * np.pi * s / psi
        points = np.stack(
            [
                inner * np.sin(alpha),
                inner * np.cos(alpha),
                outer * np.sin(beta),
                outer * np.cos(beta),
            ],
            axis=1,
        )
        spacing = (2.0 * np.pi**2 / n) ** (1.0 / 3.0)
    pairs = cKDTree(points).query_pairs(_REACH[dimension] * spacing, output_type="ndarray")
    return points, pairs.astype(np.int64)
