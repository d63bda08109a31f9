# SPDX-License-Identifier: Apache-2.0
"""The cost of a given trajectory: `1/2 int (|a|^2 + sigma |v|^2 + sum V) dt` by quadrature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.problem import Problem
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_PIECES = 4  # of each interval between samples: potentials are steep where a path passes close by


def trajectory_cost(trajectory: Trajectory, problem: Problem) -> float:
    """Cost of a trajectory by quadrature, as the problem states it; independent of the solver.

    Parameters
    ----------
    trajectory
        Any one; it need not solve the problem.
    problem
        Its tension and obstacles count, with normalised values over the trajectory's duration.

    Returns
    -------
    float
        [rad^2/s^3]; infinite where the trajectory enters a forbidden set.

    Notes
    -----
    Gauss-Legendre quadrature with six nodes on each quarter of the intervals between samples.
    """
    mesh = _subdivided(trajectory.times)
    half_steps = 0.5 * np.diff(mesh)
    times = (mesh[:-1, None] + half_steps[:, None] * (1.0 + _NODES)).ravel()
    weights = (half_steps[:, None] * _WEIGHTS).ravel()
    q, v, a = trajectory.evaluate_quaternion(np.minimum(times, trajectory.duration))
    sigma = problem.tension or 0.0
    if problem.normalized_tension is not None:
        sigma = problem.normalized_tension / trajectory.duration**2
    attitudes = so3.quaternion_to_matrix(q)
    potential, _ = problem.forbidden.repulsion(attitudes, times, trajectory.duration)
    if not np.all(np.isfinite(potential)):
        return float("inf")
    integrand = np.sum(a * a, axis=-1) + sigma * np.sum(v * v, axis=-1) + potential
    return float(0.5 * weights @ integrand)


def _subdivided(times: Array) -> Array:
    """Times (n,) with the interval between each two divided evenly."""
    steps = np.arange(_PIECES * (times.size - 1) + 1) / _PIECES
    return np.interp(steps, np.arange(times.size), times)
