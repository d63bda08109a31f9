# SPDX-License-Identifier: Apache-2.0
"""Potential and force of one obstacle in plain NumPy, batched over attitudes and times.

The compiled solver has its own version of these formulas and shares no code with this one, which
certificates and initial-value extremals read. With the distance d of an obstacle and
`w = d grad d` in body components (mathematics, sections 2 and 3):

- orientation Q: `w = -log(R^T Q)`;
- direction s for a boresight b: `w = theta / sin(theta) (R^T s x b)`;
- what is kept out: `V = tau / (d - r)^2`, `F = grad V / 2 = -tau / (d - r)^3 w / d`;
- what is kept in: `V = tau / m^2`, `m = (r^2 - d^2) / (2 r)`, `F = tau / m^3 w / r`;
- a group of members: `V = S^(-1/2)`, `S = sum V_k^-2`, `F = S^(-3/2) sum V_k^-3 F_k`.

The gradient comes times d because the product is smooth at `d = 0`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.geometry.sphere import cross
from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle, Zone

Array = NDArray[np.float64]


def distance_and_gradient(obstacle: Obstacle, R: Array, t: Array) -> tuple[Array, Array]:
    """Distances d (n,) [rad] at attitudes (n, 3, 3), and `d grad d` (n, 3) in body components."""
    if isinstance(obstacle, OrientationObstacle):
        towards = so3.log(np.swapaxes(R, -1, -2) @ obstacle.orientation_at(t))
        return np.sqrt(np.sum(towards * towards, axis=-1)), -towards
    s = np.einsum("nji,nj->ni", R, obstacle.direction_at(t))
    b = obstacle.body_axis
    across = cross(s, b)
    sine = np.sqrt(np.sum(across * across, axis=-1))
    d = np.arctan2(sine, s @ b)
    ratio = np.divide(d, sine, out=np.ones_like(d), where=sine > 0.0)
    return d, across * ratio[:, None]


def _taper(obstacle: Obstacle, d: Array) -> tuple[Array, Array]:
    """Step of a range (1 near, 0 far, C^3) and its derivative by d [1/rad]."""
    if obstacle.range is None:
        return np.ones_like(d), np.zeros_like(d)
    on, off = obstacle.range
    x = np.clip((off - d) / (off - on), 0.0, 1.0)
    step = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    return step, -140.0 * x**3 * (1.0 - x) ** 3 / (off - on)


def repulsion_of(obstacle: Obstacle, tau: float, R: Array, t: Array) -> tuple[Array, Array]:
    """Potential V (n,) of strength tau at attitudes (n, 3, 3) and times (n,), and `F` (n, 3).

    Where the obstacle is violated V is infinite and F not a number; where it does not exist both
    are zero.
    """
    d, w = distance_and_gradient(obstacle, R, t)
    r = obstacle.radius_at(t)
    with np.errstate(all="ignore"):
        if isinstance(obstacle, Zone) and obstacle.kind == "keep_in":
            margin = (r - d) * (r + d) / (2.0 * r)
            V = tau / margin**2
            F = (V / (margin * r))[:, None] * w
        else:
            margin = d - r
            step, step_1 = _taper(obstacle, d)
            own = tau / margin**2
            V = step * own
            F = ((0.5 * step_1 - step / margin) * own / d)[:, None] * w
    violated = margin <= 0.0
    V[violated], F[violated] = np.inf, np.nan
    if obstacle.active:
        absent = ~obstacle.active_at(t)
        V[absent], F[absent] = 0.0, 0.0
    return V, F


def united(members: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Potential (n,) and force (n, 3) of a group from those of its members.

    Infinite, and not a number, only where all of them are violated; zero where one repels not.
    """
    if len(members) == 1:
        return members[0]
    V = np.array([potential for potential, _ in members])
    F = np.array([force for _, force in members])
    with np.errstate(all="ignore"):
        S = np.sum(V**-2.0, axis=0)
        shares = np.where(np.isinf(V)[..., None], 0.0, V[..., None] ** -3.0 * F)
        potential = S**-0.5
        force = (S**-1.5)[:, None] * np.sum(shares, axis=0)
    force[np.any(V == 0.0, axis=0)] = 0.0
    return potential, force
