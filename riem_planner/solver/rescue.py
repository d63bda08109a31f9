# SPDX-License-Identifier: Apache-2.0
"""An answer before an extremal: what to try where Newton's method fails for every curve found.

Tried in turn, until something is certified, of which the cheapest is taken:

- nodes graded to both ends, where an end is so near an edge that even nodes don't see the path
  leave it (over `m tau^(-1/4)` of the duration, from `x'''' = tau / x^3` at margin m);
- the descended curves themselves, as splines, at the least strength that keeps them clear between
  their nodes; and extremals of stronger potentials, which keep further off, from there down as far
  as shooting follows: a certified path of the stronger problem answers the problem as stated.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.obstacles.potential import potential, row_margins
from riem_planner.obstacles.table import KEEP_IN, KIND, PATH, RADIUS, STRENGTH, obstacle_rows
from riem_planner.solver import curves
from riem_planner.solver.extremal import Extremal, extremal_near
from riem_planner.solver.search import Curve, Search, global_search
from riem_planner.solver.setup import Setup
from riem_planner.solver.splines import splined
from riem_planner.solver.watch import Watch
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_THIN = 0.03  # of the duration, over which a path leaves an edge, that even nodes don't see
_ROOM = 3e-3  # rad of margin that even nodes see
_SEEN = 0.25  # of that part, that the first interval may span
_RESOLVED = 2e-5  # of the duration; where less is left, differences of attitudes are rounding
_FINE_MESH = 0.5  # of the mesh density's integral, an interval
_FIRST, _LAST = 3e-4, 0.02  # intervals of graded nodes, of the duration
_GROWTH = 1.12  # from one to the next
_STRONGER = (10.0, 100.0, 1000.0)
_WEAKER = 10.0**-0.5  # a step down
_SPLINED_AT = (1.0, 1.2, 1.5, 2.0, 4.0, 10.0, 30.0, 100.0, 1000.0)
_MOST_CURVES = 4  # the cheapest ones


class Remedy(NamedTuple):
    """What may help where shooting failed.

    Attributes
    ----------
    name
        What is tried, in a few words.
    chains
        Each a series of paths, the best first, of which one is enough.
    """

    name: str
    chains: Iterator[Iterator[Extremal]]


def remedies(
    setup: Setup, found: Search, tolerance: float, watch: Watch, warm_start: Trajectory | None
) -> Iterator[Remedy]:
    """Ways to paths near the minima of a search, in the order in which they are worth a try."""
    if warm_start is not None:
        yield Remedy("the warm start", iter([iter([as_given(setup, warm_start)])]))
    best = found.minima[:_MOST_CURVES]
    if thinnest_layer(setup) < _THIN:
        if not best:
            best = global_search(_with_room(setup), watch, None).minima[:_MOST_CURVES]
        yield Remedy(
            "nodes graded to the ends near an edge",
            (_graded(setup, found, curve, tolerance, watch) for curve in best),
        )
    if not found.minima:
        return
    series = (_splined_series(setup, curve, watch) for curve in best)
    yield Remedy(
        "descended curves and stronger potentials",
        chain(series, _strengthened(setup, tolerance, watch)),
    )


def as_given(setup: Setup, trajectory: Trajectory) -> Extremal:
    """A trajectory in normalised time and the solver's body axes."""
    T = trajectory.duration
    states = np.zeros((trajectory.times.size, 13))
    to_body = so3.quaternion_to_matrix(setup.body)
    states[:, :4] = so3.quaternion_multiply(trajectory.quaternions_xyzw, setup.body)
    states[:, 4:7] = T * trajectory.angular_velocities @ to_body
    states[:, 7:10] = T**2 * trajectory.angular_accelerations @ to_body
    return Extremal(trajectory.times / T, states, np.inf, np.inf, np.inf, settled=False)


def as_answer(setup: Setup, curve: Curve) -> Extremal:
    """A descended curve as a spline: an answer, though no extremal."""
    times, states = splined(setup, curve.times, curve.q)
    return Extremal(times, states, curve.cost, np.inf, np.inf, settled=False)


def thinnest_layer(setup: Setup) -> float:
    """Share of the duration over which a path leaves or reaches an edge near its ends."""
    layer = float("inf")
    for time, end in ((0.0, setup.start), (1.0, setup.goal)):
        V, *rest = potential(setup.table, time, *end[:4].tolist(), 0.0)
        if V > 0.0:
            # tau / x^2 bends by 6 tau / x^4.
            layer = min(layer, float((6.0 / np.linalg.norm(rest[3:6])) ** 0.25))
    return layer


