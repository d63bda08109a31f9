# SPDX-License-Identifier: Apache-2.0
"""The published trajectory: attitude, rate and acceleration at any time.

Between samples the attitude is `R_k exp(hat(xi(t)))` with the quintic polynomial xi that
matches attitude, body rate and body acceleration at both ends of the interval. Rate and
acceleration are its exact derivatives, so `R' = R hat(v)` and `v' = a` hold to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riem_planner.checks import frozen
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.geometry.quaternions import relative, turn
from riem_planner.geometry.vectors import cross
from riem_planner.kernels import brief_kernel, inlined

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Attitude over time on [0, duration].

    Parameters
    ----------
    times : (n,)
        Increasing sample times from 0 [s].
    quaternions_xyzw : (n, 4)
        Unit quaternions, body to reference frame, continuous in sign.
    angular_velocities : (n, 3)
        Body rates v [rad/s].
    angular_accelerations : (n, 3)
        Body accelerations `a = v'` [rad/s^2].
    """

    times: Array
    quaternions_xyzw: Array
    angular_velocities: Array
    angular_accelerations: Array
    _coefficients: Array = field(init=False, repr=False)

    if TYPE_CHECKING:
        # What the constructor takes; the fields say what is kept of it.
        def __init__(
            self,
            times: ArrayLike,
            quaternions_xyzw: ArrayLike,
            angular_velocities: ArrayLike,
            angular_accelerations: ArrayLike,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Validate, freeze, and fit the polynomials."""
        shapes = {"quaternions_xyzw": 4, "angular_velocities": 3, "angular_accelerations": 3}
        times = np.array(self.times, dtype=float)
        if times.ndim != 1 or times.size < 2 or times[0] != 0.0:
            raise InvalidProblemError("times", "expected at least two times, the first one 0")
        if not (np.isfinite(times[-1]) and np.all(np.diff(times) > 0.0)):
            raise InvalidProblemError("times", "expected finite, increasing times")
        object.__setattr__(self, "times", frozen(times))
        for key, width in shapes.items():
            values = np.array(getattr(self, key), dtype=float)
            if values.shape != (times.size, width) or not np.all(np.isfinite(values)):
                raise InvalidProblemError(
                    key,
                    f"expected finite numbers of shape {(times.size, width)},"
                    f" got shape {values.shape}",
                )
            object.__setattr__(self, key, frozen(values))
        coefficients = fit_quintics(
            times, self.quaternions_xyzw, self.angular_velocities, self.angular_accelerations
        )
        object.__setattr__(self, "_coefficients", frozen(coefficients))

    @property
    def duration(self) -> float:
        """T [s]."""
        return float(self.times[-1])

    @property
    def coefficients(self) -> Array:
        """Quintics xi (n - 1, 6, 3): interval k is `sum_i coefficients[k, i] (t - t_k)^i`."""
        return self._coefficients

    def evaluate_quaternion(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Quaternions (..., 4), rates (..., 3) [rad/s], accelerations (..., 3) [rad/s^2].

        Parameters
        ----------
        t : (...)
            Times in [0, duration] [s].

        Raises
        ------
        ValueError
            A time is outside [0, duration].
        """
        t = np.asarray(t, dtype=float)
        flat = np.atleast_1d(t).ravel()
        # Written so that NaN is refused as well.
        if not (flat.size == 0 or (flat.min() >= 0.0 and flat.max() <= self.duration)):
            raise ValueError(
                f"t must lie in [0, {self.duration:.9g}] s, got"
                f" [{flat.min():.9g}, {flat.max():.9g}]"
            )
        q, v, a = evaluate_quintics(flat, self.times, self.quaternions_xyzw, self._coefficients)
        return q.reshape(*t.shape, 4), v.reshape(*t.shape, 3), a.reshape(*t.shape, 3)

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Rotation matrices (..., 3, 3), rates (..., 3), accelerations (..., 3) at times (...).

        As `evaluate_quaternion`.
        """
        q, v, a = self.evaluate_quaternion(t)
        return so3.quaternion_to_matrix(q), v, a

    def resampled(self, samples: int) -> Trajectory:
        """The trajectory through `samples` of its own points, evenly spaced in time.

        It is another trajectory, which has to be certified by itself.
        """
        if samples < 2:
            raise ValueError(f"samples must be at least 2, got {samples}")
        times = np.linspace(0.0, self.duration, samples)
        return Trajectory(times, *self.evaluate_quaternion(times))


@inlined
def _curvature_coefficients(square):
    """Of the right Jacobian and its rate: (1-cos x)/x^2, (x-sin x)/x^3, d/dx of each over x."""
    if square < 0.25:
        z = square
        first = 0.5 - z / 24 * (1 - z / 30 * (1 - z / 56 * (1 - z / 90 * (1 - z / 132))))
        second = 1 / 6 - z / 120 * (1 - z / 42 * (1 - z / 72 * (1 - z / 110 * (1 - z / 156))))
        first_rate = -1 / 12 + z * (
            1 / 180 - z * (1 / 6720 - z * (1 / 453600 - z * (1 / 47900160 - z / 7264857600)))
        )
        second_rate = -1 / 60 + z * (
            1 / 1260 - z * (1 / 60480 - z * (1 / 4989600 - z * (1 / 622702080 - z / 108972864000)))
        )
        return first, second, first_rate, second_rate
    x = np.sqrt(square)
    sine, cosine = np.sin(x), np.cos(x)
    first = (1 - cosine) / square
    second = (x - sine) / (square * x)
    first_rate = (sine / x - 2 * first) / square
    second_rate = (first - 3 * second) / square
    return first, second, first_rate, second_rate


@inlined
def _rate_and_acceleration(xi, xi_1, xi_2):
    """Body rate and acceleration of exp(xi(t)) from xi and its two derivatives."""
    square = xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2
    inner = xi[0] * xi_1[0] + xi[1] * xi_1[1] + xi[2] * xi_1[2]
    A, B, A_rate, B_rate = _curvature_coefficients(square)
    A_dot, B_dot = A_rate * inner, B_rate * inner
    c1 = cross(xi, xi_1)
    cc1 = cross(xi, c1)
    c2 = cross(xi, xi_2)
    cc2 = cross(xi, c2)
    c11 = cross(xi_1, c1)
    v = (
        xi_1[0] - A * c1[0] + B * cc1[0],
        xi_1[1] - A * c1[1] + B * cc1[1],
        xi_1[2] - A * c1[2] + B * cc1[2],
    )
    a = (
        xi_2[0] - A_dot * c1[0] - A * c2[0] + B_dot * cc1[0] + B * (c11[0] + cc2[0]),
        xi_2[1] - A_dot * c1[1] - A * c2[1] + B_dot * cc1[1] + B * (c11[1] + cc2[1]),
        xi_2[2] - A_dot * c1[2] - A * c2[2] + B_dot * cc1[2] + B * (c11[2] + cc2[2]),
    )
    return v, a


@inlined
def _jacobian_inverse_times(xi, vector):
    """Right Jacobian inverse of exp at xi, applied to a vector."""
    square = xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2
    if square < 0.25:
        tail = 1 + square * 10 / 396 * (1 + square * 691 / 27300 * (1 + square * 35 / 1382))
        C = 1 / 12 + square / 720 * (1 + square / 42 * (1 + square / 40 * tail))
    else:
        half = 0.5 * np.sqrt(square)
        C = (1 - half / np.tan(half)) / square
    c = cross(xi, vector)
    cc = cross(xi, c)
    return (
        vector[0] + 0.5 * c[0] + C * cc[0],
        vector[1] + 0.5 * c[1] + C * cc[1],
        vector[2] + 0.5 * c[2] + C * cc[2],
    )


@brief_kernel
def fit_quintics(times, quaternions, rates, accelerations):
    """Coefficients (n - 1, 6, 3) of the quintics between samples; see `Trajectory`."""
    n = times.size - 1
    coefficients = np.zeros((n, 6, 3))
    turn = np.empty(3)
    for k in range(n):
        h = times[k + 1] - times[k]
        relative(quaternions[k], quaternions[k + 1], turn)
        end = (turn[0], turn[1], turn[2])
        end_1 = _jacobian_inverse_times(end, (rates[k + 1, 0], rates[k + 1, 1], rates[k + 1, 2]))
        zero = (0.0, 0.0, 0.0)
        _, drift = _rate_and_acceleration(end, end_1, zero)
        end_2 = _jacobian_inverse_times(
            end,
            (
                accelerations[k + 1, 0] - drift[0],
                accelerations[k + 1, 1] - drift[1],
                accelerations[k + 1, 2] - drift[2],
            ),
        )
        for i in range(3):
            v, a = rates[k, i], accelerations[k, i]
            d0 = end[i] - h * v - 0.5 * h * h * a
            d1 = h * (end_1[i] - v - h * a)
            d2 = h * h * (end_2[i] - a)
            coefficients[k, 1, i] = v
            coefficients[k, 2, i] = 0.5 * a
            coefficients[k, 3, i] = (10.0 * d0 - 4.0 * d1 + 0.5 * d2) / h**3
            coefficients[k, 4, i] = (-15.0 * d0 + 7.0 * d1 - d2) / h**4
            coefficients[k, 5, i] = (6.0 * d0 - 3.0 * d1 + 0.5 * d2) / h**5
    return coefficients


@brief_kernel
def evaluate_quintics(t, times, quaternions, coefficients):
    """Quaternions (m, 4), rates (m, 3) and accelerations (m, 3) at times (m,)."""
    q_out = np.empty((t.size, 4))
    v_out = np.empty((t.size, 3))
    a_out = np.empty((t.size, 3))
    last = times.size - 2
    xi, xi_1, xi_2 = np.empty(3), np.empty(3), np.empty(3)
    for m in range(t.size):
        k = min(max(np.searchsorted(times, t[m], side="right") - 1, 0), last)
        s = t[m] - times[k]
        c = coefficients[k]
        for i in range(3):
            xi[i] = s * (c[1, i] + s * (c[2, i] + s * (c[3, i] + s * (c[4, i] + s * c[5, i]))))
            xi_1[i] = c[1, i] + s * (
                2 * c[2, i] + s * (3 * c[3, i] + s * (4 * c[4, i] + s * 5 * c[5, i]))
            )
            xi_2[i] = 2 * c[2, i] + s * (6 * c[3, i] + s * (12 * c[4, i] + s * 20 * c[5, i]))
        v, a = _rate_and_acceleration(xi, xi_1, xi_2)
        angle = np.sqrt(xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2)
        factor = np.sin(0.5 * angle) / angle if angle > 1e-8 else 0.5
        x, y, z, w = factor * xi[0], factor * xi[1], factor * xi[2], np.cos(0.5 * angle)
        p = quaternions[k]
        q = (
            p[3] * x + w * p[0] + p[1] * z - p[2] * y,
            p[3] * y + w * p[1] + p[2] * x - p[0] * z,
            p[3] * z + w * p[2] + p[0] * y - p[1] * x,
            p[3] * w - p[0] * x - p[1] * y - p[2] * z,
        )
        norm = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
        for i in range(4):
            q_out[m, i] = q[i] / norm
        for i in range(3):
            v_out[m, i] = v[i]
            a_out[m, i] = a[i]
    return q_out, v_out, a_out


@brief_kernel
def follow_turns(start, xi, xi_1, xi_2):
    """Quaternions (n, 4), rates and accelerations (n, 3) of `R_0 exp(hat(xi))`.

    Parameters
    ----------
    start : (4,)
        Quaternion of R_0.
    xi, xi_1, xi_2 : (n, 3)
        Rotation vectors and their two time derivatives.
    """
    n = xi.shape[0]
    q_out, v_out, a_out = np.empty((n, 4)), np.empty((n, 3)), np.empty((n, 3))
    for k in range(n):
        turn(start, xi[k], 1.0, q_out[k])
        v, a = _rate_and_acceleration(xi[k], xi_1[k], xi_2[k])
        for i in range(3):
            v_out[k, i], a_out[k, i] = v[i], a[i]
    return q_out, v_out, a_out
