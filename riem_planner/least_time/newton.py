# SPDX-License-Identifier: Apache-2.0
"""Newton's step of the interior point, by a Riccati recursion from the goal to the start.

The barrier problem is `min p - mu sum log s`, `c + s = 0` under the dynamics. With the multipliers
z eliminated, each stage has the Hessian `sum c' (z/s) c'^T + z c''` and the gradient
`sum c' (mu/s + z/s (c + s))`. The conditions at the goal carry multipliers nu of their own, in
which the value of going on is linear.
"""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.kernels import inlined, kernel, part
from riem_planner.least_time.linear import tau_of
from riem_planner.least_time.model import CODE, CONSTRAINT, FIRST, POWER, ROW, ROWS
from riem_planner.least_time.quantities import columns
from riem_planner.limit_rows import TORQUE

_SINGULAR = 1e-14  # pivot over the greatest diagonal entry


@inlined
def powers(p, exponent):
    """`w = p^exponent` and two derivatives."""
    w = p**exponent
    return w, exponent * w / p, exponent * (exponent - 1.0) * w / (p * p)


@inlined
def _norm_terms(i, k, iterate, linear, model, mu, w):
    """Hessian (4 x 4, as ten numbers) and gradient of `g^2 |f|^2 / w - w` in (f, w)."""
    first = model.slots[i, FIRST]
    s, z, c = iterate.s[k, first], iterate.z[k, first], linear.c[k, first]
    G = model.gains[i] ** 2
    f = linear.f[k, i]
    y0, y1, y2 = 2 * G * f[0] / w, 2 * G * f[1] / w, 2 * G * f[2] / w
    over = (c + w) / w  # g^2 |f|^2 / w^2
    y3 = -over - 1.0
    r, b = z / s, mu / s + z / s * (c + s)
    e = 2 * z * G / w
    return (
        (r * y0 * y0 + e, r * y0 * y1, r * y0 * y2, r * y1 * y1 + e, r * y1 * y2, r * y2 * y2 + e),
        (r * y0 * y3 - z * y0 / w, r * y1 * y3 - z * y1 / w, r * y2 * y3 - z * y2 / w),
        r * y3 * y3 + 2 * z * over / w,
        (b * y0, b * y1, b * y2, b * y3),
        (z * y0, z * y1, z * y2, z * y3),
    )


@inlined
def _row_terms(i, k, iterate, linear, model, mu):
    """As `_norm_terms`, of `+-rows . f - w`."""
    first = model.slots[i, FIRST]
    K0 = K1 = K2 = K3 = K4 = K5 = k0 = k1 = k2 = kw = 0.0
    b0 = b1 = b2 = b3 = z0 = z1 = z2 = z3 = 0.0
    for j in range(model.slots[i, ROWS]):
        x, y, z = model.rows[model.slots[i, ROW] + j]
        up, down = first + 2 * j, first + 2 * j + 1
        s_up, z_up, s_down, z_down = (
            iterate.s[k, up], iterate.z[k, up], iterate.s[k, down], iterate.z[k, down],
        )  # fmt: skip
        r_up, r_down = z_up / s_up, z_down / s_down
        b_up = mu / s_up + r_up * (linear.c[k, up] + s_up)
        b_down = mu / s_down + r_down * (linear.c[k, down] + s_down)
        r, d, b, e = r_up + r_down, r_down - r_up, b_up - b_down, z_up - z_down
        K0, K1, K2 = K0 + r * x * x, K1 + r * x * y, K2 + r * x * z
        K3, K4, K5 = K3 + r * y * y, K4 + r * y * z, K5 + r * z * z
        k0, k1, k2, kw = k0 + d * x, k1 + d * y, k2 + d * z, kw + r
        b0, b1, b2, b3 = b0 + b * x, b1 + b * y, b2 + b * z, b3 - b_up - b_down
        z0, z1, z2, z3 = z0 + e * x, z1 + e * y, z2 + e * z, z3 - z_up - z_down
    return (K0, K1, K2, K3, K4, K5), (k0, k1, k2), kw, (b0, b1, b2, b3), (z0, z1, z2, z3)


