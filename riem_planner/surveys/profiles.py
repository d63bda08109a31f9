# SPDX-License-Identifier: Apache-2.0
"""How fast a slew may be flown: the parameter s of its path over time, from 0 to 1.

A path is `R(s) = exp(s phi hat(e)) R_0 exp(s psi hat(b))`: a turn about a fixed axis e of the
reference frame and, at the same pace, a roll about the boresight b; with psi = 0 it is a slew
about a fixed axis. Its body rate is `s' p(s)` and its acceleration `s'' p + s'^2 p'` with
`p = phi R^T e + psi b`. The length `K = |p|` is constant, `p'` is orthogonal to p and has the
constant length `c = |phi psi| sqrt(1 - (e.b_0)^2)`.

**Limits w and a of the norms.** The fastest s has `K s' <= w` and
`K^2 s''^2 + c^2 s'^4 = a^2` where it speeds up or slows down. With `s' = q sqrt(a/c)` that is
the lemniscate: `q' = sqrt(a c)/K sqrt(1 - q^4)`, so a rise to q takes the time
`K / sqrt(a c) arcsl q` and covers `K / (2 c) arcsin q^2`. For c = 0 it is the trapezoid,
`2 sqrt(K/a)` or `K/w + w/a` altogether.

**Other limits.** Each is of the form `P |s''| + Q s'^2 <= 1` along the path (or, where the two
parts are orthogonal, the same of the squares), and `s' <= S`. The trapezoid of a constant s''
and a greatest s' is taken that is over first. P, Q, S are exact where psi = 0, else their
greatest values at samples of s plus what a chord of the second derivative's bound leaves out.

**Smooth.** `s = 10 u^3 - 15 u^4 + 6 u^5`, `u = t/T`: s' and s'' are 0 at both ends.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from riem_planner.geometry.vectors import cross, norm
from riem_planner.kernels import inlined, kernel

FASTEST, SMOOTH = 0, 1

SMOOTH_RATE = 15.0 / 8.0
"""Greatest s' T of the smooth profile."""
SMOOTH_ACCELERATION = 10.0 / np.sqrt(3.0)
"""Greatest |s''| T^2 of it."""

_STRAIGHT = 1e-8  # c/K below which c changes an acceleration by less than its last digit
_SAMPLES = 32  # intervals of s for limits that depend on the attitude in the body
_ROWS = 8  # constraints on s'': acceleration and torque, of the norm and of three axes
_GOLDEN = 0.6180339887498949
_SEARCH = 45  # steps of the golden section; the last bracket is 4e-10 of the first


def _series() -> tuple[float, ...]:
    """Coefficients a_k of `1 / sqrt(1 + sin^2 x) = a_0 + sum a_k cos 2 k x`."""
    x = np.arange(128) * np.pi / 128
    values = 1.0 / np.sqrt(1.0 + np.sin(x) ** 2)
    terms = [2.0 * float(np.mean(values * np.cos(2 * k * x))) for k in range(22)]
    return (0.5 * terms[0], *terms[1:])


_TERMS = _series()


class Capacity(NamedTuple):
    """What compiled code needs of limits.

    Parameters
    ----------
    plain
        Whether only norms of rate and acceleration are limited.
    rate, acceleration
        The limits of the norms, infinite where there is none.
    reciprocals : (4, 4)
        Of the limits of rate, acceleration, torque and momentum: of the norm, then per axis;
        0 where there is none.
    inertia : (3, 3)
        J [kg m^2].
    largest_moment
        Its greatest principal moment.
    """

    plain: bool
    rate: float
    acceleration: float
    reciprocals: np.ndarray
    inertia: np.ndarray
    largest_moment: float


@inlined
def lemniscate_time(q):
    """Inverse of the lemniscate's sine, arcsl q: `1 / sqrt(1 - t^4)` integrated from 0 to q."""
    x = np.arcsin(q)
    cosine = np.cos(2.0 * x)
    # Clenshaw's sum of a_k / (2 k) sin(2 k x).
    later = latest = 0.0
    for k in range(len(_TERMS) - 1, 0, -1):
        later, latest = _TERMS[k] / (2 * k) + 2.0 * cosine * later - latest, later
    return _TERMS[0] * x + later * np.sin(2.0 * x)


@kernel
def rise(K, c, rate, acceleration):
    """Square of the greatest q of the fastest profile, and whether it never levels off.

    Only for c > 0; `rate` and `acceleration` are the limits of the norms.
    """
    level = min(1.0, (rate / K) ** 2 * c / acceleration)
    half = c / K
    if half < 0.5 * np.pi and np.sin(half) <= level:
        return np.sin(half), True
    return level, False


@kernel
def fastest_time(K, c, rate, acceleration):
    """Least time [s] along a path of constants K and c, within limits of the norms."""
    if K == 0.0:
        return 0.0
    if acceleration == np.inf:
        return K / rate
    if c <= _STRAIGHT * K:
        if K * acceleration <= rate * rate:
            return 2.0 * np.sqrt(K / acceleration)
        return K / rate + rate / acceleration
    square, pointed = rise(K, c, rate, acceleration)
    time = 2.0 * K / np.sqrt(acceleration * c) * lemniscate_time(np.sqrt(square))
    if pointed:
        return time
    covered = K / c * np.arcsin(square)
    return time + (1.0 - covered) / np.sqrt(acceleration * square / c)


