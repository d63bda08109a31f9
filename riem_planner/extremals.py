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

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import finite_array, non_negative_number, positive_number
from riem_planner.errors import InvalidProblemError, RiemPlannerError
from riem_planner.geometry import so3
from riem_planner.geometry.sphere import cross
from riem_planner.problem import S2, SO3, Problem, Space, State

Array = NDArray[np.float64]

_TOLERANCE = 1e-13
_MOST_EVALUATIONS = 20_000  # of the field; towards a singularity the steps shrink without end


class ExtremalEndsError(RiemPlannerError):
    """The extremal could not be continued to the duration asked for.

    Parameters
    ----------
    time
        The last time it was followed to [s].
    duration
        The duration asked for [s].
    """

    def __init__(self, time: float, duration: float) -> None:
        self.time = time
        super().__init__(
            f"the extremal ends at t = {time:.9g} s of {duration:.9g} s: it leaves every bound"
            " there, or meets an obstacle; shorten the duration or change the initial values"
        )


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
    tolerance: float = _TOLERANCE,
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


def integrate(
    field: Callable[[float, Array], Array],
    start: Array,
    duration: float,
    tolerance: float = _TOLERANCE,
    step: float | None = None,
) -> Callable[[Array], Array]:
    """Dense solution of `y' = field(t, y)` on [0, duration] by DOP853.

    Raises
    ------
    ExtremalEndsError
        The solution could not be continued to the end.
    """
    from scipy.integrate import solve_ivp  # slow to load, and not needed to solve

    options: dict[str, float] = {"rtol": max(tolerance, 3e-14), "atol": tolerance}
    if step is not None:
        h = positive_number("step", step)
        # A tolerance that nothing exceeds leaves the largest step as the only bound.
        options = {"rtol": 1e-3, "atol": 1e30, "first_step": h, "max_step": h}
    evaluations = 0

    def counted(t: float, y: Array) -> Array:
        nonlocal evaluations
        evaluations += 1
        if evaluations > _MOST_EVALUATIONS:
            raise ExtremalEndsError(t, duration)
        return field(t, y)

    with np.errstate(all="ignore"):  # overflow is what the end of an extremal looks like
        result = solve_ivp(
            counted, (0.0, duration), start, method="DOP853", dense_output=True, **options
        )
    if result.status != 0 or not np.all(np.isfinite(result.y[:, -1])):
        raise ExtremalEndsError(float(result.t[-1]), duration)
    return result.sol  # type: ignore[no-any-return]


def hamiltonian(
    v: ArrayLike, a: ArrayLike, j: ArrayLike, tension: float = 0.0, potential: ArrayLike = 0.0
) -> Array:
    """`H = |v'|^2/2 + sigma |v|^2/2 - v'' . v - sum V_i / 2` (...), constant along extremals.

    Parameters
    ----------
    v, a, j : (..., n)
        Rate and its first two derivatives.
    tension
        sigma [1/s^2].
    potential : (...)
        `sum V_i`; the obstacles must be fixed.
    """
    v, a, j = (np.asarray(x, dtype=float) for x in (v, a, j))
    kinetic = 0.5 * np.sum(a * a, axis=-1) + 0.5 * tension * np.sum(v * v, axis=-1)
    return np.asarray(kinetic - np.sum(j * v, axis=-1) - 0.5 * np.asarray(potential))


def orientation_momentum(
    attitude: Array, v: Array, a: Array, j: Array, obstacle: Array, tension: float = 0.0
) -> Array:
    """`M = m - (Q^T R) m + v' x v`, `m = sigma v - v''` (..., 3): constant on SO(3).

    For one fixed orientation obstacle Q (3, 3), at attitudes (..., 3, 3).
    """
    m = tension * v - j
    turned = np.einsum("ji,...jk,...k->...i", obstacle, attitude, m)
    return np.asarray(m - turned + np.cross(a, v))


def attitude_momentum(attitude: Array, v: Array, j: Array, tension: float = 0.0) -> Array:
    """`R m`, `m = sigma v - v''` (..., 3): constant on SO(3) without obstacles."""
    return np.asarray(np.einsum("...ij,...j->...i", attitude, tension * v - j))


def pointing_momentum(attitude: Array, v: Array, a: Array, j: Array, tension: float = 0.0) -> Array:
    """`N = R (sigma v - v'' - v' x v)` (..., 3): constant on S^2 without obstacles.

    With one fixed obstacle of direction s, `s . N` is constant.
    """
    return np.asarray(np.einsum("...ij,...j->...i", attitude, tension * v - j - np.cross(a, v)))


def first_biconjugate_time(curvature: float, tension: float) -> float:
    """When a clamped geodesic stops being a local minimum, without obstacles.

    The second variation across a geodesic of speed c is
    `int ((y'' + k y)^2 + sigma (y'^2 - k y^2)) dt`. Its fields that vanish with their rates at
    both ends are even or odd about the middle, which splits the determinant of section 5 into
    two factors with simple zeros, `a = sqrt(k)` and `b = sqrt(|sigma - k|)`.

    Parameters
    ----------
    curvature
        k [rad^2/s^2]: `c^2` on S^2, `c^2 / 4` on SO(3).
    tension
        sigma [1/s^2].

    Returns
    -------
    float
        T* [s]; infinite for zero tension.
    """
    k, sigma = positive_number("curvature", curvature), non_negative_number("tension", tension)
    if sigma == 0.0:
        return math.inf
    a, b = math.sqrt(k), math.sqrt(abs(sigma - k))
    if b <= 1e-7 * a:
        return 2.0 * math.pi / a

    def even(T: float) -> float:
        S, C = math.sin(a * T / 2), math.cos(a * T / 2)
        if sigma > k:  # divided by cosh, which would overflow
            return a * S + b * C * math.tanh(b * T / 2)
        return a * S * math.cos(b * T / 2) - b * C * math.sin(b * T / 2)

    def odd(T: float) -> float:
        S, C = math.sin(a * T / 2), math.cos(a * T / 2)
        return a * C * math.sin(b * T / 2) - b * S * math.cos(b * T / 2)

    from scipy.optimize import brentq  # slow to load, and seldom needed

    # For sigma > k the odd ones come later: b tan x = a tanh(b x / a) has no root below pi.
    factors = (even,) if sigma > k else (even, odd)
    step = math.pi / (16.0 * (a + b))
    T = step
    while True:
        zeros = [
            float(brentq(factor, T, T + step, xtol=1e-15, rtol=1e-15))
            for factor in factors
            if factor(T) * factor(T + step) <= 0.0
        ]
        if zeros:
            return min(zeros)
        T += step


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
