"""Obstacles: what a trajectory keeps away from, or inside of.

The potential of an obstacle is `tau / (d - r)^2` with the distance d, the radius r and the
strength tau; a keep-in zone has `4 tau r^2 / (r^2 - d^2)^2`, and a keep-in group
`(sum m_i^4 / tau_i^2)^(-1/2)` with `m_i = max(0, (r_i^2 - d_i^2) / (2 r_i))`.
"""

from riem_planner.obstacles.forbidden import Forbidden
from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle, Zone

__all__ = ["Forbidden", "Obstacle", "OrientationObstacle", "Zone"]
