# SPDX-License-Identifier: Apache-2.0
"""First stage: Newton descent on the discretised cost, which finds minima, not mere extremals.

The curve is given by attitudes at N + 1 times (normalised, on [0, 1], any spacing). The
configuration of node k is the unit vector x_k: the quaternion itself on S^3 for SO(3), where
lengths count twice (metric weight 4), or the pointing direction for S^2 (weight 1). With
`alpha = 2 / ((h- + h+) h+)`, `beta = 2 / ((h- + h+) h-)` the covariant acceleration of node k is

    P_k (alpha x_{k+1} + beta x_{k-1}),      P_k the projector onto the tangent space at x_k,

so that the kinetic cost is a polynomial in the inner products of neighbours, with an exact
Hessian: a block pentadiagonal matrix with 3x3 blocks in the body perturbations
`R_k exp(hat(delta_k))`. On S^2 the third component (roll) is left alone. Both end nodes are
fixed, but for the third component of the last one where the goal's roll is free.
"""

from __future__ import annotations

import numpy as np

from riem_planner.geometry.quaternions import turn
from riem_planner.kernels import brief_kernel, inlined, kernel
from riem_planner.obstacles.potential import potential
from riem_planner.solver.ends import FIXED, arrival_rate, hold_terms

_MAX_STEP = 0.7  # rad a node may move in one iteration
_ARMIJO = 1e-4
_FIRST_SHIFT = 0.03  # of the kinetic block, when the Hessian is indefinite
_SADDLE_STEP = 0.25  # rad, off a saddle
_MOST_SADDLES = 4
_RECENT = 4  # costs, the greatest of which a step must undercut (Grippo, Lampariello and Lucidi)
# What a descent carries from call to call: the shift of the Hessian, the number of saddles left,
# whether the cost and its derivatives that follow are those of the curve, recent costs.
_SHIFT, SADDLES, _ASSEMBLED, _COST, _COSTS = 0, 1, 2, 3, 4
_DERIVATIVES = _COSTS + _RECENT


def fresh_memory(nodes):
    """What a descent on that many nodes carries from call to call, at its beginning."""
    return np.zeros(_DERIVATIVES + 30 * nodes)


def begin_stage(memory):
    """Forget what does not hold for other potentials; the saddles that were left still count."""
    memory[_SHIFT] = 0.0
    memory[_ASSEMBLED:_DERIVATIVES] = 0.0


@inlined
def points_of(pointing, q, x, basis):
    """Unit vectors (n, 4) of attitudes (n, 4), and how they move: dx = basis delta (n, 4, 3)."""
    for k in range(q.shape[0]):
        a, b, c, d = q[k, 0], q[k, 1], q[k, 2], q[k, 3]
        B = basis[k]
        if pointing:
            # x = R e3; a turn by delta moves it by R (delta x e3).
            x[k, 0], x[k, 1], x[k, 2] = (
                2 * (a * c + d * b),
                2 * (b * c - d * a),
                d * d - a * a - b * b + c * c,
            )
            x[k, 3] = 0.0
            B[0, 0], B[1, 0], B[2, 0] = (
                -2 * (a * b - d * c),
                -(d * d - a * a + b * b - c * c),
                -2 * (b * c + d * a),
            )
            B[0, 1], B[1, 1], B[2, 1] = (
                d * d + a * a - b * b - c * c,
                2 * (a * b + d * c),
                2 * (a * c - d * b),
            )
            B[0, 2] = B[1, 2] = B[2, 2] = B[3, 0] = B[3, 1] = B[3, 2] = 0.0
        else:
            x[k, 0], x[k, 1], x[k, 2], x[k, 3] = a, b, c, d
            B[0, 0], B[0, 1], B[0, 2] = 0.5 * d, -0.5 * c, 0.5 * b
            B[1, 0], B[1, 1], B[1, 2] = 0.5 * c, 0.5 * d, -0.5 * a
            B[2, 0], B[2, 1], B[2, 2] = -0.5 * b, 0.5 * a, 0.5 * d
            B[3, 0], B[3, 1], B[3, 2] = -0.5 * a, -0.5 * b, -0.5 * c


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@inlined
def _pull(B, x, out):
    """B^T x into `out`; shapes (4, 3), (4,), (3,)."""
    for i in range(3):
        out[i] = B[0, i] * x[0] + B[1, i] * x[1] + B[2, i] * x[2] + B[3, i] * x[3]


