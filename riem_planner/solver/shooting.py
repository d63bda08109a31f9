# SPDX-License-Identifier: Apache-2.0
"""Second stage: multiple shooting on the first-order conditions, with exact sensitivities.

Each interval is one step of the 8th-order Runge-Kutta method of Dormand and Prince. The state
of node k is the attitude with the body rate and its first two derivatives, `(q, v, a, j)`; its
perturbation has 12 components, the first three a body rotation.

A Newton step is one sweep from start to goal: it carries an orthonormal basis Y_k of the
perturbations that keep the start state (6 columns on SO(3), 4 on S^2) and one particular
solution z_k of the linearised defects. Where an interval maps `Y_k` to `Y_{k+1} U_k`, the
coordinates obey `beta_{k+1} = U_k beta_k + rho_k`; the goal gives the last ones, and
substitution backwards the others. Making the basis orthonormal at each node keeps growing and
decaying solutions apart, so that no interval's growth ever enters a solve.
"""

from __future__ import annotations

import numpy as np

from riem_planner.geometry.quaternions import relative, turn
from riem_planner.kernels import brief_kernel, inlined, kernel
from riem_planner.obstacles.potential import first_derivatives, potential
from riem_planner.solver.dop853 import NODES, STAGE_WEIGHTS, STAGES, WEIGHTS
from riem_planner.solver.ends import goal_conditions

# Of a step, by which its first and last stages lie within it: an obstacle that begins or ceases to
# exist at a node counts on one side of it.
_INSIDE = 1e-11
_TIMES = np.clip(NODES, _INSIDE, 1.0 - _INSIDE)
_COLUMNS = 8  # a basis of at most 6, and two particular solutions
_SIZE = 12 * _COLUMNS
# Of the greatest pivot: what is weak is nearly singular; what is singular is left open, and where
# the goal does not allow that, only what is nothing.
_WEAK, _SINGULAR, _NOTHING = 1e-2, 1e-7, 1e-12
_SHORT = 30.0  # of the duration an interval is short that fits in so many times
_MET = 1e-8  # of the goal's conditions
_SETTLED = 1e-4  # rad of a step, below which what weak pivots decide is worth a look
_LEVER = 1.0  # of a step, that it may else turn by that
STATE = 13  # quaternion, v, a, j
_WIDTH = 16  # with the cost, and padding for the vector unit


@inlined
def _derivative(pointing, table, sigma, time, y, linear, dF, out):
    """Time derivative of (q, v, a, j, cost).

    If `linear`, also that of the force by a rotation, in dF (3, 3).
    """
    qx, qy, qz, qw = y[0], y[1], y[2], y[3]
    v0, v1, v2, a0, a1, a2, j0, j1, j2 = (
        y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11], y[12],
    )  # fmt: skip
    if linear:
        V, g0, g1, g2, h00, h11, h22, h01, h02, h12 = potential(table, time, qx, qy, qz, qw, 0.0)
        g0, g1, g2 = 0.5 * g0, 0.5 * g1, 0.5 * g2
        # F = grad V / 2 changes by (Hessian delta - delta x grad V / 2) / 2.
        dF[0, 0], dF[0, 1], dF[0, 2] = 0.5 * h00, 0.5 * (h01 - g2), 0.5 * (h02 + g1)
        dF[1, 0], dF[1, 1], dF[1, 2] = 0.5 * (h01 + g2), 0.5 * h11, 0.5 * (h12 - g0)
        dF[2, 0], dF[2, 1], dF[2, 2] = 0.5 * (h02 - g1), 0.5 * (h12 + g0), 0.5 * h22
        if pointing:
            dF[2, 0] = dF[2, 1] = dF[2, 2] = 0.0
    else:
        V, g0, g1, g2 = first_derivatives(table, time, qx, qy, qz, qw)
        g0, g1, g2 = 0.5 * g0, 0.5 * g1, 0.5 * g2
    out[0] = 0.5 * (qw * v0 + qy * v2 - qz * v1)
    out[1] = 0.5 * (qw * v1 + qz * v0 - qx * v2)
    out[2] = 0.5 * (qw * v2 + qx * v1 - qy * v0)
    out[3] = -0.5 * (qx * v0 + qy * v1 + qz * v2)
    out[4], out[5], out[6] = a0, a1, a2
    out[7], out[8], out[9] = j0, j1, j2
    if pointing:
        # v''' = (v' x v) x v + sigma v' - F, all orthogonal to the boresight e3.
        speed, along = v0 * v0 + v1 * v1, a0 * v0 + a1 * v1
        out[10] = v0 * along - a0 * speed + sigma * a0 - g0
        out[11] = v1 * along - a1 * speed + sigma * a1 - g1
        out[12] = 0.0
    else:
        out[10] = j1 * v2 - j2 * v1 + sigma * a0 - g0
        out[11] = j2 * v0 - j0 * v2 + sigma * a1 - g1
        out[12] = j0 * v1 - j1 * v0 + sigma * a2 - g2
    out[13] = 0.5 * (a0 * a0 + a1 * a1 + a2 * a2 + sigma * (v0 * v0 + v1 * v1 + v2 * v2) + V)


