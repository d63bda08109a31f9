# SPDX-License-Identifier: Apache-2.0
"""First guesses: one curve for each way round that may be worth a descent.

A class of paths is left out only by a true lower bound: obstacles add to the cost, so no path
downhill from a guess's own minimum without obstacles is cheaper than that minimum.

Every guess has its mirror image in time: the guesses of the reversed problem, reversed, are
guesses as well, so that what is found does not depend on the direction of time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.solver import curves
from riem_planner.solver.setup import Setup

Array = NDArray[np.float64]

_NODES_LEAST, _NODES_MOST = 24, 96
_NODES_TURNING = 240
_NODE_ANGLE = 0.15  # rad of a first guess between nodes
# Turns about the rate at an end [rad], beyond half of what that rate alone would make; tried
# where it would make more than this.
_SPINS = np.arange(-7.0, 8.0, np.pi)
_SPINS_FROM = 6.0
_ROLLS = (2.0 * np.pi / 3.0, -2.0 * np.pi / 3.0)  # where it is free at the end, to begin with


class Guesses(NamedTuple):
    """Curves at the same times, the straightest first.

    Attributes
    ----------
    times : (N + 1,)
        Normalised.
    curves
        Attitudes (N + 1, 4).
    """

    times: Array
    curves: list[Array]


def ways_round(setup: Setup) -> Guesses:
    """Curves that go round either way, and further where rates ask for it; of one class each."""
    ends, rates, _, length = curves.ways_round(setup.pointing, setup.start, setup.goal)
    times = _times(length, _NODES_MOST)
    return Guesses(times, _cubics(setup, ends, rates, times))


def all_guesses(setup: Setup) -> Guesses:
    """Curves of every class that may be worth a descent; from several rolls where it is free."""
    if setup.free_roll:
        return _rolled_guesses(setup)
    if not (np.any(setup.start[4:]) or np.any(setup.goal[4:])):
        return ways_round(setup)  # from rest to rest they are their own mirror images
    back = _reversed(setup)
    ends, rates, _, length = curves.ways_round(setup.pointing, setup.start, setup.goal)
    ends_back, rates_back, _, length_back = curves.ways_round(back.pointing, back.start, back.goal)
    fast = max(_speed(setup.start), _speed(setup.goal)) > _SPINS_FROM
    times = _times(max(length, length_back), _NODES_TURNING if fast else _NODES_MOST)
    guesses = _cubics(setup, ends, rates, times) + _spins(setup, times)
    mirrored = _cubics(back, ends_back, rates_back, times) + _spins(back, times)
    guesses += [setup.with_goal(_with_start(setup, q[::-1])) for q in mirrored]
    return Guesses(times, guesses)


def _rolled_guesses(setup: Setup) -> Guesses:
    """All ways to the roll that the least rotation brings, and the straightest to two others.

    The rolls are a circle that is no contractible loop: either way round leads to the same class.
    """
    times, guesses = all_guesses(setup._replace(goal=setup.goal_at(setup.goal[:4])))
    for roll in _ROLLS:
        turn = np.array([0.0, 0.0, np.sin(0.5 * roll), np.cos(0.5 * roll)])
        goal = setup.goal_at(so3.quaternion_multiply(setup.goal[:4], turn))
        rolled = setup._replace(goal=goal)
        ends, rates, _, _ = curves.ways_round(False, rolled.start, rolled.goal)
        guesses = guesses + _cubics(rolled, ends[:1], rates[:1], times)
    return Guesses(times, guesses)


def _times(length: float, most: int) -> Array:
    nodes = min(max(int(length / _NODE_ANGLE), _NODES_LEAST), most)
    return np.arange(nodes + 1) / nodes


def _speed(state: Array) -> float:
    return float(np.linalg.norm(state[4:]))


def _cubics(setup: Setup, ends: Array, rates: Array, times: Array) -> list[Array]:
    """Curves (N + 1, 4) along cubic rotation vectors with those ends and rates (m, 3) there."""
    guesses = []
    for end, rate in zip(ends, rates, strict=True):
        q = np.empty((times.size, 4))
        curves.guess(setup.start[:4], setup.start[4:], end, rate, times, q)
        guesses.append(setup.with_goal(q))
    return guesses


def _spins(setup: Setup, times: Array) -> list[Array]:
    """Curves that turn about the initial rate while it dies away, bent to meet the goal."""
    speed = _speed(setup.start)
    if speed <= _SPINS_FROM:
        return []
    axis = setup.start[4:] / speed
    still = np.zeros(3)
    guesses = []
    for turn in 0.5 * speed + _SPINS:
        q = np.empty((times.size, 4))
        curves.guess(setup.start[:4], setup.start[4:], turn * axis, still, times, q)
        curves.meet_ends(setup.pointing, setup.start, setup.goal, times, q)
        guesses.append(setup.with_goal(q))
    return guesses


def _reversed(setup: Setup) -> Setup:
    """The same ends the other way round in time."""
    start, goal = setup.goal.copy(), setup.start.copy()
    start[4:] *= -1.0
    goal[4:] *= -1.0
    return setup._replace(start=start, goal=goal)


def _with_start(setup: Setup, q: Array) -> Array:
    """A curve with the start's own attitude, on S^2 its roll, which its rate refers to."""
    q = np.ascontiguousarray(q)
    q[0] = setup.start[:4]
    return q