@inlined
def _add_product(H, factor, A, B):
    """H += factor A^T B, shapes (3, 3), (4, 3), (4, 3)."""
    for i in range(3):
        for j in range(3):
            H[i, j] += factor * (
                A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j] + A[3, i] * B[3, j]
            )


@inlined
def _add_outer(H, factor, a, b):
    for i in range(3):
        for j in range(3):
            H[i, j] += factor * a[i] * b[j]


@kernel
def assemble(pointing, table, sigma, times, q, rate_start, goal, soft, gradient, D, L1, L2):
    """Discretised cost of a curve with its gradient and Hessian by the interior nodes.

    Parameters
    ----------
    pointing
        Whether the space is S^2, with the boresight e3.
    table : (n, 16)
        Packed obstacles.
    sigma
        Normalised tension.
    times : (N + 1,)
    q : (N + 1, 4)
        Attitudes.
    rate_start : (3,)
        Body rate at the start.
    goal : (7,) or longer
        See `ends`: where the roll at the end is free, the last node's third component, a turn
        about e3, is an unknown as well.
    soft
        See `potential`.
    gradient : (N + 1, 3)
        Out.
    D, L1, L2 : (N + 1, 3, 3)
        Out: Hessian blocks (k, k), (k + 1, k), (k + 2, k).

    Returns
    -------
    The cost.
    """
    n = q.shape[0] - 1
    weight = 1.0 if pointing else 4.0
    x = np.empty((n + 1, 4))
    basis = np.empty((n + 1, 4, 3))
    points_of(pointing, q, x, basis)
    gradient[:, :] = 0.0
    D[:, :, :] = 0.0
    L1[:, :, :] = 0.0
    L2[:, :, :] = 0.0
    scale = 1.0 if pointing else 0.25  # basis^T basis
    diagonal = np.zeros(n + 1)  # multiples of the identity, from the curvature of the sphere
    y = np.empty(4)
    ga, gb, gc = np.empty(3), np.empty(3), np.empty(3)
    total = 0.0

    free = not pointing and goal.size > FIXED
    velocity, rolled = np.empty(4), np.empty(4)
    for end in range(2):
        # f = (w / h^3) |P_0 x_1 -+ h x_0'|^2 at either end; the end node itself is fixed.
        k, other = (0, 1) if end == 0 else (n, n - 1)
        v0, v1, v2 = rate_start[0], rate_start[1], rate_start[2]
        if end == 1:
            v0, v1, v2 = arrival_rate(goal, q[n]) if free else (goal[4], goal[5], goal[6])
        for i in range(4):
            velocity[i] = basis[k, i, 0] * v0 + basis[k, i, 1] * v1 + basis[k, i, 2] * v2
        h = abs(times[other] - times[k])
        turn = h if end == 0 else -h
        c = _dot(x[k], x[other])
        slope = _dot(velocity, x[other])
        factor = weight / h**3
        total += factor * (1.0 - c * c - 2.0 * turn * slope + h * h * _dot(velocity, velocity))
        _pull(basis[other], x[k], ga)
        _pull(basis[other], velocity, gb)
        for i in range(3):
            gradient[other, i] += factor * (-2.0 * c * ga[i] - 2.0 * turn * gb[i])
        _add_outer(D[other], -2.0 * factor, ga, ga)
        diagonal[other] += factor * (2.0 * c * c + 2.0 * turn * slope)
        if free and end == 1:
            # A roll turns the last node and its velocity, which the reference frame prescribes.
            rolled[0], rolled[1] = 0.5 * velocity[1], -0.5 * velocity[0]
            rolled[2], rolled[3] = 0.5 * velocity[3], -0.5 * velocity[2]
            c_1 = _dot(basis[n, :, 2], x[other])
            _pull(basis[other], basis[n, :, 2], gb)
            _pull(basis[other], rolled, gc)
            gradient[n, 2] += factor * (-2.0 * c * c_1 - 2.0 * turn * _dot(rolled, x[other]))
            D[n, 2, 2] += factor * (0.5 * c * c - 2.0 * c_1 * c_1 + 0.5 * turn * slope)
            for i in range(3):
                L1[other, 2, i] += factor * (
                    -2.0 * c_1 * ga[i] - 2.0 * c * gb[i] - 2.0 * turn * gc[i]
                )

    for k in range(1, n):
        h_m, h_p = times[k] - times[k - 1], times[k + 1] - times[k]
        mean = 0.5 * (h_m + h_p)
        alpha, beta = 1.0 / (mean * h_p), 1.0 / (mean * h_m)
        for i in range(4):
            y[i] = alpha * x[k + 1, i] + beta * x[k - 1, i]
        s = _dot(x[k], y)
        cross = _dot(x[k - 1], x[k + 1])
        c_m, c_p = _dot(x[k], x[k - 1]), _dot(x[k], x[k + 1])
        f = mean * weight
        ab = f * alpha * beta
        fs = f * s
        total += 0.5 * f * (alpha * alpha + beta * beta + 2.0 * alpha * beta * cross - s * s)
        # s = x_k . y: its gradient by x_{k-1}, x_k, x_{k+1}.
        _pull(basis[k - 1], x[k], ga)
        _pull(basis[k], y, gb)
        _pull(basis[k + 1], x[k], gc)
        for i in range(3):
            ga[i] *= beta
            gc[i] *= alpha
            gradient[k, i] -= fs * gb[i]
            gradient[k - 1, i] -= fs * ga[i]
            gradient[k + 1, i] -= fs * gc[i]
        diagonal[k] += fs * s
        diagonal[k - 1] += fs * beta * c_m - ab * cross
        diagonal[k + 1] += fs * alpha * c_p - ab * cross
        _add_outer(D[k - 1], -f, ga, ga)
        _add_outer(D[k], -f, gb, gb)
        _add_outer(D[k + 1], -f, gc, gc)
        _add_outer(L1[k - 1], -f, gb, ga)
        _add_outer(L1[k], -f, gc, gb)
        _add_outer(L2[k - 1], -f, gc, ga)
        _add_product(L1[k - 1], -fs * beta, basis[k], basis[k - 1])
        _add_product(L1[k], -fs * alpha, basis[k + 1], basis[k])
        _add_product(L2[k - 1], ab, basis[k + 1], basis[k - 1])
        # cross = x_{k-1} . x_{k+1}
        _pull(basis[k - 1], x[k + 1], ga)
        _pull(basis[k + 1], x[k - 1], gc)
        for i in range(3):
            gradient[k - 1, i] += ab * ga[i]
            gradient[k + 1, i] += ab * gc[i]
        half = 0.5 * mean
        V, g0, g1, g2, h00, h11, h22, h01, h02, h12 = potential(
            table, times[k], q[k, 0], q[k, 1], q[k, 2], q[k, 3], soft
        )
        total += half * V
        gradient[k, 0] += half * g0
        gradient[k, 1] += half * g1
        gradient[k, 2] += half * g2
        D[k, 0, 0] += half * h00
        D[k, 1, 1] += half * h11
        D[k, 2, 2] += half * h22
        D[k, 0, 1] += half * h01
        D[k, 1, 0] += half * h01
        D[k, 0, 2] += half * h02
        D[k, 2, 0] += half * h02
        D[k, 1, 2] += half * h12
        D[k, 2, 1] += half * h12

    if sigma > 0.0:
        for k in range(n):
            f = sigma * weight / (times[k + 1] - times[k])
            c = _dot(x[k], x[k + 1])
            total += f * (1.0 - c)
            _pull(basis[k], x[k + 1], ga)
            _pull(basis[k + 1], x[k], gb)
            for i in range(3):
                gradient[k, i] -= f * ga[i]
                gradient[k + 1, i] -= f * gb[i]
            diagonal[k] += f * c
            diagonal[k + 1] += f * c
            _add_product(L1[k], -f, basis[k + 1], basis[k])

    for k in range(1, n):
        for i in range(3):
            D[k, i, i] += scale * diagonal[k]
        if pointing:
            # No roll: its equation is delta_3 = 0.
            gradient[k, 2] = 0.0
            for i in range(3):
                D[k, 2, i] = D[k, i, 2] = 0.0
                L1[k, 2, i] = L1[k, i, 2] = 0.0
                L2[k, 2, i] = L2[k, i, 2] = 0.0
            D[k, 2, 2] = 1.0
    for k in (0, n):
        h = times[1] - times[0] if k == 0 else times[n] - times[n - 1]
        V, _, _, g2, _, _, h22, _, _, _ = potential(
            table, times[k], q[k, 0], q[k, 1], q[k, 2], q[k, 3], soft
        )
        total += 0.25 * h * V
        if free and k == n:
            gradient[n, 2] += 0.25 * h * g2
            D[n, 2, 2] += 0.25 * h * h22 + scale * diagonal[n]
    if free:
        total += _free_end(table, goal, q[n], gradient, D, L1, L2)
    return total


