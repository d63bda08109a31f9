# SPDX-License-Identifier: Apache-2.0
"""What a slew has to meet at its end, by the kind of its goal.

A goal is an array: quaternion and body rate (7,); behind them, where the roll about e3 is free,
the nodes of the hold, six numbers each: the attitude of the hold at the goal's own roll
(quaternion), its normalised time, its weight in the cost. Without a hold there is one node of
weight 0.

With d the direction of e3 at the goal and w its angular velocity in the reference frame, a free
end meets (goals, transversality)

    R e3 = d,    v = R' w,    e3 . (m + v' x v) + dJ_h = 0,    m = sigma v - v'',

where J_h is the cost of the hold, which the roll alone decides.
"""

from __future__ import annotations

import numpy as np

from riem_planner.geometry.quaternions import ratio, relative, rotated, tilt, turn
from riem_planner.kernels import brief_kernel, inlined
from riem_planner.obstacles.potential import potential

FIXED = 7
"""Numbers of a goal whose roll is not free."""
NODE = 6
"""Numbers of a node of the hold: quaternion, time, weight."""


@inlined
def arrival_rate(goal, q):
    """Body rate that the goal asks for at an attitude q of its own set."""
    to_goal = np.empty(4)
    ratio(q, goal, to_goal)
    return rotated(to_goal, goal[4], goal[5], goal[6])


@inlined
def hold_terms(table, goal, q):
    """Cost of the hold after an arrival at q, with both derivatives by a roll about e3."""
    cost, slope, curvature = 0.0, 0.0, 0.0
    to_goal, roll, held = np.empty(4), np.zeros(3), np.empty(4)
    ratio(q, goal, to_goal)
    roll[2] = -2.0 * np.arctan2(to_goal[2], to_goal[3])
    for k in range(FIXED, goal.size, NODE):
        weight = goal[k + 5]
        if weight > 0.0:
            turn(goal[k : k + 4], roll, 1.0, held)
            V, _, _, g2, _, _, h22, _, _, _ = potential(
                table, goal[k + 4], held[0], held[1], held[2], held[3], 0.0
            )
            cost += 0.5 * weight * V
            slope += 0.5 * weight * g2
            curvature += 0.5 * weight * h22
    return cost, slope, curvature


@brief_kernel
def hold_cost(table, goal, q):
    """Cost of the hold after an arrival at q (4,), by the nodes that a goal has."""
    return hold_terms(table, goal, q)[0]


@brief_kernel
def settled(goal, q):
    """The goal (7,) with the roll of an attitude q (4,) that meets it."""
    out = np.empty(FIXED)
    for i in range(4):
        out[i] = q[i]
    out[4], out[5], out[6] = arrival_rate(goal, q)
    return out


@inlined
def goal_conditions(pointing, table, sigma, end, goal, G, g):
    """Rows G of the last perturbation and right-hand side g that meet the goal; from zeros."""
    if pointing:
        _meet_direction(end, goal, G, g)
    elif goal.size > FIXED:
        _meet_free_roll(table, sigma, end, goal, G, g)
    else:
        _meet_attitude(end, goal, G, g)


@inlined
def _meet_attitude(end, goal, G, g):
    error = np.empty(3)
    relative(end, goal, error)
    for i in range(3):
        G[i, i], g[i] = 1.0, error[i]
        G[3 + i, 3 + i], g[3 + i] = 1.0, goal[4 + i] - end[4 + i]


@inlined
def _point(to_goal, G, g):
    """Rows 0 and 1: e3, which a turn by delta moves by (delta_2, -delta_1, 0), on its direction."""
    G[0, 1], G[1, 0] = 1.0, -1.0
    g[0], g[1] = tilt(to_goal)


@inlined
def _meet_direction(end, goal, G, g):
    # The goal's direction in body components of the last attitude.
    to_goal = np.empty(4)
    ratio(end, goal, to_goal)
    _point(to_goal, G, g)
    # The direction's velocity at the goal, in the body components of the last attitude, is
    # to be v x e3 = (v_1, -v_0, 0); a turn by delta changes it by -delta x u.
    u0, u1, u2 = rotated(to_goal, goal[5], -goal[4], 0.0)
    G[2, 3], G[2, 2], G[2, 0], g[2] = 1.0, -u0, u2, -u1 - end[4]
    G[3, 4], G[3, 2], G[3, 1], g[3] = 1.0, -u1, u2, u0 - end[5]


@inlined
def _meet_free_roll(table, sigma, end, goal, G, g):
    to_goal = np.empty(4)
    ratio(end, goal, to_goal)
    _point(to_goal, G, g)
    # v = u with u = R' w, which a turn by delta changes by -delta x u.
    u0, u1, u2 = rotated(to_goal, goal[4], goal[5], goal[6])
    v0, v1, v2, a0, a1, j2 = end[4], end[5], end[6], end[7], end[8], end[12]
    G[2, 3], G[2, 1], G[2, 2], g[2] = 1.0, u2, -u1, u0 - v0
    G[3, 4], G[3, 2], G[3, 0], g[3] = 1.0, u0, -u2, u1 - v1
    G[4, 5], G[4, 0], G[4, 1], g[4] = 1.0, u1, -u0, u2 - v2
    # e3 . (sigma v - j + a x v) + dJ_h = 0
    _, slope, curvature = hold_terms(table, goal, end)
    G[5, 5], G[5, 11], G[5, 2] = sigma, -1.0, curvature
    G[5, 6], G[5, 4], G[5, 7], G[5, 3] = v1, a0, -v0, -a1
    g[5] = -(sigma * v2 - j2 + a0 * v1 - a1 * v0 + slope)