@inlined
def _linearised(pointing, sigma, y, dF, W, out):
    """Derivative of 12 x 8 perturbations W along the state y: both flat, columns innermost."""
    v0, v1, v2, a0, a1 = y[4], y[5], y[6], y[7], y[8]
    j0, j1, j2 = y[10], y[11], y[12]
    c = _COLUMNS
    f00, f01, f02 = dF[0, 0], dF[0, 1], dF[0, 2]
    f10, f11, f12 = dF[1, 0], dF[1, 1], dF[1, 2]
    f20, f21, f22 = dF[2, 0], dF[2, 1], dF[2, 2]
    for i in range(c):
        out[i] = W[3 * c + i] - v1 * W[2 * c + i] + v2 * W[c + i]
        out[c + i] = W[4 * c + i] - v2 * W[i] + v0 * W[2 * c + i]
        out[2 * c + i] = W[5 * c + i] - v0 * W[c + i] + v1 * W[i]
    for i in range(6 * c):
        out[3 * c + i] = W[6 * c + i]
    if pointing:
        along = a0 * v0 + a1 * v1
        speed = v0 * v0 + v1 * v1
        # d(v (a . v) - a (v . v))
        k00, k01 = along + v0 * a0 - 2.0 * a0 * v0, v0 * a1 - 2.0 * a0 * v1
        k10, k11 = v1 * a0 - 2.0 * a1 * v0, along + v1 * a1 - 2.0 * a1 * v1
        l00, l01, l11 = v0 * v0 - speed + sigma, v0 * v1, v1 * v1 - speed + sigma
        for i in range(c):
            out[9 * c + i] = (
                k00 * W[3 * c + i] + k01 * W[4 * c + i] + l00 * W[6 * c + i] + l01 * W[7 * c + i]
                - f00 * W[i] - f01 * W[c + i] - f02 * W[2 * c + i]
            )  # fmt: skip
            out[10 * c + i] = (
                k10 * W[3 * c + i] + k11 * W[4 * c + i] + l01 * W[6 * c + i] + l11 * W[7 * c + i]
                - f10 * W[i] - f11 * W[c + i] - f12 * W[2 * c + i]
            )  # fmt: skip
            out[11 * c + i] = 0.0
    else:
        for i in range(c):
            out[9 * c + i] = (
                W[10 * c + i] * v2 - W[11 * c + i] * v1 + j1 * W[5 * c + i] - j2 * W[4 * c + i]
                + sigma * W[6 * c + i] - f00 * W[i] - f01 * W[c + i] - f02 * W[2 * c + i]
            )  # fmt: skip
            out[10 * c + i] = (
                W[11 * c + i] * v0 - W[9 * c + i] * v2 + j2 * W[3 * c + i] - j0 * W[5 * c + i]
                + sigma * W[7 * c + i] - f10 * W[i] - f11 * W[c + i] - f12 * W[2 * c + i]
            )  # fmt: skip
            out[11 * c + i] = (
                W[9 * c + i] * v1 - W[10 * c + i] * v0 + j0 * W[4 * c + i] - j1 * W[3 * c + i]
                + sigma * W[8 * c + i] - f20 * W[i] - f21 * W[c + i] - f22 * W[2 * c + i]
            )  # fmt: skip


