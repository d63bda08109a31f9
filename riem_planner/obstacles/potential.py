# SPDX-License-Identifier: Apache-2.0
"""The potential of a table of obstacles with its exact derivatives, compiled.

Every obstacle sees the attitude through one number: `u = cos(d / m)`, the cosine of the angle
to a zone's axis (m = 1) or of half the angle to an attitude (m = 2). With `V = g(u)` the
gradient and Hessian are `g' du` and `g'' du du^T + g' d2u`, where u, du and d2u are
polynomials in the attitude, smooth even where the distance itself is not.

Body perturbations: `R exp(hat(delta))`. Under them

    attitude Q, p = q^-1 Q:       u = p_w,   du = p_xyz / 2,   d2u = -u I / 4
    axis s, y = R^T s:            u = y . b, du = b x y,       d2u = -u I + (y b^T + b y^T) / 2

and a vector of body components, such as the gradient, changes by
`Hessian delta - delta x gradient / 2`.

The potential of a group is `(sum V_k^-2)^(-1/2)` with the sums V_k of its members' potentials, as
where a margin m > 0 stands for `V = tau / m^2`: every other formula is the chain rule.

A potential with its derivatives travels as a tuple of ten: V, gradient (3), Hessian (xx, yy, zz,
xy, xz, yz).
"""

from __future__ import annotations

import numpy as np

from riem_planner.geometry.vectors import cross, dot, norm, turned_back
from riem_planner.kernels import brief_kernel, inlined, kernel
from riem_planner.obstacles.table import (
    BEGIN,
    BORESIGHT,
    COUNT,
    CUBICS,
    FROM,
    GROUP,
    KEEP_IN,
    KIND,
    MEMBER,
    ORIENTATION,
    PATH,
    PIECES,
    PLACE,
    RADIUS,
    RANGE_OFF,
    RANGE_ON,
    RATE,
    STRENGTH,
    UNTIL,
)

CUT_WIDTH = 0.1
"""Within this distance [rad] of the cut locus, d = pi, the kink of d is rounded off, so that the
potential is C^5; the potential as stated differs there only."""

# Width of the smooth maximum that stands in for a group that may be violated: a share of the
# margin `soft`, so that what it gives away shrinks with that, and at most some rad.
_UNION_SHARE, _UNION_MOST = 0.5, 0.05

_NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inlined
def obstacle_count(table):
    """Number of obstacles in a table: the rows behind them are pieces of paths."""
    return int(table[0, COUNT]) if table.shape[0] > 0 else 0


@inlined
def exists(table, i, time):
    """Whether obstacle i exists at a time; the ends of its window belong to it."""
    return table[i, FROM] <= time <= table[i, UNTIL]


@inlined
def _square(beta, c, s):
    """Derivatives of beta^2 by u = cos(beta) = c, with s = sin(beta); exact down to beta = 0."""
    if beta < 0.03:
        z = beta * beta
        return (
            -2.0 - z / 3.0 - 7.0 * z * z / 180.0,
            2.0 / 3.0 + z * (4.0 / 15.0 + z * 4.0 / 63.0),
        )
    return -2.0 * beta / s, 2.0 * (s - beta * c) / (s * s * s)


@inlined
def _rounded(square):
    """Taylor polynomial of `sqrt(square)` about CUT_WIDTH: eta = pi - d without its kink at 0."""
    z = square / CUT_WIDTH**2 - 1.0
    return CUT_WIDTH * (1.0 + z * (0.5 - z * (0.125 - z * (0.0625 - z * (5 / 128 - z * 7 / 256)))))


