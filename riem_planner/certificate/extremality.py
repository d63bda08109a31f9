"""How nearly a trajectory is an extremal, from its attitude, rate and acceleration alone.

The first-order conditions hold `v'''`, two derivatives more than a trajectory has at its samples.
Integrated twice they need none (mathematics, section 3; `v'' x v = (v' x v)'`):

    SO(3):  a = integral( a x v + sigma v - integral F ) + c_0 + c_1 t
    S^2:    a = integral( integral( (a x v) x v - F ) + sigma v ) + c_0 + c_1 t

The potential is that of the problem as stated. The formulas are written anew from the
obstacles' own distances, and share no code with the solver's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3, sphere
from riem_planner.obstacles import Obstacle, OrientationObstacle, Zone
from riem_planner.problem import S2

if TYPE_CHECKING:
    from riem_planner.problem import Problem
    from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_POINTS = 5  # Gauss points of an interval: integrals and derivatives of order 5 and more


def _rule() -> tuple[Array, Array, Array, Array]:
    """Gauss rule on [0, 1]: nodes, weights, integrals from 0 to each node, slope at 1/2."""
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    nodes = 0.5 * (x + 1.0)
    powers = np.vander(nodes, increasing=True)
    degree = np.arange(_POINTS)
    to_node = (nodes[:, None] ** (degree + 1) / (degree + 1)) @ np.linalg.inv(powers)
    slope = (degree * 0.5 ** np.maximum(degree - 1, 0)) @ np.linalg.inv(powers)
    return nodes, 0.5 * w, to_node, slope


_NODES, _WEIGHTS, _TO_NODE, _SLOPE = _rule()


def distance_and_gradient(obstacle: Obstacle, R: Array, t: Array) -> tuple[Array, Array]:
    """Distances d (n,) [rad] at attitudes (n, 3, 3), and `d grad d` (n, 3) in body components.

    The gradient comes times d because the product is smooth at `d = 0`.
    """
    if isinstance(obstacle, OrientationObstacle):
        towards = so3.log(np.swapaxes(R, -1, -2) @ obstacle.orientation_at(t))
        return np.asarray(np.linalg.norm(towards, axis=-1)), -towards
    s = np.einsum("nji,nj->ni", R, obstacle.direction_at(t))
    b = obstacle.boresight
    assert b is not None  # the problem gives every zone its boresight
    across = np.cross(s, b)
    d = sphere.angle(s, b)
    return d, across / np.sinc(d / np.pi)[:, None]


def _taper(obstacle: Obstacle, d: Array) -> tuple[Array, Array]:
    """Step of a range (1 near, 0 far, C^3) and its derivative by d [1/rad]."""
    if obstacle.range is None:
        return np.ones_like(d), np.zeros_like(d)
    on, off = obstacle.range
    x = np.clip((off - d) / (off - on), 0.0, 1.0)
    step = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    return step, -140.0 * x**3 * (1.0 - x) ** 3 / (off - on)


def potential_and_force(problem: Problem, R: Array, t: Array) -> tuple[Array, Array]:
    """Sum V (n,) of a problem's potentials and `F = grad V / 2` (n, 3) in body components.

    Parameters
    ----------
    R : (n, 3, 3)
        Attitudes, clear of every zone.
    t : (n,)
        Times [s].
    """
    V, F = np.zeros(t.size), np.zeros((t.size, 3))
    groups: dict[str, list[Zone]] = {}
    for obstacle in problem.obstacles:
        if isinstance(obstacle, Zone) and obstacle.kind == "keep_in":
            groups.setdefault(obstacle.group or f"alone {obstacle.name}", []).append(obstacle)
            continue
        d, w = distance_and_gradient(obstacle, R, t)
        gap = d - obstacle.radius
        step, step_1 = _taper(obstacle, d)
        own = problem.strength_of(obstacle) / gap**2
        V += step * own
        F += ((0.5 * step_1 - step / gap) * own / d)[:, None] * w
    for members in groups.values():
        total, force = np.zeros(t.size), np.zeros((t.size, 3))
        for zone in members:
            d, w = distance_and_gradient(zone, R, t)
            r = zone.half_angle
            m = np.maximum(0.0, (r * r - d * d) / (2.0 * r))
            weight = m**3 / problem.strength_of(zone) ** 2
            total += m * weight
            force += (weight / r)[:, None] * w
        V += total**-0.5
        F += (total**-1.5)[:, None] * force
    return V, F


def _along(trajectory: Trajectory) -> tuple[Array, Array, Array, Array, Array]:
    """Lengths of the intervals (n,), and at the Gauss points t, R, v, a in time order."""
    h = np.diff(trajectory.times)
    t = (trajectory.times[:-1, None] + h[:, None] * _NODES).ravel()
    return h, t, *trajectory.evaluate(t)


def _integrated(values: Array, h: Array) -> Array:
    """Integral from 0 to each Gauss point of values (n * points, 3) at all of them."""
    f = values.reshape(h.size, _POINTS, 3) * h[:, None, None]
    whole = np.einsum("j,njc->nc", _WEIGHTS, f)
    before = np.cumsum(whole, axis=0) - whole
    within = np.einsum("ij,njc->nic", _TO_NODE, f)
    return np.asarray((before[:, None, :] + within).reshape(-1, 3))


def extremality(trajectory: Trajectory, problem: Problem) -> float:
    """Residual of the first-order conditions integrated twice, relative to the largest |a|.

    0 for an exact extremal; of order 1 for a curve that has nothing to do with one. NaN where
    the trajectory enters a zone.
    """
    h, t, R, v, a = _along(trajectory)
    with np.errstate(all="ignore"):
        _, F = potential_and_force(problem, R, t)
        turning = np.cross(a, v)
        if problem.space == S2:
            b = problem.boresight
            inner = np.cross(turning, v) - F
            inner -= (inner @ b)[:, None] * b
            turning = np.zeros_like(a)
        else:
            inner = -F
        expected = _integrated(turning + problem.sigma * v + _integrated(inner, h), h)
        if not np.all(np.isfinite(expected)):
            return float("nan")
    rest = a - expected
    line = np.column_stack([np.ones_like(t), t / trajectory.duration])
    constants, *_ = np.linalg.lstsq(line, rest, rcond=None)
    residual = float(np.max(np.linalg.norm(rest - line @ constants, axis=1)))
    largest = float(np.max(np.linalg.norm(a, axis=1)))
    return residual / largest if residual > 0.0 else 0.0


def invariant_drift(trajectory: Trajectory, problem: Problem) -> float | None:
    """Spread of `H = (|a|^2 + sigma |v|^2 - sum V) / 2 - j . v`, relative to its largest terms.

    None if an obstacle moves: H is not constant then. H is taken half-way between samples,
    where the third derivative of a quintic Hermite interpolant is of its best order.
    """
    if any(np.any(obstacle.rate) for obstacle in problem.obstacles):
        return None
    h, t, R, v, a = _along(trajectory)
    middle = slice(_POINTS // 2, None, _POINTS)
    j = np.einsum("i,nic->nc", _SLOPE, a.reshape(h.size, _POINTS, 3)) / h[:, None]
    R, t, v, a = R[middle], t[middle], v[middle], a[middle]
    with np.errstate(all="ignore"):
        V, _ = potential_and_force(problem, R, t)
        kinetic = 0.5 * np.sum(a * a, axis=1) + 0.5 * problem.sigma * np.sum(v * v, axis=1)
        exchange = np.sum(j * v, axis=1)
        H = kinetic - exchange - 0.5 * V
        scale = np.max(kinetic + np.abs(exchange) + 0.5 * V)
        spread = float(np.max(H) - np.min(H))
        return spread / float(scale) if spread != 0.0 else 0.0
