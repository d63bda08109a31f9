# SPDX-License-Identifier: Apache-2.0
"""One planning request: what is asked, and how it is carried out beside the stream."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.mission.settings import Settings
from riem_planner.mission.timeline import Setpoint
from riem_planner.mission.zone_tracker import World
from riem_planner.problem import AUTO, LEAST_ACCELERATION, Problem, State
from riem_planner.solution import Solution, Status
from riem_planner.solve import solve
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_FASTER = 2.0  # a kept arrival time may raise the peak rate that much, no more
_SHARE = 0.5  # of the time left, for an attempt that others may follow
_QUADRATURE = 400  # intervals of the cost of a trajectory that no solve has priced


class Reason(Enum):
    """Why a plan is asked for."""

    GOAL = "a new goal"
    OBSTACLE = "what flew is no longer certified"
    GAIN = "a cheaper class may have opened"
    REQUEST = "a request to plan anew"
    EXECUTE = "an approved plan, from the present reference"
    RETRY = "the goal is not reached yet"
    TARGET = "the goal moves otherwise than it was told to"


@dataclass(frozen=True, eq=False)
class Goal:
    """Where to go.

    Parameters
    ----------
    quaternion : (4,)
        x, y, z, w.
    rate : (3,)
        Body rate on arrival [rad/s].
    stamp_ns
        What it is known by: the stamp of its message, or when that came [ns].
    topic
        Where it was told.
    since_ns
        When a target that turns is at that attitude [ns]; None: at its stamp.
    heard_ns
        When its last message came [ns].
    """

    quaternion: Array
    rate: Array
    stamp_ns: int = 0
    topic: str = "~/goal"
    since_ns: int | None = None
    heard_ns: int = 0

    def equals(self, other: Goal | None) -> bool:
        """Whether it is the same goal, to rounding; q and -q are the same."""
        if other is None or np.any(np.abs(self.rate - other.rate) >= 1e-9):
            return False
        since_ns = self.stamp_ns if self.since_ns is None else self.since_ns
        cosine = abs(float(self.quaternion @ other.at(since_ns)))
        return abs(cosine - 1.0) < 1e-12

    @property
    def moving(self) -> bool:
        """Whether it turns on, so that it is met at its rate and then followed."""
        return bool(np.any(self.rate))

    def at(self, time_ns: int) -> Array:
        """Where it is at a time [ns]: quaternion (4,)."""
        if not self.moving:
            return self.quaternion
        since_ns = self.stamp_ns if self.since_ns is None else self.since_ns
        turn = so3.quaternion_exp(self.rate * ((time_ns - since_ns) * 1e-9))
        turned = so3.quaternion_multiply(self.quaternion, turn)
        return np.asarray(turned / np.linalg.norm(turned))

    def shifted(self, nanoseconds: int) -> Goal:
        """The same motion, that much later; it is known by the same stamp."""
        since_ns = self.stamp_ns if self.since_ns is None else self.since_ns
        return replace(self, since_ns=since_ns + nanoseconds, heard_ns=self.heard_ns + nanoseconds)


@dataclass(frozen=True, eq=False)
class Attempt:
    """One problem to try, how to search, and the largest rate to accept [rad/s]."""

    problem: Problem
    search: Literal["global", "local"]
    warm_start: Trajectory | None = None
    fastest: float = float("inf")


@dataclass(frozen=True, eq=False)
class Request:
    """What the worker is to plan.

    Parameters
    ----------
    reason
        Why.
    goal
        Where to.
    attempts
        Tried in order; the first that is solved counts.
    deadline
        Of all attempts together [s].
    splice_ns
        Where the plan is to begin [ns].
    start
        The reference there.
    fresh
        Nothing is streamed yet, so the plan may begin whenever it is ready.
    approved
        To be flown without asking again.
    """

    reason: Reason
    goal: Goal
    attempts: tuple[Attempt, ...]
    deadline: float
    splice_ns: int
    start: Setpoint
    fresh: bool
    approved: bool


@dataclass(frozen=True, eq=False)
class Result:
    """What became of a request: the solution, the problem it solves, the time it took [s]."""

    request: Request
    solution: Solution
    problem: Problem
    elapsed: float


def state_of(setpoint: Setpoint) -> State:
    """A setpoint as the end of a problem."""
    return State.from_quaternion_xyzw(setpoint.quaternion, setpoint.rate)


def build_problem(
    settings: Settings, world: World, start: Setpoint, goal: Goal, duration: float
) -> Problem:
    """The problem from a reference state to a goal, in the world as it will be at the start.

    A goal that moves is met where it will be after that duration.

    A duration of 0 is the least within the limits.

    Raises
    ------
    InvalidProblemError
        A value is wrong, such as a goal on s2 that rolls.
    """
    arrival_ns = start.stamp_ns + round(duration * 1e9)
    return Problem(
        start=state_of(start),
        goal=State.from_quaternion_xyzw(goal.at(arrival_ns), goal.rate),
        duration=cast(float, duration or AUTO),  # the problem makes a number of it
        space=settings.space,
        normalized_tension=settings.normalized_tension,
        obstacles=world.obstacles(start.stamp_ns),
        boresight=settings.boresight,
        limits=settings.limits,
        objective=LEAST_ACCELERATION if duration else settings.objective,
    )


def carry_out(request: Request, should_stop: Callable[[], bool] = lambda: False) -> Result:
    """Solve a request; never raises for what can't be solved."""
    begin = time.monotonic()
    worst: tuple[Solution, Problem] | None = None
    last = request.attempts[-1]
    for attempt in request.attempts:
        left = request.deadline - (time.monotonic() - begin)
        if worst is not None and (left <= 0.0 or should_stop()):
            break
        solution = solve(
            attempt.problem,
            deadline=max(left if attempt is last else _SHARE * left, 1e-3),
            should_stop=should_stop,
            warm_start=attempt.warm_start,
            search=attempt.search,
        )
        certificate = solution.certificate
        if solution.solved and certificate is not None:
            if certificate.rate_bound <= attempt.fastest:
                problem = attempt.problem.timed(
                    certificate.trajectory.duration, attempt.problem.limits
                )
                return Result(request, solution, problem, time.monotonic() - begin)
            continue
        worst = (solution, attempt.problem)
        if solution.status in (Status.CANCELLED, Status.START_IN_ZONE):
            break
    if worst is None:
        nothing = Solution(Status.NO_CERTIFIED_TRAJECTORY, "no plan keeps to a sensible rate")
        worst = (nothing, request.attempts[-1].problem)
    return Result(request, *worst, time.monotonic() - begin)