@inlined
def _outside(d, c, s, m, r, tau, on, off):
    """V, dV/du, d2V/du2 of tau / (d - r)^2, with its taper or rounded cut locus."""
    if d <= r:
        return np.inf, 0.0, 0.0
    if on == np.inf and d > np.pi - CUT_WIDTH:
        if m == 2.0:
            beta = np.arctan2(c, s)
            B = 4.0 * beta * beta
            B_1 = 8.0 * beta / s
            B_2 = 8.0 * (1.0 + beta * c / s) / (s * s)
        else:
            beta = np.pi - d
            B = beta * beta
            B_1, B_2 = _square(beta, -c, s)
            B_1 = -B_1
        eta = _rounded(B)
        z = B / CUT_WIDTH**2 - 1.0
        eta_B = (0.5 - z * (0.25 - z * (0.1875 - z * (5 / 32 - z * 35 / 256)))) / CUT_WIDTH
        eta_BB = (-0.25 + z * (0.375 - z * (15 / 32 - z * 35 / 64))) / CUT_WIDTH**3
        gap = np.pi - eta - r
        V = tau / (gap * gap)
        V_eta, V_eta_eta = 2.0 * V / gap, 6.0 * V / (gap * gap)
        V_B = V_eta * eta_B
        V_BB = V_eta_eta * eta_B * eta_B + V_eta * eta_BB
        return V, V_B * B_1, V_BB * B_1 * B_1 + V_B * B_2
    gap = d - r
    V = tau / (gap * gap)
    V_1, V_2 = -2.0 * V / gap, 6.0 * V / (gap * gap)
    if d > on:
        if d >= off:
            return 0.0, 0.0, 0.0
        width = off - on
        x = (off - d) / width
        step = x**4 * (35.0 - x * (84.0 - x * (70.0 - 20.0 * x)))
        step_1 = -140.0 * (x * (1.0 - x)) ** 3 / width
        step_2 = 420.0 * (x * (1.0 - x)) ** 2 * (1.0 - 2.0 * x) / width**2
        V_2 = V_2 * step + 2.0 * V_1 * step_1 + V * step_2
        V_1 = V_1 * step + V * step_1
        V = V * step
    return V, -m * V_1 / s, (m * V_2 - V_1 * c / s) * m / (s * s)


@inlined
def _keep_out(c, s, m, r, tau, on, off, soft):
    """As `_outside`; below a margin of `soft` its quadratic Taylor polynomial in u."""
    d = m * np.arctan2(s, c)
    if d >= r + soft:
        return _outside(d, c, s, m, r, tau, on, off)
    edge = (r + soft) / m
    c_edge = np.cos(edge)
    V, V_1, V_2 = _outside(r + soft, c_edge, np.sin(edge), m, r, tau, np.inf, np.inf)
    du = c - c_edge
    return V + du * (V_1 + 0.5 * du * V_2), V_1 + du * V_2, V_2


@inlined
def _barrier(m, tau, soft):
    """V, dV/dm, d2V/dm2 of `tau / m^2`; below m = `soft` its quadratic Taylor polynomial."""
    edge = max(m, soft)
    V = tau / (edge * edge)
    V_m, V_mm = -2.0 * V / edge, 6.0 * V / (edge * edge)
    dm = m - edge
    return V + dm * (V_m + 0.5 * dm * V_mm), V_m + dm * V_mm, V_mm


@inlined
def _keep_in(c, s, r, tau, soft):
    """V, dV/du, d2V/du2 of `_barrier` at m = (r^2 - d^2) / (2 r)."""
    beta = np.arctan2(s, c)
    B_1, B_2 = _square(beta, c, s)
    m = 0.5 * (r * r - beta * beta) / r
    m_1, m_2 = -0.5 * B_1 / r, -0.5 * B_2 / r
    if not max(m, soft) > 0.0:
        return np.inf, 0.0, 0.0
    V, V_m, V_mm = _barrier(m, tau, soft)
    return V, V_m * m_1, V_mm * m_1 * m_1 + V_m * m_2


@inlined
def _cubic(table, k, first, t):
    """The cubic at column `first` of piece k, a time t after its beginning."""
    return table[k, first] + t * (
        table[k, first + 1] + t * (table[k, first + 2] + t * table[k, first + 3])
    )


@inlined
def _on_path(table, i, time):
    """Direction (three numbers and 0) of an obstacle on a path, and its radius."""
    low = int(table[i, PATH])
    high = low + int(table[i, PIECES]) - 1
    while low < high:
        middle = (low + high + 1) // 2
        if table[middle, BEGIN] <= time:
            low = middle
        else:
            high = middle - 1
    t = time - table[low, BEGIN]
    p = (
        _cubic(table, low, CUBICS, t),
        _cubic(table, low, CUBICS + 4, t),
        _cubic(table, low, CUBICS + 8, t),
    )
    size = norm(p)
    return (p[0] / size, p[1] / size, p[2] / size, 0.0), _cubic(table, low, CUBICS + 12, t)


