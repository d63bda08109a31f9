# SPDX-License-Identifier: Apache-2.0
"""First guesses of curves on a general space, and their other sides of an obstacle."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from riem_planner.manifolds.descent import CoarseCost
from riem_planner.manifolds.matrices import Array, Real, made_unitary
from riem_planner.manifolds.problem import GeneralProblem
from riem_planner.manifolds.solution import GeneralTrajectory

_INTERVALS = 24
_LEAST_INTERVALS = 6  # between two points that are to be passed
_NEAR = 0.6  # distance of an obstacle up to which both of its sides are tried
_SADDLE = 0.1  # distance of an obstacle from a curve in which its sides are much the same
_MOST_NORMALS = 2  # directions off a curve that meets an obstacle, each of them both ways
_CLEAR = 0.3  # distance to which a curve is pushed off an obstacle


def mesh(problem: GeneralProblem) -> Real:
    """Normalised times (N + 1,), evenly spaced between the points that are to be passed."""
    stops = [0.0, *(x.time / problem.duration for x in problem.waypoints), 1.0]
    parts = []
    for begin, end in pairwise(stops):
        count = max(round(_INTERVALS * (end - begin)), _LEAST_INTERVALS)
        parts.append(begin + (end - begin) * np.arange(count) / count)
    return np.append(np.concatenate(parts), 1.0)


def direct(problem: GeneralProblem, times: Real) -> Array:
    """The curve (N + 1, size, size) of geodesics from point to point."""
    T = problem.duration
    stops = [problem.start.element, *(x.element for x in problem.waypoints), problem.goal.element]
    when = np.array([0.0, *(x.time / T for x in problem.waypoints), 1.0])
    curve = np.empty((times.size, *problem.start.element.shape), dtype=problem.space.basis.dtype)
    for k in range(len(stops) - 1):
        own = (times >= when[k] - 1e-12) & (times <= when[k + 1] + 1e-12)
        share = (times[own] - when[k]) / (when[k + 1] - when[k])
        out = problem.space.between(stops[k], stops[k + 1])
        curve[own] = stops[k] @ problem.space.exp(share[:, None] * out)
        curve[np.flatnonzero(own)[-1]] = stops[k + 1]
    return curve


def detours(problem: GeneralProblem, times: Real, count: int) -> list[Array]:
    """Curves by way of points off the geodesic, some on the far side of the space.

    The same in every run. Without waypoints only: the way between two of them is short.
    """
    if problem.waypoints:
        return []
    space = problem.space
    start, goal = problem.start.element, problem.goal.element
    rng = np.random.default_rng(0)
    middle = start @ space.exp(0.5 * space.between(start, goal))
    curves = []
    for k in range(1, count + 1):
        offset = rng.normal(size=space.dimension)
        size = (0.5, 1.5, 3.0)[k % 3]
        point = middle @ space.exp(size * offset / np.linalg.norm(offset))
        out, home = space.between(start, point), space.between(point, goal)
        first = start @ space.exp(2.0 * times[times < 0.5, None] * out)
        second = point @ space.exp((2.0 * times[times >= 0.5, None] - 1.0) * home)
        curve = np.concatenate([first, second])
        curve[-1] = goal
        curves.append(curve)
    return curves


def warm(problem: GeneralProblem, trajectory: GeneralTrajectory, times: Real) -> Array:
    """A trajectory at normalised times, moved to begin and end where the problem does."""
    space = problem.space
    g = trajectory.evaluate(np.minimum(times * trajectory.duration, trajectory.duration))[0]
    stops = [(0, problem.start.element), (len(g) - 1, problem.goal.element)]
    T = problem.duration
    stops += [(int(np.argmin(np.abs(times - x.time / T))), x.element) for x in problem.waypoints]
    moves = {k: space.between(g[k], element) for k, element in stops}
    known = sorted(moves)
    offsets = np.stack(
        [
            np.interp(times, times[known], [moves[k][i] for k in known])
            for i in range(space.dimension)
        ],
        axis=-1,
    )
    g = g @ space.exp(offsets)
    for k, element in stops:
        g[k] = element
    return np.asarray(g)


def straight_lifts(cost: CoarseCost, g: Array) -> Array:
    """The same points, each with the lift that the curve itself arrives with."""
    space = cost.space
    if space.frame_turn(space.identity) is None:
        return g
    steps = space.exp(space.between(g[:-1], g[1:]))
    step = space.inverse(g[:-1]) @ g[1:]
    lifts, turn = [g[0]], np.eye(space.size)
    for k in range(len(steps)):
        # g_(k+1) = g_k exp(X) kappa; behind a turn the lift g_k turn arrives without kappa.
        turn = made_unitary(space.inverse(space.inverse(steps[k]) @ step[k]) @ turn)
        lifts.append(g[k + 1] @ turn)
    return made_unitary(np.stack(lifts))


def sides(cost: CoarseCost, free: Array, *, both: bool) -> list[Array]:
    """The curve pushed off the obstacles that it comes near, and the other sides of them.

    Parameters
    ----------
    cost
        The problem on its mesh.
    free : (N + 1, size, size)
        A curve, such as that without obstacles.
    both
        Whether to try the other side of an obstacle that is near; where it is on the curve both
        are tried in any case.
    """
    g = straight_lifts(cost, free)
    if not cost.repulsion:
        return [g]
    d, towards = cost.repulsion.distances(g, cost.times)
    first, others = np.zeros((len(g), cost.space.dimension)), []
    changes = []
    for i in range(d.shape[1]):
        own = _pushes(cost, g, d[:, i], towards[:, i], float(cost.repulsion.radii[i]), both=both)
        if own:
            first = first + own[0]
            changes += [(own[0], other) for other in own[1:]]
    others = [first - one + other for one, other in changes]
    return [g @ cost.space.exp(push) for push in (first, *others)]


def _pushes(
    cost: CoarseCost, g: Array, d: Real, towards: Real, radius: float, *, both: bool
) -> list[Real]:
    """Steps (N + 1, n) of a curve to the sides of one obstacle, its own first."""
    inner = np.flatnonzero(cost.free.reshape(len(g), -1).all(axis=1))
    if inner.size == 0:
        return []
    k = int(inner[np.argmin(d[inner])])
    if d[k] > _NEAR + radius:
        return []
    across = np.eye(cost.space.dimension)
    chord = cost.space.between(g[k - 1], g[k + 1])
    length = float(np.linalg.norm(chord))
    if length > 1e-9:
        across -= np.outer(chord, chord) / length**2
    normal = across @ (d[k] * towards[k])
    off = float(np.linalg.norm(normal))
    clear = radius + _CLEAR
    shape = _bump(cost, k)
    amounts: list[Real] = []
    if off > 1e-6:
        unit = normal / off
        amounts.append(-max(clear - off, 0.0) * unit)
        if off < _SADDLE or (both and cost.space.dimension == 2):
            amounts.append((clear + off) * unit)
    if off < 1e-3:
        normals = np.linalg.svd(across)[0].T[:-1] if length > 1e-9 else across
        for unit in normals[: _MOST_NORMALS if off <= 1e-6 else 0]:
            amounts += [clear * unit, -clear * unit]
    return [shape[:, None] * amount for amount in amounts]


def _bump(cost: CoarseCost, k: int) -> Real:
    """1 at node k, 0 with its rate at the nearest nodes that stay (N + 1,)."""
    fixed = np.flatnonzero(~cost.free.reshape(cost.times.size, -1).all(axis=1))
    t = cost.times
    begin, end = t[fixed[fixed < k].max(initial=0)], t[fixed[fixed > k].min(initial=t.size - 1)]
    x = np.where(t <= t[k], (t - begin) / (t[k] - begin), (end - t) / (end - t[k]))
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def shooting_nodes(cost: CoarseCost, g: Array) -> tuple[Array, Real]:
    """Shooting nodes (N, ...) with v, v', v'' by differences of a coarse curve (N + 1, ...)."""
    space, h = cost.space, cost.h[:, None]
    g = straight_lifts(cost, g)
    mean = space.between(g[:-1], g[1:]) / h
    a = np.zeros((h.size, space.dimension))
    a[1:] = (mean[1:] - mean[:-1]) / cost.weights[1:-1, None]
    v = mean - 0.5 * h * a
    if cost.start_rate is None:
        v[0] = mean[0]
    else:
        v[0] = cost.start_rate
        a[0] = 2.0 * (mean[0] - v[0]) / h[0]
    return g[:-1], np.stack([v, a, np.gradient(a, cost.times[:-1], axis=0)], axis=1)
