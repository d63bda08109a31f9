# SPDX-License-Identifier: Apache-2.0
"""The least duration where the path changes with it: searched upwards, then halved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from riem_planner.certificate import certify_limits
from riem_planner.geometry import so3
from riem_planner.limits import Limits
from riem_planner.problem import Problem
from riem_planner.solution import Solution, Status
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

AT_REST = np.zeros(3)

TOLERANCE = 0.004
"""Relative error of the least duration where it has to be searched for."""

MARGIN = 3e-4
"""Relative; the bounds of limits are tight to 1e-4 of their values."""

_LARGEST_STEP, _LEAST_STEP = 1.15, 1.02
_MOST_SOLVES = 150
_MOST_FAILURES = 12  # solves in a row without any trajectory before the search is given up
_LONGEST = 1000.0  # times the duration the search begins with


class Solve(Protocol):
    """Solves a problem of fixed duration, from a warm start.

    With `local` only the class of paths of the warm start counts, however costly it is.
    """

    def __call__(
        self, problem: Problem, near: Trajectory | None, *, local: bool = False
    ) -> Solution:
        """Outcome of the solve."""


@dataclass(frozen=True, eq=False)
class LeastDuration:
    """The least duration within limits, or why there is none.

    Parameters
    ----------
    duration
        The least duration [s]; infinite if none was found.
    binding
        The limit that binds there.
    trajectory
        The slew that needs no longer.
    failure
        What stands against any duration.
    """

    duration: float
    binding: str = ""
    trajectory: Trajectory | None = None
    failure: Solution | None = None


def _candidates(solution: Solution) -> list[Trajectory]:
    if solution.trajectory is None:
        return []
    return [solution.trajectory, *(other.trajectory for other in solution.alternatives)]


def quickest(
    solution: Solution, limits: Limits, total_momentum: Array = AT_REST
) -> tuple[float, str, Trajectory]:
    """The trajectory that has to be stretched least, with its factor and binding limit."""
    stretched = []
    for each in _candidates(solution):
        use = certify_limits(each, limits, total_momentum)
        stretched.append((use.stretch, use.binding, each))
    return min(stretched, key=lambda item: item[0])


@dataclass
class _Trial:
    """A duration that was tried, and how much slower its quickest slew would have to be."""

    duration: float
    solution: Solution
    stretch: float = math.inf
    binding: str = ""
    trajectory: Trajectory | None = None

    @property
    def kept(self) -> bool:
        """Whether the limits are kept."""
        return self.stretch <= 1.0


@dataclass
class _Trials:
    """The durations tried for a problem that has neither limits nor a duration of its own."""

    free: Problem
    limits: Limits
    total_momentum: Array
    solve: Solve
    made: list[_Trial] = field(default_factory=list)

    def at(self, T: float) -> _Trial:
        """One more, of every class of paths."""
        made = (trial.trajectory for trial in reversed(self.made))
        near = next((trajectory for trajectory in made if trajectory is not None), None)
        T = min(T, _known(self.free))
        return self._add(T, self.solve(replace(self.free, duration=T), near))

    def along(self, kept: _Trial, T: float) -> _Trial:
        """One more, of another trial's class alone."""
        timed = replace(self.free, duration=T)
        return self._add(T, self.solve(timed, kept.trajectory, local=True))

    def _add(self, T: float, solution: Solution) -> _Trial:
        quick = (
            ()
            if solution.trajectory is None
            else quickest(solution, self.limits, self.total_momentum)
        )
        self.made.append(_Trial(T, solution, *quick))
        return self.made[-1]