@inlined
def _turned(n, w, s):
    """A vector turned by the quaternion (n, w): `s + 2 w n x s + 2 n x (n x s)`."""
    c = cross(n, s)
    d = cross(n, c)
    return (
        s[0] + 2.0 * (w * c[0] + d[0]),
        s[1] + 2.0 * (w * c[1] + d[1]),
        s[2] + 2.0 * (w * c[2] + d[2]),
        0.0,
    )


@inlined
def _placed(table, i, time):
    """Place of obstacle i at a time, four numbers, and its radius."""
    if table[i, PATH] >= 0.0:
        return _on_path(table, i, time)
    s = (table[i, PLACE], table[i, PLACE + 1], table[i, PLACE + 2])
    d, r = table[i, PLACE + 3], table[i, RADIUS]
    x, y, z = time * table[i, RATE], time * table[i, RATE + 1], time * table[i, RATE + 2]
    square = x * x + y * y + z * z
    if square == 0.0:
        return (s[0], s[1], s[2], d), r
    angle = np.sqrt(square)
    f = np.sin(0.5 * angle) / angle
    n, w = (f * x, f * y, f * z), np.cos(0.5 * angle)
    if table[i, KIND] != ORIENTATION:
        return _turned(n, w, s), r
    c = cross(n, s)
    return (
        w * s[0] + d * n[0] + c[0],
        w * s[1] + d * n[1] + c[1],
        w * s[2] + d * n[2] + c[2],
        w * d - dot(n, s),
    ), r


@inlined
def _seen(table, i, place, q):
    """How obstacle i at a place sees an attitude.

    Returns
    -------
    u, its gradient e (3,), sin(d / m), m, and of its Hessian `k I + (y b^T + b y^T) / 2` the
    number k and the vectors y and b.
    """
    if table[i, KIND] == ORIENTATION:
        n, s = (q[0], q[1], q[2]), (place[0], place[1], place[2])
        u = dot(n, s) + q[3] * place[3]
        sign = 0.5 if u >= 0.0 else -0.5
        c = cross(n, s)
        e = (
            sign * (q[3] * s[0] - place[3] * n[0] - c[0]),
            sign * (q[3] * s[1] - place[3] * n[1] - c[1]),
            sign * (q[3] * s[2] - place[3] * n[2] - c[2]),
        )
        zero = (0.0, 0.0, 0.0)
        u = abs(u)
        return u, e, 2.0 * norm(e), 2.0, -0.25 * u, zero, zero
    y = turned_back(q, (place[0], place[1], place[2]))
    b = (table[i, BORESIGHT], table[i, BORESIGHT + 1], table[i, BORESIGHT + 2])
    u, e = dot(y, b), cross(b, y)
    return u, e, norm(e), 1.0, -u, y, b


@inlined
def _of_obstacle(table, i, time, q, soft):
    """Potential of obstacle i with its derivatives."""
    place, r = _placed(table, i, time)
    u, e, sine, m, trace, y, b = _seen(table, i, place, q)
    tau = table[i, STRENGTH]
    if table[i, KIND] == KEEP_IN:
        V, V_1, V_2 = _keep_in(u, sine, r, tau, soft)
    else:
        on, off = table[i, RANGE_ON], table[i, RANGE_OFF]
        V, V_1, V_2 = _keep_out(u, sine, m, r, tau, on, off, soft)
    k = V_1 * trace
    return (
        V,
        V_1 * e[0],
        V_1 * e[1],
        V_1 * e[2],
        V_2 * e[0] * e[0] + k + V_1 * y[0] * b[0],
        V_2 * e[1] * e[1] + k + V_1 * y[1] * b[1],
        V_2 * e[2] * e[2] + k + V_1 * y[2] * b[2],
        V_2 * e[0] * e[1] + 0.5 * V_1 * (y[0] * b[1] + y[1] * b[0]),
        V_2 * e[0] * e[2] + 0.5 * V_1 * (y[0] * b[2] + y[2] * b[0]),
        V_2 * e[1] * e[2] + 0.5 * V_1 * (y[1] * b[2] + y[2] * b[1]),
    )


@inlined
def _added(a, b):
    """Sum of two potentials with their derivatives."""
    return (
        a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4],
        a[5] + b[5], a[6] + b[6], a[7] + b[7], a[8] + b[8], a[9] + b[9],
    )  # fmt: skip