@inlined
def _workspace():
    """Stages and stage values of the state and of the perturbations; the force's derivative."""
    return (
        np.zeros((STAGES, _WIDTH)),
        np.empty(_WIDTH),
        np.empty((STAGES, _SIZE)),
        np.empty(_SIZE),
        np.empty((3, 3)),
    )


@inlined
def _step(pointing, table, sigma, time, h, y, W, linear, work):
    """One Runge-Kutta step of the state y (16,) and, if `linear`, the perturbations W, in place."""
    k, stage, kW, stage_W, dF = work
    for s in range(STAGES):
        for i in range(_WIDTH):
            stage[i] = y[i]
        for r in range(s):
            f = h * STAGE_WEIGHTS[s, r]
            if f != 0.0:
                for i in range(_WIDTH):
                    stage[i] += f * k[r, i]
        _derivative(pointing, table, sigma, time + _TIMES[s] * h, stage, linear, dF, k[s])
        if linear:
            for i in range(_SIZE):
                stage_W[i] = W[i]
            for r in range(s):
                f = h * STAGE_WEIGHTS[s, r]
                if f != 0.0:
                    for i in range(_SIZE):
                        stage_W[i] += f * kW[r, i]
            _linearised(pointing, sigma, stage, dF, stage_W, kW[s])
    for r in range(STAGES):
        f = h * WEIGHTS[r]
        if f != 0.0:
            for i in range(_WIDTH):
                y[i] += f * k[r, i]
            if linear:
                for i in range(_SIZE):
                    W[i] += f * kW[r, i]
    norm = 1.0 / np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2 + y[3] ** 2)
    for i in range(4):
        y[i] *= norm


@inlined
def _difference(state, reference, out):
    """Out (12,) = state minus reference, as a perturbation of the reference."""
    relative(reference, state, out)
    for i in range(9):
        out[3 + i] = state[4 + i] - reference[4 + i]


@kernel
def measure(pointing, table, sigma, times, states, defects, middles, costs, interpolation):
    """Defects by two half steps an interval, the states between, and the cost.

    Parameters
    ----------
    times : (M + 1,)
        Normalised.
    states : (M + 1, 13)
    defects : (M, 12)
        Out: end of interval k minus state k + 1.
    middles : (M, 13)
        Out: states half-way.
    costs : (M,)
        Out: cost of each interval.
    interpolation : (M,)
        Out: estimated error of the quintics through all these states [rad].

    Returns
    -------
    The largest component of the defects; infinite where the states run through an obstacle.
    """
    work = _workspace()
    largest = 0.0
    y, W = np.zeros(_WIDTH), np.empty(1)
    first = work[0][0]
    bend = np.empty(3)
    for k in range(times.size - 1):
        h = 0.5 * (times[k + 1] - times[k])
        for i in range(STATE):
            y[i] = states[k, i]
        y[STATE] = 0.0
        _step(pointing, table, sigma, times[k], h, y, W, False, work)
        for i in range(STATE):
            middles[k, i] = y[i]
        for i in range(3):
            bend[i] = first[10 + i]
        _step(pointing, table, sigma, times[k] + h, h, y, W, False, work)
        for i in range(3):
            bend[i] -= 2.0 * first[10 + i]
        end = times[k + 1] - _INSIDE * h
        _derivative(pointing, table, sigma, end, y, False, work[4], first)
        # A quintic's error is h^6 / 46080 times the sixth derivative, here by a second
        # difference of the fourth.
        for i in range(3):
            bend[i] += first[10 + i]
        size = np.sqrt(bend[0] ** 2 + bend[1] ** 2 + bend[2] ** 2)
        interpolation[k] = h**4 / 46080.0 * size
        _difference(y, states[k + 1], defects[k])
        costs[k] = y[STATE]
        for i in range(12):
            largest = max(largest, abs(defects[k, i]))
        if not costs[k] < np.inf:
            return np.inf
    return largest


