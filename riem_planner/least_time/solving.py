# SPDX-License-Identifier: Apache-2.0
"""The least duration found: classes of paths, followed coarsely, the best again on the samples."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from riem_planner.certificate import Certificate, certify, certify_limits
from riem_planner.duration import Solve, broken_at_ends, nothing_to_do, solve_auto
from riem_planner.geometry import so3
from riem_planner.least_time import paths
from riem_planner.least_time.bound import least_possible_duration
from riem_planner.least_time.free_path import COARSE, Optimum, followed, refined
from riem_planner.least_time.retiming import path_of, retimed
from riem_planner.least_time.transcription import Frame
from riem_planner.problem import LEAST_ACCELERATION, Problem
from riem_planner.solution import Alternative, Solution, Status
from riem_planner.solver.watch import InterruptedSolveError, Watch
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

FREE, RETIMED = "free path", "retimed path"
"""Levels of a plan."""

SAMPLES = 201

_TIGHTENINGS = (5e-4, 2e-3, 6e-3)
_SAME = 2e-3  # relative difference of the durations of one class
_MOST_STRETCHED = 1.02
_TRIED = 3  # classes on the samples before the search is given up
_ALTERNATIVES = 3
_LONGER = (1.0, 1.6, 2.5)  # where an end moves, its path has to be flown at its speed
_SHORTEST = 1e-6  # s
_BINDS = 0.01  # part of a limit that is left where it binds
_PACE = 1.5  # of the longest time that a coarse path took, what another may take


@dataclass(frozen=True, eq=False)
class _Plan:
    """A certified trajectory."""

    trajectory: Trajectory
    certificate: Certificate
    level: str
    converged: bool


class LeastTime:
    """One request.

    Parameters
    ----------
    problem
        Of least time.
    watch
        Tells when to stop.
    neighbour
        Solves the problem of least acceleration.
    samples
        Of the plan; twice as many where they cannot be certified.
    """

    def __init__(
        self, problem: Problem, watch: Watch, neighbour: Solve, samples: int = SAMPLES
    ) -> None:
        self._problem, self._watch, self._neighbour = problem, watch, neighbour
        self._samples = samples
        self._frame = Frame(problem)
        self._near: dict[float, Solution] = {}
        moves = problem.goals[0].moves or np.any(problem.arrival.angular_velocity)
        self._rests = not moves and not np.any(problem.start.angular_velocity)
        self._stretches = (
            self._rests and not np.any(problem.total_momentum) and not problem.forbidden.moving
        )
        self._found: list[Optimum] = []  # of each class one
        self._slowest = 0.0  # s, of the starts followed

    def solve(self) -> Solution:
        """The quickest certified plan found."""
        problem = self._problem
        assert problem.limits is not None  # a problem of least time has them
        refusal = broken_at_ends(problem, problem.limits) or nothing_to_do(problem)
        if refusal is not None:
            return refusal
        if problem.goals[0].moves:
            return self._least_acceleration()
        plan = quick = None
        try:
            if self._watch.limited:
                quick = self.retimed()
            self._follow_all()
            plan = self._published()
        except InterruptedSolveError as interruption:
            if interruption.status is Status.CANCELLED:
                raise
        plan = plan or quick or self.retimed()
        return self._least_acceleration() if plan is None else self._told(plan)

    def along(self, path: Trajectory | None) -> Solution:
        """The quickest motion along a path; by default the straightest one."""
        problem = self._problem
        assert problem.limits is not None  # a problem of least time has them
        refusal = broken_at_ends(problem, problem.limits) or nothing_to_do(problem)
        if refusal is not None:
            return refusal
        if problem.goals[0].moves:
            return self._least_acceleration()
        plan = self.retimed(path)
        return self._least_acceleration() if plan is None else self._told(plan)

    def _starts(self) -> Iterator[Array]:
        """Paths to start from, the likeliest first."""
        frame = self._frame
        straight = paths.straight(frame, COARSE)
        yield straight
        sides = paths.sides(frame)
        free = not self._problem.forbidden.sets
        for side in sides[:: 2 if free else 1]:
            yield paths.bent(straight, paths.BEND * side)
        if frame.rolling and (not free or paths.angle(frame) > paths.LONG_WAY_FROM):
            yield paths.straight(frame, COARSE, long=True)
        if free:
            return
        for trajectory in self._neighbours():
            yield paths.along(frame, trajectory, COARSE)

    def _neighbours(self, longer: float = 1.0) -> Iterator[Trajectory]:
        """Paths of least acceleration, in so many times what the straight slew needs."""
        solution = self._least(longer)
        if solution.trajectory is not None:
            yield solution.trajectory
        for other in solution.alternatives:
            yield other.trajectory

    def _least(self, longer: float) -> Solution:
        if longer not in self._near:
            V, A = paths.motion(paths.straight(self._frame, COARSE))
            duration = max(longer * self._frame.slower(V, A, 1.0), _SHORTEST)
            self._near[longer] = self._neighbour(self._problem.timed(duration), None)
        return self._near[longer]

    def _follow_all(self) -> None:
        """Find a local optimum of each class, the quickest first."""
        found = self._found
        for path in self._starts():
            begin = time.monotonic()
            optimum = followed(self._frame, path)
            self._watch.count(optimum.iterations)
            self._slowest = max(self._slowest, time.monotonic() - begin)
            same = (abs(o.duration / optimum.duration - 1.0) < _SAME for o in found)
            if optimum.near and not any(same):
                found.append(optimum)
            if not self._watch.has_time_for(_PACE * self._slowest * (1 + self._samples / COARSE)):
                break
        found.sort(key=lambda optimum: optimum.duration)

    def _published(self) -> _Plan | None:
        """The first optimum that is certified on the samples."""
        for optimum in self._found[:_TRIED]:
            for intervals in (self._samples - 1, 2 * (self._samples - 1)):
                warm = optimum
                for tightening in _TIGHTENINGS:
                    warm = refined(self._frame, warm, intervals, tightening)
                    self._watch.count(warm.iterations)
                    plan = self._certified(warm)
                    if plan is not None:
                        return plan
                    if not warm.converged:
                        break
        return None

    def _certified(self, optimum: Optimum) -> _Plan | None:
        """The plan of an optimum."""
        trajectory = self._frame.trajectory(optimum.iterate, optimum.duration)
        return self._checked(trajectory, FREE, optimum.converged)

    def _checked(self, trajectory: Trajectory, level: str, converged: bool) -> _Plan | None:
        """The plan of a trajectory, made slower by little where its limits ask for it."""
        problem = self._problem
        # Where zones move, the certificate looks at them again.
        if self._stretches or (level == RETIMED and self._rests):
            use = certify_limits(trajectory, problem.limits, problem.total_momentum)
            most = _MOST_STRETCHED if level == FREE else math.inf
            if 1.0 < use.stretch < most:
                trajectory = stretched(trajectory, use.stretch * (1.0 + 1e-9))
        certificate = certify(trajectory, problem)
        if not certificate.certified:
            return None
        return _Plan(trajectory, certificate, level, converged)

    def retimed(self, path: Trajectory | None = None) -> _Plan | None:
        """Level (a): the quickest motion along a path; by default along the straight slew, or
        the quickest of those of least acceleration where that is not clear.
        """  # noqa: D205
        if path is not None:
            return self._along([path])
        for longer in (1.0,) if self._rests else _LONGER:
            plan = self._along(self._given_paths(longer))
            if plan is not None:
                return plan
        return None

    def _along(self, given: Iterable[Trajectory]) -> _Plan | None:
        """The quickest certified motion along one of some paths."""
        plans = []
        for trajectory in given:
            along = path_of(self._frame, trajectory)
            if along is None:
                continue
            for tightening in _TIGHTENINGS if self._rests else (*_TIGHTENINGS, 0.03, 0.1):
                quick = retimed(self._frame, along, self._samples, tightening)
                plan = None if quick is None else self._checked(quick, RETIMED, False)
                if plan is not None:
                    plans.append(plan)
                    break
        return min(plans, key=lambda each: each.trajectory.duration, default=None)

    def _given_paths(self, longer: float) -> Iterator[Trajectory]:
        """Paths to go along: the straight slew, else bent ones, else of least acceleration."""
        frame = self._frame
        if self._rests:
            straight = paths.straight_slew(frame)
            if self._clear(straight):
                yield straight
                return
            base = paths.straight(frame, 2 * COARSE)
            slews = (
                paths.slew_along(frame, paths.bent(base, paths.BEND * side))
                for side in paths.sides(frame)
            )
            bent = [slew for slew in slews if self._clear(slew)]
            if frame.rolling and bent:
                yield from bent
                return
        yield from self._neighbours(longer)

    def _clear(self, trajectory: Trajectory) -> bool:
        """Whether a path keeps out of zones, as they are at the start."""
        attitudes = so3.quaternion_to_matrix(trajectory.quaternions_xyzw)
        return bool(np.min(self._problem.forbidden.least_margin(attitudes, 0.0)) > 0.0)

    def _least_acceleration(self) -> Solution:
        """What is left where no motion of least time is certified."""
        problem = self._problem
        solution = solve_auto(problem.timed(math.inf, problem.limits), self._neighbour)
        if not solution.solved or solution.trajectory is None:
            return solution
        note = (
            "no motion of least time was certified: this is the least of least-acceleration curves"
        )
        T = solution.trajectory.duration
        return replace(
            solution,
            message=f"{solution.message}; {note}",
            notes=(*solution.notes, note),
            cost=T,
            converged=False,
            alternatives=(),
            level=LEAST_ACCELERATION,
            least_possible_duration=least_possible_duration(problem),
        )

    def _told(self, plan: _Plan) -> Solution:
        """The solution that publishes a plan."""
        T = plan.trajectory.duration
        margins = plan.certificate.limits_left
        binding = [key for key, left in margins.items() if left < _BINDS]
        bound = least_possible_duration(self._problem)
        said = (
            f"the least duration found is {T:.6g} s, bound by"
            f" {' and '.join(f'limits.{key}' for key in binding) or 'zones'} ({plan.level});"
            f" no path needs less than {bound:.6g} s"
        )
        return Solution(
            Status.SOLVED,
            f"solved and certified in {1e3 * self._watch.elapsed:.2f} ms; {said}",
            trajectory=plan.trajectory,
            certificate=plan.certificate,
            cost=T,
            converged=plan.converged,
            alternatives=tuple(self._alternatives(T)),
            notes=(said, *self._notes()),
            level=plan.level,
            least_possible_duration=bound,
        )

    def _notes(self) -> Iterator[str]:
        points = [str(o.name) for o in self._problem.obstacles if o.radius == 0.0]
        if points:
            yield f"obstacles without a radius play no part in the least time: {', '.join(points)}"

    def _alternatives(self, duration: float) -> Iterator[Alternative]:
        """Other classes, as certified on few samples."""
        count = 0
        for optimum in self._found:
            if optimum.duration < duration * (1.0 + _SAME) or count == _ALTERNATIVES:
                continue
            plan = self._certified(optimum)
            if plan is not None:
                count += 1
                T = plan.trajectory.duration
                yield Alternative(T, plan.certificate.clearance, plan.trajectory)


def stretched(trajectory: Trajectory, factor: float) -> Trajectory:
    """The same path, so many times slower."""
    return Trajectory(
        trajectory.times * factor,
        trajectory.quaternions_xyzw,
        trajectory.angular_velocities / factor,
        trajectory.angular_accelerations / factor**2,
    )
