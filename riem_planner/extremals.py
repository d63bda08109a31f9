# SPDX-License-Identifier: Apache-2.0
"""First-order conditions, and the extremals that start from given initial values.

An extremal of `1/2 int (|a|^2 + sigma |v|^2 + sum V_i) dt` satisfies, with `F = grad(sum V_i)/2`
in body components (mathematics, section 3):

- SO(3): `v''' = v'' x v + sigma v' - F`;
- S^2, lifted horizontally: `v''' = (v' x v) x v + sigma v' - F`, all orthogonal to b;
- a compact group: `v''' = sigma v' - [v, v''] - F`;
- a symmetric space: `v''' = sigma v' - [v, [v', v]] - F` in m.

Extremals that meet an obstacle head-on leave every bound in finite time: that is what the
equations say, and the reason why boundary-value problems are solved another way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_array
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.geometry.sphere import cross
from riem_planner.integration import TOLERANCE, ExtremalEndsError, integrate
from riem_planner.invariants import (
    attitude_momentum,
    first_biconjugate_time,
    hamiltonian,
    orientation_momentum,
    pointing_momentum,
)
from riem_planner.problem import S2, SO3, Problem, Space, State

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Extremal:
    """A solution of the first-order conditions on [0, duration].

    Parameters
    ----------
    problem
        Space, tension and obstacles; its start is where the extremal starts.
    """

    problem: Problem
    _dense: Callable[[Array], Array]

    @property
    def duration(self) -> float:
        """T [s]."""
        return self.problem.duration

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Attitudes (..., 3, 3), rates, accelerations and jerks (..., 3) at times (...) [s].

        Raises
        ------
        ValueError
            A time is outside [0, duration].
        """
        times = np.asarray(t, dtype=float)
        if not np.all((times >= 0.0) & (times <= self.duration)):
            raise ValueError(f"t must lie in [0, {self.duration:.9g}] s, got {times}")
        state = np.moveaxis(self._dense(times.ravel()), 0, -1).reshape(*times.shape, 13)
        q = state[..., :4] / np.linalg.norm(state[..., :4], axis=-1, keepdims=True)
        return so3.quaternion_to_matrix(q), state[..., 4:7], state[..., 7:10], state[..., 10:13]

    def potential(self, t: ArrayLike) -> Array:
        """Sum of the potentials `V_i` (...) [rad^2/s^4] along the extremal at times (...)."""
        times = np.asarray(t, dtype=float)
        R = self.evaluate(times)[0].reshape(-1, 3, 3)
        V, _ = self.problem.forbidden.repulsion(R, times.ravel(), self.duration)
        return V.reshape(times.shape)

    def hamiltonian(self, t: ArrayLike) -> Array:
        """H (...) [rad^2/s^4] at times (...); constant where all obstacles are fixed."""
        _, v, a, j = self.evaluate(t)
        return hamiltonian(v, a, j, self.problem.sigma, self.potential(t))


def snap(space: Space, v: Array, a: Array, j: Array, sigma: float, force: Array) -> Array:
    """Third derivative `v'''` (..., 3) [rad/s^4] of the body rate along an extremal.

    Parameters
    ----------
    space
        `SO3` or `S2`.
    v, a, j : (..., 3)
        Body rate and its first two derivatives [rad/s, rad/s^2, rad/s^3].
    sigma
        Tension [1/s^2].
    force : (..., 3)
        `F`, half the gradient of the potential in body components.
    """
    curvature = cross(j, v) if space == SO3 else cross(cross(a, v), v)
    return np.asarray(curvature + sigma * a - force)


def extremal(
    space: Any,
    state: Any,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    obstacles: Sequence[Any] = (),
    tension: float = 0.0,
    *,
    duration: float,
    boresight: ArrayLike = (1.0, 0.0, 0.0),
    tolerance: float = TOLERANCE,
    step: float | None = None,
) -> Any:
    """The extremal with given initial values, by DOP853 with dense output.

    Parameters
    ----------
    space
        `SO3`, `S2`, or a space of `riem_planner.manifolds.matrix_space`.
    state
        Initial attitude and body rate (`State`); on a matrix space a `GeneralState`.
    acceleration, jerk : (n,)
        v'(0) [rad/s^2] and v''(0) [rad/s^3], n = 3 on SO(3) and S^2; on S^2 orthogonal to
        the boresight.
    obstacles
        What repels; on a matrix space `PointObstacle`.
    tension
        sigma [1/s^2].
    duration
        T [s].
    boresight : (3,)
        On S^2 the axis that points; on SO(3) the axis of zones that name none.
    tolerance
        Local error allowed per step, relative to 1.
    step
        Fixed step [s] in place of the tolerance, to measure the order of convergence.

    Returns
    -------
    Extremal
        Or a `GeneralExtremal`, with the same methods.

    Raises
    ------
    InvalidProblemError
        A value is wrong.
    ExtremalEndsError
        The extremal leaves every bound before the duration.
    """
    if not isinstance(space, Space):
        from riem_planner.manifolds.extremal import general_extremal

        return general_extremal(
            space,
            state,
            acceleration,
            jerk,
            obstacles,
            tension,
            duration=duration,
            tolerance=tolerance,
            step=step,
        )
    problem = Problem(
        start=state,
        goal=state,
        duration=duration,
        space=space,
        tension=tension,
        obstacles=tuple(obstacles),
        boresight=np.asarray(boresight),
    )
    a = _horizontal(problem, "acceleration", acceleration)
    j = _horizontal(problem, "jerk", jerk)
    _check_outside(problem)
    y0 = np.concatenate([state.quaternion_xyzw, state.angular_velocity, a, j])
    dense = integrate(_field(problem), y0, problem.duration, tolerance, step)
    return Extremal(problem, dense)


def _horizontal(problem: Problem, key: str, value: ArrayLike) -> Array:
    """A vector (3,), on S^2 checked to be orthogonal to the boresight."""
    vector = finite_array(key, value, (3,))
    if problem.space == S2:
        # The rule and its message for a rate hold for its derivatives as well.
        problem._check_horizontal(key, State(problem.start.orientation, vector))
    return vector


def _check_outside(problem: Problem) -> None:
    for name, margin in problem.margins(problem.start.orientation).items():
        if margin <= 0.0:
            raise InvalidProblemError(
                "state", f"expected a start outside of obstacle {name!r}, got {margin:.6g} rad"
            )


def _field(problem: Problem) -> Callable[[float, Array], Array]:
    """Time derivative of the state `(q, v, a, j)` (13,)."""
    sigma, space = problem.sigma, problem.space

    def field(t: float, y: Array) -> Array:
        q, v, a, j = y[:4], y[4:7], y[7:10], y[10:]
        force = np.zeros(3)
        if problem.obstacles:
            attitude = so3.quaternion_to_matrix(q / np.linalg.norm(q))
            force = problem.forbidden.repulsion(attitude[None], t, problem.duration)[1][0]
        q_rate = 0.5 * np.append(q[3] * v + cross(q[:3], v), -(q[:3] @ v))
        return np.concatenate([q_rate, a, j, snap(space, v, a, j, sigma, force)])

    return field


__all__ = [
    "Extremal",
    "ExtremalEndsError",
    "attitude_momentum",
    "extremal",
    "first_biconjugate_time",
    "hamiltonian",
    "integrate",
    "orientation_momentum",
    "pointing_momentum",
    "snap",
]