def searched(
    free: Problem,
    limits: Limits,
    solve: Solve,
    estimate: float,
    total_momentum: Array = AT_REST,
    most: float = math.inf,
) -> LeastDuration:
    """The least duration where the path changes with it.

    Parameters
    ----------
    free
        The problem without limits; its duration does not count.
    limits
        What has to be kept.
    solve
        Solves a problem of fixed duration and no limits.
    estimate
        Duration that the straight slew would need [s].
    total_momentum : (3,)
        Of body and wheels, in the reference frame [N m s].
    most
        Longer durations are of no use [s].
    """
    trials = _Trials(free, limits, total_momentum, solve)
    broken = trials.at(_start_of_search(free, estimate))
    while broken.kept and len(trials.made) < _MOST_SOLVES:
        broken = trials.at(0.5 * broken.duration)
    kept = None
    while kept is None:
        if _hopeless(free, trials.made, most):
            return LeastDuration(math.inf, failure=_no_duration(free, trials.made))
        step = min(_LARGEST_STEP, max(_LEAST_STEP, math.sqrt(broken.stretch)))
        trial = trials.at(step * broken.duration)
        if trial.kept:
            kept = trial
        else:
            broken = trial
    kept = _followed(trials, _halved(trials.at, broken, kept))
    duration = min(kept.duration * (1.0 + MARGIN), _known(free))
    return LeastDuration(duration, kept.binding, kept.trajectory)


def _known(free: Problem) -> float:
    """The longest duration that the samples of all moving zones cover [s]."""
    return free.forbidden.known_until - free.hold


def _halved(tried: Callable[[float], _Trial], broken: _Trial, kept: _Trial) -> _Trial:
    """The shortest of the kept trials from a broken one on, to `TOLERANCE`."""
    while kept.duration > broken.duration * (1.0 + TOLERANCE):
        trial = tried(math.sqrt(broken.duration * kept.duration))
        if trial.kept:
            kept = trial
        else:
            broken = trial
    return kept


def _followed(trials: _Trials, kept: _Trial) -> _Trial:
    """The shortest kept trial of a trial's class of paths.

    Only the cheapest classes are seen of each duration. One that is seen from some duration on
    may keep the limits long before.
    """
    while kept.stretch < 1.0 - TOLERANCE and len(trials.made) < _MOST_SOLVES:
        part = max((1.0 + 0.5 * TOLERANCE) * kept.stretch, 1.0 / _LARGEST_STEP)
        shorter = trials.along(kept, part * kept.duration)
        if not shorter.kept:
            return _halved(partial(trials.along, kept), shorter, kept)
        kept = shorter
    return kept


def _hopeless(free: Problem, trials: list[_Trial], most: float) -> bool:
    """Whether longer durations are not worth trying."""
    status = trials[-1].solution.status
    moving = free.forbidden.moving or free.goals[0].moves
    if status is Status.START_IN_ZONE or (status is Status.GOAL_IN_ZONE and not moving):
        return True
    last = trials[-_MOST_FAILURES:]
    failures = len(last) == _MOST_FAILURES and all(trial.trajectory is None for trial in last)
    known = min(most, _LONGEST * trials[0].duration)
    too_long = trials[-1].duration > known or trials[-1].duration >= _known(free)
    return failures or too_long or len(trials) >= _MOST_SOLVES


def _no_duration(free: Problem, trials: list[_Trial]) -> Solution:
    """What to say where every duration failed."""
    last = trials[-1]
    if all(trial.trajectory is None for trial in trials):
        return last.solution
    least = min(trials, key=lambda trial: trial.stretch)
    remedy = "raise that limit"
    if last.duration >= _known(free):
        remedy += ", or give samples of the moving zones for longer: they end there"
    if any(obstacle.normalized_strength is None for obstacle in free.obstacles):
        remedy += ", or give normalized_strength, with which a longer slew is a gentler one"
    return Solution(
        Status.LIMITS_EXCEEDED,
        f"no duration from {trials[0].duration:.4g} to {last.duration:.4g} s keeps the limits; at"
        f" best, {least.stretch:.4g} times too fast for limits.{least.binding} in"
        f" {least.duration:.4g} s; {remedy}",
    )


def _start_of_search(problem: Problem, estimate: float) -> float:
    """A duration below the least one that is likely [s]."""
    speed = max(
        float(np.linalg.norm(state.angular_velocity)) for state in (problem.start, problem.arrival)
    )
    if speed == 0.0:
        return 0.5 * estimate
    angle = float(so3.distance(problem.start.orientation, problem.arrival.orientation))
    return 0.5 * min(estimate, max(angle / speed, 1e-3 * estimate))
