# SPDX-License-Identifier: Apache-2.0
"""What holds at the start and the goal, and the small system that joins the two."""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.kernels import inlined, kernel
from riem_planner.least_time.dynamics import difference
from riem_planner.least_time.linear import tau_of
from riem_planner.least_time.vectors import seen


@inlined
def condition_count(model):
    """How many conditions there are at the goal."""
    return (2 if model.pointing else 3) + (3 if model.rolling else 2) * (2 if model.smooth else 1)


@kernel
def end_conditions(iterate, model):
    """Conditions at the goal `C^T x = c`, (10, n) and (n,), and at the start `x = B y + b`.

    y (m,) are the duration's variable and, unless motion begins smoothly, the acceleration; the
    first returned is C, then c, B (10, m), b (10,).
    """
    last = iterate.V.shape[0] - 1
    first = 0 if model.rolling else 1
    free = 3 - first
    tau, tau_1 = tau_of(iterate.p[0], model)
    n = condition_count(model)
    C, c = np.zeros((10, n)), np.empty(n)
    w, goal = model.ends[1], model.goal
    rate = (w[0], w[1], w[2])
    if model.pointing:
        y = seen(iterate.q, last, (goal[0], goal[1], goal[2]))
        sine = np.sqrt(y[1] * y[1] + y[2] * y[2])
        f = np.arctan2(sine, y[0]) / sine if sine > 1e-12 else 1.0
        C[1, 0], C[2, 1], c[0], c[1] = 1.0, 1.0, -f * y[2], f * y[1]
        rate = seen(iterate.q, last, rate)
        at = 2
    else:
        missed = difference(iterate.q[last], goal)
        for i in range(3):
            C[i, i], c[i] = 1.0, missed[i]
        at = 3
    B, b = np.zeros((10, 1 if model.smooth else 1 + free)), np.zeros(10)
    B[9, 0] = 1.0
    for j in range(free):
        i = first + j
        C[3 + i, at + j], C[9, at + j] = 1.0, -tau_1 * rate[i]
        c[at + j] = tau * rate[i] - iterate.V[last, i]
        b[3 + i] = tau * model.ends[0, i] - iterate.V[0, i]
        B[3 + i, 0] = tau_1 * model.ends[0, i]
        if model.smooth:
            C[6 + i, at + free + j], c[at + free + j] = 1.0, -iterate.A[last, i]
            b[6 + i] = -iterate.A[0, i]
        else:
            B[6 + i, 1 + j] = 1.0
    return C, c, B, b


@inlined
def _factored(A):
    """Cholesky factor of a symmetric matrix, in place; false where it is not positive."""
    n = A.shape[0]
    largest = 0.0
    for i in range(n):
        largest = max(largest, A[i, i])
    for j in range(n):
        for i in range(j, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            if i == j:
                if not A[j, j] > 1e-15 * largest:
                    return False
                A[j, j] = np.sqrt(A[j, j])
            else:
                A[i, j] /= A[j, j]
    return True


@inlined
def _solved(L, b):
    """Solve with a Cholesky factor, in place."""
    n = L.shape[0]
    for i in range(n):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@kernel
def join(riccati, B, b, x):
    """State of the first stage (10,) into x, and the multipliers nu; false where no minimum is.

    `min_y max_nu` of the value at `x = B y + b`; its curvature in nu is -M, in y, with nu
    eliminated, `B^T (P + R_1 M^-1 R_1^T) B`.
    """
    P, R = riccati.P, riccati.R
    m, n = B.shape[1], R.shape[1] - 1
    M = -riccati.M
    if not _factored(M):
        return False, riccati.m
    slope = R[:, 0].copy()
    slope[9] += 1.0  # the cost is p
    nu = np.empty(n)
    for j in range(n):
        nu[j] = riccati.m[j]
        for i in range(10):
            nu[j] += R[i, 1 + j] * b[i]
    _solved(M, nu)
    for i in range(10):
        for j in range(10):
            slope[i] += P[i, j] * b[j]
        for j in range(n):
            slope[i] += R[i, 1 + j] * nu[j]
    W = np.empty((m, n))
    S, y = np.zeros((m, m)), np.zeros(m)
    for a in range(m):
        for j in range(n):
            W[a, j] = 0.0
            for i in range(10):
                W[a, j] += B[i, a] * R[i, 1 + j]
        for i in range(10):
            y[a] -= B[i, a] * slope[i]
    for a in range(m):
        column = W[a].copy()
        _solved(M, column)
        for c in range(m):
            for j in range(n):
                S[c, a] += W[c, j] * column[j]
            for i in range(10):
                for j in range(10):
                    S[c, a] += B[i, c] * P[i, j] * B[j, a]
    if not _factored(S):
        return False, nu
    _solved(S, y)
    for i in range(10):
        x[i] = b[i]
        for a in range(m):
            x[i] += B[i, a] * y[a]
    change = np.zeros(n)
    for j in range(n):
        for a in range(m):
            change[j] += W[a, j] * y[a]
    _solved(M, change)
    return True, nu + change
