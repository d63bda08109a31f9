# SPDX-License-Identifier: Apache-2.0
"""Global search: one descent for each class of paths that is worth a try.

Classes are enumerated on purpose: the short and the long way round (and further turns where the
end rates ask for them), the other side of each obstacle that the best curves pass, and both
ways off a symmetric saddle.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3, sphere
from riem_planner.obstacles.table import GROUP, RADIUS, depends_on_time, obstacle_rows
from riem_planner.solver import curves
from riem_planner.solver.descent import SADDLES, begin_stage, descend, fresh_memory
from riem_planner.solver.guesses import Guesses, all_guesses, ways_round
from riem_planner.solver.setup import Setup
from riem_planner.solver.watch import Watch
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_SOFT_POINTS = (0.35, 0.1, 0.03)
_SOFT_ZONES = (1.0, 0.5, 0.25, 0.1, 0.05, 0.02)
_SOFT_LAST = (0.01, 0.003)
_SOFT_AGAIN = (0.1, 0.03)
_SOFT_WARM = (0.05,)
_SOFT_PATH: tuple[tuple[float, ...], ...] = ((), (0.01,), (0.02,))
_ROUGH, _FINE = 1e-2, 1e-9
_COARSE = 0.7  # angle between nodes over the margin, above which the curve is made finer
_DEEP = 0.1  # rad that a curve may run into an obstacle between its nodes, to be of any use
_FINER = (0.5, 0.25)  # of the mesh density's integral between nodes
_NODES_FINE = 400
_MOST_ITERATIONS = 60
_MOST_FINER = 20  # from a curve that is a minimum already but for its nodes
_SAME_COST, _MIRRORED = 1e-4, 1e-9  # relative
_SAME_PLACE = 0.05  # rad
_SAME_CURVE = 1e-7
_MOST_DESCENTS = 16
_WORTH_CROSSING = 1.2  # of the best cost, up to which a curve's other sides are tried
_MORE_NODES = 5.0 / 3.0  # where a group may hide a way between them
_DEAR = 2.0  # of the best cost, at which the lower bound of a class rules it out
WORTHLESS = 10.0
"""Of the best cost, above which another class is of no use."""


@dataclass(eq=False)
class Curve:
    """A discretised curve: a local minimum of the discretised cost."""

    times: Array
    q: Array
    cost: float


@dataclass
class Search:
    """State of a global search: the minima found so far, cheapest first.

    Parameters
    ----------
    setup
        The problem.
    watch
        When to stop.
    times : (N + 1,)
        Normalised times of the nodes.
    minima
        Found so far, cheapest first.
    tried
        Curves that were descended from.
    least_cost
        Of the guesses without obstacles, normalised; NaN where it was not looked for.
    """

    setup: Setup
    watch: Watch
    times: Array
    minima: list[Curve] = field(default_factory=list)
    tried: int = 0
    least_cost: float = float("nan")
    _seen: list[float] = field(default_factory=list)

    def add(self, q: Array, softs: tuple[float, ...], *, both: bool = True) -> bool:
        """Descend from a curve, and `both` ways off a saddle; whether a new minimum came of it."""
        begin = q.copy()
        self.tried += 1
        curve, saddle = self._relax(q, softs, 1.0)
        new = self.keep(curve)
        if saddle and (both or curve is None):
            new |= self.keep(self._relax(begin, softs, -1.0)[0])
        return new

    def keep(self, curve: Curve | None) -> bool:
        """Keep a minimum, if there is one; whether it is new."""
        if curve is None or any(self._same(curve, other) for other in self.minima):
            return False
        self.minima.append(curve)
        self.minima.sort(key=lambda minimum: minimum.cost)
        return True

    def _same(self, first: Curve, second: Curve) -> bool:
        """Whether two minima are one, or mirror images of each other."""
        difference = abs(first.cost - second.cost)
        if difference > _SAME_COST * second.cost:
            return False
        # Of two that cost nearly the same and lie apart, the cheaper one is wanted.
        return difference <= _MIRRORED * second.cost or self._apart(first, second) < _SAME_PLACE

    def _apart(self, first: Curve, second: Curve) -> float:
        """Greatest distance between two curves at the same times [rad]."""
        other = curves.resampled(second.times, second.q, first.times)
        if self.setup.pointing:
            x, y = (so3.quaternion_to_matrix(q)[:, :, 2] for q in (first.q, other))
            return float(np.max(sphere.angle(x, y)))
        return float(np.max(so3.quaternion_distance(first.q, other)))

    def _relax(self, q: Array, softs: tuple[float, ...], side: float) -> tuple[Curve | None, bool]:
        """Descend while the potentials harden; the exact minimum, and whether a saddle was left."""
        memory = fresh_memory(q.shape[0])
        curve = self.descended(q, softs, side, memory)
        return (None if curve is None else self._seen_through(curve)), memory[SADDLES] > 0.0

    def descended(
        self,
        q: Array,
        softs: tuple[float, ...] = (),
        side: float = 1.0,
        memory: Array | None = None,
    ) -> Curve | None:
        """The minimum on the search's nodes; None if there is none, or if it is known."""
        memory = fresh_memory(q.shape[0]) if memory is None else memory
        hardest = min(softs, default=np.inf)
        exact = np.inf if softs else self._cost(q)
        for soft in (*softs, *_SOFT_LAST):
            if np.isfinite(exact) and soft < hardest:
                break
            cost, _ = self._stage(self.times, q, soft, _ROUGH, side, memory)
            exact = self._cost(q)
            if exact == cost:
                break
        if not np.isfinite(exact):
            return None
        cost, _ = self._stage(self.times, q, 0.0, _FINE, side, memory)
        # To make a curve finer takes longer than to find it: once is enough.
        if any(abs(cost - other) <= _SAME_CURVE * other for other in self._seen):
            return None
        self._seen.append(cost)
        return Curve(self.times, q, cost)

    def _seen_through(self, curve: Curve) -> Curve | None:
        """The curve on nodes fine enough to see what it passes; None if it is of no use."""
        for interval in _FINER:
            ratio, depth = curves.coarseness(self.setup.table, curve.times, curve.q)
            if depth > _DEEP:
                return None
            if ratio < _COARSE and np.isfinite(curve.cost):
                break
            finer, converged = self.finer(curve, interval)
            # Coarse nodes may hide a way through an obstacle, which finer ones then push out of.
            if self.minima and not (converged and finer.cost < WORTHLESS * self.minima[0].cost):
                return None
            if np.isfinite(curve.cost) and not converged and depth == 0.0:
                break  # the only one so far: the certificate will tell
            curve = finer
        return curve if np.isfinite(curve.cost) else None

    def finer(self, curve: Curve, interval: float) -> tuple[Curve, bool]:
        """The curve on nodes that span `interval` of the mesh density's integral each.

        Also whether the descent soon converged: mostly, if not, the coarse nodes hid a way through
        an obstacle.
        """
        s = self.setup
        times, states = curves.mesh_and_states(
            s.pointing, s.table, curve.times, s.lifted(curve.q), s.start, s.goal,
            interval, curve.times.size, _NODES_FINE,
        )  # fmt: skip
        return self._hardened(times, s.with_goal(np.ascontiguousarray(states[:, :4])))

    def on_nodes(self, times: Array, q: Array) -> Curve:
        """The minimum near a curve on nodes of its own; of infinite cost if there is none."""
        return self._hardened(times, q)[0]

    def _hardened(self, times: Array, begin: Array) -> tuple[Curve, bool]:
        # Softer potentials only where hard ones fail: they let a curve slip out of a narrow gap.
        for softs in ((), _SOFT_LAST, (*_SOFT_AGAIN, *_SOFT_LAST)):
            q, memory = begin.copy(), fresh_memory(begin.shape[0])
            for soft in softs:
                self._stage(times, q, soft, _ROUGH, 1.0, memory, _MOST_FINER)
            cost, converged = self._stage(times, q, 0.0, _FINE, 1.0, memory, _MOST_FINER)
            if cost < np.inf:
                return Curve(times, q, cost), converged
        return Curve(times, q, np.inf), False

    def _cost(self, q: Array) -> float:
        return float(self._descend(self.times, q, 0.0, 0.0, 1.0, 0, fresh_memory(q.shape[0]))[0])

    def _stage(
        self,
        times: Array,
        q: Array,
        soft: float,
        tolerance: float,
        side: float,
        memory: Array,
        most: int = _MOST_ITERATIONS,
    ) -> tuple[float, bool]:
        """Descend in place; the cost, and whether it converged."""
        begin_stage(memory)
        while True:
            stride = min(self.watch.stride, most)
            cost, done, converged = self._descend(times, q, soft, tolerance, side, stride, memory)
            self.watch.count(done)
            most -= stride
            if converged or done < stride or most <= 0:
                return float(cost), bool(converged)

    def _descend(
        self,
        times: Array,
        q: Array,
        soft: float,
        tolerance: float,
        side: float,
        most: int,
        memory: Array,
    ) -> tuple[float, int, bool]:
        s = self.setup
        result: tuple[float, int, bool] = descend(
            s.pointing, s.table, s.sigma, times, q, s.start[4:], s.goal,
            soft, tolerance, side, most, memory, self.watch.flag,
        )  # fmt: skip
        return result

    @property
    def softs(self) -> tuple[float, ...]:
        """Margins over which the potentials harden, from a first guess that may violate them."""
        zones = bool(np.any(obstacle_rows(self.setup.table)[:, RADIUS] > 0.0))
        return _SOFT_ZONES if zones else _SOFT_POINTS

    def cross_obstacles(self, most: int) -> None:
        """Try the other side of each obstacle from the best curves, the cheapest first."""
        crossed: list[Curve] = []
        while most > 0:
            limit = _WORTH_CROSSING * min((c.cost for c in self.minima), default=0.0)
            curve = next((c for c in self.minima if c.cost <= limit and c not in crossed), None)
            if curve is None:
                break
            crossed.append(curve)
            for i in range(len(obstacle_rows(self.setup.table))):
                q = self.reflected(curve, i)
                if q is None:
                    continue
                self.add(q, _SOFT_AGAIN)
                most -= 1
                if most == 0 or self.minima[0].cost < curve.cost:
                    break

    def reflected(self, curve: Curve, obstacle: int) -> Array | None:
        """The curve moved to the other side of an obstacle; None where it is far off."""
        s = self.setup
        q = np.empty_like(curve.q)
        if not curves.reflect(s.pointing, s.table, obstacle, curve.times, s.lifted(curve.q), q):
            return None
        return s.with_goal(curves.resampled(curve.times, s.lifted(q), self.times))


