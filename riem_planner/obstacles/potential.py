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
"""

from __future__ import annotations

import numpy as np

from riem_planner.kernels import brief_kernel, inlined, kernel
from riem_planner.obstacles.table import (
    BORESIGHT,
    GROUP,
    KIND,
    PLACE,
    RADIUS,
    RANGE_OFF,
    RANGE_ON,
    RATE,
    STRENGTH,
)

CUT_WIDTH = 0.1
"""Within this distance [rad] of the cut locus, d = pi, the kink of d is rounded off, so that the
potential is C^5; the potential as stated differs there only."""

# Width of the smooth maximum that stands in for a keep-in group that may be violated: a share of
# the margin `soft`, so that what it gives away shrinks with that, and at most some rad.
_UNION_SHARE, _UNION_MOST = 0.5, 0.05
_ORIENTATION, _KEEP_OUT = 0, 1


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
def _placed(table, i, time):
    """Place of obstacle i at a normalised time: four numbers."""
    a, b, c, d = table[i, PLACE], table[i, PLACE + 1], table[i, PLACE + 2], table[i, PLACE + 3]
    x, y, z = time * table[i, RATE], time * table[i, RATE + 1], time * table[i, RATE + 2]
    square = x * x + y * y + z * z
    if square == 0.0:
        return a, b, c, d
    angle = np.sqrt(square)
    f = np.sin(0.5 * angle) / angle
    x, y, z, w = f * x, f * y, f * z, np.cos(0.5 * angle)
    if table[i, KIND] == _ORIENTATION:
        return (
            w * a + d * x + y * c - z * b,
            w * b + d * y + z * a - x * c,
            w * c + d * z + x * b - y * a,
            w * d - x * a - y * b - z * c,
        )
    # s + 2 w (n x s) + 2 n x (n x s)
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * p + y * r - z * q),
        b + 2.0 * (w * q + z * p - x * r),
        c + 2.0 * (w * r + x * q - y * p),
        0.0,
    )


@inlined
def _sum(table, time, x, y, z, w, soft):
    """What `potential` returns; what its caller leaves unused is never computed."""
    total = 0.0
    G0, G1, G2 = 0.0, 0.0, 0.0
    H00, H11, H22, H01, H02, H12 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    n = table.shape[0]
    # Sums over the members of the present keep-in group: weights, gradient, Hessian.
    group = -1.0
    width = min(_UNION_SHARE * soft, _UNION_MOST)
    top, weight, tau_group = -np.inf, 0.0, 0.0
    g0, g1, g2 = 0.0, 0.0, 0.0
    h00, h01, h02, h11, h12, h22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        a, b, c, d = _placed(table, i, time)
        r, tau = table[i, RADIUS], table[i, STRENGTH]
        if table[i, KIND] == _ORIENTATION:
            u = x * a + y * b + z * c + w * d
            sign = 0.5 if u >= 0.0 else -0.5
            e0 = sign * (w * a - d * x - (y * c - z * b))
            e1 = sign * (w * b - d * y - (z * a - x * c))
            e2 = sign * (w * c - d * z - (x * b - y * a))
            u = abs(u)
            sine = 2.0 * np.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
            V, V_1, V_2 = _keep_out(
                u, sine, 2.0, r, tau, table[i, RANGE_ON], table[i, RANGE_OFF], soft
            )
            p0, p1, p2, f0, f1, f2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            trace = -0.25 * u
        else:
            # y = R^T s by s - 2 w (n x s) + 2 n x (n x s)
            c0, c1, c2 = y * c - z * b, z * a - x * c, x * b - y * a
            p0 = a - 2.0 * (w * c0 - (y * c2 - z * c1))
            p1 = b - 2.0 * (w * c1 - (z * c0 - x * c2))
            p2 = c - 2.0 * (w * c2 - (x * c1 - y * c0))
            f0, f1, f2 = (
                table[i, BORESIGHT],
                table[i, BORESIGHT + 1],
                table[i, BORESIGHT + 2],
            )
            u = p0 * f0 + p1 * f1 + p2 * f2
            e0, e1, e2 = f1 * p2 - f2 * p1, f2 * p0 - f0 * p2, f0 * p1 - f1 * p0
            sine = np.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
            trace = -u
            if table[i, KIND] == _KEEP_OUT:
                V, V_1, V_2 = _keep_out(
                    u, sine, 1.0, r, tau, table[i, RANGE_ON], table[i, RANGE_OFF], soft
                )
            else:
                V, V_1, V_2 = 0.0, 0.0, 0.0
        if table[i, GROUP] < 0:
            total += V
            G0 += V_1 * e0
            G1 += V_1 * e1
            G2 += V_1 * e2
            k = V_1 * trace
            H00 += V_2 * e0 * e0 + k + V_1 * p0 * f0
            H11 += V_2 * e1 * e1 + k + V_1 * p1 * f1
            H22 += V_2 * e2 * e2 + k + V_1 * p2 * f2
            H01 += V_2 * e0 * e1 + 0.5 * V_1 * (p0 * f1 + p1 * f0)
            H02 += V_2 * e0 * e2 + 0.5 * V_1 * (p0 * f2 + p2 * f0)
            H12 += V_2 * e1 * e2 + 0.5 * V_1 * (p1 * f2 + p2 * f1)
            continue
        if table[i, GROUP] != group:
            group = table[i, GROUP]
            top, weight, tau_group = -np.inf, 0.0, 0.0
            g0, g1, g2 = 0.0, 0.0, 0.0
            h00, h01, h02, h11, h12, h22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        # Margin m = (r^2 - d^2) / (2 r) of this member, by u.
        beta = np.arctan2(sine, u)
        A_1, A_2 = _square(beta, u, sine)
        m = 0.5 * (r * r - beta * beta) / r
        m_1, m_2 = -0.5 * A_1 / r, -0.5 * A_2 / r
        # Weights of its gradient and of the square of its gradient in the group's sums.
        if soft > 0.0:
            if m > top:
                rescale = np.exp((top - m) / width)
                weight *= rescale
                g0, g1, g2 = g0 * rescale, g1 * rescale, g2 * rescale
                h00, h01, h02 = h00 * rescale, h01 * rescale, h02 * rescale
                h11, h12, h22 = h11 * rescale, h12 * rescale, h22 * rescale
                top = m
            once = np.exp((m - top) / width)
            twice = once / width
            weight += once
            tau_group = max(tau_group, tau)
        elif m > 0.0:
            once = m**3 / tau**2
            twice = 3.0 * m**2 / tau**2
            weight += once * m
        else:
            once, twice = 0.0, 0.0
        k1 = once * m_1
        k2 = once * m_2 + twice * m_1 * m_1
        g0, g1, g2 = g0 + k1 * e0, g1 + k1 * e1, g2 + k1 * e2
        h00 += k2 * e0 * e0 + k1 * (trace + p0 * f0)
        h11 += k2 * e1 * e1 + k1 * (trace + p1 * f1)
        h22 += k2 * e2 * e2 + k1 * (trace + p2 * f2)
        h01 += k2 * e0 * e1 + 0.5 * k1 * (p0 * f1 + p1 * f0)
        h02 += k2 * e0 * e2 + 0.5 * k1 * (p0 * f2 + p2 * f0)
        h12 += k2 * e1 * e2 + 0.5 * k1 * (p1 * f2 + p2 * f1)
        if i + 1 < n and table[i + 1, GROUP] == group:
            continue
        # The last member: V by the sums. `first` multiplies the sums, `second` g g^T.
        if soft > 0.0:
            M = top + width * np.log(weight)
            edge = max(M, soft)
            V_edge = tau_group / (edge * edge)
            V_M, V_MM = -2.0 * V_edge / edge, 6.0 * V_edge / (edge * edge)
            du = M - edge
            V = V_edge + du * (V_M + 0.5 * du * V_MM)
            V_M += du * V_MM
            first = V_M / weight
            second = (V_MM - V_M / width) / (weight * weight)
        elif weight > 0.0:
            V = 1.0 / np.sqrt(weight)
            first = -2.0 * V / weight
            second = 12.0 * V / (weight * weight)
        else:
            V, first, second = np.inf, 0.0, 0.0
        total += V
        G0 += first * g0
        G1 += first * g1
        G2 += first * g2
        H00 += first * h00 + second * g0 * g0
        H11 += first * h11 + second * g1 * g1
        H22 += first * h22 + second * g2 * g2
        H01 += first * h01 + second * g0 * g1
        H02 += first * h02 + second * g0 * g2
        H12 += first * h12 + second * g1 * g2
    return total, G0, G1, G2, H00, H11, H22, H01, H02, H12


@brief_kernel
def potential(table, time, x, y, z, w, soft):
    """Sum of the potentials at an attitude, with body gradient and covariant Hessian.

    Parameters
    ----------
    table : (n, 16)
        Packed obstacles.
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
    return _sum(table, time, x, y, z, w, soft)


