# SPDX-License-Identifier: Apache-2.0
"""The cost of any curve, by quadrature; independent of the planner and of its peers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from riem_planner import Problem, Trajectory
from riem_planner.geometry import so3, sphere
from riem_planner.obstacles import OrientationObstacle

Array = NDArray[np.float64]
Curve = Callable[[Array], tuple[Array, Array, Array]]
"""Times (m,) to quaternions (m, 4), body rates (m, 3), body accelerations (m, 3)."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


def clearances(problem: Problem, quaternions: Array, times: Array) -> Array:
    """Distance (n, m) [rad] to the edge of each of n keep-out obstacles; negative inside."""
    rows = []
    attitudes = so3.quaternion_to_matrix(quaternions)
    for obstacle in problem.obstacles:
        if obstacle.kind == "keep_in":
            raise ValueError("the benchmark has no keep-in zones")
        if isinstance(obstacle, OrientationObstacle):
            distance = so3.quaternion_distance(
                quaternions, so3.matrix_to_quaternion(obstacle.orientation_at(times))
            )
        else:
            axis = np.asarray(obstacle.boresight)
            distance = sphere.angle(attitudes @ axis, obstacle.direction_at(times))
        rows.append(distance - obstacle.radius)
    return np.array(rows).reshape(len(rows), len(times))


def cost_of(problem: Problem, curve: Curve, mesh: Array) -> float:
    """`1/2 int (|a|^2 + sigma |v|^2 + sum V) dt`, Gauss-Legendre on each interval of a mesh.

    Infinite where the curve meets a forbidden set.
    """
    step = np.diff(mesh)
    times = (mesh[:-1, None] + 0.5 * step[:, None] * (1.0 + _NODES)).ravel()
    weights = (0.5 * step[:, None] * _WEIGHTS).ravel()
    quaternions, rates, accelerations = curve(times)
    quaternions = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    integrand = np.sum(accelerations**2, axis=-1) + problem.sigma * np.sum(rates**2, axis=-1)
    gaps = clearances(problem, quaternions, times)
    if np.any(gaps <= 0.0):
        return float("inf")
    strengths = np.array([problem.strength_of(obstacle) for obstacle in problem.obstacles])
    integrand = integrand + strengths @ (1.0 / gaps**2)
    return float(0.5 * weights @ integrand)


def trajectory_cost(problem: Problem, trajectory: Trajectory) -> float:
    """Cost of a published trajectory, on a mesh four times as fine as its own."""
    own = trajectory.times
    mesh = np.interp(np.arange(4 * (len(own) - 1) + 1) / 4.0, np.arange(len(own)), own)
    return cost_of(problem, trajectory.evaluate_quaternion, mesh)


def faults(problem: Problem, trajectory: Trajectory, samples: int = 4001) -> list[str]:
    """What a trajectory that claims to be right gets wrong, by dense sampling."""
    times = np.linspace(0.0, trajectory.duration, samples)
    q, v, a = trajectory.evaluate_quaternion(times)
    found = []
    gaps = clearances(problem, q, times)
    if gaps.size and gaps.min() <= 0.0:
        found.append(f"{gaps.min():.3g} rad from a forbidden set")
    if abs(trajectory.duration - problem.duration) > 1e-9 * problem.duration:
        found.append("wrong duration")
    ends = ((q[0], v[0], problem.start), (q[-1], v[-1], problem.goal))
    for quaternion, rate, state in ends:
        error = _end_error(problem, quaternion, rate, state.orientation, state.angular_velocity)
        if error > 1e-6:
            found.append(f"misses an end by {error:.3g}")
    jumps = np.abs(np.diff(q, axis=0)).max()
    if jumps > 2.0 * np.abs(v).max() * problem.duration / samples + 1e-9:
        found.append(f"jumps by {jumps:.3g}")
    rate_step = np.diff(v, axis=0) - 0.5 * (a[1:] + a[:-1]) * (times[1] - times[0])
    if np.abs(rate_step).max() > 1e-2 * max(1.0, float(np.abs(v).max())):
        found.append("the rate is not the integral of the acceleration")
    return found


def _end_error(
    problem: Problem, quaternion: Array, rate: Array, orientation: Array, velocity: Array
) -> float:
    attitude = so3.quaternion_to_matrix(quaternion)
    if problem.space.name == "so3":
        turn = so3.quaternion_distance(quaternion, so3.matrix_to_quaternion(orientation))
        return float(max(turn, np.linalg.norm(rate - velocity)))
    b = problem.boresight
    turn = sphere.angle(attitude @ b, orientation @ b)
    motion = attitude @ np.cross(rate, b) - orientation @ np.cross(velocity, b)
    return float(max(turn, np.linalg.norm(motion)))
