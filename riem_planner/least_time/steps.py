# SPDX-License-Identifier: Apache-2.0
"""How far to go along a Newton step, and going there, compiled."""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.kernels import inlined, kernel
from riem_planner.least_time.dynamics import product

_LARGEST_TURN = 0.6  # rad, of an attitude in one step


@kernel
def dual_steps(iterate, step, used, mu):
    """Fill the steps of the multipliers; returns the slope of the barrier function."""
    slope = step.x[0, 9]
    for k in range(used.shape[0]):
        for i in range(used.shape[1]):
            if used[k, i]:
                s, z, ds = iterate.s[k, i], iterate.z[k, i], step.s[k, i]
                step.z[k, i] = mu / s - z - z / s * ds
                slope -= mu * ds / s
    return slope


@inlined
def _within(values, steps, used, part):
    """Greatest step, at most 1, that takes no value below `1 - part` of itself."""
    alpha = 1.0
    for k in range(used.shape[0]):
        for i in range(used.shape[1]):
            if used[k, i] and steps[k, i] < 0.0:
                alpha = min(alpha, -part * values[k, i] / steps[k, i])
    return alpha


@kernel
def longest(iterate, step, used, mu):
    """The longest steps of the primal and of the dual variables."""
    part = max(0.99, 1.0 - mu)
    alpha = _within(iterate.s, step.s, used, part)
    turn = 0.0
    for k in range(step.x.shape[0]):
        for i in range(3):
            turn = max(turn, abs(step.x[k, i]))
    if alpha * turn > _LARGEST_TURN:
        alpha = _LARGEST_TURN / turn
    if step.x[0, 9] < 0.0:
        alpha = min(alpha, -0.7 * iterate.p[0] / step.x[0, 9])
    return alpha, _within(iterate.z, step.z, used, part)


@kernel
def move(iterate, step, used, alpha, trial):
    """The primal variables a step further, into `trial`."""
    for k in range(used.shape[0]):
        x = step.x[k]
        p = product(iterate.q[k], (alpha * x[0], alpha * x[1], alpha * x[2]))
        norm = np.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3])
        for i in range(4):
            trial.q[k, i] = p[i] / norm
        for i in range(3):
            trial.V[k, i] = iterate.V[k, i] + alpha * x[3 + i]
            trial.A[k, i] = iterate.A[k, i] + alpha * x[6 + i]
        for i in range(used.shape[1]):
            trial.s[k, i] = iterate.s[k, i] + alpha * step.s[k, i] if used[k, i] else 1.0
    trial.p[0] = iterate.p[0] + alpha * step.x[0, 9]


@kernel
def accept(iterate, trial, step, used, mu, alphas):
    """Take the trial, and a step of the multipliers; the sum of products s z, and the least."""
    alpha, dual = alphas
    total, least = 0.0, np.inf
    for k in range(used.shape[0]):
        for i in range(used.shape[1]):
            if used[k, i]:
                s = trial.s[k, i]
                z = iterate.z[k, i] + dual * step.z[k, i]
                iterate.z[k, i] = min(max(z, 1e-8 * mu / s), 1e8 * mu / s)
                iterate.s[k, i] = s
                total += s * iterate.z[k, i]
                least = min(least, s * iterate.z[k, i])
        for i in range(3):
            iterate.costates[k, i] += alpha * (step.costates[k, i] - iterate.costates[k, i])
    iterate.q[:], iterate.V[:], iterate.A[:] = trial.q, trial.V, trial.A
    iterate.p[0] = trial.p[0]
    return total, least