@brief_kernel
def first_derivatives(table, time, x, y, z, w):
    """The potential and its body gradient alone: V, G0, G1, G2 as those of `potential`."""
    V, G0, G1, G2 = _sum(table, time, x, y, z, w, 0.0)[:4]
    return V, G0, G1, G2


@brief_kernel
def towards(table, i, time, x, y, z, w):
    """Distance d [rad] of an attitude to obstacle i, and the body rotation that lessens it.

    Returns
    -------
    d, and three components along the rotation (of no particular length).
    """
    a, b, c, d = _placed(table, i, time)
    if table[i, KIND] == _ORIENTATION:
        u = x * a + y * b + z * c + w * d
        sign = 1.0 if u >= 0.0 else -1.0
        e0 = sign * (w * a - d * x - (y * c - z * b))
        e1 = sign * (w * b - d * y - (z * a - x * c))
        e2 = sign * (w * c - d * z - (x * b - y * a))
        return 2.0 * np.arctan2(np.sqrt(e0 * e0 + e1 * e1 + e2 * e2), abs(u)), e0, e1, e2
    c0, c1, c2 = y * c - z * b, z * a - x * c, x * b - y * a
    p0 = a - 2.0 * (w * c0 - (y * c2 - z * c1))
    p1 = b - 2.0 * (w * c1 - (z * c0 - x * c2))
    p2 = c - 2.0 * (w * c2 - (x * c1 - y * c0))
    f0, f1, f2 = table[i, BORESIGHT], table[i, BORESIGHT + 1], table[i, BORESIGHT + 2]
    e0, e1, e2 = f1 * p2 - f2 * p1, f2 * p0 - f0 * p2, f0 * p1 - f1 * p0
    cosine = p0 * f0 + p1 * f1 + p2 * f2
    return np.arctan2(np.sqrt(e0 * e0 + e1 * e1 + e2 * e2), cosine), e0, e1, e2


