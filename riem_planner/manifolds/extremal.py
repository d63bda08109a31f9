# SPDX-License-Identifier: Apache-2.0
"""Extremals on the spaces given by matrices: the field, and initial-value integration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853

from riem_planner.checks import finite_array, non_negative_number, positive_number
from riem_planner.errors import InvalidProblemError
from riem_planner.integration import integrate
from riem_planner.invariants import hamiltonian
from riem_planner.manifolds.matrices import Array, Real
from riem_planner.manifolds.matrix_space import MatrixSpace
from riem_planner.manifolds.problem import (
    GeneralState,
    PointObstacle,
    checked_obstacles,
    checked_state,
)
from riem_planner.manifolds.repulsion import Repulsion

Field = Callable[[Real, Array, Real], tuple[Array, Real]]


def extremal_field(space: MatrixSpace, sigma: float, repulsion: Repulsion) -> Field:
    """Rates of a lift (..., N, N) and of `(v, v', v'')` (..., 3, n) along an extremal."""

    def field(s: Real, g: Array, w: Real) -> tuple[Array, Real]:
        v, a, j = w[..., 0, :], w[..., 1, :], w[..., 2, :]
        rates = np.empty_like(w)
        rates[..., :2, :] = w[..., 1:, :]
        rates[..., 2, :] = space.curvature_term(v, a, j) + sigma * a
        if repulsion:
            rates[..., 2, :] -= repulsion.force(g, s)
        return g @ space.algebra(v), rates

    return field


def runge_kutta_step(field: Field, s: Real, g: Array, w: Real, h: Real) -> tuple[Array, Real]:
    """One step of the eighth-order rule of DOP853 from times s (...), of lengths h (...)."""
    stages = DOP853.n_stages
    step = h[..., None, None]
    g_rates = np.empty((stages, *g.shape), dtype=g.dtype)
    w_rates = np.empty((stages, *w.shape))

    def reached(weights: Real) -> tuple[Array, Real]:
        # Not a product of matrices: the library's threads would wait for each other.
        used = np.flatnonzero(weights)
        own = weights[used]
        ahead = np.einsum("k,k...->...", own, g_rates[used])
        return g + step * ahead, w + step * np.einsum("k,k...->...", own, w_rates[used])

    g_rates[0], w_rates[0] = field(s, g, w)
    for k in range(1, stages):
        g_rates[k], w_rates[k] = field(s + DOP853.C[k] * h, *reached(DOP853.A[k, :k]))
    return reached(DOP853.B)


@dataclass(frozen=True, eq=False)
class GeneralExtremal:
    """A solution of the first-order conditions on [0, duration].

    Parameters
    ----------
    space
        Where it lives.
    duration
        T [s].
    tension
        sigma [1/s^2].
    obstacles
        What repels.
    """

    space: MatrixSpace
    duration: float
    tension: float
    obstacles: tuple[PointObstacle, ...]
    _dense: Callable[[Array], Array]

    def evaluate(self, t: ArrayLike) -> tuple[Array, Real, Real, Real]:
        """Lifts (..., N, N), and v, v', v'' (..., n), at times (...) [s].

        Raises
        ------
        ValueError
            A time is outside [0, duration].
        """
        times = np.asarray(t, dtype=float)
        if not np.all((times >= 0.0) & (times <= self.duration)):
            raise ValueError(f"t must lie in [0, {self.duration:.9g}] s, got {times}")
        y = np.moveaxis(self._dense(times.ravel()), 0, -1)
        g, w = _unpacked(self.space, y)
        v, a, j = (w[:, k].reshape(*times.shape, -1) for k in range(3))
        return g.reshape(*times.shape, *g.shape[-2:]), v, a, j

    def hamiltonian(self, t: ArrayLike) -> Real:
        """H (...) at times (...) [s], constant where all obstacles are fixed."""
        g, v, a, j = self.evaluate(t)
        potential = Repulsion(self.space, self.obstacles).potential(g, np.asarray(t, dtype=float))
        return hamiltonian(v, a, j, self.tension, potential)


def _packed(g: Array, w: Real) -> Real:
    flat = np.reshape(g, -1)
    return np.concatenate([flat.real, flat.imag, np.reshape(w, -1)])


def _unpacked(space: MatrixSpace, y: Real) -> tuple[Array, Real]:
    n = space.size**2
    real, imaginary = y[..., :n], y[..., n : 2 * n]
    g = real + 1j * imaginary if np.iscomplexobj(space.basis) else real
    shape = y.shape[:-1]
    return g.reshape(*shape, space.size, space.size), y[..., 2 * n :].reshape(*shape, 3, -1)


def general_extremal(
    space: MatrixSpace,
    state: GeneralState,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    obstacles: Sequence[PointObstacle] = (),
    tension: float = 0.0,
    *,
    duration: float,
    tolerance: float = 1e-13,
    step: float | None = None,
) -> GeneralExtremal:
    """The extremal with given initial values; see `riem_planner.extremals.extremal`."""
    if not isinstance(space, MatrixSpace):
        raise InvalidProblemError(
            "space", f"expected SO3, S2 or a MatrixSpace, got {type(space).__name__}"
        )
    T = positive_number("duration", duration)
    sigma = non_negative_number("tension", tension)
    state = checked_state(space, "state", state)
    points = checked_obstacles(space, tuple(obstacles))
    a = finite_array("acceleration", acceleration, (space.dimension,))
    j = finite_array("jerk", jerk, (space.dimension,))
    repulsion = Repulsion(space, points)
    if not np.isfinite(repulsion.potential(state.element)):
        raise InvalidProblemError("state", "expected a start outside of every obstacle")
    field = extremal_field(space, sigma, repulsion)

    def flat(t: float, y: Real) -> Real:
        return _packed(*field(np.asarray(t), *_unpacked(space, y)))

    if state.rate is None:
        raise InvalidProblemError("state.rate", "expected the initial rate, got a free one")
    start = _packed(state.element, np.stack([state.rate, a, j]))
    return GeneralExtremal(space, T, sigma, points, integrate(flat, start, T, tolerance, step))