@inlined
def _free_end(table, goal, end, gradient, D, L1, L2):
    """Add the hold, whose cost comes back; of the last node nothing but the roll is unknown."""
    n = gradient.shape[0] - 1
    cost, slope, curvature = hold_terms(table, goal, end)
    gradient[n, 0] = gradient[n, 1] = 0.0
    gradient[n, 2] += slope
    D[n, 2, 2] += curvature
    for i in range(2):
        for j in range(3):
            D[n, i, j] = D[n, j, i] = 0.0
            L1[n - 1, i, j] = L2[n - 2, i, j] = 0.0
        D[n, i, i] = 1.0
    return cost


@inlined
def _unknowns_end(pointing, goal, n):
    """One past the last node with unknowns."""
    return n + 1 if not pointing and goal.size > FIXED else n


@brief_kernel
def kinetic_stencil(times, stencil):
    """Pentadiagonal (N + 1, 3) second-variation of the acceleration in flat space.

    Rows k hold the entries (k, k), (k + 1, k), (k + 2, k): the metric in which indefinite
    Hessians are shifted. The last node, of which at most the roll is unknown, stands alone, with
    the cost of a cubic to it.
    """
    n = times.size - 1
    stencil[:, :] = 0.0
    stencil[1, 0] += 2.0 / (times[1] - times[0]) ** 3
    stencil[n - 1, 0] += 2.0 / (times[n] - times[n - 1]) ** 3
    for k in range(1, n):
        h_m, h_p = times[k] - times[k - 1], times[k + 1] - times[k]
        mean = 0.5 * (h_m + h_p)
        alpha, beta = 1.0 / (mean * h_p), 1.0 / (mean * h_m)
        gamma = -(alpha + beta)
        stencil[k - 1, 0] += mean * beta * beta
        stencil[k, 0] += mean * gamma * gamma
        stencil[k + 1, 0] += mean * alpha * alpha
        stencil[k - 1, 1] += mean * beta * gamma
        stencil[k, 1] += mean * gamma * alpha
        stencil[k - 1, 2] += mean * beta * alpha
    stencil[n - 1, 1] = stencil[n - 2, 2] = 0.0
    stencil[n, 0] = 12.0 / (times[n] - times[0]) ** 3