@inlined
def _times_f(K, x):
    """The part of f of a Hessian times a vector."""
    return (
        K[0] * x[0] + K[1] * x[1] + K[2] * x[2],
        K[1] * x[0] + K[3] * x[1] + K[4] * x[2],
        K[2] * x[0] + K[4] * x[1] + K[5] * x[2],
    )


@inlined
def _add_quantity(i, k, linear, model, terms, by_p, out):
    """Add a quantity's Hessian and gradient, carried over to the stage's variables."""
    K, K_w, K_ww, b, z = terms
    w_1, w_2, tau_1 = by_p
    H, g = out
    X, t = linear.by_stage[k, i], linear.by_tau[k, i]
    low, high = columns(model.slots[i, CODE])
    e = (t[0] * tau_1, t[1] * tau_1, t[2] * tau_1)
    Ke = _times_f(K, e)
    for c in range(low, high):
        x = (X[0, c], X[1, c], X[2, c])
        y = _times_f(K, x)
        g[c] += x[0] * b[0] + x[1] * b[1] + x[2] * b[2]
        for d in range(low, c + 1):
            H[c, d] += y[0] * X[0, d] + y[1] * X[1, d] + y[2] * X[2, d]
        cross = w_1 * (K_w[0] * x[0] + K_w[1] * x[1] + K_w[2] * x[2])
        cross += Ke[0] * x[0] + Ke[1] * x[1] + Ke[2] * x[2]
        H[max(c, 9), min(c, 9)] += cross if c != 9 else 0.0
    g[9] += w_1 * b[3] + e[0] * b[0] + e[1] * b[1] + e[2] * b[2]
    H[9, 9] += w_1 * w_1 * K_ww + w_2 * z[3] + e[0] * Ke[0] + e[1] * Ke[1] + e[2] * Ke[2]
    H[9, 9] += 2 * w_1 * (K_w[0] * e[0] + K_w[1] * e[1] + K_w[2] * e[2])


@inlined
def _add_gyroscopic(z, J, H):
    """The second derivatives of `z . (V x J V)`, `J hat(z) - hat(z) J`."""
    S = ((0.0, -z[2], z[1]), (z[2], 0.0, -z[0]), (-z[1], z[0], 0.0))
    for a in range(3):
        for b in range(a + 1):
            for c in range(3):
                H[3 + a, 3 + b] += J[a, c] * S[c][b] - S[a][c] * J[c, b]


@part
def _stage(k, iterate, linear, model, used, mu, exact, out):
    """Add all constraints of a stage to its Hessian (13, 13), lower part, and gradient (13,)."""
    H, g = out
    p = iterate.p[0]
    _, tau_1 = tau_of(p, model)
    for i in range(model.slots.shape[0]):
        if not used[k, model.slots[i, FIRST]]:
            continue
        w, w_1, w_2 = powers(p, model.slots[i, POWER] / model.power)
        if model.slots[i, ROWS] == 0:
            terms = _norm_terms(i, k, iterate, linear, model, mu, w)
        else:
            terms = _row_terms(i, k, iterate, linear, model, mu)
        _add_quantity(i, k, linear, model, terms, (w_1, w_2, tau_1), out)
        if exact and model.slots[i, CODE] == TORQUE:
            _add_gyroscopic(terms[4], model.inertia, H)
    for j in range(model.sets.shape[0]):
        i = model.sets[j, CONSTRAINT]
        if not used[k, i]:
            continue
        s, z = iterate.s[k, i], iterate.z[k, i]
        r, b = z / s, mu / s + z / s * (linear.c[k, i] + s)
        by_d, by_p = linear.set_by_d[k, j], linear.set_by_tau[k, j] * tau_1
        for c in range(3):
            g[c] += b * by_d[c]
            for d in range(c + 1):
                H[c, d] += r * by_d[c] * by_d[d]
                if exact:
                    H[c, d] += z * linear.set_by_dd[k, j, c, d]
            H[9, c] += r * by_d[c] * by_p
        g[9] += b * by_p
        H[9, 9] += r * by_p * by_p


