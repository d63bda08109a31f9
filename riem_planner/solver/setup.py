# SPDX-License-Identifier: Apache-2.0
"""A problem in the form that the solver works on: normalised time, what points along e3."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.hold import hold_nodes
from riem_planner.obstacles.table import BORESIGHT, KIND, ORIENTATION, PLACE, obstacle_rows
from riem_planner.problem import S2, Problem, State
from riem_planner.solver.curves import lift
from riem_planner.solver.ends import FIXED, settled

Array = NDArray[np.float64]

_UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])
_UNTURNED.flags.writeable = False


class Setup(NamedTuple):
    """Boundary-value problem in normalised time s = t / T.

    Attributes
    ----------
    pointing
        Whether the space is S^2.
    table : (n, WIDTH)
        What is forbidden.
    sigma
        `sigma T^2`.
    start : (7,)
        Quaternion x, y, z, w and body rate times T.
    goal : (7,) or longer
        The same; where the roll is free, the nodes of the hold behind it: see `ends`.
    held : (7,) or longer
        The goal with the nodes of the hold, whether its roll is free or not.
    body : (4,)
        Quaternion from the solver's body axes to the user's. On S^2, and where the roll at the
        end is free, the solver's are turned so that the boresight is e3.
    """

    pointing: bool
    table: Array
    sigma: float
    start: Array
    goal: Array
    held: Array
    body: Array

    def lifted(self, q: Array) -> Array:
        """Attitudes (n, 4) of a curve, made roll-free on S^2."""
        if not self.pointing:
            return q
        lifted = q.copy()
        lifted[0] = self.start[:4]
        lift(lifted)
        return lifted

    @property
    def free_roll(self) -> bool:
        """Whether the roll at the end is free, on SO(3)."""
        return self.goal.size > FIXED

    def goal_at(self, q: Array) -> Array:
        """The goal (7,) with the roll of an attitude (4,) that meets it, where the roll is free."""
        if not self.free_roll:
            return self.goal
        turned: Array = settled(self.goal, np.ascontiguousarray(q))
        return turned

    def with_goal(self, q: Array) -> Array:
        """The same array, on S^2 with the goal's own roll at its end: its rate refers to that."""
        if self.pointing:
            q[-1] = self.goal[:4]
        return q


@lru_cache(maxsize=16)
def _body_axes(x: float, y: float, z: float) -> tuple[Array, Array]:
    """Quaternion to the user's body axes from ones with e3 along a boresight, and the way back."""
    body = so3.minimal_rotation(np.array([0.0, 0.0, 1.0]), np.array([x, y, z]))
    body.flags.writeable = False
    return body, so3.quaternion_to_matrix(body).T


def set_up(problem: Problem) -> Setup:
    """Normalise a problem with a single goal."""
    T = problem.duration
    pointing = problem.space == S2
    table = problem.forbidden.normalised_table(T)
    body, to_body = _UNTURNED, None
    axis = problem.boresight if pointing else problem.roll_axis
    if axis is not None:
        body, to_body = _body_axes(*axis.tolist())
        table = _turned(table, body, to_body)
    start, goal = (
        _end(state, T, body, to_body, pointing) for state in (problem.start, problem.arrival)
    )
    held = goal
    if not pointing and axis is not None:
        goal = held = _with_hold(problem, _least_rolled(start, goal))
    elif problem.hold > 0.0:
        held = _with_hold(problem, goal)
    return Setup(pointing, table, problem.sigma * T**2, start, goal, held, body)


def _turned(table: Array, body: Array, to_body: Array) -> Array:
    """A packed table for body axes turned by `body`."""
    rows = obstacle_rows(table)
    attitudes = rows[:, KIND] == ORIENTATION
    rows[attitudes, PLACE : PLACE + 4] = so3.quaternion_multiply(
        rows[attitudes, PLACE : PLACE + 4], body
    )
    rows[:, BORESIGHT : BORESIGHT + 3] = rows[:, BORESIGHT : BORESIGHT + 3] @ to_body.T
    return table


def _end(state: State, T: float, body: Array, to_body: Array | None, pointing: bool) -> Array:
    """Quaternion and normalised body rate (7,) of a state, in the solver's body axes."""
    q, v = state.quaternion_xyzw, state.angular_velocity * T
    if to_body is not None:
        q = so3.quaternion_multiply(q, body)
        v = to_body @ v
        if pointing:
            v[2] = 0.0
    return np.concatenate([q, v])


def _least_rolled(start: Array, goal: Array) -> Array:
    """The goal (7,) with the roll that the least rotation of e3 from the start brings along."""
    first, last = (so3.quaternion_to_matrix(end[:4]) for end in (start, goal))
    q = so3.quaternion_multiply(so3.minimal_rotation(first[:, 2], last[:, 2]), start[:4])
    back = so3.quaternion_to_matrix(q).T @ last
    return np.concatenate([q, back @ goal[4:7]])


def _with_hold(problem: Problem, goal: Array) -> Array:
    """A goal (7,) with the nodes of its hold behind it; see `ends`."""
    times, weights = hold_nodes(problem)
    turns = problem.goals[0].tracked(problem.duration, times)[0]
    q = so3.quaternion_multiply(so3.matrix_to_quaternion(turns), goal[:4])
    nodes = np.column_stack([q, times / problem.duration, weights / problem.duration])
    return np.concatenate([goal, nodes.ravel()])
