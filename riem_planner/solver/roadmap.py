# SPDX-License-Identifier: Apache-2.0
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
from riem_planner.obstacles.table import (
    BORESIGHT,
    KEEP_IN,
    KIND,
    PATH,
    PLACE,
    RADIUS,
    obstacle_rows,
)
from riem_planner.solver.setup import Setup
from riem_planner.solver.watch import Watch

Array = NDArray[np.float64]

NODES = 400
"""Intervals of the curves made from paths."""

_POINTS = {3: 41_253, 4: 60_000}  # a degree apart on S^2; 13 degrees of rotation on S^3
_REACH = {3: 1.6, 4: 1.7}  # of the mean spacing, within which points are joined
_DETOUR = 0.05  # rad: a margin at which an edge counts twice its length
_SMOOTHING = 5
_IN_A_MEMBER, _NEAREST = 8_000, 14  # points in each keep-in zone; neighbours of each point


def roadmap_curves(setup: Setup, watch: Watch) -> tuple[Array, list[Array]]:
    """Curves along shortest paths through what is allowed.

    Returns
    -------
    times : (NODES + 1,)
    curves
        Attitudes (NODES + 1, 4), one for each way round that is open; none where the zones seal
        the goal off, as far as the grid can tell.
    """
    points, pairs, margins = _allowed(setup, watch)
    times = np.linspace(0.0, 1.0, NODES + 1)
    if not pairs.size:
        return times, []
    tail, head = pairs.T
    margin = np.minimum(margins[tail], margins[head])
    length = np.linalg.norm(points[tail] - points[head], axis=1) * (1.0 + (_DETOUR / margin) ** 2)
    size = (points.shape[0],) * 2
    graph = coo_array((length, (tail, head)), shape=size).tocsr()
    start, goals = ends_of(setup)
    begin = int(np.argmax(points @ start))
    _, before = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
    watch.count(0)
    curves = []
    for goal in goals:
        node = int(np.argmax(points @ goal))
        path = [goal]
        while node >= 0:
            path.append(points[node])
            node = int(before[node])
        if len(path) < 3 or not np.array_equal(path[-1], points[begin]):
            continue
        path.append(start)
        curves.append(_curve(setup, np.array(path[::-1]), times))
    return times, curves


def _allowed(setup: Setup, watch: Watch) -> tuple[Array, NDArray[np.int64], Array]:
    """Allowed points (n, d) of the grid, pairs (m, 2) of neighbours, and margins (n,) [rad].

    Where attitudes are kept in a group, which may leave tubes that the grid does not see, more
    points lie in its members.
    """
    points, pairs = _grid(3 if setup.pointing else 4)
    watch.count(0)
    inside = [] if setup.pointing else _inside_members(setup.table)
    points = np.concatenate([points, *inside])
    margins = margins_along(setup.table, 0.0, attitudes_of(setup, points))
    free = margins > 0.0
    watch.count(0)
    if not inside:
        pairs = (np.cumsum(free) - 1)[pairs[free[pairs].all(axis=1)]]
        return points[free], pairs, margins[free]
    points, margins = points[free], margins[free]
    if points.shape[0] <= _NEAREST:
        return points, np.empty((0, 2), dtype=np.int64), margins
    nearest = cKDTree(points).query(points, k=_NEAREST + 1)[1][:, 1:]
    pairs = np.column_stack([np.repeat(np.arange(points.shape[0]), _NEAREST), nearest.ravel()])
    middles = points[pairs[:, 0]] + points[pairs[:, 1]]
    middles /= np.linalg.norm(middles, axis=1)[:, None]
    pairs = pairs[margins_along(setup.table, 0.0, middles) > 0.0]
    watch.count(0)
    return points, pairs, margins


def _inside_members(table: Array) -> list[Array]:
    """Quaternions (n, 4), of both signs, spread evenly over each keep-in zone."""
    k = np.arange(1, _IN_A_MEMBER + 1)[:, None]
    # The sequence of least discrepancy in three dimensions by powers of the plastic number.
    u = (k * 1.2207440846057596 ** -np.arange(1.0, 4.0)) % 1.0
    found = []
    rows = obstacle_rows(table)
    for row in rows[(rows[:, KIND] == KEEP_IN) & (rows[:, PATH] < 0.0)]:
        s, b = row[PLACE : PLACE + 3], row[BORESIGHT : BORESIGHT + 3]
        cosine = 1.0 - u[:, 0] * (1.0 - np.cos(row[RADIUS]))
        sine = np.sqrt(1.0 - cosine**2)
        x, y = sine * np.cos(2.0 * np.pi * u[:, 1]), sine * np.sin(2.0 * np.pi * u[:, 1])
        to_place = so3.minimal_rotation(np.array([0.0, 0.0, 1.0]), s)
        seen = np.column_stack([x, y, cosine]) @ so3.quaternion_to_matrix(to_place).T
        q = so3.quaternion_multiply(
            so3.minimal_rotation(b, seen), so3.quaternion_exp(2.0 * np.pi * u[:, 2:] * b)
        )
        found += [q, -q]
    return found


def ends_of(setup: Setup) -> tuple[Array, list[Array]]:
    """The start on the unit sphere, and the goals: on SO(3) both quaternions of the goal."""
    if setup.pointing:
        start, goal = (so3.quaternion_to_matrix(end[:4])[:, 2] for end in (setup.start, setup.goal))
        return start, [goal]
    return setup.start[:4], [setup.goal[:4], -setup.goal[:4]]


def attitudes_of(setup: Setup, points: Array) -> Array:
    """Attitudes (n, 4) of points of the unit sphere: on S^2 some attitude for each direction."""
    if not setup.pointing:
        return points
    return so3.minimal_rotation(np.array([0.0, 0.0, 1.0]), points)


def _curve(setup: Setup, path: Array, times: Array) -> Array:
    """Attitudes along a path of unit vectors, smoothed, at even speed."""
    for _ in range(_SMOOTHING):
        path[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
        path /= np.linalg.norm(path, axis=1)[:, None]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    return curve_at(setup, along / along[-1], path, times)


def curve_at(setup: Setup, path_times: Array, path: Array, times: Array) -> Array:
    """Attitudes at times along a path of unit vectors, each at its own time."""
    x = np.stack([np.interp(times, path_times, column) for column in path.T], axis=1)
    x /= np.linalg.norm(x, axis=1)[:, None]
    q = setup.lifted(attitudes_of(setup, x)) if setup.pointing else x
    q[0] = setup.start[:4]
    return setup.with_goal(np.ascontiguousarray(q))


@lru_cache(maxsize=2)
def _grid(dimension: int) -> tuple[Array, NDArray[np.int64]]:
    """Nearly even points (n, d) on the unit sphere of R^d, and pairs (m, 2) of neighbours."""
    points, spacing = sphere_points(dimension, _POINTS[dimension])
    pairs = cKDTree(points).query_pairs(_REACH[dimension] * spacing, output_type="ndarray")
    return points, pairs.astype(np.int64)


def sphere_points(dimension: int, n: int) -> tuple[Array, float]:
    """Nearly even points (n, d) on the unit sphere of R^d, d = 3 or 4, and their mean spacing."""
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
    return points, float(spacing)