@kernel
def rounding(table, crossing, times, q):
    """Potentials as stated minus those with the rounded cut locus, along intervals of a curve.

    Parameters
    ----------
    table : (n, 16)
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
    for i in range(table.shape[0]):
        r, tau = table[i, RADIUS], table[i, STRENGTH]
        for k in range(times.shape[0]):
            if not crossing[i, k]:
                continue
            for j in range(times.shape[1]):
                x, y, z, w = q[k, j]
                d = towards(table, i, times[k, j], x, y, z, w)[0]
                eta = np.pi - d
                if eta < CUT_WIDTH:
                    out[k, j] += tau / (d - r) ** 2 - tau / (np.pi - _rounded(eta * eta) - r) ** 2
    return out


@brief_kernel
def row_margins(table, time, q):
    """Margin of an attitude to each row's edge [rad], positive where allowed (n,)."""
    out = np.empty(table.shape[0])
    for i in range(table.shape[0]):
        d = towards(table, i, time, q[0], q[1], q[2], q[3])[0]
        out[i] = d - table[i, RADIUS] if table[i, GROUP] < 0.0 else table[i, RADIUS] - d
    return out


@kernel
def margins_along(table, time, q):
    """Least margin of attitudes (n, 4) to all forbidden sets at a time [rad], (n,).

    Of a keep-in group the best member counts.
    """
    out = np.empty(q.shape[0])
    n = table.shape[0]
    for k in range(q.shape[0]):
        least, inside = np.inf, -np.inf
        for i in range(n):
            d = towards(table, i, time, q[k, 0], q[k, 1], q[k, 2], q[k, 3])[0]
            if table[i, GROUP] < 0.0:
                least = min(least, d - table[i, RADIUS])
                continue
            inside = max(inside, table[i, RADIUS] - d)
            if i + 1 == n or table[i + 1, GROUP] != table[i, GROUP]:
                least = min(least, inside)
                inside = -np.inf
        out[k] = least
    return out
