"""Upper bounds, in continuous time, of the part of each limit that a trajectory uses.

A quantity f (rate, acceleration, torque or momentum) strays from its chord over h by at most
`M h^2 / 8` with `M >= |f''|`, and the part of a limit used, a maximum of norms, is convex. So
between two times it is at most the larger of its values there plus `M h^2 / 8` over the limit.

With `p_n` the largest `|xi^(n)|` on the interval, and `|d^n/dt^n exp(-u hat(xi))|` bounded by
`u p_1`, `u p_2 + u^2 p_1^2` and `u p_3 + 3 u^2 p_1 p_2 + u^3 p_1^3`, the mean over u in [0, 1]
in `v = J(xi) xi'` gives

    |v''|  <= p_3 + 3/2 p_1 p_2 + p_1^3 / 3,
    |v'''| <= p_4 + 2 p_1 p_3 + 3/2 p_2^2 + 2 p_1^2 p_2 + p_1^4 / 4.

The torque is `J a + v x J v`, the momentum `J v`; `|J x|` is at most the greatest moment `|x|`.
"""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import (
    all_finite,
    cross,
    derivatives,
    motion,
    motion_bounds,
    norm,
)
from riem_planner.kernels import inlined, kernel

TIGHTNESS = 1e-4
"""A bound is more than the greatest value found by at most this part."""

_ACCELERATION, _TORQUE, _MOMENTUM = 1, 2, 3
_DEPTH = 40  # halvings of one interval
_EVALUATIONS = 100_000


@inlined
def _derivative_bounds(c, k, s, h):
    """Upper bounds of |v|, |a|, |v''| and |v'''| on [s, s + h] of interval k."""
    p_1, _ = motion_bounds(c, k, s, h)
    S0 = S1 = S2 = S3 = T0 = T1 = T2 = U0 = U1 = 0.0
    for i in range(3):
        c2, c3, c4, c5 = c[k, 2, i], c[k, 3, i], c[k, 4, i], c[k, 5, i]
        q0 = 2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))
        q1 = h * (6 * c3 + s * (24 * c4 + s * 60 * c5))
        q2 = h * h * (12 * c4 + s * 60 * c5)
        q3 = h * h * h * 20 * c5
        S0 += q0**2
        S1 += (q0 + q1 / 3) ** 2
        S2 += (q0 + 2 * q1 / 3 + q2 / 3) ** 2
        S3 += (q0 + q1 + q2 + q3) ** 2
        T0 += q1**2
        T1 += (q1 + q2) ** 2
        T2 += (q1 + 2 * q2 + 3 * q3) ** 2
        U0 += (2 * q2) ** 2
        U1 += (2 * q2 + 6 * q3) ** 2
    p_2 = np.sqrt(max(S0, S1, S2, S3))
    p_3 = np.sqrt(max(T0, T1, T2)) / h
    p_4 = np.sqrt(max(U0, U1)) / (h * h)
    return (
        p_1,
        p_2 + 0.5 * p_1**2,
        p_3 + 1.5 * p_1 * p_2 + p_1**3 / 3,
        p_4 + 2 * p_1 * p_3 + 1.5 * p_2**2 + 2 * p_1**2 * p_2 + 0.25 * p_1**4,
    )


@inlined
def _second_derivative(quantity, J_largest, bounds):
    """Upper bound of |f''| of a quantity."""
    V, A, v_2, v_3 = bounds
    if quantity == _ACCELERATION:
        return v_3
    if quantity == _TORQUE:
        return J_largest * (v_3 + 2 * V * v_2 + 2 * A * A)
    if quantity == _MOMENTUM:
        return J_largest * v_2
    return v_2


@inlined
def _value(quantity, v, a, J):
    """The quantity, from rate and acceleration."""
    if quantity == 0:
        return v
    if quantity == _ACCELERATION:
        return a
    m = (
        J[0, 0] * v[0] + J[0, 1] * v[1] + J[0, 2] * v[2],
        J[1, 0] * v[0] + J[1, 1] * v[1] + J[1, 2] * v[2],
        J[2, 0] * v[0] + J[2, 1] * v[1] + J[2, 2] * v[2],
    )
    if quantity == _MOMENTUM:
        return m
    g = cross(v, m)
    return (
        J[0, 0] * a[0] + J[0, 1] * a[1] + J[0, 2] * a[2] + g[0],
        J[1, 0] * a[0] + J[1, 1] * a[1] + J[1, 2] * a[2] + g[1],
        J[2, 0] * a[0] + J[2, 1] * a[1] + J[2, 2] * a[2] + g[2],
    )


@inlined
def _part(quantity, c, k, s, J, reciprocals):
    """Part of a quantity's limit in use at time s of interval k."""
    xi, xi_1, xi_2 = derivatives(c, k, s)
    v, a = motion(xi, xi_1, xi_2)
    f = _value(quantity, v, a, J)
    return max(
        reciprocals[quantity, 0] * norm(f),
        reciprocals[quantity, 1] * abs(f[0]),
        reciprocals[quantity, 2] * abs(f[1]),
        reciprocals[quantity, 3] * abs(f[2]),
    )


@inlined
def _bound_quantity(quantity, times, c, J, J_largest, reciprocals, work):
    """Certified upper bound of the part used, the greatest part found, and its time."""
    sampled, right, right_s = work
    last = times.size - 1
    largest = max(
        reciprocals[quantity, 0],
        reciprocals[quantity, 1],
        reciprocals[quantity, 2],
        reciprocals[quantity, 3],
    )
    most, worst = -1.0, 0.0
    for k in range(last + 1):
        inside = min(k, last - 1)
        sampled[k] = _part(quantity, c, inside, times[k] - times[inside], J, reciprocals)
        if sampled[k] > most:
            most, worst = sampled[k], times[k]
    certified = most
    evaluations = 0
    for k in range(last):
        # From left to right: `right` is a stack of the ends still ahead.
        s, left, depth = 0.0, sampled[k], 0
        right_s[0], right[0] = times[k + 1] - times[k], sampled[k + 1]
        while depth >= 0:
            h = right_s[depth] - s
            M = _second_derivative(quantity, J_largest, _derivative_bounds(c, k, s, h))
            bound = max(left, right[depth]) + 0.125 * M * h * h * largest
            if bound <= most * (1.0 + TIGHTNESS) or depth == _DEPTH or evaluations == _EVALUATIONS:
                certified = max(certified, bound)
                left, s = right[depth], right_s[depth]
                depth -= 1
                continue
            evaluations += 1
            depth += 1
            right_s[depth] = s + 0.5 * h
            right[depth] = _part(quantity, c, k, right_s[depth], J, reciprocals)
            if right[depth] > most:
                most, worst = right[depth], times[k] + right_s[depth]
    return certified, most, worst


@kernel
def bound_limits(times, coefficients, J, J_largest, reciprocals):
    """Upper bound of the part used, the greatest part found and its time (4, 3), per quantity.

    NaN where there is no limit, or the trajectory is not finite.
    """
    result = np.empty((4, 3))
    finite = all_finite(coefficients)
    work = (np.empty(times.size), np.empty(_DEPTH + 1), np.empty(_DEPTH + 1))
    for quantity in range(4):
        result[quantity, 0] = result[quantity, 1] = result[quantity, 2] = np.nan
        total = 0.0
        for i in range(4):
            total += reciprocals[quantity, i]
        if finite and total > 0.0:
            result[quantity, 0], result[quantity, 1], result[quantity, 2] = _bound_quantity(
                quantity, times, coefficients, J, J_largest, reciprocals, work
            )
    return result
