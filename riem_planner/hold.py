# SPDX-License-Identifier: Apache-2.0
"""What follows the arrival: the attitude stays at its goal, or goes on with it.

The cost of a hold is that of the zones alone, `1/2 int_T^(T+H) V dt`, by Gauss's rule on pieces
over which nothing moves far.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.obstacles import Forbidden, Obstacle, OrientationObstacle
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_GAUSS_POINTS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(8)  # on [-1, 1]
_PIECE = 0.05  # rad that the zones and the goal together move over a piece
_LOOKS = 64  # at how far they move
_SAMPLE = 0.02  # rad between samples of a hold that moves
_LEAST_SAMPLES = 9
_CONTACT_LOOKS, _CONTACT_ROLLS, _REFINEMENTS = 200, 360, 20


def hold_nodes(problem: Problem) -> tuple[Array, Array]:
    """Times (n,) after the arrival and weights (n,) of the integral over the hold [s].

    One time of weight 0 where there is no hold, or nothing to keep away from.
    """
    T, H = problem.duration, problem.hold
    if H == 0.0 or not problem.obstacles:
        return np.array([T]), np.array([0.0])
    looks = np.linspace(T, T + H, _LOOKS + 1)
    moved = _turn_of_goal(problem, looks) + max(_moved(o, looks) for o in problem.obstacles)
    pieces = 1 + int(moved / _PIECE)
    half = 0.5 * H / pieces
    middles = T + half * (1.0 + 2.0 * np.arange(pieces))
    times = (middles[:, None] + half * _GAUSS_POINTS).ravel()
    return times, half * np.tile(_GAUSS_WEIGHTS, pieces)


def _moved(obstacle: Obstacle, times: Array) -> float:
    """About the angle that an obstacle's place moves over some times [rad]."""
    if isinstance(obstacle, OrientationObstacle):
        return float(np.linalg.norm(obstacle.rate)) * float(times[-1] - times[0])
    return float(np.linalg.norm(np.diff(obstacle.direction_at(times), axis=0), axis=1).sum())


def _turn_of_goal(problem: Problem, times: Array) -> float:
    """About the angle that the attitude turns over some times of the hold [rad]."""
    rates = problem.goals[0].tracked(problem.duration, times)[1]
    speeds = np.linalg.norm(rates, axis=1)
    return float(np.sum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)))


def hold_trajectory(problem: Problem, trajectory: Trajectory) -> Trajectory | None:
    """How the attitude goes on after a trajectory's end; None where the problem has no hold.

    Its time begins with the arrival; it begins where the trajectory ends, with the goal's rate.

    Parameters
    ----------
    problem
        With a single goal; its duration is the trajectory's.
    trajectory
        A slew to the goal.
    """
    if problem.hold == 0.0:
        return None
    T = trajectory.duration
    turned = _turn_of_goal(problem, np.linspace(T, T + problem.hold, _LOOKS + 1))
    count = max(_LEAST_SAMPLES, 1 + int(turned / _SAMPLE))
    return hold_samples(problem, trajectory, np.linspace(0.0, problem.hold, count))


def hold_samples(problem: Problem, trajectory: Trajectory, since: Array) -> Trajectory:
    """The hold after a trajectory, sampled at times (n,) since the arrival [s], from 0 on."""
    turns, rates, accelerations = problem.goals[0].tracked(
        trajectory.duration, trajectory.duration + since
    )
    q_end = trajectory.quaternions_xyzw[-1]
    q = so3.quaternion_multiply(so3.matrix_to_quaternion(turns), q_end)
    q[0] = q_end
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    R = so3.quaternion_to_matrix(q)
    v, a = (np.einsum("kji,kj->ki", R, of) for of in (rates, accelerations))
    return Trajectory(since, q, v, a)


def later(forbidden: Forbidden, time: float) -> Forbidden:
    """What is forbidden as it goes on from a time [s], which becomes time 0."""
    obstacles = tuple(_later(obstacle, time) for obstacle in forbidden.obstacles)
    return replace(forbidden, obstacles=obstacles)


def _later(obstacle: Obstacle, time: float) -> Obstacle:
    if isinstance(obstacle, OrientationObstacle):
        return replace(obstacle, orientation=obstacle.orientation_at(time))
    path = obstacle.path
    return replace(
        obstacle,
        direction=obstacle.direction_at(time) if path is None else path.later(time),
        active=tuple((start - time, end - time) for start, end in obstacle.active),
    )


@dataclass(frozen=True)
class Contact:
    """Where a goal, or the hold after it, is in what is forbidden.

    Parameters
    ----------
    name
        Of the forbidden set.
    depth
        How deep [rad]; of a hold where it begins, 0.
    time
        Time of the first contact [s].
    at_any_roll
        Whether the roll is free and none of them is clear; what is told is of the best one.
    """

    name: str
    depth: float
    time: float
    at_any_roll: bool

    def sentence(self, arrival: float) -> str:
        """What is wrong, in words, for a slew that arrives at a time [s]."""
        rolled = "; no other roll is clear either" if self.at_any_roll else ""
        if self.time > arrival:
            return (
                f"the hold at the goal enters the forbidden set of {self.name!r} at"
                f" t = {self.time:.6g} s, {self.time - arrival:.4g} s after the arrival{rolled}"
            )
        degrees = np.degrees(self.depth)
        return (
            f"the goal is {degrees:.4g} degrees inside the forbidden set of {self.name!r}{rolled}"
        )


def contact(problem: Problem) -> Contact | None:
    """The first contact of the goal, or of the hold after it; None where there is none.

    Parameters
    ----------
    problem
        With a single goal and a duration.
    """
    T, axis = problem.duration, problem.roll_axis
    times = np.array([T])
    if problem.hold > 0.0:
        times = np.linspace(T, T + problem.hold, 1 + _CONTACT_LOOKS)
    turns = problem.goals[0].tracked(T, times)[0] @ problem.arrival.orientation
    found = _contact_of(problem, turns, times, free=axis is not None)
    if found is None or axis is None:
        return found
    rolls = np.linspace(0.0, 2.0 * np.pi, _CONTACT_ROLLS, endpoint=False)

    def at(roll: float) -> float:
        attitudes = turns @ so3.exp(roll * axis)
        return float(np.min(problem.forbidden.least_margin(attitudes, times)))

    margins = np.array([at(roll) for roll in rolls])
    best, step = float(rolls[np.argmax(margins)]), float(rolls[1])
    for _ in range(_REFINEMENTS):
        near = best + step * np.array([-0.5, 0.0, 0.5])
        best, step = float(near[np.argmax([at(roll) for roll in near])]), 0.5 * step
    return _contact_of(problem, turns @ so3.exp(best * axis), times, free=True)


def _contact_of(problem: Problem, attitudes: Array, times: Array, *, free: bool) -> Contact | None:
    """The first contact of attitudes (n, 3, 3) at times (n,)."""
    first: Contact | None = None
    for name, margins in problem.forbidden.margins(attitudes, times).items():
        inside = np.flatnonzero(margins <= 0.0)
        if inside.size and (first is None or times[inside[0]] < first.time):
            k = int(inside[0])
            time = float(times[k])
            if k > 0:  # the margin is nearly straight between so many times
                share = margins[k - 1] / (margins[k - 1] - margins[k])
                time = float(times[k - 1] + share * (times[k] - times[k - 1]))
            first = Contact(name, max(0.0, -float(margins[k])) if k == 0 else 0.0, time, free)
    return first