@kernel
def factor(first, last, D, L1, L2, C, M1, M2, shift, stencil):
    """Block Cholesky factorisation of nodes first..last - 1; False when not positive definite.

    C holds the lower triangular diagonal blocks, M1 and M2 the blocks below them.
    """
    for k in range(first, last):
        for i in range(3):
            # By elements: Numba takes seconds to compile the copy of a whole array.
            for j in range(3):
                C[k, i, j], M1[k, i, j], M2[k, i, j] = D[k, i, j], L1[k, i, j], L2[k, i, j]
            if shift > 0.0:
                C[k, i, i] += shift * stencil[k, 0]
                M1[k, i, i] += shift * stencil[k, 1]
                M2[k, i, i] += shift * stencil[k, 2]
    for k in range(first, last):
        A = C[k]
        if not A[0, 0] > 0.0:
            return False
        l00 = np.sqrt(A[0, 0])
        l10, l20 = A[1, 0] / l00, A[2, 0] / l00
        d1 = A[1, 1] - l10 * l10
        if not d1 > 1e-14 * A[1, 1]:
            return False
        l11 = np.sqrt(d1)
        l21 = (A[2, 1] - l20 * l10) / l11
        d2 = A[2, 2] - l20 * l20 - l21 * l21
        if not d2 > 1e-14 * A[2, 2]:
            return False
        l22 = np.sqrt(d2)
        A[0, 0], A[1, 0], A[2, 0], A[1, 1], A[2, 1], A[2, 2] = l00, l10, l20, l11, l21, l22
        for below in range(1, min(3, last - k)):
            B = M1[k] if below == 1 else M2[k]
            for i in range(3):
                B[i, 0] = B[i, 0] / l00
                B[i, 1] = (B[i, 1] - B[i, 0] * l10) / l11
                B[i, 2] = (B[i, 2] - B[i, 0] * l20 - B[i, 1] * l21) / l22
        if k + 1 < last:
            E, F = M1[k], M2[k]
            for i in range(3):
                for j in range(3):
                    C[k + 1, i, j] -= E[i, 0] * E[j, 0] + E[i, 1] * E[j, 1] + E[i, 2] * E[j, 2]
            if k + 2 < last:
                for i in range(3):
                    for j in range(3):
                        M1[k + 1, i, j] -= F[i, 0] * E[j, 0] + F[i, 1] * E[j, 1] + F[i, 2] * E[j, 2]
                        C[k + 2, i, j] -= F[i, 0] * F[j, 0] + F[i, 1] * F[j, 1] + F[i, 2] * F[j, 2]
    return True