@kernel
def smooth_time(K, c, rate, acceleration):
    """Least duration [s] of the smooth profile, within limits of the norms.

    With `p = u (1 - u)` the squared acceleration times T^4 is
    `3600 K^2 p^2 (1 - 4 p) + 810000 c^2 p^8`, greatest at p = 1/4 or at the least root of
    `1 - 6 p + 900 (c/K)^2 p^6`.
    """
    if K == 0.0:
        return 0.0
    x = (c / K) ** 2
    p = 1.0 / 6.0
    for _ in range(60):
        step = (1.0 - 6.0 * p + 900.0 * x * p**6) / (6.0 - 5400.0 * x * p**5)
        if not (p + step < 0.25 and step > 1e-17):
            break
        p += step
    top = 3600.0 * p * p * (1.0 - 4.0 * p) + 810000.0 * x * p**8
    greatest = K * np.sqrt(max(top, 810000.0 * x * 0.25**8))
    # The last factor pays for p, which is found to 1e-9 at worst.
    return max(SMOOTH_RATE * K / rate, np.sqrt(greatest / acceleration)) * (1.0 + 1e-12)


@inlined
def _times_inertia(J, x):
    return (
        J[0, 0] * x[0] + J[0, 1] * x[1] + J[0, 2] * x[2],
        J[1, 0] * x[0] + J[1, 1] * x[1] + J[1, 2] * x[2],
        J[2, 0] * x[0] + J[2, 1] * x[1] + J[2, 2] * x[2],
    )


@inlined
def _part(row, x, more):
    """Part of a limit that x uses at most, if each of its components may be larger by `more`."""
    return max(
        row[0] * (norm(x) + more),
        max(
            row[1] * (abs(x[0]) + more),
            max(row[2] * (abs(x[1]) + more), row[3] * (abs(x[2]) + more)),
        ),
    )


@inlined
def _raise_rows(rows, first, row, x, y, more):
    """Raise the constraints of one quantity to what `x s'' + y s'^2` uses."""
    for i in range(4):
        size = norm(x) if i == 0 else abs(x[i - 1])
        side = norm(y) if i == 0 else abs(y[i - 1])
        rows[first + i, 0] = max(rows[first + i, 0], row[i] * (size + more[0]))
        rows[first + i, 1] = max(rows[first + i, 1], row[i] * (side + more[1]))


@kernel
def constrain(capacity, turn, roll, b, rows):
    """Fill the constraints P, Q, orthogonal (8, 3) of a path; returns S.

    Parameters
    ----------
    turn : 3 numbers
        `phi R_0^T e`, the turn about the fixed axis in body components.
    roll
        psi [rad], about the body axis b.
    """
    J, reciprocals, largest = capacity.inertia, capacity.reciprocals, capacity.largest_moment
    along = turn[0] * b[0] + turn[1] * b[1] + turn[2] * b[2]
    off = (turn[0] - along * b[0], turn[1] - along * b[1], turn[2] - along * b[2])
    side = cross(b, off)
    wide = norm(off)
    K = np.sqrt((along + roll) ** 2 + wide * wide)
    n = _SAMPLES if roll * wide != 0.0 else 0
    # Half the second differences that samples 1/n apart leave out, of p, p' and p x J p.
    chord = 0.125 / (n * n) if n > 0 else 0.0
    p_more = chord * roll * roll * wide
    slope_more = chord * abs(roll) ** 3 * wide
    spin_more = chord * 2.0 * roll * roll * wide * (K + wide)
    for i in range(_ROWS):
        rows[i, 0] = rows[i, 1] = rows[i, 2] = 0.0
    rows[0, 2] = 1.0
    rows[4, 2] = 1.0 if n == 0 else 0.0
    used = 0.0
    for k in range(n + 1):
        angle = roll * k / n if n > 0 else 0.0
        cosine, sine = np.cos(angle), np.sin(angle)
        p = (
            (along + roll) * b[0] + cosine * off[0] - sine * side[0],
            (along + roll) * b[1] + cosine * off[1] - sine * side[1],
            (along + roll) * b[2] + cosine * off[2] - sine * side[2],
        )
        slope = (
            -roll * (cosine * side[0] + sine * off[0]),
            -roll * (cosine * side[1] + sine * off[1]),
            -roll * (cosine * side[2] + sine * off[2]),
        )
        m, m_slope = _times_inertia(J, p), _times_inertia(J, slope)
        spin = cross(p, m)
        torque = (m_slope[0] + spin[0], m_slope[1] + spin[1], m_slope[2] + spin[2])
        used = max(used, _part(reciprocals[0], p, p_more))
        used = max(used, _part(reciprocals[3], m, largest * p_more))
        _raise_rows(rows, 0, reciprocals[1], p, slope, (p_more, slope_more))
        more = (largest * p_more, largest * (slope_more + spin_more))
        _raise_rows(rows, 4, reciprocals[2], m, torque, more)
    return 1.0 / used if used > 0.0 else np.inf


