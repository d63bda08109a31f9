# SPDX-License-Identifier: Apache-2.0
"""Whether zones of one boresight part two directions: decided exactly.

The union of caps parts two points outside it if and only if some closed chain of overlapping
caps crosses an arc between the points an odd number of times, each link drawn as the shorter
arc from centre to centre, which lies in the two caps. (Two caps always meet in one connected
piece, so these chains generate the first homology of the union, and Alexander duality counts
the parts of the rest.) The caps are joined one link at a time in a forest that remembers the
parity of crossings from each cap to its root; a link within a tree of the other parity closes a
wall.
"""

# Compiled: Numba finds the types.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False

from __future__ import annotations

from riem_planner.geometry.vectors import cross, norm
from riem_planner.kernels import inlined, kernel
from riem_planner.surveys.screen import angle_between, dot

_OVERLAP = 1e-12  # rad; caps that overlap by less count as apart
_DEGENERATE = 1e-11  # a triple product this small leaves open which side a point is on
_TRIES = 4  # third points for the arc from start to goal

UNDECIDED, OPEN, WALLED = -1, 0, 1


@inlined
def _side(a, b, c):
    """Sign of the triple product of a, b, c; 0 where rounding leaves it open."""
    product = dot(cross(a, b), c)
    if product > _DEGENERATE:
        return 1
    return -1 if product < -_DEGENERATE else 0


@kernel
def _crossings(a, b, c, d):
    """1 if the arcs ab and cd cross, 0 if not, -1 if rounding leaves it open."""
    first, second = _side(a, c, b), _side(c, b, d)
    third, fourth = _side(b, d, a), _side(d, a, c)
    if first * second < 0 or second * third < 0 or third * fourth < 0 or fourth * first < 0:
        return 0  # two that differ for certain
    if first == 0 or second == 0 or third == 0 or fourth == 0:
        return -1
    return 1


@inlined
def _unit(v):
    size = norm(v)
    return v[0] / size, v[1] / size, v[2] / size


@inlined
def _third_point(start, goal, attempt):
    """A point off the great circle of start and goal, no quarter turn from either if possible."""
    offsets = (0.37, -0.61, 0.83, -0.23)
    side = cross(start, goal)
    if norm(side) < 1e-3:
        side = cross(start, (0.48, 0.6, 0.64))
        if norm(side) < 1e-1:
            side = cross(start, (0.6, -0.8, 0.0))
    side = _unit(side)
    f = offsets[attempt]
    # Not halfway between opposite ends: zones like to lie in a ring there.
    middle = (
        1.3 * start[0] + goal[0],
        1.3 * start[1] + goal[1],
        1.3 * start[2] + goal[2],
    )
    ahead = cross(side, start)
    return _unit(
        (
            middle[0] + f * side[0] + 0.1 * ahead[0],
            middle[1] + f * side[1] + 0.1 * ahead[1],
            middle[2] + f * side[2] + 0.1 * ahead[2],
        )
    )


@inlined
def _link_parity(a, b, start, third, goal):
    """Parity of the crossings of a link with the arc over the third point; -1 if open."""
    if dot(a, b) < -1.0 + 1e-12:
        return -1  # antipodes: which way the link goes is open
    first, second = _crossings(a, b, start, third), _crossings(a, b, third, goal)
    if first < 0 or second < 0:
        return -1
    return first ^ second


@inlined
def _zone_axis(zones, k):
    return zones[k, 0], zones[k, 1], zones[k, 2]


@inlined
def _root(parents, parities, k):
    """Root of a cap's tree, and the parity of crossings on the way to it."""
    parity = 0
    while parents[k] != k:
        parity ^= parities[k]
        k = parents[k]
    return k, parity


@kernel
def _attempt(start, third, goal, zones, group, work):
    """WALLED, OPEN, or UNDECIDED where rounding leaves a link's crossings open."""
    parents, parities, groups = work
    for k in range(zones.shape[0]):
        parents[k], parities[k] = k, 0
    open_link = False
    for i in range(zones.shape[0]):
        for j in range(i):
            if groups[i] != group or groups[j] != group:
                continue
            a, b = _zone_axis(zones, i), _zone_axis(zones, j)
            if angle_between(a, b) > zones[i, 3] + zones[j, 3] - _OVERLAP:
                continue
            parity = _link_parity(a, b, start, third, goal)
            if parity < 0:
                open_link = True
                continue
            root_i, parity_i = _root(parents, parities, i)
            root_j, parity_j = _root(parents, parities, j)
            if root_i != root_j:
                parents[root_i], parities[root_i] = root_j, parity ^ parity_i ^ parity_j
            elif parity ^ parity_i ^ parity_j:
                return WALLED
    return UNDECIDED if open_link else OPEN


@kernel
def walled(start, goal, zones, group, work):
    """Whether zones of one boresight part two directions outside them.

    Parameters
    ----------
    start, goal : 3 numbers
        Unit vectors, clear of the zones.
    zones : (k, 5)
        Axes, half-angles [rad] and their cosines.
    group
        Of the boresight; `work` holds each zone's.
    work
        Parents (k,), parities (k,), groups (k,) of the zones.

    Returns
    -------
    int
        WALLED, OPEN, or UNDECIDED.
    """
    verdict = UNDECIDED
    for attempt in range(_TRIES):
        verdict = _attempt(start, _third_point(start, goal, attempt), goal, zones, group, work)
        if verdict != UNDECIDED:
            break
    return verdict
