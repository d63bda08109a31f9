# SPDX-License-Identifier: Apache-2.0
"""Upper bounds, in continuous time, of the part of each limit that a trajectory uses.

A quantity f (rate, acceleration, torque, momentum, jerk, torque's rate, and what the wheels give
and store) strays from its chord over h by at most `M h^2 / 8` with `M >= |f''|`, and the part of a
limit used, a maximum of norms, is convex. So between two times it is at most the larger of its
values there plus `M h^2 / 8` over the limit.

With `p_n` the largest `|xi^(n)|` on the interval, and `|d^n/dt^n exp(-u hat(xi))|` bounded by
`u p_1`, `u p_2 + u^2 p_1^2`, `u p_3 + 3 u^2 p_1 p_2 + u^3 p_1^3` and
`u p_4 + u^2 (4 p_1 p_3 + 3 p_2^2) + 6 u^3 p_1^2 p_2 + u^4 p_1^4`, the mean over u in [0, 1] in
`v = J(xi) xi'` gives

    |v^(2)| <= p_3 + 3/2 p_1 p_2 + p_1^3 / 3,
    |v^(3)| <= p_4 + 2 p_1 p_3 + 3/2 p_2^2 + 2 p_1^2 p_2 + p_1^4 / 4,
    |v^(4)| <= p_5 + 5/2 p_1 p_4 + 5 p_2 p_3 + 10/3 p_1^2 p_3 + 5 p_1 p_2^2 + 5/2 p_1^3 p_2
               + p_1^5 / 5.

The torque is `J a + v x J v`, the momentum `J v`; `|J x|` is at most the greatest moment `|x|`.
Wheels give `J a + v x h` and store `h - J v`, with the total momentum `h = R^T H`, `h' = h x v`,
of constant length. Jerk and torque's rate jump at samples; of each interval its own ends count.
"""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.certificate.interval import (
    all_finite,
    attitude,
    derivatives,
    jerk,
    motion,
    motion_bounds,
    rotated,
    third_derivative,
)
from riem_planner.geometry.vectors import cross, norm
from riem_planner.kernels import inlined, kernel
from riem_planner.limit_rows import (
    ACCELERATION,
    JERK,
    KEYS,
    MOMENTUM,
    RATE,
    TORQUE,
    TORQUE_RATE,
    WHEEL_MOMENTUM,
    WHEEL_TORQUE,
)

TIGHTNESS = 1e-4
"""A bound is more than the greatest value found by at most this part."""

_QUANTITIES = len(KEYS)
_DEPTH = 40  # halvings of one interval
_EVALUATIONS = 100_000


@inlined
def _derivative_bounds(c, k, s, h):
    """Upper bounds of |v| and of the norms of its four derivatives on [s, s + h] of interval k."""
    p_1, _ = motion_bounds(c, k, s, h)
    S0 = S1 = S2 = S3 = T0 = T1 = T2 = U0 = U1 = W = 0.0
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
        W += (120 * c5) ** 2
    p_2 = np.sqrt(max(S0, S1, S2, S3))
    p_3 = np.sqrt(max(T0, T1, T2)) / h
    p_4 = np.sqrt(max(U0, U1)) / (h * h)
    p_5 = np.sqrt(W)
    v_4 = p_5 + 2.5 * p_1 * p_4 + 5 * p_2 * p_3 + 10 / 3 * p_1**2 * p_3
    v_4 += 5 * p_1 * p_2**2 + 2.5 * p_1**3 * p_2 + p_1**5 / 5
    return (
        p_1,
        p_2 + 0.5 * p_1**2,
        p_3 + 1.5 * p_1 * p_2 + p_1**3 / 3,
        p_4 + 2 * p_1 * p_3 + 1.5 * p_2**2 + 2 * p_1**2 * p_2 + 0.25 * p_1**4,
        v_4,
    )


@inlined
def _second_derivative(quantity, J, H, bounds):
    """Upper bound of |f''| of a quantity; J the greatest moment, H the total momentum's norm."""
    V, A, v_2, v_3, v_4 = bounds
    if quantity == ACCELERATION:
        return v_3
    if quantity == TORQUE:
        return J * (v_3 + 2 * V * v_2 + 2 * A * A)
    if quantity == MOMENTUM:
        return J * v_2
    if quantity == JERK:
        return v_4
    if quantity == TORQUE_RATE:
        return J * (v_4 + 2 * V * v_3 + 6 * A * v_2)
    if quantity == WHEEL_TORQUE:
        return J * v_3 + H * (v_2 + 3 * A * V + V**3)
    if quantity == WHEEL_MOMENTUM:
        return J * v_2 + H * (A + V * V)
    return v_2


@inlined
def _times(J, x):
    return (
        J[0, 0] * x[0] + J[0, 1] * x[1] + J[0, 2] * x[2],
        J[1, 0] * x[0] + J[1, 1] * x[1] + J[1, 2] * x[2],
        J[2, 0] * x[0] + J[2, 1] * x[1] + J[2, 2] * x[2],
    )


