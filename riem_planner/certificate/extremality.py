# SPDX-License-Identifier: Apache-2.0
"""How nearly a trajectory is an extremal, from its attitude, rate and acceleration alone.

The first-order conditions hold `v'''`, two derivatives more than a trajectory has at its samples.
Integrated twice they need none (mathematics, section 3; `v'' x v = (v' x v)'`):

    SO(3):  a = integral( a x v + sigma v - integral F ) + c_0 + c_1 t
    S^2:    a = integral( integral( (a x v) x v - F ) + sigma v ) + c_0 + c_1 t

The potential is that of the problem as stated, in plain NumPy: it shares no code with the
solver's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from riem_planner.problem import S2, Problem
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
    _, F = problem.forbidden.repulsion(R, t, problem.duration)
    if not np.all(np.isfinite(F)):
        return float("nan")
    with np.errstate(all="ignore"):
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
    if problem.forbidden.moving:
        return None
    h, t, R, v, a = _along(trajectory)
    middle = slice(_POINTS // 2, None, _POINTS)
    j = np.einsum("i,nic->nc", _SLOPE, a.reshape(h.size, _POINTS, 3)) / h[:, None]
    R, t, v, a = R[middle], t[middle], v[middle], a[middle]
    with np.errstate(all="ignore"):
        V, _ = problem.forbidden.repulsion(R, t, problem.duration)
        kinetic = 0.5 * np.sum(a * a, axis=1) + 0.5 * problem.sigma * np.sum(v * v, axis=1)
        exchange = np.sum(j * v, axis=1)
        H = kinetic - exchange - 0.5 * V
        scale = np.max(kinetic + np.abs(exchange) + 0.5 * V)
        spread = float(np.max(H) - np.min(H))
        return spread / float(scale) if spread != 0.0 else 0.0
