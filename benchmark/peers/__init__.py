# SPDX-License-Identifier: Apache-2.0
"""Other ways to solve the same problems, each built as its users would build it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmark.cost import Curve
from riem_planner import Problem
from riem_planner.geometry import so3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PeerResult:
    """What a peer answered.

    Attributes
    ----------
    success
        Whether it reports success.
    curve
        Its answer as a function of time.
    mesh : (n,)
        Its own mesh [s].
    """

    success: bool
    curve: Curve
    mesh: Array


def horizontal_basis(problem: Problem) -> Array:
    """Basis (3, k) of the body rates: all of them on SO(3), those without roll on S^2."""
    if problem.space.name == "so3":
        return np.eye(3)
    return np.linalg.svd(problem.boresight[None, :])[2][1:].T


def hermite_guess(problem: Problem, times: Array) -> tuple[Array, Array, Array, Array]:
    """Quaternions, rates, accelerations and jerks (m, ...) of the cubic in the rotation vector.

    It meets both ends; jerks are left to the cubic's own third derivative.
    """
    T = problem.duration
    q0 = problem.start.quaternion_xyzw
    v0, v1 = problem.start.angular_velocity, problem.goal.angular_velocity
    q1 = goal_quaternion(problem)
    if problem.space.name == "s2":
        v1 = so3.quaternion_to_matrix(q1).T @ problem.goal.orientation @ v1
    turn = so3.quaternion_log(so3.quaternion_multiply(so3.quaternion_conjugate(q0), q1))
    slope = so3.right_jacobian_inverse(turn) @ v1
    second = (3.0 * turn / T - 2.0 * v0 - slope) / T
    third = (v0 + slope - 2.0 * turn / T) / T**2
    s = times[:, None]
    xi = s * (v0 + s * (second + s * third))
    rate = v0 + s * (2.0 * second + 3.0 * s * third)
    v = np.einsum("nij,nj->ni", so3.right_jacobian(xi), rate)
    q = so3.quaternion_multiply(q0, so3.quaternion_exp(xi))
    return q, v, 2.0 * second + 6.0 * s * third, np.broadcast_to(6.0 * third, v.shape)


def goal_quaternion(problem: Problem) -> Array:
    """Attitude (4,) to guess at the end; on S^2 the one of the least rotation from the start."""
    if problem.space.name == "so3":
        return problem.goal.quaternion_xyzw
    start, b = problem.start, problem.boresight
    turn = so3.minimal_rotation(start.orientation @ b, problem.goal.orientation @ b)
    return so3.quaternion_multiply(turn, start.quaternion_xyzw)