def global_search(setup: Setup, watch: Watch, warm_start: Trajectory | None) -> Search:
    """Minima of the classes that are worth a try, cheapest first."""
    guesses = all_guesses(setup)
    found = Search(setup, watch, guesses.times)
    if warm_start is not None:
        found.add(warm_guess(setup, warm_start, guesses.times), _SOFT_WARM)
    ways = unhindered(setup, watch, guesses)
    found.least_cost = min((way.minimum.cost for way in ways), default=found.least_cost)
    for way in ways:
        if not setup.table.size:
            found.tried += 1
            found.keep(way.minimum)
        elif not found.minima or way.minimum.cost < _DEAR * found.minima[0].cost:
            found.add(way.guess, found.softs)
    if np.any(obstacle_rows(setup.table)[:, GROUP] >= 0.0):
        _look_again(found, ways)
    found.cross_obstacles(_MOST_DESCENTS)
    return found


def _look_again(found: Search, ways: list[Unhindered]) -> None:
    """Descend on more nodes as well: a narrow hand-over within a group may lie between nodes."""
    nodes = round(_MORE_NODES * (found.times.size - 1))
    finer = Search(found.setup, found.watch, np.arange(nodes + 1) / nodes)
    for way in ways:
        lifted = found.setup.lifted(way.guess)
        q = found.setup.with_goal(curves.resampled(found.times, lifted, finer.times))
        if not finer.minima or way.minimum.cost < _DEAR * finer.minima[0].cost:
            finer.add(q, finer.softs)
    found.tried += finer.tried
    for curve in finer.minima:
        found.keep(curve)