@inlined
def _add_curvature(k, linear, costate, H):
    """The costate times the second order of the step, `-d (exp(theta) hat(costate) / 2) y`."""
    Y, back = linear.by_motion[k], linear.back[k]
    for j in range(9):
        x, y, z = Y[0, j], Y[1, j], Y[2, j]
        c0 = -0.5 * (costate[1] * z - costate[2] * y)
        c1 = -0.5 * (costate[2] * x - costate[0] * z)
        c2 = -0.5 * (costate[0] * y - costate[1] * x)
        column = 3 + j if j < 6 else 4 + j
        for i in range(3):
            H[column, i] += back[0, i] * c0 + back[1, i] * c1 + back[2, i] * c2


@inlined
def _through(k, linear, h, X, out):
    """`F^T X` of the derivatives F (10, 13) of the dynamics, for X (10, m), into `out` (13, m)."""
    back, Y = linear.back[k], linear.by_motion[k]
    for c in range(X.shape[1]):
        x, y, z = X[0, c], X[1, c], X[2, c]
        for j in range(3):
            v, a = X[3 + j, c], X[6 + j, c]
            out[j, c] = back[0, j] * x + back[1, j] * y + back[2, j] * z
            out[3 + j, c] = Y[0, j] * x + Y[1, j] * y + Y[2, j] * z + v
            out[6 + j, c] = Y[0, 3 + j] * x + Y[1, 3 + j] * y + Y[2, 3 + j] * z + h * v + a
            out[10 + j, c] = Y[0, 6 + j] * x + Y[1, 6 + j] * y + Y[2, 6 + j] * z + 0.5 * h * v + a
        out[9, c] = X[9, c]


@inlined
def _control_gains(X, G, gains):
    """Minimise over the control: `gains = -X_uu^-1 (X_ux, G_u)`; false where it is no minimum."""
    largest = max(X[10, 10], X[11, 11], X[12, 12])
    d0 = X[10, 10]
    l10, l20 = X[11, 10] / d0, X[12, 10] / d0
    d1 = X[11, 11] - l10 * X[11, 10]
    e = X[12, 11] - l20 * X[11, 10]
    l21 = e / d1
    d2 = X[12, 12] - l20 * X[12, 10] - l21 * e
    if not min(d0, d1, d2) > _SINGULAR * largest:
        return False
    for c in range(gains.shape[1]):
        if c < 10:
            y0, y1, y2 = X[10, c], X[11, c], X[12, c]
        else:
            y0, y1, y2 = G[10, c - 10], G[11, c - 10], G[12, c - 10]
        y1 -= l10 * y0
        y2 = (y2 - l20 * y0 - l21 * y1) / d2
        y1 = y1 / d1 - l21 * y2
        gains[0, c], gains[1, c], gains[2, c] = -(y0 / d0 - l10 * y1 - l20 * y2), -y1, -y2
    return True


@inlined
def _eliminate(X, G, gains, riccati):
    """The value at the stage before, its control chosen."""
    P, R = riccati.P, riccati.R
    conditions = R.shape[1] - 1
    for i in range(10):
        x, y, z = X[10, i], X[11, i], X[12, i]
        for j in range(i + 1):
            P[i, j] = P[j, i] = X[i, j] + x * gains[0, j] + y * gains[1, j] + z * gains[2, j]
        for c in range(conditions + 1):
            R[i, c] = G[i, c] + x * gains[0, 10 + c] + y * gains[1, 10 + c] + z * gains[2, 10 + c]
    for i in range(conditions):
        x, y, z = G[10, 1 + i], G[11, 1 + i], G[12, 1 + i]
        riccati.m[i] += x * gains[0, 10] + y * gains[1, 10] + z * gains[2, 10]
        for j in range(conditions):
            riccati.M[i, j] += x * gains[0, 11 + j] + y * gains[1, 11 + j] + z * gains[2, 11 + j]


