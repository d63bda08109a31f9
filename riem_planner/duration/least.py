# SPDX-License-Identifier: Apache-2.0
"""Whether a slew has a least duration, and what it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from riem_planner.duration import braking
from riem_planner.duration.search import (
    MARGIN,
    TOLERANCE,
    LeastDuration,
    Solve,
    quickest,
    searched,
)
from riem_planner.geometry import so3
from riem_planner.goals import State
from riem_planner.limit_rows import KEYS, MOMENTUM, POWERS, RATE, WHEEL_MOMENTUM
from riem_planner.limits import Limits
from riem_planner.problem import S2, Problem
from riem_planner.solution import Solution, Status
from riem_planner.solver.watch import InterruptedSolveError

Array = NDArray[np.float64]

_LEAST_ESTIMATE, _GREATEST_ESTIMATE = 1e-6, 1e8  # s; what is searched stays a valid duration
_ROLLS = 360


def solve_auto(problem: Problem, solve: Solve) -> Solution:
    """Solve a problem of automatic duration: find the least, then solve for it.

    The message says the duration and the limit that binds.
    """
    braked = _solved_by_braking(problem, solve)
    if braked is None or braked.trajectory is None:
        return _solved_smoothly(problem, solve)
    most = braked.trajectory.duration
    try:
        smooth = _solved_smoothly(problem, solve, most)
    except InterruptedSolveError as interruption:
        if interruption.status is Status.CANCELLED:
            raise
        return braked
    longer = smooth.trajectory is None or most < smooth.trajectory.duration
    return braked if longer else smooth


def _solved_by_braking(problem: Problem, solve: Solve) -> Solution | None:
    """The answer that stops first; None where that is no path of its own, or not certified."""
    limits = problem.limits
    if limits is None or not braking.applies(problem):
        return None
    stop = braking.hardest_stop(problem, limits)
    if stop is None:
        return None
    at_rest = State(so3.quaternion_to_matrix(stop.quaternions_xyzw[-1]))
    slew = _solved_smoothly(replace(problem, start=at_rest), solve).trajectory
    return None if slew is None else braking.stop_then_slew(problem, stop, slew)


def _solved_smoothly(problem: Problem, solve: Solve, most: float = math.inf) -> Solution:
    found = least_duration(problem, solve, most)
    if found.failure is not None:
        return found.failure
    for T in (found.duration, found.duration * (1.0 + TOLERANCE)):
        # The solution of another start differs in the last digits.
        found = replace(found, duration=T)
        solution = _solved_near(replace(problem, duration=T), found, solve)
        if solution.solved:
            break
    said = _sentence(found)
    return replace(solution, message=f"{solution.message}; {said}", notes=(*solution.notes, said))


def advised(problem: Problem, refused: Solution, solve: Solve) -> Solution:
    """A solution that was refused for its limits, with the least duration that would not be.

    Where the duration is no less than that after all, the solution found in its search.
    """
    try:
        found = least_duration(problem, solve)
        if found.duration <= problem.duration:
            solution = _solved_near(problem, found, solve)
            if solution.solved:
                return solution
    except InterruptedSolveError as interruption:
        if interruption.status is Status.CANCELLED:
            raise
        return refused
    said = _sentence(found) if found.failure is None else found.failure.message
    return replace(refused, message=f"{refused.message}; {said}", notes=(*refused.notes, said))


def _solved_near(problem: Problem, found: LeastDuration, solve: Solve) -> Solution:
    """The cheapest slew within the limits, or that of the class that was found if none is seen."""
    solution = solve(problem, found.trajectory)
    return solution if solution.solved else solve(problem, found.trajectory, local=True)


def least_duration(problem: Problem, solve: Solve, most: float = math.inf) -> LeastDuration:
    """Shortest duration for which some certified slew keeps a problem's limits.

    Parameters
    ----------
    problem
        With limits; its duration does not count.
    solve
        Solves a problem of fixed duration and no limits.
    most
        Longer durations are of no use [s].
    """
    limits = problem.limits
    if limits is None:
        raise ValueError("the least duration needs limits; the problem has none")
    free = problem.timed(1.0)
    failure = broken_at_ends(problem, limits)
    if failure is not None:
        return LeastDuration(math.inf, failure=failure)
    estimate = _estimate(free, limits)
    if estimate == 0.0:
        if not (free.obstacles and _scales(problem)):
            return _stays(free)
        estimate = 1.0  # s; obstacles push the path out and back, as far whatever the duration
    if not _LEAST_ESTIMATE <= estimate <= _GREATEST_ESTIMATE:
        return _impossible(
            f"these limits mean a slew of about {estimate:.4g} s; check their units (rad/s,"
            " rad/s^2, N m, N m s, and kg m^2 of the inertia)"
        )
    if _scales(problem):
        return _scaled(free, limits, solve, estimate)
    return searched(free, limits, solve, estimate, problem.total_momentum, most)


def _impossible(message: str) -> LeastDuration:
    return LeastDuration(math.inf, failure=Solution(Status.LIMITS_EXCEEDED, message))


def _stays(problem: Problem) -> LeastDuration:
    """The answer where nothing has to move."""
    rule = "the shorter the better" if problem.obstacles else "any duration keeps the limits"
    return _impossible(f"start and goal are the same state at rest: {rule}; give one, in seconds")


def nothing_to_do(problem: Problem) -> Solution | None:
    """Refusal if start and goal are the same state at rest."""
    if problem.goals[0].moves:
        return None
    start, goal = problem.start, problem.arrival
    if np.any(start.angular_velocity) or np.any(goal.angular_velocity):
        return None
    R_0, R_1 = start.orientation, goal.orientation
    axis = problem.boresight if problem.space == S2 else problem.roll_axis
    if axis is not None:
        there = float(np.linalg.norm((R_1 - R_0) @ axis)) > 0.0
    else:
        there = float(so3.distance(R_0, R_1)) > 0.0
    return None if there else _stays(problem).failure


def _sentence(found: LeastDuration) -> str:
    return (
        f"the least duration of the least-acceleration curves found is {found.duration:.6g} s,"
        f" bound by limits.{found.binding}; objective least_time may be quicker"
    )


def broken_at_ends(problem: Problem, limits: Limits) -> Solution | None:
    """Refusal if the rate asked for at an end is more than the limits allow."""
    ends = [("start", problem.start, problem.start.angular_velocity[None])]
    if not problem.goals[0].moves:  # else its rate depends on the duration
        ends.append(("goal", problem.arrival, _arrival_rates(problem)))
    for key, state, rates in ends:
        h = state.orientation.T @ problem.total_momentum
        parts = np.array([limits.parts(rate, np.zeros(3), h=h) for rate in rates])
        for row in (RATE, MOMENTUM, WHEEL_MOMENTUM):
            least = float(np.min(parts[:, row]))
            if least > 1.0:
                return Solution(
                    Status.LIMITS_EXCEEDED,
                    f"{key}.angular_velocity: {least:.4g} times limits.{KEYS[row]}; no duration"
                    f" helps, lower the rate at the {key} or raise the limit",
                )
    return None


def _arrival_rates(problem: Problem) -> Array:
    """Body rates (n, 3) that the goal allows: where its roll is free, of many rolls."""
    rate = problem.arrival.angular_velocity
    axis = problem.boresight if problem.space == S2 else problem.roll_axis
    if axis is None:
        return rate[None]
    rolls = np.linspace(0.0, 2.0 * math.pi, _ROLLS, endpoint=False)
    return np.asarray(rate @ so3.exp(rolls[:, None] * np.asarray(axis)))


def _scales(problem: Problem) -> bool:
    """Whether the path is the same for every duration."""
    held_free = problem.hold > 0.0 and problem.roll_axis is not None
    return (
        not np.any(problem.start.angular_velocity)
        and not problem.goals[0].moves
        and not np.any(problem.arrival.angular_velocity)
        and not held_free
        and not problem.tension
        and not np.any(problem.total_momentum)
        and not problem.forbidden.moving
        and all(obstacle.normalized_strength is not None for obstacle in problem.obstacles)
    )


def _estimate(problem: Problem, limits: Limits) -> float:
    """Duration that the straight cubic would need [s]; 0 where nothing has to move."""
    R_0, R_1 = problem.start.orientation, problem.arrival.orientation
    v_0, v_1 = problem.start.angular_velocity, problem.arrival.angular_velocity
    axis = problem.boresight if problem.space == S2 else problem.roll_axis
    if axis is not None:
        x, y = R_0 @ axis, R_1 @ axis
        turn = R_0.T @ so3.quaternion_log(so3.minimal_rotation(x, y))
    else:
        turn = so3.log(R_0.T @ R_1)
    still = np.zeros(3)
    needed = [0.0]
    for power, motion in (
        (1.0, (1.5 * turn, still, still)),
        (2.0, (still, 6.0 * turn, still)),
        (3.0, (still, still, 12.0 * turn)),
        (2.0, (still, v_1 - v_0, still)),  # a change of rate alone takes time as well
    ):
        parts = limits.parts(*motion).tolist()
        of_power = [part for part, of in zip(parts, POWERS, strict=True) if of == power]
        needed += [part ** (1.0 / power) for part in of_power if part > 0.0]
    if max(needed) == 0.0 and np.any(v_0):
        return 2.0 * math.pi / float(np.linalg.norm(v_0))  # all the way round
    return float(max(needed))


def _scaled(free: Problem, limits: Limits, solve: Solve, estimate: float) -> LeastDuration:
    """The least duration where the path does not depend on it."""
    solution = solve(replace(free, duration=estimate), None)
    if solution.trajectory is None:
        return LeastDuration(math.inf, failure=solution)
    factor, binding, trajectory = quickest(solution, limits)
    if estimate * factor < _LEAST_ESTIMATE:
        return _stays(free)
    return LeastDuration(estimate * factor * (1.0 + MARGIN), binding, trajectory)
