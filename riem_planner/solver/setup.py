"""A problem in the form that the solver works on: normalised time, boresight e3 on S^2."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.obstacles.table import BORESIGHT
from riem_planner.problem import S2, Problem
from riem_planner.solver.curves import lift

Array = NDArray[np.float64]

_UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])
_UNTURNED.flags.writeable = False


class Setup(NamedTuple):
    """Boundary-value problem in normalised time s = t / T.

    Attributes
    ----------
    pointing
        Whether the space is S^2; the body axes are then turned so that the boresight is e3.
    table : (n, 16)
        Packed obstacles.
    sigma
        `sigma T^2`.
    start, goal : (7,)
        Quaternion x, y, z, w and body rate times T.
    body : (4,)
        Quaternion from the solver's body axes to the user's.
    """

    pointing: bool
    table: Array
    sigma: float
    start: Array
    goal: Array
    body: Array

    def lifted(self, q: Array) -> Array:
        """Attitudes (n, 4) of a curve, made roll-free on S^2."""
        if not self.pointing:
            return q
        lifted = q.copy()
        lifted[0] = self.start[:4]
        lift(lifted)
        return lifted

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
    """Normalise a problem."""
    T = problem.duration
    pointing = problem.space == S2
    table = problem.forbidden.normalised_table(T)
    body, to_body = _UNTURNED, None
    ends = []
    if pointing:
        body, to_body = _body_axes(*problem.boresight.tolist())
        table[:, BORESIGHT : BORESIGHT + 3] = (0.0, 0.0, 1.0)
    for state in (problem.start, problem.goal):
        q, v = state.quaternion_xyzw, state.angular_velocity * T
        if to_body is not None:
            q = so3.quaternion_multiply(q, body)
            v = to_body @ v
            v[2] = 0.0
        ends.append(np.concatenate([q, v]))
    start, goal = ends
    return Setup(pointing, table, problem.sigma * T**2, start, goal, body)
