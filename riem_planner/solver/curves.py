# SPDX-License-Identifier: Apache-2.0
"""Curves between the stages: first guesses, meshes, and states on a mesh."""

from __future__ import annotations

import numpy as np

from riem_planner.geometry.quaternions import ratio, relative, tilt, turn
from riem_planner.kernels import brief_kernel, inlined, kernel
from riem_planner.obstacles.potential import (
    CUT_WIDTH,
    exists,
    margin,
    margins_along,
    obstacle_count,
    potential,
    towards,
)
from riem_planner.obstacles.table import FROM, GROUP, KEEP_IN, KIND, RANGE_ON, SPEED, UNTIL
from riem_planner.solver.ends import FIXED, arrival_rate

_PARTS = 8  # of an interval, where obstacles are looked for
_NEAR = 1.2  # rad from its edge, within which an obstacle has another side worth a try


@brief_kernel
def lift(q):
    """Make attitudes (n, 4) roll-free about e3 along the curve of their directions, in place."""
    for k in range(1, q.shape[0]):
        a, b, c, d = q[k, 0], q[k, 1], q[k, 2], q[k, 3]
        x0, x1, x2 = 2 * (a * c + d * b), 2 * (b * c - d * a), d * d - a * a - b * b + c * c
        a, b, c, d = -q[k - 1, 0], -q[k - 1, 1], -q[k - 1, 2], q[k - 1, 3]
        p0, p1, p2 = b * x2 - c * x1, c * x0 - a * x2, a * x1 - b * x0
        y0 = x0 + 2.0 * (d * p0 + b * p2 - c * p1)
        y1 = x1 + 2.0 * (d * p1 + c * p0 - a * p2)
        y2 = x2 + 2.0 * (d * p2 + a * p1 - b * p0)
        s = np.sqrt(y0 * y0 + y1 * y1)
        f = np.arctan2(s, y2) / s if s > 0.0 else 1.0
        turn(q[k - 1], (-f * y1, f * y0, 0.0), 1.0, q[k])


@inlined
def _weights(t, nodes, count, C):
    """Weights C[i, m] of node values for the derivative m = 0..3 at t (Fornberg 1988)."""
    C[:, :] = 0.0
    C[0, 0] = 1.0
    c1 = 1.0
    c4 = nodes[0] - t
    for i in range(1, count):
        top = min(i, 3)
        c2 = 1.0
        c5 = c4
        c4 = nodes[i] - t
        for j in range(i):
            c3 = nodes[i] - nodes[j]
            c2 *= c3
            if j == i - 1:
                for m in range(top, 0, -1):
                    C[i, m] = c1 * (m * C[i - 1, m - 1] - c5 * C[i - 1, m]) / c2
                C[i, 0] = -c1 * c5 * C[i - 1, 0] / c2
            for m in range(top, 0, -1):
                C[j, m] = (c4 * C[j, m] - m * C[j, m - 1]) / c3
            C[j, 0] = c4 * C[j, 0] / c3
        c1 = c2


@inlined
def _has_cut(table, i):
    """Whether the potential of obstacle i has a kink where its distance is pi."""
    kept_out = table[i, GROUP] < 0.0 and table[i, KIND] != KEEP_IN
    return kept_out and table[i, RANGE_ON] == np.inf


@inlined
def _with_edges(table, mesh):
    """A mesh with nodes where obstacles begin or cease to exist: there the potential jumps."""
    n = obstacle_count(table)
    size = mesh.size
    out = np.empty(size + 2 * n)
    out[:size] = mesh
    for i in range(n):
        for column in (FROM, UNTIL):
            edge = table[i, column]
            if not (mesh[0] < edge < mesh[-1]):
                continue
            k = np.searchsorted(out[:size], edge)
            if edge == out[k]:
                continue
            for m in range(size, k, -1):
                out[m] = out[m - 1]
            out[k] = edge
            size += 1
    return out[:size]