@inlined
def _keep(k, riccati):
    """Keep the rows that give the costate of stage k."""
    for i in range(3):
        for j in range(10):
            riccati.state_rows[k, i, j] = riccati.P[i, j]
        for j in range(riccati.R.shape[1]):
            riccati.end_rows[k, i, j] = riccati.R[i, j]


@inlined
def _at_goal(H, g, ends, riccati):
    """The value at the goal, and the conditions there: columns of `ends[0]`, `ends[1]`."""
    for i in range(10):
        for j in range(i + 1):
            riccati.P[i, j] = riccati.P[j, i] = H[i, j]
        riccati.R[i, 0] = g[i]
        for j in range(ends[1].size):
            riccati.R[i, 1 + j] = ends[0][i, j]
    riccati.M[:] = 0.0
    for j in range(ends[1].size):
        riccati.m[j] = -ends[1][j]


@kernel
def backward(iterate, linear, model, used, barrier, ends, riccati):
    """The value of going on from the start; false where the Hessian is not convex enough.

    Parameters
    ----------
    barrier
        The parameter mu, whether second derivatives that may be indefinite count, and what is
        added to the Hessian of U against long steps where the optimum is flat.
    ends
        Conditions at the goal, `ends[0]^T x = ends[1]` (10, n), (n,).
    """
    mu, exact, damping = barrier
    n = iterate.V.shape[0] - 1
    h, weight = 1.0 / n, model.weight * n
    columns_R = riccati.R.shape[1]
    H, g = np.zeros((13, 13)), np.zeros(13)
    half, X = np.empty((13, 10)), np.empty((13, 13))
    turned, right, G = np.empty((10, 13)), np.empty((10, columns_R)), np.empty((13, columns_R))
    _stage(n, iterate, linear, model, used, mu, exact, (H, g))
    _at_goal(H, g, ends, riccati)
    _keep(n, riccati)
    for k in range(n - 1, -1, -1):
        H[:] = 0.0
        g[:] = 0.0
        _stage(k, iterate, linear, model, used, mu, exact, (H, g))
        for i in range(3):
            H[10 + i, 10 + i] += weight + damping
            g[10 + i] += weight * (iterate.A[k + 1, i] - iterate.A[k, i])
        if exact:
            _add_curvature(k, linear, iterate.costates[k + 1], H)
        e = linear.defect[k]
        for i in range(10):
            for c in range(columns_R):
                right[i, c] = riccati.R[i, c]
            right[i, 0] += riccati.P[i, 0] * e[0] + riccati.P[i, 1] * e[1] + riccati.P[i, 2] * e[2]
        for j in range(columns_R - 1):
            for i in range(3):
                riccati.m[j] += riccati.R[i, 1 + j] * e[i]
        _through(k, linear, h, riccati.P, half)
        for i in range(10):
            for j in range(13):
                turned[i, j] = half[j, i]
        _through(k, linear, h, turned, X)
        _through(k, linear, h, right, G)
        for i in range(13):
            G[i, 0] += g[i]
            for j in range(i + 1):
                X[i, j] += H[i, j]
                X[j, i] = X[i, j]
        if not model.rolling:  # the first component of the control is not free
            X[10, :] = 0.0
            X[:, 10] = 0.0
            X[10, 10] = 1.0
            G[10, :] = 0.0
        if not _control_gains(X, G, riccati.gains[k]):
            return False
        _eliminate(X, G, riccati.gains[k], riccati)
        _keep(k, riccati)
    return True