@kernel
def newton(
    pointing, table, sigma, times, states, goal, defects, given, gain, valley, whole, step, left
):
    """Newton step of the multiple-shooting equations.

    Parameters
    ----------
    states : (M + 1, 13)
        The first one's attitude and rate are met exactly.
    goal : (7,) or longer
        See `ends`; on S^2 only the direction and its velocity count.
    defects : (M, 12)
        Used where `given`, else overwritten by those of whole steps.
    gain : (M,)
        Share of the given defects' difference to those of whole steps that is their own error.
    valley
        The most that the step may turn by what is nearly undetermined [rad]; without a limit
        where infinite.
    whole : (M, 13)
        Out: defects of whole steps, and the cost of each interval.
    step : (M + 1, 12)
        Out: perturbations of the states that would meet the linearised equations.
    left : (M + 1, 12)
        Out, where the defects are given: what their own errors make of the solution.

    Returns
    -------
    What the step leaves of the goal's conditions, 0 but where extremals are a family, or nearly;
    infinite if there is no step.
    """
    M = times.size - 1
    columns = 4 if pointing else 6
    c = _COLUMNS
    work = _workspace()
    y = np.zeros(_WIDTH)
    W = np.zeros(_SIZE)
    # Two right-hand sides: the defects, and their errors.
    Y = np.zeros((M + 1, 12, 6))
    z = np.zeros((M + 1, 2, 12))
    U = np.zeros((M, 6, 6))
    rho = np.zeros((M, 2, 6))
    if pointing:
        Y[0, 6, 0] = Y[0, 7, 1] = Y[0, 9, 2] = Y[0, 10, 3] = 1.0
    else:
        for i in range(6):
            Y[0, 6 + i, i] = 1.0
    for k in range(M):
        for i in range(12):
            for j in range(columns):
                W[i * c + j] = Y[k, i, j]
            W[i * c + 6] = z[k, 0, i]
            W[i * c + 7] = z[k, 1, i]
        for i in range(STATE):
            y[i] = states[k, i]
        y[STATE] = 0.0
        _step(pointing, table, sigma, times[k], times[k + 1] - times[k], y, W, True, work)
        _difference(y, states[k + 1], whole[k])
        whole[k, 12] = y[STATE]
        if not given:
            for i in range(12):
                defects[k, i] = whole[k, i]
        E = Y[k + 1]
        for j in range(columns):
            for i in range(12):
                E[i, j] = W[i * c + j]
        # Modified Gram-Schmidt.
        for j in range(columns):
            for m in range(j):
                s = 0.0
                for i in range(12):
                    s += E[i, m] * E[i, j]
                U[k, m, j] = s
                for i in range(12):
                    E[i, j] -= s * E[i, m]
            s = 0.0
            for i in range(12):
                s += E[i, j] ** 2
            s = np.sqrt(s)
            if not s > 1e-300:
                return np.inf
            U[k, j, j] = s
            s = 1.0 / s
            for i in range(12):
                E[i, j] *= s
        for i in range(12):
            z[k + 1, 0, i] = W[i * c + 6] + defects[k, i]
            z[k + 1, 1, i] = W[i * c + 7] + gain[k] * (defects[k, i] - whole[k, i])
        for r in range(2):
            for j in range(columns):
                s = 0.0
                for i in range(12):
                    s += E[i, j] * z[k + 1, r, i]
                rho[k, r, j] = s
                for i in range(12):
                    z[k + 1, r, i] -= s * E[i, j]

    G = np.zeros((6, 12))
    g = np.zeros(6)
    goal_conditions(pointing, table, sigma, states[M], goal, G, g)
    beta, system = _end_system(columns, G, g, Y[M], z[M, 0])
    without = beta.copy()
    limited = valley < np.inf
    rest = _solve(system.copy(), without, _WEAK) if limited else 0.0
    full = beta.copy()
    # Where the path meets an edge at the goal, intervals are short, and attitudes move with the
    # cube of their length only: weak is not singular there.
    singular = _SINGULAR * min(1.0, (_SHORT * (times[M] - times[M - 1])) ** 3)
    missed = _solve(system.copy(), full, singular)
    if limited and missed > _MET:
        missed = _solve(system, beta, _NOTHING)
        full = beta
    _substitute(U, rho[:, 0], Y, z[:, 0], full, step)
    if rest > 0.0:
        # Nearly a family of extremals, along which Newton's steps mean little: they are short, and
        # wait until the others are settled.
        strong = np.empty((M + 1, 12))
        _substitute(U, rho[:, 0], Y, z[:, 0], without, strong)
        size, along = 0.0, 0.0
        for k in range(M + 1):
            for i in range(3):
                size = max(size, abs(strong[k, i]))
                along = max(along, abs(step[k, i] - strong[k, i]))
        most = valley if size < _SETTLED else min(valley, _LEVER * size)
        if not along <= most:
            share = most / along
            missed = (1.0 - share) * rest
            for k in range(M + 1):
                for i in range(12):
                    step[k, i] = strong[k, i] + share * (step[k, i] - strong[k, i])
    # The errors leave the end where it is.
    beta, system = _end_system(columns, G, np.zeros(6), Y[M], z[M, 1])
    _solve(system, beta, singular)
    _substitute(U, rho[:, 1], Y, z[:, 1], beta, left)
    finite = True
    for k in range(M + 1):
        for i in range(12):
            finite = finite and abs(step[k, i]) < np.inf and abs(left[k, i]) < np.inf
    return missed if finite else np.inf


