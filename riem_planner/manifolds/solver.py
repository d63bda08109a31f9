# SPDX-License-Identifier: Apache-2.0
"""Boundary-value problems on a general space: descent from several curves, then shooting.

Plain NumPy and SciPy: it is the independent check of the compiled solver, and the way to every
space that one does not know.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from riem_planner.manifolds.clearance import proven_clearance
from riem_planner.manifolds.descent import CoarseCost, descend, off_saddle
from riem_planner.manifolds.guesses import (
    detours as detour_curves,
)
from riem_planner.manifolds.guesses import (
    direct,
    mesh,
    shooting_nodes,
    sides,
    warm,
)
from riem_planner.manifolds.matrices import Array, Real, made_unitary
from riem_planner.manifolds.matrix_space import OutsideInjectivityRadiusError
from riem_planner.manifolds.problem import GeneralProblem, shape_of
from riem_planner.manifolds.repulsion import Repulsion
from riem_planner.manifolds.shooting import Nodes, Shooting, Shot, shoot
from riem_planner.manifolds.solution import GeneralSolution, GeneralTrajectory
from riem_planner.solution import Status

_SAME = 1e-7  # relative difference of costs that means the same extremal
_SAME_COARSE = 1e-5
_WORTH_SHOOTING = 2.0  # of the least coarse cost
_MOST_RESULTS = 3
_COARSE_STEP = 0.5  # of an interval, relative to the distance to an obstacle's ball
_MOST_NODES = 120
_NOTE_FAMILY = (
    "one of a family of extremals of equal cost, as round an obstacle on the axis of a rotation;"
    " no member is a strict minimum"
)
_NOTE_SAMPLED = "the clearance is sampled, not proven between the samples"


class _StopError(Exception):
    def __init__(self, status: Status) -> None:
        self.status = status


_Minimum = tuple[float, Array, CoarseCost, float]  # cost, curve, its mesh and last margin


@dataclass(eq=False)
class _Found:
    """An extremal that was found."""

    cost: float
    trajectory: GeneralTrajectory
    shot: Shot
    curve: Array
    coarse: CoarseCost
    margin: float


@dataclass(eq=False)
class _Search:
    """State of a solve: what was found so far."""

    problem: GeneralProblem
    tolerance: float
    check: Callable[[], None]
    repulsion: Repulsion = field(init=False)
    shooting: Shooting = field(init=False)
    minima: list[_Minimum] = field(default_factory=list)
    found: list[_Found] = field(default_factory=list)
    iterations: int = 0
    _seen: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        T = self.problem.duration
        self.repulsion = Repulsion(self.problem.space, self.problem.obstacles, T**4, T)
        self.shooting = Shooting(self.problem, self.repulsion)

    def descend(self, times: Real, curve: Array) -> None:
        """Add the minimum below a curve, and those to both sides of a saddle."""
        found = self._minimum(times, curve)
        if found is None:
            return
        value, g, cost, margin = found
        below = [self._minimum(cost.times, side) for side in off_saddle(cost, g, margin) or ()]
        lower = [x for x in below if x is not None and x[0] < (1.0 - _SAME_COARSE) * value]
        self.minima += lower or [found]
        self.minima.sort(key=lambda entry: entry[0])

    def _minimum(self, times: Real, curve: Array) -> _Minimum | None:
        """The minimum below a curve; None if there is none, or if it is known."""
        cost = CoarseCost(self.problem, self.repulsion, times)
        g, value, margin = descend(cost, curve, self.check)
        if self._known(value):
            return None
        finer = self._fine(cost, g, value, margin)
        if finer[0] is not cost and self._known(finer[2]):
            return None
        cost, g, value, margin = finer
        return value, g, cost, margin

    def _known(self, value: float) -> bool:
        """Whether a curve of this cost was seen, or it is none; remembers it."""
        if not np.isfinite(value) or any(
            abs(value - other) <= _SAME_COARSE * other for other in self._seen
        ):
            return True
        self._seen.append(value)
        return False

    def _fine(
        self, cost: CoarseCost, g: Array, value: float, margin: float
    ) -> tuple[CoarseCost, Array, float, float]:
        """The curve on nodes that are close where it passes an obstacle."""
        space = self.problem.space
        for _ in range(4):
            if not self.repulsion or len(g) > _MOST_NODES or not np.isfinite(value):
                break
            gap = (self.repulsion.distances(g, cost.times)[0] - self.repulsion.radii).min(axis=1)
            X = space.between(g[:-1], g[1:])
            length = np.linalg.norm(X, axis=1)
            nearest = np.maximum(np.minimum(gap[1:], gap[:-1]), 1e-3)
            coarse = np.flatnonzero(length > _COARSE_STEP * nearest)
            if coarse.size == 0:
                break
            times = np.insert(
                cost.times, coarse + 1, 0.5 * (cost.times[coarse] + cost.times[coarse + 1])
            )
            g = np.insert(g, coarse + 1, g[coarse] @ space.exp(0.5 * X[coarse]), axis=0)
            cost = CoarseCost(self.problem, self.repulsion, times)
            g, value, margin = descend(cost, g, self.check, (margin, 0.3 * margin, 0.1 * margin))
        return cost, g, value, margin

    def shoot(self, most: int) -> None:
        """Refine the cheapest curves that have not been refined yet."""
        while self.minima and len(self.found) < most:
            value, curve, cost, margin = self.minima.pop(0)
            least = min((entry.cost for entry in self.found), default=np.inf)
            if value > _WORTH_SHOOTING * least * self.problem.duration**3:
                continue
            nodes = Nodes(cost.times, *shooting_nodes(cost, curve))
            if self.problem.start.rate is None:
                nodes.w[0, 1] = 0.0
            shot = shoot(self.shooting, nodes, self.tolerance, self.check)
            if shot is None:
                continue
            self.iterations += shot.iterations
            trajectory = _along_one_lift(self.shooting, shot)
            found = trajectory_cost(trajectory)
            if np.isfinite(found) and all(
                abs(found - other.cost) > _SAME * other.cost for other in self.found
            ):
                self.found.append(_Found(found, trajectory, shot, curve, cost, margin))


def solve_general(
    problem: GeneralProblem,
    *,
    deadline: float | None = None,
    should_stop: Callable[[], bool] | None = None,
    tolerance: float = 1e-11,
    detours: int = 4,
    warm_start: GeneralTrajectory | None = None,
    both_sides: bool = True,
) -> GeneralSolution:
    """Solve a boundary-value problem on a compact group, a symmetric space or R^n.

    Parameters
    ----------
    problem
        The problem.
    deadline
        Time allowed [s]; by default none. When it passes, the best found so far is returned.
    should_stop
        Asked once an iteration; true ends the solve.
    tolerance
        Error allowed in the integration of an interval.
    detours
        Initial curves tried besides the geodesic: by way of points off it, some on the far
        side of the space. They are the same in every run.
    warm_start
        A trajectory near the one looked for; its whole length is taken to fit the problem's.
    both_sides
        Whether the other side of each obstacle near the way is tried; where an obstacle is on
        the way both sides are in any case.

    Returns
    -------
    GeneralSolution
        A value also where nothing was found.

    Raises
    ------
    OutsideInjectivityRadiusError
        The goal is on the cut locus of the start and there are no detours to take.
    """
    begin = time.monotonic()

    def check() -> None:
        if should_stop is not None and should_stop():
            raise _StopError(Status.CANCELLED)
        if deadline is not None and time.monotonic() - begin > deadline:
            raise _StopError(Status.OUT_OF_TIME)

    refused = _end_inside(problem)
    if refused is not None:
        return refused
    search = _Search(problem, tolerance, check)
    stopped: Status | None = None
    try:
        with np.errstate(all="ignore"):  # trial curves may leave every bound
            _look(search, detours, warm_start, both_sides=both_sides)
    except _StopError as reason:
        stopped = reason.status
    elapsed = time.monotonic() - begin
    if stopped is Status.CANCELLED or (stopped is not None and not search.found):
        return GeneralSolution(
            stopped,
            f"stopped after {elapsed:.3g} s: {stopped.advice}",
            iterations=search.iterations,
            solve_time=elapsed,
        )
    notes = [problem.space.remark] if problem.space.remark else []
    if stopped is not None:
        notes.append(
            f"the deadline passed after {elapsed:.3g} s: the best found so far, not all that was"
            " to be tried"
        )
    everything = stopped is None and detours > 0 and both_sides
    solution = _best(search, notes, everything=everything)
    return replace(solution, solve_time=time.monotonic() - begin)


def _look(
    search: _Search, detours: int, warm_start: GeneralTrajectory | None, *, both_sides: bool
) -> None:
    """Descend from every curve that is worth it; the first is refined at once."""
    problem = search.problem
    space = problem.space
    times = mesh(problem)
    if warm_start is not None:
        search.descend(times, warm(problem, warm_start, times))
        search.shoot(1)
    if detours == 0 and warm_start is None and not problem.waypoints:
        # Raises where there is no one geodesic.
        space.log(space.inverse(problem.start.element) @ problem.goal.element)
    if detours > 0 or not search.found:
        free_cost = CoarseCost(problem, Repulsion(space, ()), times)
        free, _, _ = descend(free_cost, direct(problem, times), search.check, (1.0,))
        cost = CoarseCost(problem, search.repulsion, times)
        for curve in sides(cost, free, both=both_sides):
            search.descend(times, curve)
            search.shoot(1)
        for curve in detour_curves(problem, times, detours):
            search.descend(times, curve)
    search.shoot(_MOST_RESULTS)


def _end_inside(problem: GeneralProblem) -> GeneralSolution | None:
    ends = (
        ("start", Status.START_IN_ZONE, 0.0),
        ("goal", Status.GOAL_IN_ZONE, problem.duration),
    )
    for key, status, when in ends:
        for name, margin in problem.margins(getattr(problem, key).element, when).items():
            if margin <= 0.0 and _excludes(problem, name):
                message = f"the {key} is {-margin:.6g} inside of obstacle {name!r}"
                return GeneralSolution(status, message)
    if not np.isfinite(problem.space.between(problem.start.element, problem.goal.element)).all():
        raise OutsideInjectivityRadiusError(
            problem.space.name, "no logarithm from start to goal was found in the Lie algebra"
        )
    return None


def _excludes(problem: GeneralProblem, name: str) -> bool:
    return any(o.name == name and shape_of(o).excludes for o in problem.obstacles)


def _best(search: _Search, notes: list[str], *, everything: bool) -> GeneralSolution:
    problem = search.problem
    for entry in sorted(search.found, key=lambda entry: entry.cost):
        clearance, proven = proven_clearance(entry.trajectory, entry.shot.error)
        if any(margin <= 0.0 and _excludes(problem, name) for name, margin in clearance.items()):
            continue
        others = sorted(
            ((x.cost, x.trajectory) for x in search.found if x.cost > entry.cost),
            key=lambda other: other[0],
        )
        minimum = entry.shot.family == 0 and _is_minimum(entry)
        if entry.shot.family:
            notes = [*notes, _NOTE_FAMILY]
        if not proven:
            notes = [*notes, _NOTE_SAMPLED]
        return GeneralSolution(
            Status.SOLVED,
            "; ".join([f"solved: cost {entry.cost:.9g}", *notes]),
            entry.trajectory,
            entry.cost,
            clearance,
            _boundary_error(entry.trajectory),
            entry.shot.error,
            tuple(others),
            search.iterations,
            notes=tuple(notes),
            local_minimum=minimum,
            converged=everything,
            clearance_proven=proven,
        )
    message = "no initial curve led to an extremal that keeps off every obstacle"
    return GeneralSolution(
        Status.NO_CERTIFIED_TRAJECTORY, message, iterations=search.iterations, notes=tuple(notes)
    )


def _is_minimum(entry: _Found) -> bool:
    """Whether the second variation of the discretised cost is positive, near the extremal."""
    return entry.coarse.is_convex(entry.curve, entry.margin)


def _along_one_lift(shooting: Shooting, shot: Shot) -> GeneralTrajectory:
    """The trajectory with every node's lift turned into the one that the curve arrives with.

    A lift that is turned by an element of K at its node arrives turned by the same one.
    """
    space, nodes = shooting.space, shot.nodes
    arrivals = shooting.arrivals(nodes)
    g, w = [*nodes.g, arrivals.g[-1]], [*nodes.w, arrivals.w[-1]]
    if space.frame_turn(space.identity) is not None:
        turn = np.eye(space.size)
        for k in range(1, len(g)):
            if k < len(nodes.g):
                step = space.inverse(arrivals.g[k - 1]) @ g[k]
                away = space.inverse(space.exp(space.between(arrivals.g[k - 1], g[k]))) @ step
                turn = made_unitary(space.inverse(away) @ turn)
            w[k] = space.in_frame(space.inverse(turn)[None], w[k])
            g[k] = g[k] @ turn
    return GeneralTrajectory(shooting.problem, nodes.times, np.stack(g), np.stack(w))


def trajectory_cost(trajectory: GeneralTrajectory) -> float:
    """The cost, by Gauss's rule with eight points in each interval."""
    problem, T = trajectory.problem, trajectory.duration
    nodes, weights = np.polynomial.legendre.leggauss(8)
    h = np.diff(trajectory.times) * T
    t = np.minimum(trajectory.times[:-1, None] * T + 0.5 * h[:, None] * (nodes + 1.0), T)
    g, v, a = trajectory.evaluate(t)
    density = np.sum(a * a, axis=-1) + problem.tension * np.sum(v * v, axis=-1)
    density = density + Repulsion(problem.space, problem.obstacles).potential(g, t)
    return 0.25 * float(np.sum(h[:, None] * weights * density))


def _boundary_error(trajectory: GeneralTrajectory) -> tuple[float, float]:
    problem = trajectory.problem
    space, goal = problem.space, problem.goal
    g, v, a = trajectory.evaluate(trajectory.duration)
    element = goal.element
    if len(goal.along):
        element = element @ space.exp(space.between(element, g) @ goal.along.T @ goal.along)
    rate = a if goal.rate is None else space.in_frame(space.inverse(element) @ g, v) - goal.rate
    return space.gap(g, element), float(np.linalg.norm(rate))