@kernel
def substitute(first, last, C, M1, M2, rhs):
    """Solve with the factors of `factor`, in place: rhs (N + 1, 3)."""
    for k in range(first, last):
        for i in range(3):
            s = rhs[k, i]
            for j in range(i):
                s -= C[k, i, j] * rhs[k, j]
            rhs[k, i] = s / C[k, i, i]
        for i in range(3):
            if k + 1 < last:
                rhs[k + 1, i] -= (
                    M1[k, i, 0] * rhs[k, 0] + M1[k, i, 1] * rhs[k, 1] + M1[k, i, 2] * rhs[k, 2]
                )
            if k + 2 < last:
                rhs[k + 2, i] -= (
                    M2[k, i, 0] * rhs[k, 0] + M2[k, i, 1] * rhs[k, 1] + M2[k, i, 2] * rhs[k, 2]
                )
    for k in range(last - 1, first - 1, -1):
        for i in range(2, -1, -1):
            s = rhs[k, i]
            if k + 1 < last:
                for j in range(3):
                    s -= M1[k, j, i] * rhs[k + 1, j]
            if k + 2 < last:
                for j in range(3):
                    s -= M2[k, j, i] * rhs[k + 2, j]
            for j in range(i + 1, 3):
                s -= C[k, j, i] * rhs[k, j]
            rhs[k, i] = s / C[k, i, i]


@kernel
def descend(
    pointing, table, sigma, times, q, rate_start, goal, soft, tolerance, side, most, memory,
    stop,
):  # fmt: skip
    """Newton descent on the discretised cost, in place.

    Parameters
    ----------
    tolerance
        Stop when the predicted decrease is below this share of the cost.
    side
        +1 or -1: which way to leave a saddle, along its direction of negative curvature.
    most
        Most iterations; call again with the same memory to go on.
    memory
        From `fresh_memory`; `begin_stage` first where anything but it has changed.
    stop : (1,)
        Of a `StopFlag`: looked at before each iteration.

    Returns
    -------
    cost
        Infinite where a potential is infinite along the curve.
    iterations
    converged
        Whether the tolerance was met at a point with a positive definite Hessian.
    """
    n = q.shape[0] - 1
    last = _unknowns_end(pointing, goal, n)
    m = 3 * (n + 1)
    kept = memory[_DERIVATIVES:]
    gradient = kept[:m].reshape(n + 1, 3)
    D = kept[m : 4 * m].reshape(n + 1, 3, 3)
    L1 = kept[4 * m : 7 * m].reshape(n + 1, 3, 3)
    L2 = kept[7 * m : 10 * m].reshape(n + 1, 3, 3)
    trial_gradient = np.empty((n + 1, 3))
    E, M1, M2 = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3))
    C, N1, N2 = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3))
    stencil = np.empty((n + 1, 3))
    kinetic_stencil(times, stencil)
    step = np.zeros((n + 1, 3))
    trial = q.copy()
    if memory[_ASSEMBLED] == 0.0:
        memory[_ASSEMBLED] = 1.0
        memory[_COST] = assemble(
            pointing, table, sigma, times, q, rate_start, goal, soft, gradient, D, L1, L2
        )
    cost = memory[_COST]
    if not cost < np.inf:
        return cost, 0, False
    for iteration in range(most):
        if stop[0] != 0:
            return cost, iteration, False
        while not factor(1, last, D, L1, L2, C, N1, N2, memory[_SHIFT], stencil):
            memory[_SHIFT] = max(3.0 * memory[_SHIFT], _FIRST_SHIFT)
            if memory[_SHIFT] > 1e9:
                return cost, iteration, False
        for k in range(1, last):
            for i in range(3):
                step[k, i] = -gradient[k, i]
        substitute(1, last, C, N1, N2, step)
        slope, longest = _slope_and_length(gradient, step)
        if -slope <= 2.0 * tolerance * cost:
            if memory[_SHIFT] == 0.0:
                return cost, iteration, True
            # A saddle: leave it along the softest direction, by inverse iteration.
            memory[_SHIFT] *= 0.5
            if factor(1, last, D, L1, L2, C, N1, N2, 0.0, stencil):
                memory[_SHIFT] = 0.0
                continue
            while not factor(1, last, D, L1, L2, C, N1, N2, memory[_SHIFT], stencil):
                memory[_SHIFT] *= 2.0
            _softest(pointing, last, C, N1, N2, step)
            memory[SADDLES] += 1.0
            if memory[SADDLES] > _MOST_SADDLES:
                return cost, iteration, False
            _, longest = _slope_and_length(gradient, step)
            for i in range(_RECENT):
                memory[_COSTS + i] = 0.0
            scale = side * _SADDLE_STEP / longest
            for k in range(1, last):
                turn(q[k], step[k], scale, q[k])
            cost = assemble(
                pointing, table, sigma, times, q, rate_start, goal, soft, gradient, D, L1, L2
            )
            memory[_COST] = cost
            if not cost < np.inf:
                return cost, iteration, False
            continue
        scale = min(1.0, _MAX_STEP / longest)
        accepted = False
        # In a curved valley full steps climb a little, and the next one makes good for it. On
        # softened potentials that might change sides.
        bound = cost
        if soft == 0.0:
            for i in range(_RECENT):
                bound = max(bound, memory[_COSTS + i])
        for _ in range(12):
            for k in range(1, last):
                turn(q[k], step[k], scale, trial[k])
            trial_cost = assemble(
                pointing, table, sigma, times, trial, rate_start, goal, soft,
                trial_gradient, E, M1, M2,
            )  # fmt: skip
            if trial_cost <= bound + _ARMIJO * scale * slope:
                accepted = True
                break
            scale *= 0.4
        if not accepted:
            if -slope <= 1e-9 * cost and memory[_SHIFT] == 0.0:
                return cost, iteration, True
            memory[_SHIFT] = max(10.0 * memory[_SHIFT], _FIRST_SHIFT)
            if memory[_SHIFT] > 1e9:
                return cost, iteration, False
            continue
        for k in range(1, last):
            for i in range(4):
                q[k, i] = trial[k, i]
        for i in range(_RECENT - 1):
            memory[_COSTS + i] = memory[_COSTS + 1 + i]
        memory[_COSTS + _RECENT - 1] = cost
        cost = memory[_COST] = trial_cost
        gradient[:], D[:], L1[:], L2[:] = trial_gradient, E, M1, M2
        memory[_SHIFT] = 0.2 * memory[_SHIFT] if memory[_SHIFT] > 0.1 * _FIRST_SHIFT else 0.0
    return cost, most, False