@inlined
def _sum(x, y):
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


@inlined
def _momentum(quaternions, c, k, s, H):
    """The total angular momentum in body axes."""
    if H[0] == 0.0 and H[1] == 0.0 and H[2] == 0.0:
        return 0.0, 0.0, 0.0
    x, y, z, w = attitude(quaternions, c, k, s)
    return rotated((-x, -y, -z, w), (H[0], H[1], H[2]))


@inlined
def _value(quantity, path, k, s, body):
    """The quantity at time s of interval k."""
    quaternions, c = path
    J, _, H = body
    xi, xi_1, xi_2 = derivatives(c, k, s)
    v, a = motion(xi, xi_1, xi_2)
    if quantity == RATE:
        return v
    if quantity == ACCELERATION:
        return a
    if quantity == TORQUE:
        return _sum(_times(J, a), cross(v, _times(J, v)))
    if quantity == MOMENTUM:
        return _times(J, v)
    if quantity == WHEEL_TORQUE:
        return _sum(_times(J, a), cross(v, _momentum(quaternions, c, k, s, H)))
    if quantity == WHEEL_MOMENTUM:
        h, m = _momentum(quaternions, c, k, s, H), _times(J, v)
        return h[0] - m[0], h[1] - m[1], h[2] - m[2]
    j = jerk(xi, xi_1, xi_2, third_derivative(c, k, s))
    if quantity == JERK:
        return j
    return _sum(_times(J, j), _sum(cross(a, _times(J, v)), cross(v, _times(J, a))))


@inlined
def _part(quantity, path, k, s, body, table):
    """Part of a quantity's limit in use at time s of interval k."""
    norms, rows, first = table
    f = _value(quantity, path, k, s, body)
    part = norms[quantity] * norm(f)
    for i in range(first[quantity], first[quantity + 1]):
        part = max(part, abs(rows[i, 0] * f[0] + rows[i, 1] * f[1] + rows[i, 2] * f[2]))
    return part


@inlined
def _greatest(quantity, table):
    """The most that a unit change of a quantity changes the part used."""
    norms, rows, first = table
    most = norms[quantity]
    for i in range(first[quantity], first[quantity + 1]):
        most = max(most, norm((rows[i, 0], rows[i, 1], rows[i, 2])))
    return most


@inlined
def _bound_quantity(quantity, times, path, body, table, work):
    """Certified upper bound of the part used, the greatest part found, and its time."""
    starts, ends, right, right_s = work
    n = times.size - 1
    largest = _greatest(quantity, table)
    H = norm((body[2][0], body[2][1], body[2][2]))
    most, worst = -1.0, 0.0
    for k in range(n):
        h = times[k + 1] - times[k]
        starts[k] = _part(quantity, path, k, 0.0, body, table)
        ends[k] = _part(quantity, path, k, h, body, table)
        if starts[k] > most:
            most, worst = starts[k], times[k]
        if ends[k] > most:
            most, worst = ends[k], times[k + 1]
    certified = most
    evaluations = 0
    for k in range(n):
        # From left to right: `right` is a stack of the ends still ahead.
        s, left, depth = 0.0, starts[k], 0
        right_s[0], right[0] = times[k + 1] - times[k], ends[k]
        while depth >= 0:
            h = right_s[depth] - s
            M = _second_derivative(quantity, body[1], H, _derivative_bounds(path[1], k, s, h))
            bound = max(left, right[depth]) + 0.125 * M * h * h * largest
            if bound <= most * (1.0 + TIGHTNESS) or depth == _DEPTH or evaluations == _EVALUATIONS:
                certified = max(certified, bound)
                left, s = right[depth], right_s[depth]
                depth -= 1
                continue
            evaluations += 1
            depth += 1
            right_s[depth] = s + 0.5 * h
            right[depth] = _part(quantity, path, k, right_s[depth], body, table)
            if right[depth] > most:
                most, worst = right[depth], times[k] + right_s[depth]
    return certified, most, worst


@kernel
def bound_limits(times, path, body, table):
    """Upper bound of the part used, the greatest part found and its time (8, 3), per row.

    NaN where there is no limit, or the trajectory is not finite.

    Parameters
    ----------
    times : (n,)
        Of the samples.
    path
        Quaternions (n, 4) of the samples and the coefficients (n - 1, 6, 3) between them.
    body
        Inertia (3, 3), its greatest moment, the total momentum (3,) in the reference frame.
    table
        `LimitTable`.
    """
    result = np.empty((_QUANTITIES, 3))
    finite = all_finite(path[1])
    size = times.size
    work = (np.empty(size), np.empty(size), np.empty(_DEPTH + 1), np.empty(_DEPTH + 1))
    for quantity in range(_QUANTITIES):
        result[quantity, 0] = result[quantity, 1] = result[quantity, 2] = np.nan
        if finite and _greatest(quantity, table) > 0.0:
            result[quantity, 0], result[quantity, 1], result[quantity, 2] = _bound_quantity(
                quantity, times, path, body, table, work
            )
    return result
