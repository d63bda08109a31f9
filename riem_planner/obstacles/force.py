"""Potential and force of a problem's obstacles in plain NumPy, one attitude at a time.

The compiled solver has its own version of these formulas; this one is read by the
initial-value extremals and is the independent check of the other.

With the distance d of an obstacle and `w = d grad d` in body components
(mathematics, sections 2 and 3):

- orientation Q: `w = -log(R^T Q)`;
- direction s for a boresight b: `w = theta / sin(theta) (R^T s x b)`;
- what is kept out: `V = tau / (d - r)^2`, `F = grad V / 2 = -tau / (d - r)^3 w / d`;
- a keep-in group: `V = S^(-1/2)`, `S = sum m_i^4 / tau_i^2`, `m_i = (r_i^2 - d_i^2) / (2 r_i)`,
  `F = S^(-3/2) sum m_i^3 / tau_i^2 w_i / r_i`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle, Zone

if TYPE_CHECKING:
    from riem_planner.problem import Problem

Array = NDArray[np.float64]


_FIRST_AXIS = np.array([1.0, 0.0, 0.0])


def cross(x: Array, y: Array) -> Array:
    """Cross product of vectors (..., 3); several times faster than NumPy's for a single one."""
    result = np.empty(np.broadcast_shapes(x.shape, y.shape))
    result[..., 0] = x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1]
    result[..., 1] = x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2]
    result[..., 2] = x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]
    return result


def distance_and_gradient(obstacle: Obstacle, attitude: Array, time: float) -> tuple[float, Array]:
    """Distance d [rad] to an obstacle's place, and `d grad d` (3,) in body components [rad]."""
    moves = bool(np.any(obstacle.rate))
    if isinstance(obstacle, OrientationObstacle):
        place = obstacle.orientation_at(time) if moves else obstacle.orientation
        towards = so3.log(attitude.T @ place)
        return math.sqrt(float(towards @ towards)), -towards
    boresight = _FIRST_AXIS if obstacle.boresight is None else obstacle.boresight
    direction = attitude.T @ (obstacle.direction_at(time) if moves else obstacle.direction)
    gradient = cross(direction, boresight)
    sine = math.sqrt(float(gradient @ gradient))
    theta = math.atan2(sine, float(direction @ boresight))
    return theta, gradient * (theta / sine if sine > 0.0 else 1.0)


def _taper(obstacle: Obstacle, d: float) -> tuple[float, float]:
    """The C^3 step of a range, and its derivative by d [1/rad]."""
    if obstacle.range is None:
        return 1.0, 0.0
    on, off = obstacle.range
    x = min(max((off - d) / (off - on), 0.0), 1.0)
    step = x**4 * (35.0 - x * (84.0 - x * (70.0 - 20.0 * x)))
    return step, -140.0 * (x * (1.0 - x)) ** 3 / (off - on)


def _keep_out(obstacle: Obstacle, tau: float, attitude: Array, time: float) -> tuple[float, Array]:
    d, w = distance_and_gradient(obstacle, attitude, time)
    margin = d - obstacle.radius
    if margin <= 0.0:
        return math.inf, np.full(3, math.nan)
    step, slope = _taper(obstacle, d)
    V = tau / margin**2
    return V * step, (0.5 * V * slope - V / margin * step) * w / d


def _keep_in(
    members: list[tuple[Zone, float]], attitude: Array, time: float
) -> tuple[float, Array]:
    total, weighted = 0.0, np.zeros(3)
    for zone, tau in members:
        d, w = distance_and_gradient(zone, attitude, time)
        r = zone.half_angle
        m = max(0.0, (r * r - d * d) / (2.0 * r))
        total += m**4 / tau**2
        weighted += m**3 / tau**2 * w / r
    if total == 0.0:
        return math.inf, np.full(3, math.nan)
    return float(total**-0.5), weighted * total**-1.5


def potential_and_force(problem: Problem, attitude: Array, time: float) -> tuple[float, Array]:
    """Sum of the potentials of a problem, and half its gradient in body components.

    Parameters
    ----------
    problem
        The obstacles' names, boresights and strengths are taken from it.
    attitude : (3, 3)
        Rotation matrix, body to reference frame.
    time
        t [s], for obstacles that move.

    Returns
    -------
    potential
        `sum V_i` [rad^2/s^4]; infinite in a forbidden set.
    force : (3,)
        `F = grad(sum V_i) / 2` [rad/s^4]; not a number in a forbidden set.
    """
    potential, force = 0.0, np.zeros(3)
    groups: dict[str, list[tuple[Zone, float]]] = {}
    for obstacle in problem.obstacles:
        tau = problem.strength_of(obstacle)
        if isinstance(obstacle, Zone) and obstacle.kind == "keep_in":
            name = str(obstacle.name) if obstacle.group is None else obstacle.group
            groups.setdefault(name, []).append((obstacle, tau))
            continue
        V, F = _keep_out(obstacle, tau, attitude, time)
        potential, force = potential + V, force + F
    for members in groups.values():
        V, F = _keep_in(members, attitude, time)
        potential, force = potential + V, force + F
    return potential, force