@inlined
def _function(value, first, second, a):
    """A function of a potential, by its value and two derivatives: the chain rule."""
    g = (a[1], a[2], a[3])
    return (
        value,
        first * g[0],
        first * g[1],
        first * g[2],
        first * a[4] + second * g[0] * g[0],
        first * a[5] + second * g[1] * g[1],
        first * a[6] + second * g[2] * g[2],
        first * a[7] + second * g[0] * g[1],
        first * a[8] + second * g[0] * g[2],
        first * a[9] + second * g[1] * g[2],
    )


@inlined
def _weight(member):
    """`V^-2` of a member: infinite where it repels not, nothing where it is violated."""
    V = member[0]
    if not np.inf > V:
        return _NOTHING
    if V == 0.0:
        return _function(np.inf, 0.0, 0.0, _NOTHING)
    W = 1.0 / (V * V)
    return _function(W, -2.0 * W / V, 6.0 * W * W, member)


@inlined
def _united(weights):
    """`S^(-1/2)` of a group's sum of weights."""
    S = weights[0]
    if not np.inf > S:
        return _NOTHING
    if S == 0.0:
        return _function(np.inf, 0.0, 0.0, _NOTHING)
    V = 1.0 / np.sqrt(S)
    return _function(V, -0.5 * V / S, 0.75 * V / (S * S), weights)


@inlined
def _clear(member, tau, soft):
    """The margin m at which `_barrier` is a member's potential: infinite where it repels not."""
    V = member[0]
    if not V > 0.0:
        return _function(np.inf, 0.0, 0.0, _NOTHING)
    edge = tau / (soft * soft)
    if edge > V:
        m = np.sqrt(tau / V)
        return _function(m, -0.5 * m / V, 0.75 * m / V / V, member)
    root = np.sqrt(3.0 * V / edge - 2.0)
    first = -0.5 * soft / (root * edge)
    return _function(soft * (4.0 - root) / 3.0, first, -1.5 * first / (root * root * edge), member)


@inlined
def _greater(a, b, soft):
    """Smooth maximum of two margins; of many, one after the other, it is that of all."""
    if not np.inf > a[0] or b[0] == -np.inf:
        return a
    if not np.inf > b[0] or a[0] == -np.inf:
        return b
    width = min(_UNION_SHARE * soft, _UNION_MOST)
    less = np.exp(-abs(a[0] - b[0]) / width)
    p = 1.0 / (1.0 + less)
    p = p if a[0] >= b[0] else less * p
    both = p * (1.0 - p) / width
    apart = _added(a, _function(0.0, -1.0, 0.0, b))
    bend = _function(0.0, 0.0, both, apart)
    top = max(a[0], b[0]) + width * np.log1p(less)
    mean = _added(_function(0.0, p, 0.0, a), _function(top, 1.0 - p, 0.0, b))
    return _added(mean, bend)


@inlined
def _joined(group, member, tau, soft):
    """A group's sum with one more member: of weights, or where it is softened its margin."""
    if soft > 0.0:
        return _greater(group, _clear(member, tau, soft), soft)
    return _added(group, _weight(member))


@inlined
def _of_group(group, tau, soft):
    """Potential of a group by `_joined` of all its members."""
    if soft > 0.0:
        if not np.inf > group[0]:
            return _NOTHING
        V, first, second = _barrier(group[0], tau, soft)
        return _function(V, first, second, group)
    return _united(group)


@inlined
def _sum(table, time, q, soft):
    """What `potential` returns; what its caller leaves unused is never computed."""
    empty = _function(-np.inf if soft > 0.0 else 0.0, 0.0, 0.0, _NOTHING)
    total, member, joined = _NOTHING, _NOTHING, empty
    tau, strongest = 0.0, 0.0
    n = obstacle_count(table)
    for i in range(n):
        part = _of_obstacle(table, i, time, q, soft) if exists(table, i, time) else _NOTHING
        group = table[i, GROUP]
        if group < 0.0:
            total = _added(total, part)
            continue
        member = _added(member, part)
        tau = max(tau, table[i, STRENGTH])
        more = i + 1 < n and table[i + 1, GROUP] == group
        if more and table[i + 1, MEMBER] == table[i, MEMBER]:
            continue
        joined = _joined(joined, member, tau, soft)
        strongest = max(strongest, tau)
        member, tau = _NOTHING, 0.0
        if not more:
            total = _added(total, _of_group(joined, strongest, soft))
            joined, strongest = empty, 0.0
    return total