def attempts_anew(problem: Problem) -> tuple[Attempt, ...]:
    """Search everywhere, in the configured duration."""
    return (Attempt(problem, "global"),)


def attempts_keeping(
    kept: Problem, anew: Problem, warm_start: Trajectory, peak_rate: float
) -> tuple[Attempt, ...]:
    """The same side in the same time if possible, else any side, else the duration anew."""
    fastest = _FASTER * peak_rate
    return (
        Attempt(kept, "local", warm_start, fastest),
        Attempt(kept, "global", None, fastest),
        Attempt(anew, "global"),
    )


def cost_along(problem: Problem, trajectory: Trajectory, begin: float = 0.0) -> float:
    """Cost [rad^2/s^3] of a trajectory from a time in it [s] on, by Simpson's rule."""
    times = np.linspace(begin, trajectory.duration, _QUADRATURE + 1)
    attitudes, v, a = trajectory.evaluate(times)
    lagrangian = np.sum(a * a, axis=1) + problem.sigma * np.sum(v * v, axis=1)
    V, _ = problem.forbidden.repulsion(attitudes, times - begin, problem.duration)
    lagrangian = lagrangian + V
    weights = np.full(times.size, 2.0)
    weights[1::2] = 4.0
    weights[[0, -1]] = 1.0
    return float(0.5 * weights @ lagrangian * (times[1] - times[0]) / 3.0)
