"""The least duration of a slew within limits.

With `s = t / T` the problem on [0, 1] has the tension `sigma T^2` and the strengths `tau T^4`
(mathematics, section 3). From rest to rest, with these normalised values given and nothing that
moves, the path is therefore the same for every duration: its rate and momentum go with 1/T, its
acceleration and torque with 1/T^2, and one solve tells the least T.

Otherwise the path changes with T. The durations are then searched from well below the estimate
upwards, in steps of at most 15 %, each solved anew from the last one's trajectory, and the first
step from broken limits to kept ones is halved until it is known to `TOLERANCE`. A window of
durations narrower than a step can be missed. The search ends without an answer past `_LONGEST`
times where it began, or where nothing at all is found any more: with strengths of their own,
obstacles push as hard however long a slew takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from riem_planner.certificate import certify_limits
from riem_planner.geometry import so3
from riem_planner.limits import Limits
from riem_planner.problem import S2, Problem
from riem_planner.solution import Solution, Status
from riem_planner.solver.watch import InterruptedSolveError
from riem_planner.trajectory import Trajectory

Solve = Callable[[Problem, Trajectory | None], Solution]
"""Solves a problem of fixed duration, from a warm start."""

TOLERANCE = 0.004
"""Relative error of the least duration where it has to be searched for."""

_POWERS = {"rate": 1.0, "acceleration": 2.0, "torque": 2.0, "momentum": 1.0}
_MARGIN = 3e-4  # relative; the bounds of limits are tight to 1e-4 of their values
_LARGEST_STEP, _LEAST_STEP = 1.15, 1.02
_MOST_SOLVES = 150
_MOST_FAILURES = 12  # solves in a row without any trajectory before the search is given up
_LONGEST = 1000.0  # times the duration the search begins with
_LEAST_ESTIMATE, _GREATEST_ESTIMATE = 1e-6, 1e8  # s; what is searched stays a valid duration


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


def solve_auto(problem: Problem, solve: Solve) -> Solution:
    """Solve a problem of automatic duration: find the least, then solve for it.

    The message says the duration and the limit that binds.
    """
    found = least_duration(problem, solve)
    if found.failure is not None:
        return found.failure
    solution = solve(replace(problem, duration=found.duration), found.trajectory)
    if solution.status is Status.LIMITS_EXCEEDED:
        # The solution of another start differs in the last digits.
        found = replace(found, duration=found.duration * (1.0 + TOLERANCE))
        solution = solve(replace(problem, duration=found.duration), found.trajectory)
    said = _sentence(found)
    return replace(solution, message=f"{solution.message}; {said}", notes=(*solution.notes, said))


def advised(problem: Problem, refused: Solution, solve: Solve) -> Solution:
    """A solution that was refused for its limits, with the least duration that would not be."""
    try:
        found = least_duration(problem, solve)
    except InterruptedSolveError as interruption:
        if interruption.status is Status.CANCELLED:
            raise
        return refused
    said = _sentence(found) if found.failure is None else found.failure.message
    return replace(refused, message=f"{refused.message}; {said}", notes=(*refused.notes, said))


def least_duration(problem: Problem, solve: Solve) -> LeastDuration:
    """Shortest duration for which some certified slew keeps a problem's limits.

    Parameters
    ----------
    problem
        With limits; its duration does not count.
    solve
        Solves a problem of fixed duration and no limits.
    """
    limits = problem.limits
    if limits is None:
        raise ValueError("the least duration needs limits; the problem has none")
    failure = _broken_at_ends(problem, limits)
    if failure is not None:
        return LeastDuration(math.inf, failure=failure)
    free = replace(problem, limits=None, duration=1.0)
    estimate = _estimate(free, limits)
    if estimate == 0.0:
        if not (free.obstacles and _scales(free)):
            return _stays(free)
        estimate = 1.0  # s; obstacles push the path out and back, as far whatever the duration
    if not _LEAST_ESTIMATE <= estimate <= _GREATEST_ESTIMATE:
        return _impossible(
            f"these limits mean a slew of about {estimate:.4g} s; check their units (rad/s,"
            " rad/s^2, N m, N m s, and kg m^2 of the inertia)"
        )
    if _scales(free):
        return _scaled(free, limits, solve, estimate)
    return _searched(free, limits, solve, estimate)


def _impossible(message: str) -> LeastDuration:
    return LeastDuration(math.inf, failure=Solution(Status.LIMITS_EXCEEDED, message))


def _stays(problem: Problem) -> LeastDuration:
    """The answer where nothing has to move."""
    rule = "the shorter the better" if problem.obstacles else "any duration keeps the limits"
    return _impossible(f"start and goal are the same state at rest: {rule}; give one, in seconds")


def _sentence(found: LeastDuration) -> str:
    return (
        f"the least duration within the limits is {found.duration:.6g} s, bound by limits."
        f"{found.binding}"
    )


def _broken_at_ends(problem: Problem, limits: Limits) -> Solution | None:
    """Refusal if the rate asked for at an end is more than the limits allow."""
    for key, state in (("start", problem.start), ("goal", problem.goal)):
        used = limits.used(state.angular_velocity, np.zeros(3))
        for name in ("rate", "momentum"):
            if used.get(name, 0.0) > 1.0:
                return Solution(
                    Status.LIMITS_EXCEEDED,
                    f"{key}.angular_velocity: {used[name]:.4g} times limits.{name}; no duration"
                    f" helps, lower the rate at the {key} or raise the limit",
                )
    return None


def _scales(problem: Problem) -> bool:
    """Whether the path is the same for every duration."""
    return (
        not np.any(problem.start.angular_velocity)
        and not np.any(problem.goal.angular_velocity)
        and not problem.tension
        and all(
            obstacle.normalized_strength is not None and not np.any(obstacle.rate)
            for obstacle in problem.obstacles
        )
    )


def _estimate(problem: Problem, limits: Limits) -> float:
    """Duration that the straight cubic would need [s]; 0 where nothing has to move."""
    R_0, R_1 = problem.start.orientation, problem.goal.orientation
    v_0, v_1 = problem.start.angular_velocity, problem.goal.angular_velocity
    if problem.space == S2:
        x, y = R_0 @ problem.boresight, R_1 @ problem.boresight
        turn = R_0.T @ so3.quaternion_log(so3.minimal_rotation(x, y))
    else:
        turn = so3.log(R_0.T @ R_1)
    still = np.zeros(3)
    needed = [
        part ** (1.0 / _POWERS[key])
        for v, a in ((1.5 * turn, still), (still, 6.0 * turn))
        for key, part in limits.used(v, a).items()
        if (_POWERS[key] == 2.0) == bool(np.any(a))
    ]
    # A change of rate alone takes time as well.
    needed += [part for key, part in limits.used(still, v_1 - v_0).items() if _POWERS[key] == 2.0]
    if max(needed) == 0.0 and np.any(v_0):
        return 2.0 * math.pi / float(np.linalg.norm(v_0))  # all the way round
    return float(max(needed))


def _candidates(solution: Solution) -> list[Trajectory]:
    if solution.trajectory is None:
        return []
    return [solution.trajectory, *(other.trajectory for other in solution.alternatives)]


def _stretch(trajectory: Trajectory, limits: Limits) -> tuple[float, str]:
    """How many times slower a trajectory would keep the limits, and which limit says so."""
    parts = certify_limits(trajectory, limits).parts
    factors = {key: part ** (1.0 / _POWERS[key]) for key, part in parts.items()}
    binding = max(factors, key=lambda key: factors[key])
    return factors[binding], binding


def _quickest(solution: Solution, limits: Limits) -> tuple[float, str, Trajectory]:
    """The trajectory that has to be stretched least, with its factor and binding limit."""
    stretched = [(*_stretch(each, limits), each) for each in _candidates(solution)]
    return min(stretched, key=lambda item: item[0])


def _scaled(free: Problem, limits: Limits, solve: Solve, estimate: float) -> LeastDuration:
    """The least duration where the path does not depend on it."""
    solution = solve(replace(free, duration=estimate), None)
    if solution.trajectory is None:
        return LeastDuration(math.inf, failure=solution)
    factor, binding, trajectory = _quickest(solution, limits)
    if estimate * factor < _LEAST_ESTIMATE:
        return _stays(free)
    return LeastDuration(estimate * factor * (1.0 + _MARGIN), binding, trajectory)


@dataclass
class _Trial:
    """A duration that was tried, and how much slower its quickest slew would have to be."""

    duration: float
    stretch: float
    binding: str
    solution: Solution
    trajectory: Trajectory | None

    @property
    def kept(self) -> bool:
        """Whether the limits are kept."""
        return self.stretch <= 1.0


def _searched(free: Problem, limits: Limits, solve: Solve, estimate: float) -> LeastDuration:
    """The least duration where the path changes with it."""
    trials: list[_Trial] = []

    def tried(T: float) -> _Trial:
        near = next((t.trajectory for t in reversed(trials) if t.trajectory is not None), None)
        solution = solve(replace(free, duration=T), near)
        if solution.trajectory is None:
            trials.append(_Trial(T, math.inf, "", solution, None))
        else:
            stretch, binding, trajectory = _quickest(solution, limits)
            trials.append(_Trial(T, stretch, binding, solution, trajectory))
        return trials[-1]

    broken = tried(_start_of_search(free, estimate))
    while broken.kept and len(trials) < _MOST_SOLVES:
        broken = tried(0.5 * broken.duration)
    kept = None
    while kept is None:
        if _hopeless(free, trials):
            return LeastDuration(math.inf, failure=_no_duration(trials))
        step = min(_LARGEST_STEP, max(_LEAST_STEP, math.sqrt(broken.stretch)))
        trial = tried(step * broken.duration)
        if trial.kept:
            kept = trial
        else:
            broken = trial
    while kept.duration > broken.duration * (1.0 + TOLERANCE):
        trial = tried(math.sqrt(broken.duration * kept.duration))
        if trial.kept:
            kept = trial
        else:
            broken = trial
    return LeastDuration(
        kept.duration * (1.0 + _MARGIN), broken.binding or kept.binding, kept.trajectory
    )


def _hopeless(free: Problem, trials: list[_Trial]) -> bool:
    """Whether longer durations are not worth trying."""
    status = trials[-1].solution.status
    moving = any(np.any(obstacle.rate) for obstacle in free.obstacles)
    if status is Status.START_IN_ZONE or (status is Status.GOAL_IN_ZONE and not moving):
        return True
    last = trials[-_MOST_FAILURES:]
    failures = len(last) == _MOST_FAILURES and all(trial.trajectory is None for trial in last)
    too_long = trials[-1].duration > _LONGEST * trials[0].duration
    return failures or too_long or len(trials) >= _MOST_SOLVES


def _no_duration(trials: list[_Trial]) -> Solution:
    """What to say where every duration failed."""
    last = trials[-1]
    if all(trial.trajectory is None for trial in trials):
        return last.solution
    least = min(trials, key=lambda trial: trial.stretch)
    return Solution(
        Status.LIMITS_EXCEEDED,
        f"no duration from {trials[0].duration:.4g} to {last.duration:.4g} s keeps the limits; at"
        f" best, {least.stretch:.4g} times too fast for limits.{least.binding} in"
        f" {least.duration:.4g} s",
    )


def _start_of_search(problem: Problem, estimate: float) -> float:
    """A duration below the least one that is likely [s]."""
    speed = max(
        float(np.linalg.norm(state.angular_velocity)) for state in (problem.start, problem.goal)
    )
    if speed == 0.0:
        return 0.5 * estimate
    angle = float(so3.distance(problem.start.orientation, problem.goal.orientation))
    return 0.5 * min(estimate, max(angle / speed, 1e-3 * estimate))
