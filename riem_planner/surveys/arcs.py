# SPDX-License-Identifier: Apache-2.0
"""Detours in closed form: the boresight runs on a small circle, and rolls at the same pace.

Of one boresight at b_0 in the reference frame before and at b_1 after the slew, let
`d = b_1 - b_0` and `m = b_0 + b_1` be made unit, and `n = m x d`. The circles through both have
the axes `e = n cos tau + m sin tau`. With the turn phi about e that takes b_0 to b_1, in either
sense, and the roll psi that is left, in either sense, the path is

    R(s) = exp(s phi hat(e)) R_0 exp(s psi hat(b)).

Whether it is clear is exact (`screen`), how long it takes as well (`profiles`); the eigenaxis
slew is the member with psi = 0. What is left is a search over tau.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.geometry.vectors import cross, norm
from riem_planner.kernels import inlined, kernel
from riem_planner.surveys.profiles import (
    FASTEST,
    constrain,
    constrained_time,
    fastest_time,
    smooth_time,
)
from riem_planner.surveys.screen import arc_clear, arc_outside, dot

COARSE, FINE = 64, 768
"""Circles that are tried, and how many where none of those is clear."""
_HALVINGS = 12  # of the step in tau, about the best circle
_NEAREST = 1e-7  # rad; a boresight that moves less has no circle of its own


@kernel
def roll_of(frame, tau, phi):
    """Roll psi in (-pi, pi] that is left after the turn phi about the axis of tau.

    `exp(psi hat(b_0)) = exp(-phi hat(e)) R_1 R_0^T`, from the frame's quaternion of R_1 R_0^T.
    """
    h, p, x_n, x_m, x_d, w = frame
    cos_tau, sin_tau = np.cos(tau), np.sin(tau)
    cosine, sine = np.cos(0.5 * phi), np.sin(0.5 * phi)
    x_e = cos_tau * x_n + sin_tau * x_m
    x_b = p * x_m - h * x_d
    side = cos_tau * (p * x_d + h * x_m) - sin_tau * h * x_n  # x . (e x b_0)
    scalar = cosine * w + sine * x_e
    vector = cosine * x_b - sine * w * p * sin_tau + sine * side
    psi = 2.0 * np.arctan2(vector, scalar)
    if psi > np.pi:
        return psi - 2.0 * np.pi
    if psi <= -np.pi:
        return psi + 2.0 * np.pi
    return psi


@inlined
def turn_of(frame, tau):
    """Turn phi in [0, pi] about the axis of tau that takes b_0 to b_1."""
    h, p = frame[0], frame[1]
    along = p * np.sin(tau)
    return np.arctan2(2.0 * h * p * np.cos(tau), 1.0 - 2.0 * h * h - along * along)


@inlined
def axis_of(basis, tau):
    """Axis e of tau in the reference frame."""
    n, m, _ = basis
    c, s = np.cos(tau), np.sin(tau)
    return c * n[0] + s * m[0], c * n[1] + s * m[1], c * n[2] + s * m[2]


@inlined
def frame_of(first, last, between):
    """Basis n, m, d and the figures of a pair in it; the boresight moves by more than 1e-7.

    Parameters
    ----------
    first, last : 3 numbers
        b_0 and b_1.
    between : 4 numbers
        Quaternion of R_1 R_0^T.
    """
    d = (last[0] - first[0], last[1] - first[1], last[2] - first[2])
    size = norm(d)
    d = (d[0] / size, d[1] / size, d[2] / size)
    m = (last[0] + first[0], last[1] + first[1], last[2] + first[2])
    if norm(m) < 1e-9:
        # Opposite: any axis across will do.
        m = cross(d, (1.0, 0.0, 0.0)) if abs(d[0]) < 0.6 else cross(d, (0.0, 1.0, 0.0))
    along = dot(m, d)
    m = (m[0] - along * d[0], m[1] - along * d[1], m[2] - along * d[2])
    length = norm(m)
    m = (m[0] / length, m[1] / length, m[2] / length)
    n = cross(m, d)
    x = (between[0], between[1], between[2])
    h, p = 0.5 * size, dot(first, m)
    return (n, m, d), (h, p, dot(x, n), dot(x, m), dot(x, d), between[3])


@inlined
def place_zones(basis, zones, places):
    """Components of the zones' axes (k, 5) in the basis, with half-angle and cosine."""
    n, m, d = basis
    for k in range(zones.shape[0]):
        z = (zones[k, 0], zones[k, 1], zones[k, 2])
        places[k, 0], places[k, 1], places[k, 2] = dot(z, n), dot(z, m), dot(z, d)
        places[k, 3], places[k, 4] = zones[k, 3], zones[k, 4]


