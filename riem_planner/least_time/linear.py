# SPDX-License-Identifier: Apache-2.0
"""Values and derivatives of everything along an iterate."""
# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.kernels import inlined, kernel
from riem_planner.least_time.dynamics import difference, differentiate_step, product, theta
from riem_planner.least_time.model import CODE, CONSTRAINT, FIRST, POWER, ROW, ROWS
from riem_planner.least_time.quantities import differentiate, of_interval, quantity
from riem_planner.least_time.zones import forbidden


@inlined
def tau_of(p, model):
    """`T / T_0`, and its derivative by p."""
    tau = p ** (1.0 / model.power)
    return tau, tau / (model.power * p)


@inlined
def _bounds(i, k, linear, model, w):
    """The constraints of slot i at node k, from the quantity."""
    f = linear.f[k, i]
    first, rows = model.slots[i, FIRST], model.slots[i, ROWS]
    if rows == 0:
        square = f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
        linear.c[k, first] = model.gains[i] ** 2 * square / w - w
    for j in range(rows):
        r = model.rows[model.slots[i, ROW] + j]
        x = r[0] * f[0] + r[1] * f[1] + r[2] * f[2]
        linear.c[k, first + 2 * j] = x - w
        linear.c[k, first + 2 * j + 1] = -x - w


@kernel
def linearise(iterate, model, linear, derivatives):
    """Fill `linear` along an iterate: values, and where asked for derivatives."""
    q, V, A = iterate.q, iterate.V, iterate.A
    n = V.shape[0] - 1
    p = iterate.p[0]
    tau, _ = tau_of(p, model)
    for k in range(n + 1):
        for i in range(model.slots.shape[0]):
            code = model.slots[i, CODE]
            if k == n and of_interval(code):
                continue
            f = quantity(code, k, iterate, model, tau)
            linear.f[k, i, 0], linear.f[k, i, 1], linear.f[k, i, 2] = f
            _bounds(i, k, linear, model, p ** (model.slots[i, POWER] / model.power))
            if derivatives:
                t = differentiate(code, k, iterate, model, tau, linear.by_stage[k, i])
                linear.by_tau[k, i, 0], linear.by_tau[k, i, 1], linear.by_tau[k, i, 2] = t
        for j in range(model.sets.shape[0]):
            c, by_tau = forbidden(
                j, k, q, tau - 1.0, model, linear.set_by_d[k, j], linear.set_by_dd[k, j]
            )
            linear.c[k, model.sets[j, CONSTRAINT]] = c
            linear.set_by_tau[k, j] = by_tau
        if k < n:
            x, _ = theta(k, V, A, 1.0 / n)
            e = difference(q[k + 1], product(q[k], x))
            linear.defect[k, 0], linear.defect[k, 1], linear.defect[k, 2] = e
            if derivatives:
                differentiate_step(k, V, A, linear.back[k], linear.by_motion[k])


@kernel
def infeasibility(iterate, linear, used, goal, start):
    """Sum of what constraints, steps and both ends are missed by; greatest; sum of log slacks."""
    total = worst = logarithms = 0.0
    for k in range(used.shape[0]):
        for i in range(used.shape[1]):
            if used[k, i]:
                missed = abs(linear.c[k, i] + iterate.s[k, i])
                total += missed
                worst = max(worst, missed)
                logarithms += np.log(iterate.s[k, i])
    steps = 0.0
    for k in range(linear.defect.shape[0]):
        for i in range(3):
            steps += abs(linear.defect[k, i])
    for i in range(goal.size):
        steps += abs(goal[i])
    for i in range(start.size):
        steps += abs(start[i])
    return total + 10.0 * steps, max(worst, steps), logarithms