def _with_room(setup: Setup) -> Setup:
    """The problem with smaller zones where an end is near an edge, so that nodes see it left."""
    table = setup.table.copy()
    rows = obstacle_rows(table)
    for time, end in ((0.0, setup.start), (1.0, setup.goal)):
        lack = _ROOM - row_margins(table, time, end)
        # Of a group only the zones that are kept; the size of what moves along samples stays.
        near = (lack > 0.0) & (lack < _ROOM) & (rows[:, PATH] < 0.0)
        rows[near, RADIUS] += np.where(rows[near, KIND] == KEEP_IN, lack[near], -lack[near])
    return setup._replace(table=table)


def _graded(
    setup: Setup, found: Search, curve: Curve, tolerance: float, watch: Watch
) -> Iterator[Extremal]:
    """An extremal by nodes that see how the path leaves an edge; else the path on coarser ones."""
    layer = thinnest_layer(setup)
    for first in (_SEEN * layer, _FIRST) if layer > _RESOLVED else (_FIRST,):
        times = graded_times(min(first, _FIRST))
        q = setup.with_goal(curves.resampled(curve.times, setup.lifted(curve.q), times))
        finer = found.on_nodes(times, q)
        if finer.cost == np.inf:
            continue
        extremal = extremal_near(setup, finer.times, finer.q, tolerance, watch, _FINE_MESH)
        if extremal is not None:
            yield extremal
        if first >= _FIRST:
            yield as_answer(setup, finer)


def graded_times(first: float) -> Array:
    """Normalised times (N + 1,), dense at both ends, where the first interval is given."""
    count = int(np.log(_LAST / first) / np.log(_GROWTH)) + 1
    ends = np.concatenate([[0.0], np.cumsum(first * _GROWTH ** np.arange(count))])
    middle = np.linspace(ends[-1], 1.0 - ends[-1], int((1.0 - 2.0 * ends[-1]) / _LAST) + 1)
    return np.concatenate([ends[:-1], middle, 1.0 - ends[-2::-1]])


def _splined_series(setup: Setup, curve: Curve, watch: Watch) -> Iterator[Extremal]:
    """A curve on finer nodes as a spline, at rising strengths, which keep it further off."""
    middles = 0.5 * (curve.times[1:] + curve.times[:-1])
    times = np.sort(np.concatenate([curve.times, middles]))
    q = setup.with_goal(curves.resampled(curve.times, setup.lifted(curve.q), times))
    for factor in _SPLINED_AT:
        stronger = _with_strength(setup, factor)
        pushed = Search(stronger, watch, times).on_nodes(times, q.copy())
        if pushed.cost < np.inf:
            yield as_answer(setup, pushed)
            q = pushed.q


def _strengthened(setup: Setup, tolerance: float, watch: Watch) -> Iterator[Iterator[Extremal]]:
    """Extremals of stronger potentials, each followed down as far as shooting goes."""
    for factor in _STRONGER:
        strong = _with_strength(setup, factor)
        found = global_search(strong, watch, None)
        for curve in found.minima[:_MOST_CURVES]:
            extremal = extremal_near(strong, curve.times, curve.q, tolerance, watch)
            if extremal is not None:
                yield _followed_down(setup, factor, extremal, tolerance, watch)


def _followed_down(
    setup: Setup, factor: float, extremal: Extremal, tolerance: float, watch: Watch
) -> Iterator[Extremal]:
    """Of an extremal's continuation to weaker potentials what was reached last, and others."""
    reached = [(factor, extremal)]
    while factor > 1.0:
        factor = max(1.0, factor * _WEAKER)
        weaker = _with_strength(setup, factor)
        times, states = reached[-1][1].times, reached[-1][1].states
        found = Search(weaker, watch, times)
        curve = found.on_nodes(times, weaker.with_goal(np.ascontiguousarray(states[:, :4])))
        if curve.cost == np.inf:
            break
        follower = extremal_near(weaker, curve.times, curve.q, tolerance, watch)
        if follower is None:
            break
        reached.append((factor, follower))
    for factor, path in reversed(reached):
        if factor == 1.0:
            yield path
        else:
            yield Extremal(path.times, path.states, path.cost, np.inf, np.inf, settled=False)


def _with_strength(setup: Setup, factor: float) -> Setup:
    table = setup.table.copy()
    obstacle_rows(table)[:, STRENGTH] *= factor
    return setup._replace(table=table)