@kernel
def forward(iterate, linear, model, used, multipliers, riccati, step):
    """The step along all stages from that of the first state, `step.x[0]`."""
    n = iterate.V.shape[0] - 1
    h = 1.0 / n
    variables = np.empty(13)
    for k in range(n + 1):
        x = step.x[k]
        for i in range(3):
            total = riccati.end_rows[k, i, 0]
            for j in range(10):
                total += riccati.state_rows[k, i, j] * x[j]
            for j in range(multipliers.size):
                total += riccati.end_rows[k, i, 1 + j] * multipliers[j]
            step.costates[k, i] = total
        if k < n:
            _advance(k, h, linear, multipliers, riccati, step)
        for i in range(10):
            variables[i] = x[i]
        for i in range(3):
            variables[10 + i] = step.u[k, i] if k < n else 0.0
        _slack_steps(k, iterate, linear, model, used, variables, step.s)


@inlined
def _advance(k, h, linear, multipliers, riccati, step):
    """Control of stage k, and the state after it."""
    x, after, u = step.x[k], step.x[k + 1], step.u[k]
    gains, back, Y = riccati.gains[k], linear.back[k], linear.by_motion[k]
    for i in range(3):
        u[i] = gains[i, 10]
        for j in range(10):
            u[i] += gains[i, j] * x[j]
        for j in range(multipliers.size):
            u[i] += gains[i, 11 + j] * multipliers[j]
    for i in range(3):
        after[i] = linear.defect[k, i]
        for j in range(3):
            after[i] += back[i, j] * x[j] + Y[i, j] * x[3 + j]
            after[i] += Y[i, 3 + j] * x[6 + j] + Y[i, 6 + j] * u[j]
        after[3 + i] = x[3 + i] + h * (x[6 + i] + 0.5 * u[i])
        after[6 + i] = x[6 + i] + u[i]
    after[9] = x[9]


@inlined
def _slack_steps(k, iterate, linear, model, used, x, out):
    """Steps of the slacks of a stage, `-(c + s) - c' x`."""
    p = iterate.p[0]
    _, tau_1 = tau_of(p, model)
    for i in range(model.slots.shape[0]):
        first = model.slots[i, FIRST]
        if not used[k, first]:
            continue
        w, w_1, _ = powers(p, model.slots[i, POWER] / model.power)
        dw = w_1 * x[9]
        X, t = linear.by_stage[k, i], linear.by_tau[k, i]
        f0, f1, f2 = t[0] * tau_1 * x[9], t[1] * tau_1 * x[9], t[2] * tau_1 * x[9]
        low, high = columns(model.slots[i, CODE])
        for c in range(low, high):
            f0, f1, f2 = f0 + X[0, c] * x[c], f1 + X[1, c] * x[c], f2 + X[2, c] * x[c]
        if model.slots[i, ROWS] == 0:
            f = linear.f[k, i]
            change = 2 * model.gains[i] ** 2 * (f[0] * f0 + f[1] * f1 + f[2] * f2) / w
            change -= ((linear.c[k, first] + w) / w + 1.0) * dw
            out[k, first] = -(linear.c[k, first] + iterate.s[k, first]) - change
        for j in range(model.slots[i, ROWS]):
            r = model.rows[model.slots[i, ROW] + j]
            y = r[0] * f0 + r[1] * f1 + r[2] * f2
            a, b = first + 2 * j, first + 2 * j + 1
            out[k, a] = -(linear.c[k, a] + iterate.s[k, a]) - (y - dw)
            out[k, b] = -(linear.c[k, b] + iterate.s[k, b]) + (y + dw)
    for j in range(model.sets.shape[0]):
        i = model.sets[j, CONSTRAINT]
        if used[k, i]:
            by_d = linear.set_by_d[k, j]
            change = by_d[0] * x[0] + by_d[1] * x[1] + by_d[2] * x[2]
            change += linear.set_by_tau[k, j] * tau_1 * x[9]
            out[k, i] = -(linear.c[k, i] + iterate.s[k, i]) - change