class Unhindered(NamedTuple):
    """A guess, and the minimum that it descends to where there are no obstacles."""

    guess: Array
    minimum: Curve


def unhindered(setup: Setup, watch: Watch, guesses: Guesses) -> list[Unhindered]:
    """Guesses of different minima without obstacles, the cheapest of these first.

    No path downhill from there to what obstacles leave is cheaper than that minimum; but where the
    roll at the end is free and slides, for it is judged as it stands in the guess.
    """
    bare = setup._replace(table=setup.table[:0])
    space = Search(bare, watch, guesses.times)
    ways = []
    for q in guesses.curves:
        if setup.free_roll and setup.table.size:
            # All rolls would slide to one minimum: each is judged by its own.
            space = Search(bare._replace(goal=setup.goal_at(q[-1])), watch, guesses.times)
        minimum = space.descended(q.copy())
        if minimum is not None:
            ways.append(Unhindered(q, minimum))
    return sorted(ways, key=lambda way: way.minimum.cost)


def local_search(setup: Setup, watch: Watch, warm_start: Trajectory | None) -> Search:
    """The minimum of one class: that of the warm start, or the straightest."""
    times, guesses = ways_round(setup)
    found = Search(setup, watch, times)
    if warm_start is not None:
        found.add(warm_guess(setup, warm_start, times), _SOFT_WARM, both=False)
    for q in guesses:
        if found.minima:
            break
        found.add(q, found.softs)
    return found


def warm_guess(setup: Setup, trajectory: Trajectory, times: Array) -> Array:
    """A trajectory at normalised times, turned at both ends to meet the problem's states."""
    q = trajectory.evaluate_quaternion(
        np.minimum(times * trajectory.duration, trajectory.duration)
    )[0]
    if setup.pointing or setup.free_roll:
        q = so3.quaternion_multiply(q, setup.body)
    curves.meet_ends(setup.pointing, setup.start, setup.goal, times, q)
    return setup.with_goal(q)


def roadmap_search(setup: Setup, watch: Watch) -> Search:
    """Minima near shortest paths over a grid, for clutter where every smooth guess fails."""
    # Slow to load, and seldom needed.
    from riem_planner.solver.roadmap import roadmap_curves
    from riem_planner.solver.timed_roadmap import timed_curves

    moving = depends_on_time(setup.table)
    times, paths = (timed_curves if moving else roadmap_curves)(setup, watch)
    found = Search(setup, watch, times)
    for q in paths:
        for softs in _SOFT_PATH:
            found.add(q.copy(), softs)
    return found
