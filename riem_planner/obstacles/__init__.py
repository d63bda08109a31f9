"""Obstacles: what a trajectory keeps away from, or inside of.

The potential of an obstacle is `tau / (d - r)^2` with the distance d, the radius r and the
strength tau; a keep-in zone has `4 tau r^2 / (r^2 - d^2)^2`, and a keep-in group
`(sum m_i^4 / tau_i^2)^(-1/2)` with `m_i = max(0, (r_i^2 - d_i^2) / (2 r_i))`.
"""

from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle, Zone
from riem_planner.obstacles.table import ObstacleTable, obstacle_table

__all__ = ["Obstacle", "ObstacleTable", "OrientationObstacle", "Zone", "obstacle_table"]