@kernel
def mesh_and_states(pointing, table, times, q, start, goal, interval, least, most):
    """Shooting mesh fitted to a discretised curve, and the states of the curve on it.

    Intervals are short where the curve passes an obstacle: they span equal shares of
    `speed * (1 + 1 / margin) + (|Hess V| / 2)^(1/4) + 1`, with the margin by `2 V / |grad V|`.

    Parameters
    ----------
    times : (N + 1,)
    q : (N + 1, 4)
        Attitudes; on S^2 roll-free.
    start : (7,)
        Quaternion and body rate.
    goal : (7,) or longer
        See `ends`; where its roll is free, the curve's last attitude has that of the end.
    interval
        Share of the integral that one interval spans.
    least, most
        Bounds of the number of intervals.

    Returns
    -------
    mesh : (M + 1,)
    states : (M + 1, 13)
        Attitude, body rate and its two derivatives.
    """
    n = q.shape[0] - 1
    xi = np.empty(3)
    density = np.empty(n + 1)
    for k in range(n + 1):
        low, high = max(k - 1, 0), min(k + 1, n)
        relative(q[low], q[high], xi)
        speed = np.sqrt(xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2) / (times[high] - times[low])
        V, g0, g1, g2, h00, h11, h22, h01, h02, h12 = potential(
            table, times[k], q[k, 0], q[k, 1], q[k, 2], q[k, 3], 0.0
        )
        density[k] = 5.0 + speed
        if 0.0 < V < np.inf:
            slope = np.sqrt(g0**2 + g1**2 + g2**2)
            size = h00**2 + h11**2 + h22**2 + 2.0 * (h01**2 + h02**2 + h12**2)
            density[k] += 0.5 * speed * slope / V + (0.25 * size) ** 0.125
        cut = np.pi
        for i in range(obstacle_count(table)):
            if _has_cut(table, i) and exists(table, i, times[k]):
                d = towards(table, i, times[k], q[k, 0], q[k, 1], q[k, 2], q[k, 3])[0]
                cut = min(cut, np.pi - d)
        density[k] += 4.0 * speed * CUT_WIDTH / (cut + CUT_WIDTH) ** 2
    total = np.empty(n + 1)
    total[0] = 0.0
    for k in range(n):
        total[k + 1] = total[k] + 0.5 * (density[k] + density[k + 1]) * (times[k + 1] - times[k])
    M = min(max(int(total[n] / interval) + 1, least), most)
    mesh = np.empty(M + 1)
    mesh[0], mesh[M] = times[0], times[n]
    k = 0
    for i in range(1, M):
        target = total[n] * i / M
        while total[k + 1] < target:
            k += 1
        share = (target - total[k]) / (total[k + 1] - total[k])
        mesh[i] = times[k] + share * (times[k + 1] - times[k])
    mesh = _with_edges(table, mesh)
    M = mesh.size - 1

    states = np.empty((M + 1, 13))
    count = min(6, n + 1)
    C = np.empty((count, 4))
    nodes = np.empty(count)
    d = np.empty((4, 3))
    k = 0
    for i in range(M + 1):
        t = mesh[i]
        while k < n and abs(times[k + 1] - t) < abs(times[k] - t):
            k += 1
        low = min(max(k - count // 2 + (1 if t > times[k] else 0), 0), n + 1 - count)
        for m in range(count):
            nodes[m] = times[low + m]
        _weights(t, nodes, count, C)
        d[:, :] = 0.0
        for m in range(count):
            relative(q[k], q[low + m], xi)
            for r in range(4):
                for j in range(3):
                    d[r, j] += C[m, r] * xi[j]
        turn(q[k], d[0], 1.0, states[i])
        # Body derivatives of exp(xi(t)) to second order in xi.
        for r in range(3):
            e = d[r + 1]
            states[i, 4 + 3 * r] = e[0] - 0.5 * (d[0, 1] * e[2] - d[0, 2] * e[1])
            states[i, 5 + 3 * r] = e[1] - 0.5 * (d[0, 2] * e[0] - d[0, 0] * e[2])
            states[i, 6 + 3 * r] = e[2] - 0.5 * (d[0, 0] * e[1] - d[0, 1] * e[0])
        states[i, 10] -= 0.5 * (d[1, 1] * d[2, 2] - d[1, 2] * d[2, 1])
        states[i, 11] -= 0.5 * (d[1, 2] * d[2, 0] - d[1, 0] * d[2, 2])
        states[i, 12] -= 0.5 * (d[1, 0] * d[2, 1] - d[1, 1] * d[2, 0])
        if pointing:
            states[i, 6] = states[i, 9] = states[i, 12] = 0.0
    for i in range(4):
        states[0, i] = start[i]
    sign = 0.0
    for i in range(4):
        sign += states[M, i] * goal[i]
    for i in range(3):
        states[0, 4 + i] = start[4 + i]
    if not pointing and goal.size > FIXED:
        for i in range(4):
            states[M, i] = q[n, i]
        states[M, 4], states[M, 5], states[M, 6] = arrival_rate(goal, q[n])
    elif not pointing:
        for i in range(3):
            states[M, 4 + i] = goal[4 + i]
        for i in range(4):
            states[M, i] = goal[i] if sign > 0.0 else -goal[i]
    return mesh, states


@brief_kernel
def guess(q_start, rate_start, xi_end, rate_end, times, q):
    """Attitudes (N + 1, 4) along the cubic rotation vector from 0 to `xi_end`.

    Parameters
    ----------
    rate_start, rate_end : (3,)
        Derivatives of the rotation vector at both ends.
    """
    xi = np.empty(3)
    for k in range(times.size):
        s = times[k]
        a = s * (1.0 - s) ** 2
        b = s * s * (3.0 - 2.0 * s)
        c = s * s * (s - 1.0)
        for i in range(3):
            xi[i] = a * rate_start[i] + b * xi_end[i] + c * rate_end[i]
        turn(q_start, xi, 1.0, q[k])


@brief_kernel
def meet_ends(pointing, start, goal, times, q):
    """Turn a curve (N + 1, 4) smoothly to meet a start (7,) and a goal, in place."""
    at_start, at_goal, delta = np.empty(3), np.empty(3), np.empty(3)
    relative(q[0], start, at_start)
    if pointing or goal.size > FIXED:
        to_goal = np.empty(4)
        ratio(q[-1], goal, to_goal)
        x, y = tilt(to_goal)
        at_goal[0], at_goal[1], at_goal[2] = -y, x, 0.0
    else:
        relative(q[-1], goal, at_goal)
    for k in range(times.size):
        s = times[k]
        share = s * s * (3.0 - 2.0 * s)
        for i in range(3):
            delta[i] = (1.0 - share) * at_start[i] + share * at_goal[i]
        turn(q[k], delta, 1.0, q[k])
    for i in range(4):
        q[0, i] = start[i]


@brief_kernel
def shift_end(sigma, times, states, goal):
    """Turn states (n, 13) on SO(3) smoothly so that the last one has the goal's attitude and rate.

    To first order in what is amiss. Returns what that adds to the cost, from the momenta of
    attitude and rate, sigma v - j and a.
    """
    n = times.size - 1
    turned, faster = np.empty(3), np.empty(3)
    relative(states[n], goal, turned)
    v, a, j = states[n, 4:7].copy(), states[n, 7:10].copy(), states[n, 10:13].copy()
    cost = 0.0
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        amiss = goal[4 + i] - v[i]
        faster[i] = amiss + turned[k] * v[m] - turned[m] * v[k]
        cost += a[i] * amiss + (sigma * v[i] - j[i]) * turned[i]
    c = np.empty((3, 3))
    for k in range(n + 1):
        s = times[k]
        for i in range(3):
            c[0, i] = s * s * ((3.0 - 2.0 * s) * turned[i] + (s - 1.0) * faster[i])
            c[1, i] = s * (6.0 * (1.0 - s) * turned[i] + (3.0 * s - 2.0) * faster[i])
            c[2, i] = (6.0 - 12.0 * s) * turned[i] + (6.0 * s - 2.0) * faster[i]
        v[:], a[:] = states[k, 4:7], states[k, 7:10]
        turn(states[k], c[0], 1.0, states[k])
        for i in range(3):
            m, o = (i + 1) % 3, (i + 2) % 3
            # exp(-c) v + c', and its derivative.
            states[k, 4 + i] += c[1, i] - (c[0, m] * v[o] - c[0, o] * v[m])
            states[k, 7 + i] += (
                c[2, i] - (c[1, m] * v[o] - c[1, o] * v[m]) - (c[0, m] * a[o] - c[0, o] * a[m])
            )
    for i in range(4):
        states[n, i] = goal[i]
    for i in range(3):
        states[n, 4 + i] = goal[4 + i]
    return cost


@brief_kernel
def reflect(pointing, table, i, times, q, out):
    """Move a curve across obstacle i, to the same distance on its other side.

    The bump is widest where the curve is nearest to the obstacle and vanishes with its slope at
    both ends.

    Parameters
    ----------
    q : (N + 1, 4)
    out : (N + 1, 4)
        Out: the moved attitudes.

    Returns
    -------
    Whether the obstacle is near enough, and one that has sides.
    """
    n = q.shape[0] - 1
    nearest, least = 0, np.inf
    axis = np.zeros(3)
    for k in range(1, n):
        if not exists(table, i, times[k]):
            continue
        d, x, y, z = towards(table, i, times[k], q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        if d < least:
            nearest, least = k, d
            axis[0], axis[1], axis[2] = x, y, z
    if pointing:
        axis[2] = 0.0
    length = np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    if not length > 0.0:
        return False
    y = q[nearest]
    clear = margin(table, i, times[nearest], y[0], y[1], y[2], y[3])
    if not (clear if table[i, KIND] != KEEP_IN else -clear) < _NEAR:
        return False
    angle = 2.0 * max(least, 0.02)
    peak = times[nearest]
    delta = np.empty(3)
    for k in range(n + 1):
        s = times[k] / peak if k <= nearest else (1.0 - times[k]) / (1.0 - peak)
        bump = s * s * (3.0 - 2.0 * s)
        for j in range(3):
            delta[j] = angle * bump * axis[j] / length
        turn(q[k], delta, 1.0, out[k])
    return True


@kernel
def coarseness(table, times, q):
    """How well the nodes of a discretised curve see the obstacles that it passes.

    Returns
    -------
    ratio
        Largest angle between neighbours over their distance to an obstacle's edge: above about 1
        the curve may pass through an obstacle unseen.
    depth
        How deep the geodesics between neighbours run into an obstacle [rad]; 0 if they don't.
    """
    ratio, depth = 0.0, 0.0
    xi, between = np.empty(3), np.empty(4)
    for k in range(q.shape[0] - 1):
        relative(q[k], q[k + 1], xi)
        angle = np.sqrt(xi[0] ** 2 + xi[1] ** 2 + xi[2] ** 2)
        clear = np.pi
        for part in range(_PARTS):
            if part == 1 and angle < clear:
                break
            share = part / _PARTS
            turn(q[k], xi, share, between)
            t = times[k] + share * (times[k + 1] - times[k])
            least = min(np.pi, margins_along(table, t, between.reshape(1, 4))[0])
            if part == 0:
                clear = least
            depth = max(depth, -least)
        ratio = max(ratio, angle / max(clear, 1e-9))
    return ratio, depth


@brief_kernel
def resampled(times, q, new_times):
    """Attitudes of a curve at other times, along the geodesics between its nodes."""
    out = np.empty((new_times.size, 4))
    xi = np.empty(3)
    k = 0
    for i in range(new_times.size):
        while k < times.size - 2 and times[k + 1] < new_times[i]:
            k += 1
        relative(q[k], q[k + 1], xi)
        turn(q[k], xi, (new_times[i] - times[k]) / (times[k + 1] - times[k]), out[i])
    return out


@kernel
def crosses_cut(table, times, states):
    """Whether obstacle i may have its cut locus within CUT_WIDTH of interval k, (n, M).

    Parameters
    ----------
    times : (M + 1,)
    states : (M + 1, 13)
    """
    M = times.size - 1
    near = np.zeros((obstacle_count(table), M), dtype=np.bool_)
    for i in range(obstacle_count(table)):
        if not _has_cut(table, i):
            continue
        turning = table[i, SPEED]
        before = 0.0
        for k in range(M + 1):
            y = states[k]
            d = towards(table, i, times[k], y[0], y[1], y[2], y[3])[0]
            if k > 0:
                speed = turning + max(
                    np.sqrt(y[4] ** 2 + y[5] ** 2 + y[6] ** 2),
                    np.sqrt(states[k - 1, 4] ** 2 + states[k - 1, 5] ** 2 + states[k - 1, 6] ** 2),
                )
                reach = 0.5 * (before + d + speed * (times[k] - times[k - 1]))
                present = table[i, FROM] < times[k] and table[i, UNTIL] > times[k - 1]
                if present and reach > np.pi - CUT_WIDTH:
                    near[i, k - 1] = True
            before = d
    return near


@brief_kernel
def ways_round(pointing, start, goal):
    """Cubic rotation vectors from start to goal: either way round and more, straightest first.

    Parameters
    ----------
    start, goal : (7,)
        Quaternion and body rate.

    Returns
    -------
    ends, rates : (m, 3)
        Rotation vector at the goal, and its derivative there.
    costs : (m,)
        Half the integral of the squared second derivative.
    length
        Angle that the straighter two may cover, for the choice of nodes [rad].
    """
    p, q = start, goal
    x = p[3] * q[0] - q[3] * p[0] - (p[1] * q[2] - p[2] * q[1])
    y = p[3] * q[1] - q[3] * p[1] - (p[2] * q[0] - p[0] * q[2])
    z = p[3] * q[2] - q[3] * p[2] - (p[0] * q[1] - p[1] * q[0])
    w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    a, v = start[4:], goal[4:].copy()
    if pointing:
        # Of all goal attitudes with the goal's direction, the one reached without roll: undo
        # its turn about e3.
        size = np.sqrt(z * z + w * w)
        if size > 1e-12:
            c, s = w / size, -z / size
            x, y = c * x + s * y, c * y - s * x
            cosine, sine = c * c - s * s, 2.0 * c * s
            v[0], v[1] = cosine * v[0] + sine * v[1], cosine * v[1] - sine * v[0]
            z, w = 0.0, size
    sine = np.sqrt(x * x + y * y + z * z)
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    angle = 2.0 * np.arctan2(sine, w)
    axis = np.zeros(3)
    if sine > 1e-9:
        axis[0], axis[1], axis[2] = x / sine, y / sine, z / sine
    else:
        size = 0.0
        for i in range(3):
            axis[i] = a[i] + v[i]
            size += axis[i] ** 2
        if size > 1e-18:
            axis /= np.sqrt(size)
        else:
            axis[1] = 1.0
    turns = (0, -1, 1, -2, 2)
    extra = 2 if pointing and angle > 0.9 * np.pi else 0
    ends, rates = np.zeros((5 + extra, 3)), np.zeros((5 + extra, 3))
    costs = np.empty(5 + extra)
    inner = axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2]
    for m in range(5 + extra):
        if m < 5:
            along = angle + 2.0 * np.pi * turns[m]
            half = 0.5 * along
            # The inverse Jacobian of exp, bounded near full turns, where it has poles.
            cot = half / np.tan(half) if abs(np.sin(half)) > 1e-9 else 1.0
            cot = min(max(cot, -2.0), 2.0)
            bend = min(max(half, -2.0), 2.0)
            n = axis
            for i in range(3):
                across = v[i] - inner * n[i]
                j, k = (i + 1) % 3, (i + 2) % 3
                ends[m, i] = along * n[i]
                rates[m, i] = inner * n[i] + cot * across + bend * (n[j] * v[k] - n[k] * v[j])
        else:
            # Near the antipode any way round is as good: the two at right angles as well.
            side = 1.0 if m == 5 else -1.0
            ends[m, 0], ends[m, 1] = -side * angle * axis[1], side * angle * axis[0]
        cost = 0.0
        for i in range(3):
            b, c = ends[m, i], rates[m, i]
            cost += 3.0 * b * b - 3.0 * b * (a[i] + c) + a[i] * a[i] + a[i] * c + c * c
        costs[m] = 2.0 * cost
    # Both ways always; further turns only where rates may make one of them the straighter.
    moving = 0.0
    for i in range(3):
        moving += a[i] * a[i] + v[i] * v[i]
    limit = max(costs[0], costs[1]) if moving == 0.0 else np.inf
    chosen = np.empty(5 + extra, dtype=np.int64)
    count = 0
    for m in range(5 + extra):
        if m < 2 or m >= 5 or costs[m] < limit:
            place = count
            while place > 0 and costs[m] < costs[chosen[place - 1]]:
                chosen[place] = chosen[place - 1]
                place -= 1
            chosen[place] = m
            count += 1
    chosen = chosen[:count]
    length = 0.0
    for m in chosen[:2]:
        length = max(length, np.sqrt(np.sum(ends[m] ** 2)) + 0.3 * np.sqrt(np.sum(rates[m] ** 2)))
    length += 0.3 * np.sqrt(np.sum(a**2))
    return ends[chosen], rates[chosen], costs[chosen], length