@inlined
def _slope_and_length(gradient, step):
    """Inner product of both, and the longest step of a node."""
    slope, longest = 0.0, 0.0
    for k in range(step.shape[0]):
        size = 0.0
        for i in range(3):
            slope += gradient[k, i] * step[k, i]
            size += step[k, i] ** 2
        longest = max(longest, size)
    return slope, np.sqrt(longest)


@inlined
def _softest(pointing, last, C, M1, M2, step):
    """Direction of least curvature, by inverse iteration with the factors, from a fixed start."""
    n = step.shape[0] - 1
    for k in range(n + 1):
        inside = 1.0 if 0 < k < last else 0.0
        across = inside if k < n else 0.0  # of the last node the roll alone is unknown
        step[k, 0], step[k, 1] = across, 0.7 * across
        step[k, 2] = 0.0 if pointing else 0.4 * inside
    for _ in range(6):
        substitute(1, last, C, M1, M2, step)
        size = 0.0
        for k in range(n + 1):
            for i in range(3):
                size = max(size, abs(step[k, i]))
        for k in range(n + 1):
            for i in range(3):
                step[k, i] /= size


@kernel
def positive_definite(pointing, table, sigma, times, q, rate_start, goal):
    """Whether the second variation of the discretised cost is positive definite at a curve.

    By Sylvester's law the Cholesky factorisation exists just then: no conjugate point of the
    problem, with a free roll at its end where the goal leaves it so, lies inside (0, 1].
    """
    n = q.shape[0] - 1
    gradient = np.empty((n + 1, 3))
    D, L1, L2 = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3))
    C, N1, N2 = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3)), np.empty((n + 1, 3, 3))
    cost = assemble(pointing, table, sigma, times, q, rate_start, goal, 0.0, gradient, D, L1, L2)
    last = _unknowns_end(pointing, goal, n)
    return cost < np.inf and factor(1, last, D, L1, L2, C, N1, N2, 0.0, gradient)
