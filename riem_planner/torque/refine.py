# SPDX-License-Identifier: Apache-2.0
"""From a trajectory of least acceleration to one of least torque in the same class of paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.certificate import Certificate, certify
from riem_planner.errors import InvalidProblemError
from riem_planner.limits import Limits
from riem_planner.problem import SO3, Problem
from riem_planner.torque.cost import Motion, TorqueCost
from riem_planner.torque.descent import descend
from riem_planner.torque.extremality import torque_extremality
from riem_planner.torque.splines import SplineMesh
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_LEAST_INTERVALS = 48
_MOST_INTERVALS = 2000
_REFINEMENTS = 3


@dataclass(frozen=True, eq=False)
class TorqueSolution:
    """Outcome of `refine_torque`.

    Parameters
    ----------
    trajectory
        The trajectory of least torque; None if the certificate refuses it.
    certificate
        The ordinary checker's verdict on it; `certificate.reasons` says why it was refused.
    effort, effort_before
        `int |u|^2 dt` of the torque `u = J a + v x J v`, of the result and of the trajectory it
        began with [N^2 m^2 s].
    cost, cost_before
        `1/2 int (|u|^2 / J_m^2 + sigma |v|^2 + sum V_i) dt` of both [rad^2/s^3].
    first_order_residual
        Relative residual of this cost's first-order conditions, of the result.
    local_minimum
        Whether the second variation of the discretised cost is positive definite.
    iterations
        Newton steps.
    """

    trajectory: Trajectory | None
    certificate: Certificate
    effort: float
    effort_before: float
    cost: float
    cost_before: float
    first_order_residual: float
    local_minimum: bool
    iterations: int

    @property
    def solved(self) -> bool:
        """Whether there is a certified trajectory."""
        return self.trajectory is not None


def refine_torque(
    trajectory: Trajectory,
    problem: Problem,
    inertia: ArrayLike | None = None,
    *,
    tolerance: float = 1e-6,
) -> TorqueSolution:
    """The trajectory of least torque that lies downhill from a given one.

    It keeps to the class of paths of the given one, as far as steps of at most 0.5 rad that never
    end in a zone do: one could leap an obstacle smaller than that.

    Parameters
    ----------
    trajectory
        Where to begin, such as that of `solve`; it meets the ends of the problem, and no zone.
    problem
        On SO(3). Its duration, tension and obstacles count; where its duration is automatic,
        that of the trajectory does.
    inertia : (3, 3)
        J [kg m^2]; by default that of the problem's limits.
    tolerance
        Of the residual of the first-order conditions, relative: while it is larger the mesh is
        halved, up to three times. `first_order_residual` says what was reached.

    Raises
    ------
    InvalidProblemError
        The space is not SO(3), an inertia is missing or impossible, or the trajectory is not of
        this problem.
    """
    problem, J = _checked(trajectory, problem, inertia)
    mesh = SplineMesh(_nodes(trajectory))
    cost = TorqueCost(problem, J, mesh.points, mesh.weights)
    begin = _motion(trajectory, mesh)
    before = cost.value(begin), cost.effort(begin)
    if not np.isfinite(before[0]):
        raise InvalidProblemError("trajectory", "it enters a zone; begin with a certified one")
    best, iterations = trajectory, 0
    for refinement in range(_REFINEMENTS + 1):
        found = descend(cost, mesh, _motion(best, mesh))
        best = _trajectory(found.motion, mesh, problem.duration)
        iterations += found.iterations
        residual = torque_extremality(best, problem, J)
        finer = np.sort(np.concatenate([mesh.nodes, 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])]))
        if residual <= tolerance or refinement == _REFINEMENTS or finer.size > _MOST_INTERVALS:
            break
        mesh = SplineMesh(finer)
        cost = TorqueCost(problem, J, mesh.points, mesh.weights)
    certificate = certify(best, problem)
    reached = _motion(best, mesh)
    # From normalised time, and the mean moment, to seconds and newton metres.
    scale, moment = problem.duration**-3, float(np.trace(J)) / 3.0
    return TorqueSolution(
        trajectory=best if certificate.certified else None,
        certificate=certificate,
        effort=scale * moment**2 * cost.effort(reached),
        effort_before=scale * moment**2 * before[1],
        cost=scale * cost.value(reached),
        cost_before=scale * before[0],
        first_order_residual=residual,
        local_minimum=found.minimum,
        iterations=iterations,
    )


def _checked(
    trajectory: Trajectory, problem: Problem, inertia: ArrayLike | None
) -> tuple[Problem, Array]:
    if problem.space != SO3:
        raise InvalidProblemError(
            "space", "expected so3: on s2 the roll is free, and torque would depend on it"
        )
    if inertia is None:
        inertia = None if problem.limits is None else problem.limits.inertia
    if inertia is None:
        raise InvalidProblemError("inertia", "missing; torque needs it: a 3x3 matrix in kg m^2")
    J = Limits(rate=1.0, inertia=inertia).inertia_matrix
    if problem.has_auto_duration:
        problem = problem.timed(trajectory.duration, problem.limits)
    if not abs(trajectory.duration - problem.duration) <= 1e-9 * problem.duration:
        raise InvalidProblemError(
            "trajectory",
            f"expected a duration of {problem.duration:.9g} s, got {trajectory.duration:.9g} s",
        )
    return problem, J


def _nodes(trajectory: Trajectory) -> Array:
    """Normalised times of the trajectory's samples, each interval divided evenly into as many."""
    samples = trajectory.times / trajectory.duration
    parts = -(-_LEAST_INTERVALS // (samples.size - 1))
    inner = samples[:-1, None] + np.diff(samples)[:, None] * np.arange(parts) / parts
    return np.append(inner.ravel(), 1.0)


def _motion(trajectory: Trajectory, mesh: SplineMesh) -> Motion:
    T = trajectory.duration
    q, v, a = trajectory.evaluate_quaternion(np.minimum(mesh.points * T, T))
    return Motion(q, v * T, a * T**2)


def _trajectory(motion: Motion, mesh: SplineMesh, duration: float) -> Trajectory:
    q, v, a = (column[mesh.at_nodes] for column in motion)
    return Trajectory(mesh.nodes * duration, q, v / duration, a / duration**2)
