# SPDX-License-Identifier: Apache-2.0
"""What the limits bear on, and its derivatives, in the normalised time of a transcription.

With `s = t / T` in [0, 1], `V = T v` and `A = T^2 a`, the dynamics know no duration, and a limit L
of a quantity f that goes with `1/T^j` becomes `|f(V, A)| <= (T/T_0)^j` for f over `L T_0^j`. With
`p = (T/T_0)^m`, m the greatest of the powers j, the right sides `w_j = p^(j/m)` are concave, so
limits of rates, accelerations and jerks are convex sets of (V, A, p).

A stage has the variables `(d, V, A, p, U)`: the attitude `R exp(hat(d))`, rate and acceleration at
its node, the duration, and the change `U = A_+ - A` to the next node, between which A is linear.
"""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

from riem_planner.geometry.vectors import cross
from riem_planner.kernels import inlined, part
from riem_planner.least_time.model import MIDDLE
from riem_planner.least_time.vectors import (
    add_diagonal,
    add_hat,
    add_hat_times,
    add_matrix,
    plus,
    row,
    seen,
    times,
)
from riem_planner.limit_rows import (
    ACCELERATION,
    JERK,
    MOMENTUM,
    RATE,
    TORQUE,
    TORQUE_RATE,
    WHEEL_MOMENTUM,
    WHEEL_TORQUE,
)


@inlined
def of_interval(code):
    """Whether a quantity belongs to an interval, not to a node."""
    return code >= MIDDLE or code in (JERK, TORQUE_RATE)


@inlined
def half_way(k, V, A, h):
    """Rate and acceleration half-way to the next node, and the change of acceleration."""
    v, a = row(V, k), row(A, k)
    u = (A[k + 1, 0] - a[0], A[k + 1, 1] - a[1], A[k + 1, 2] - a[2])
    return plus(plus(v, a, 0.5 * h), u, h / 8), plus(a, u, 0.5), u


@inlined
def columns(code):
    """Range of the variables that a quantity depends on."""
    if code in (RATE, MOMENTUM):
        return 3, 6
    if code == ACCELERATION:
        return 6, 9
    if code == TORQUE:
        return 3, 9
    if code in (WHEEL_TORQUE, WHEEL_MOMENTUM):
        return 0, 9
    if code == JERK:
        return 10, 13
    return 3, 13


@part
def quantity(code, k, iterate, model, tau):
    """A limited quantity at node k, or of the interval after it; `tau = T / T_0`."""
    q, V, A = iterate.q, iterate.V, iterate.A
    J, H = model.inertia, model.momentum
    v, a = row(V, k), row(A, k)
    if code == RATE:
        return v
    if code == ACCELERATION:
        return a
    if code == MOMENTUM:
        return times(J, v)
    if code == TORQUE:
        return plus(times(J, a), cross(v, times(J, v)), 1.0)
    if code == WHEEL_TORQUE:
        return plus(times(J, a), cross(v, seen(q, k, (H[0], H[1], H[2]))), tau)
    if code == WHEEL_MOMENTUM:
        m = times(J, v)
        return plus((-m[0], -m[1], -m[2]), seen(q, k, (H[0], H[1], H[2])), tau)
    h = 1.0 / (V.shape[0] - 1)
    v, a, u = half_way(k, V, A, h)
    j = (u[0] / h, u[1] / h, u[2] / h)
    if code == JERK:
        return j
    if code == RATE + MIDDLE:
        return v
    if code == TORQUE_RATE:
        return plus(times(J, j), plus(cross(a, times(J, v)), cross(v, times(J, a)), 1.0), 1.0)
    return times(J, v)


@part
def differentiate(code, k, iterate, model, tau, out):
    """Derivatives of `quantity` by the stage's variables, into `out` (3, 13); by tau returned."""
    q, V, A = iterate.q, iterate.V, iterate.A
    J, H = model.inertia, model.momentum
    v = row(V, k)
    h = 1.0 / (V.shape[0] - 1)
    out[:] = 0.0
    if code == RATE:
        add_diagonal(out, 3, 1.0)
    elif code == ACCELERATION:
        add_diagonal(out, 6, 1.0)
    elif code == MOMENTUM:
        add_matrix(out, 3, J, 1.0)
    elif code == TORQUE:
        add_matrix(out, 6, J, 1.0)
        add_hat_times(out, 3, v, J, 1.0)
        add_hat(out, 3, times(J, v), -1.0)
    elif code == WHEEL_TORQUE:
        m = seen(q, k, (H[0], H[1], H[2]))
        add_matrix(out, 6, J, 1.0)
        add_hat(out, 3, m, -tau)
        # The momentum changes by m x d, so the torque by v x (m x d) = m (v . d) - d (v . m).
        for i in range(3):
            for j in range(3):
                out[i, j] += tau * m[i] * v[j]
        add_diagonal(out, 0, -tau * (v[0] * m[0] + v[1] * m[1] + v[2] * m[2]))
        return cross(v, m)
    elif code == WHEEL_MOMENTUM:
        m = seen(q, k, (H[0], H[1], H[2]))
        add_matrix(out, 3, J, -1.0)
        add_hat(out, 0, m, tau)
        return m
    elif code == JERK:
        add_diagonal(out, 10, 1.0 / h)
    elif code == RATE + MIDDLE:
        add_diagonal(out, 3, 1.0)
        add_diagonal(out, 6, 0.5 * h)
        add_diagonal(out, 10, h / 8)
    elif code == TORQUE_RATE:
        _differentiate_torque_rate(k, V, A, J, out)
    else:
        add_matrix(out, 3, J, 1.0)
        add_matrix(out, 6, J, 0.5 * h)
        add_matrix(out, 10, J, h / 8)
    return 0.0, 0.0, 0.0


@inlined
def _differentiate_torque_rate(k, V, A, J, out):
    """Of `J U / h + a x J v + v x J a`, half-way."""
    h = 1.0 / (V.shape[0] - 1)
    v, a, _ = half_way(k, V, A, h)
    for column, by_v, by_a in ((3, 1.0, 0.0), (6, 0.5 * h, 1.0), (10, h / 8, 0.5)):
        add_hat_times(out, column, a, J, by_v)
        add_hat(out, column, times(J, a), -by_v)
        add_hat_times(out, column, v, J, by_a)
        add_hat(out, column, times(J, v), -by_a)
    add_matrix(out, 10, J, 1.0 / h)
