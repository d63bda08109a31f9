# SPDX-License-Identifier: Apache-2.0
"""How near a boresight comes to a zone while it runs on a circle: exact, in closed form.

A boresight b that is turned about the unit axis e by an angle t has to a direction z the cosine
`A + B cos t + C sin t` with `A = (e.b)(e.z)`, `B = b.z - A`, `C = (e x b).z`. Over an arc it is
greatest at an end or, where the derivative says that the top `A + hypot(B, C)` is passed, there.
Near the edge of a zone, where a cosine tells an angle badly, angles are compared instead.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

import numpy as np

from riem_planner.geometry.vectors import cross, norm
from riem_planner.kernels import inlined

EDGE = 1e-12
"""Whatever is no further than this from a zone is in it [rad]; angles are good to 1e-15."""
_SURE = 1e-6  # of a difference of cosines: beyond it the angles differ by more than that


@inlined
def dot(a, b):
    """Inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def angle_between(a, b):
    """Angle of two vectors [rad]."""
    return np.arctan2(norm(cross(a, b)), dot(a, b))


@inlined
def outside(x, z, half_angle, cosine):
    """Whether x is clear of the zone of axis z; `cosine` is that of its half-angle."""
    difference = cosine - dot(x, z)
    if difference > _SURE or difference < -_SURE:
        return difference > 0.0
    return angle_between(x, z) - half_angle > EDGE


@inlined
def passes_top(B, C, turn, cos_turn, sin_turn):
    """Whether `B cos t + C sin t` has its maximum strictly inside (0, turn), turn < 2 pi."""
    slope = C * cos_turn - B * sin_turn
    if turn <= np.pi:
        return C > 0.0 and slope < 0.0
    return C > 0.0 or slope < 0.0


@inlined
def arc_clear(A, B, C, turn, cosine):
    """+1 or -1 where cosines tell whether an arc is clear of a zone, else 0.

    Parameters
    ----------
    A, B, C
        Of the cosine along the arc.
    turn
        Angle of the arc with its cosine and sine.
    cosine
        Of the zone's half-angle.
    """
    angle, cos_turn, sin_turn = turn
    greatest = max(A + B, A + B * cos_turn + C * sin_turn)
    if passes_top(B, C, angle, cos_turn, sin_turn):
        greatest = A + np.sqrt(B * B + C * C)
    difference = cosine - greatest
    if difference > _SURE:
        return 1
    return -1 if difference < -_SURE else 0


@inlined
def arc_outside(b, e, turn, z, half_angle):
    """Whether an arc is clear of a zone, by angles: for arcs that touch its edge or nearly do.

    Parameters
    ----------
    b, e, z : 3 numbers
        Where the boresight begins, the axis of the arc, the zone's axis; unit vectors.
    turn
        Angle of the arc with its cosine and sine.
    """
    angle, cos_turn, sin_turn = turn
    along = dot(e, b)
    side = cross(e, b)
    end = (
        along * e[0] + cos_turn * (b[0] - along * e[0]) + sin_turn * side[0],
        along * e[1] + cos_turn * (b[1] - along * e[1]) + sin_turn * side[1],
        along * e[2] + cos_turn * (b[2] - along * e[2]) + sin_turn * side[2],
    )
    least = min(angle_between(b, z), angle_between(end, z))
    B, C = dot(b, z) - along * dot(e, z), dot(side, z)
    if passes_top(B, C, angle, cos_turn, sin_turn):
        least = min(least, abs(angle_between(e, z) - angle_between(e, b)))
    return least - half_angle > EDGE


@inlined
def turn_clear(b, e, turn, z, half_angle, cosine):
    """Whether the boresight b, turned about e, keeps clear of the zone of axis z."""
    A = dot(e, b) * dot(e, z)
    told = arc_clear(A, dot(b, z) - A, dot(cross(e, b), z), turn, cosine)
    if told != 0:
        return told > 0
    return arc_outside(b, e, turn, z, half_angle)