@kernel
def circle_clear(frame, tau, phi, places):
    """Whether the boresight keeps clear on the circle of tau, turned by phi of either sign."""
    h, p = frame[0], frame[1]
    cos_tau, sin_tau = np.cos(tau), np.sin(tau)
    sign = 1.0 if phi >= 0.0 else -1.0
    turn = (abs(phi), np.cos(phi), sign * np.sin(phi))
    for k in range(places.shape[0]):
        z_n, z_m, z_d = places[k, 0], places[k, 1], places[k, 2]
        A = p * sin_tau * (z_n * cos_tau + z_m * sin_tau)
        B = p * z_m - h * z_d - A
        C = sign * (cos_tau * (p * z_d + h * z_m) - sin_tau * h * z_n)
        told = arc_clear(A, B, C, turn, places[k, 4])
        if told == 0:
            first, axis = (0.0, p, -h), (sign * cos_tau, sign * sin_tau, 0.0)
            if arc_outside(first, axis, turn, (z_n, z_m, z_d), places[k, 3]):
                continue
        if told <= 0:
            return False
    return True


@kernel
def _time(pace, frame, tau, phi, psi):
    """Time along a path whose constants are known: K and c, or all constraints."""
    capacity, profile, body, b, rows = pace
    n, m, _ = body
    p = frame[1]
    sin_tau = np.sin(tau)
    if capacity.plain:
        along = p * sin_tau
        K = np.sqrt(max(0.0, phi * phi + psi * psi + 2.0 * phi * psi * along))
        c = abs(phi * psi) * np.sqrt(max(0.0, 1.0 - along * along))
        if profile == FASTEST:
            return fastest_time(K, c, capacity.rate, capacity.acceleration)
        return smooth_time(K, c, capacity.rate, capacity.acceleration)
    cosine = phi * np.cos(tau)
    sine = phi * sin_tau
    turn = (
        cosine * n[0] + sine * m[0],
        cosine * n[1] + sine * m[1],
        cosine * n[2] + sine * m[2],
    )
    S = constrain(capacity, turn, psi, b, rows)
    return constrained_time(profile, rows, S)


@inlined
def _least_possible(pace, frame, tau, phi, psi):
    """A time that no profile of a path can beat; cheap."""
    capacity = pace[0]
    if not capacity.plain:
        return 0.0
    K = np.sqrt(max(0.0, phi * phi + psi * psi + 2.0 * phi * psi * frame[1] * np.sin(tau)))
    return fastest_time(K, 0.0, capacity.rate, capacity.acceleration)


@kernel
def _try_circle(pace, frame, tau, backwards, places, best):
    """The better of the best path so far (time, tau, phi, psi) and those of one circle."""
    phi = turn_of(frame, tau)
    if backwards:
        phi -= 2.0 * np.pi
    psi = roll_of(frame, tau, phi)
    other = psi - 2.0 * np.pi if psi > 0.0 else psi + 2.0 * np.pi
    quick = _least_possible(pace, frame, tau, phi, psi) < best[0]
    quick_other = _least_possible(pace, frame, tau, phi, other) < best[0]
    if not (quick or quick_other):
        return best
    if not circle_clear(frame, tau, phi, places):
        return best
    if quick:
        time = _time(pace, frame, tau, phi, psi)
        if time < best[0]:
            best = (time, tau, phi, psi)
    if quick_other:
        time = _time(pace, frame, tau, phi, other)
        if time < best[0]:
            best = (time, tau, phi, other)
    return best


@kernel
def _refined(pace, frame, step, backwards, places, best):
    """The best path after a search about its tau with ever smaller steps."""
    for _ in range(_HALVINGS):
        step *= 0.5
        tau = best[1]
        best = _try_circle(pace, frame, tau + step, backwards, places, best)
        best = _try_circle(pace, frame, tau - step, backwards, places, best)
    return best


@kernel
def quickest_arc(pace, frame, places, count):
    """Least time, tau, phi and psi over `count` circles and near the best; time inf if none.

    Parameters
    ----------
    pace
        Capacity, profile, the basis n, m, d in body components, the boresight in the body, and
        room for the constraints (8, 3).
    frame
        Figures of the pair, of `frame_of`.
    places
        Zones in its basis, of `place_zones`.
    """
    step = np.pi / count
    found = (np.inf, 0.0, 0.0, 0.0)
    for backwards in (False, True):
        best = (found[0], 0.0, 0.0, 0.0)
        for i in range(count):
            tau = -0.5 * np.pi + (i + 0.5) * step
            best = _try_circle(pace, frame, tau, backwards, places, best)
        if best[0] < found[0]:
            found = _refined(pace, frame, step, backwards, places, best)
    return found
