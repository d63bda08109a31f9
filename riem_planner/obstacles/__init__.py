# SPDX-License-Identifier: Apache-2.0
"""Obstacles: what a trajectory keeps away from, or inside of.

The potential of an obstacle is `tau / (d - r)^2` with the distance d, the radius r and the
strength tau; a keep-in zone has `4 tau r^2 / (r^2 - d^2)^2`, and a group of members, each with
the sum V_k of its zones' potentials, `(sum V_k^-2)^(-1/2)`.
"""

from riem_planner.obstacles.forbidden import Forbidden
from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle, Zone

__all__ = ["Forbidden", "Obstacle", "OrientationObstacle", "Zone"]