@inlined
def _end_system(columns, G, g, Y, z):
    """Right-hand side and matrix of the goal's conditions for the last node's coordinates."""
    system = np.zeros((columns, columns))
    beta = np.zeros(columns)
    for i in range(columns):
        beta[i] = g[i]
        for m in range(12):
            beta[i] -= G[i, m] * z[m]
            for j in range(columns):
                system[i, j] += G[i, m] * Y[m, j]
    return beta, system


@inlined
def _substitute(U, rho, Y, z, beta, out):
    """Perturbations (M + 1, 12) of all nodes from the last one's coordinates, which are used up."""
    columns = beta.size
    for k in range(U.shape[0], -1, -1):
        if k < U.shape[0]:
            for j in range(columns):
                beta[j] -= rho[k, j]
            for j in range(columns - 1, -1, -1):
                s = beta[j]
                for m in range(j + 1, columns):
                    s -= U[k, j, m] * beta[m]
                beta[j] = s / U[k, j, j]
        for i in range(12):
            s = z[k, i]
            for j in range(columns):
                s += Y[k, i, j] * beta[j]
            out[k, i] = s


@inlined
def _solve(A, b, least):
    """Solve A x = b in place by elimination with full pivots; x comes in b.

    Where A is singular the extremals are a family, as about an obstacle that lies on an axis of
    symmetry; the components whose pivots are at most `least` of the greatest stay as they are.
    Returns the largest part of b that no x gives then, infinite if A is zero.
    """
    n = b.size
    order = np.arange(n)
    greatest = 0.0
    rank = n
    for i in range(n):
        row, column = i, i
        for r in range(i, n):
            for m in range(i, n):
                if abs(A[r, m]) > abs(A[row, column]):
                    row, column = r, m
        pivot = abs(A[row, column])
        greatest = max(greatest, pivot)
        if not pivot > least * greatest:
            rank = i
            break
        for m in range(n):
            A[i, m], A[row, m] = A[row, m], A[i, m]
        for r in range(n):
            A[r, i], A[r, column] = A[r, column], A[r, i]
        b[i], b[row] = b[row], b[i]
        order[i], order[column] = order[column], order[i]
        for r in range(i + 1, n):
            f = A[r, i] / A[i, i]
            for m in range(i, n):
                A[r, m] -= f * A[i, m]
            b[r] -= f * b[i]
    missed = 0.0 if rank > 0 else np.inf
    for i in range(rank, n):
        missed = max(missed, abs(b[i]))
    x = np.zeros(n)
    for i in range(rank - 1, -1, -1):
        s = b[i]
        for m in range(i + 1, rank):
            s -= A[i, m] * x[order[m]]
        x[order[i]] = s / A[i, i]
    for i in range(n):
        b[i] = x[i]
    return missed


@brief_kernel
def advance(states, step, scale):
    """Apply a Newton step, in place; returns the largest rotation in it [rad]."""
    largest = 0.0
    for k in range(states.shape[0]):
        largest = max(largest, step[k, 0] ** 2 + step[k, 1] ** 2 + step[k, 2] ** 2)
        turn(states[k], step[k], scale, states[k])
        for i in range(9):
            states[k, 4 + i] += scale * step[k, 3 + i]
    return np.sqrt(largest)