@inlined
def _acceleration_left(rows, speed):
    """Greatest |s''| that the constraints allow up to a speed s'; negative where none does."""
    least = np.inf
    for i in range(_ROWS):
        P, Q = rows[i, 0], rows[i, 1] * speed * speed
        if Q >= 1.0:
            return -1.0
        if P > 0.0:
            left = np.sqrt(1.0 - Q * Q) if rows[i, 2] != 0.0 else 1.0 - Q
            least = min(least, left / P)
    return least


@inlined
def trapezoid_time(speed, acceleration):
    """Time from s = 0 to 1 with a greatest s' and a constant |s''|."""
    if acceleration <= 0.0:
        return np.inf
    if speed * speed >= acceleration:
        return 2.0 / np.sqrt(acceleration)
    return 1.0 / speed + speed / acceleration


@kernel
def best_trapezoid(rows, S):
    """Greatest s' and constant |s''| of the trapezoid that is over first."""
    free = _acceleration_left(rows, 0.0)
    high = min(S, np.sqrt(free))
    steady = 0.0
    for i in range(_ROWS):
        steady = max(steady, rows[i, 1])
    if steady == 0.0 or high == np.inf:
        return high, free
    high = min(high, 1.0 / np.sqrt(steady))
    low = 1e-3 * high
    x, y = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    f = trapezoid_time(x, _acceleration_left(rows, x))
    g = trapezoid_time(y, _acceleration_left(rows, y))
    for _ in range(_SEARCH):
        if f <= g:
            high, y, g = y, x, f
            x = high - _GOLDEN * (high - low)
            f = trapezoid_time(x, _acceleration_left(rows, x))
        else:
            low, x, f = x, y, g
            y = low + _GOLDEN * (high - low)
            g = trapezoid_time(y, _acceleration_left(rows, y))
    return low, _acceleration_left(rows, low)


@kernel
def constrained_time(profile, rows, S):
    """Least time within constraints of a path; see `constrain`."""
    if profile == FASTEST:
        speed, acceleration = best_trapezoid(rows, S)
        return trapezoid_time(speed, acceleration)
    square = 0.0
    for i in range(_ROWS):
        P, Q = rows[i, 0] * SMOOTH_ACCELERATION, rows[i, 1] * SMOOTH_RATE**2
        square = max(square, np.sqrt(P * P + Q * Q) if rows[i, 2] != 0.0 else P + Q)
    return max(SMOOTH_RATE / S, np.sqrt(square))


TRAPEZOID, LEMNISCATE, POLYNOMIAL = 0, 1, 2


@kernel
def pace_of(capacity, profile, turn, roll, b):
    """Duration and shape of the fastest profile along one path; see `constrain`.

    Returns
    -------
    tuple
        Duration [s], TRAPEZOID, LEMNISCATE or POLYNOMIAL, and three numbers: greatest s' and s''
        of a trapezoid; `sqrt(a c) / K`, `sqrt(a/c)` and the greatest q squared of a lemniscate.
    """
    off = cross((turn[0], turn[1], turn[2]), (b[0], b[1], b[2]))
    along = turn[0] * b[0] + turn[1] * b[1] + turn[2] * b[2]
    wide = norm(off)
    K, c = np.sqrt((along + roll) ** 2 + wide * wide), abs(roll) * wide
    rows = np.empty((_ROWS, 3))
    if not capacity.plain:
        v, w = (turn[0], turn[1], turn[2]), (b[0], b[1], b[2])
        S = constrain(capacity, v, roll, w, rows)
        time = constrained_time(profile, rows, S)
        if profile != FASTEST:
            return time, POLYNOMIAL, 0.0, 0.0, 0.0
        speed, acceleration = best_trapezoid(rows, S)
        return time, TRAPEZOID, speed, acceleration, 0.0
    if profile != FASTEST:
        time = smooth_time(K, c, capacity.rate, capacity.acceleration)
        return time, POLYNOMIAL, 0.0, 0.0, 0.0
    time = fastest_time(K, c, capacity.rate, capacity.acceleration)
    if c <= _STRAIGHT * K or capacity.acceleration == np.inf:
        s_acceleration = capacity.acceleration / K
        return time, TRAPEZOID, min(capacity.rate / K, np.sqrt(s_acceleration)), s_acceleration, 0.0
    square, _ = rise(K, c, capacity.rate, capacity.acceleration)
    a = capacity.acceleration
    return time, LEMNISCATE, np.sqrt(a * c) / K, np.sqrt(a / c), square


@kernel
def lemniscate_times(q):
    """`lemniscate_time` of an array (n,)."""
    out = np.empty(q.size)
    for i in range(q.size):
        out[i] = lemniscate_time(q[i])
    return out