@brief_kernel
def potential(table, time, x, y, z, w, soft):
    """Sum of the potentials at an attitude, with body gradient and covariant Hessian.

    Parameters
    ----------
    table : (n, WIDTH)
        What is forbidden, in units of the duration.
    time
        Normalised time.
    x, y, z, w
        Unit quaternion.
    soft
        Margin [rad] below which potentials are extended by quadratics, so that they are finite
        and push outward everywhere; 0 for the potentials themselves, infinite where violated.

    Returns
    -------
    V
    G0, G1, G2
        Body gradient.
    H00, H11, H22, H01, H02, H12
        Covariant Hessian.
    """
    return _sum(table, time, (x, y, z, w), soft)


@brief_kernel
def first_derivatives(table, time, x, y, z, w):
    """The potential and its body gradient alone: V, G0, G1, G2 as those of `potential`."""
    V, G0, G1, G2 = _sum(table, time, (x, y, z, w), 0.0)[:4]
    return V, G0, G1, G2


@inlined
def _distance(table, i, place, q):
    """Distance d [rad] of an attitude to obstacle i at a place, and the gradient of cos(d / m)."""
    u, e, sine, m, _, _, _ = _seen(table, i, place, q)
    return m * np.arctan2(sine, u), e


@brief_kernel
def towards(table, i, time, x, y, z, w):
    """Distance d [rad] of an attitude to obstacle i, and the body rotation that lessens it.

    Returns
    -------
    d, and three components along the rotation (of no particular length).
    """
    place, _ = _placed(table, i, time)
    d, e = _distance(table, i, place, (x, y, z, w))
    return d, e[0], e[1], e[2]


@brief_kernel
def margin(table, i, time, x, y, z, w):
    """Distance of an attitude to the edge of obstacle i [rad], negative where it is violated.

    Where it does not exist pi, as far as can be.
    """
    if not exists(table, i, time):
        return np.pi
    place, r = _placed(table, i, time)
    outside = _distance(table, i, place, (x, y, z, w))[0] - r
    return -outside if table[i, KIND] == KEEP_IN else outside


@kernel
def rounding(table, crossing, times, q):
    """Potentials as stated minus those with the rounded cut locus, along intervals of a curve.

    Parameters
    ----------
    table : (n, WIDTH)
    crossing : (n, M)
        Whether obstacle i may have its cut locus near interval k.
    times : (M, s)
        Normalised.
    q : (M, s, 4)

    Returns
    -------
    (M, s)
    """
    out = np.zeros(times.shape)
    for i in range(obstacle_count(table)):
        tau = table[i, STRENGTH]
        for k in range(times.shape[0]):
            if not crossing[i, k]:
                continue
            for j in range(times.shape[1]):
                if not exists(table, i, times[k, j]):
                    continue
                place, r = _placed(table, i, times[k, j])
                d = _distance(table, i, place, (q[k, j, 0], q[k, j, 1], q[k, j, 2], q[k, j, 3]))[0]
                eta = np.pi - d
                if eta < CUT_WIDTH:
                    out[k, j] += tau / (d - r) ** 2 - tau / (np.pi - _rounded(eta * eta) - r) ** 2
    return out


@brief_kernel
def row_margins(table, time, q):
    """Margin of an attitude to each obstacle's edge [rad], positive where allowed (n,)."""
    out = np.empty(obstacle_count(table))
    for i in range(out.size):
        out[i] = margin(table, i, time, q[0], q[1], q[2], q[3])
    return out


@kernel
def margins_along(table, time, q):
    """Least margin of attitudes (n, 4) to all forbidden sets at a time [rad], (n,).

    Of a group the best member counts, of a member its worst obstacle.
    """
    out = np.empty(q.shape[0])
    n = obstacle_count(table)
    for k in range(q.shape[0]):
        least, best, worst = np.inf, -np.inf, np.inf
        for i in range(n):
            own = margin(table, i, time, q[k, 0], q[k, 1], q[k, 2], q[k, 3])
            group = table[i, GROUP]
            if group < 0.0:
                least = min(least, own)
                continue
            worst = min(worst, own)
            more = i + 1 < n and table[i + 1, GROUP] == group
            if more and table[i + 1, MEMBER] == table[i, MEMBER]:
                continue
            best, worst = max(best, worst), np.inf
            if not more:
                least, best = min(least, best), -np.inf
        out[k] = least
    return out
