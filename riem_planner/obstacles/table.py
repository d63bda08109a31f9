"""Obstacles as one array, the form that compiled code reads: a row each.

| columns | quantity |
|---|---|
| KIND | ORIENTATION, KEEP_OUT or KEEP_IN |
| PLACE | quaternion x, y, z, w of an attitude, or a unit vector and 0, at time 0 |
| BORESIGHT | body axis of a zone |
| RATE | angular velocity in the reference frame |
| RADIUS | [rad] |
| STRENGTH | tau; 0 where only places count |
| RANGE_ON, RANGE_OFF | taper [rad]; infinite where there is none |
| GROUP | number of the keep-in group, -1 for what is kept out |

Keep-in zones come last, group by group. Times are in seconds, or in units of a duration.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle

Array = NDArray[np.float64]

ORIENTATION, KEEP_OUT, KEEP_IN = 0, 1, 2

KIND, PLACE, BORESIGHT, RATE, RADIUS, STRENGTH, RANGE_ON, RANGE_OFF, GROUP, WIDTH = (
    0, 1, 5, 8, 11, 12, 13, 14, 15, 16,
)  # fmt: skip
"""First column of each quantity, and the number of columns."""

_KINDS = {"keep_out": KEEP_OUT, "keep_in": KEEP_IN}


def packed(obstacles: Sequence[tuple[Obstacle, int]]) -> Array:
    """Rows (n, WIDTH) of obstacles, each with its group, in seconds and without strengths."""
    rows = np.zeros((len(obstacles), WIDTH))
    rows[:, RANGE_ON : RANGE_OFF + 1] = np.inf
    for row, (obstacle, group) in zip(rows, obstacles, strict=True):
        if isinstance(obstacle, OrientationObstacle):
            row[PLACE : PLACE + 4] = so3.matrix_to_quaternion(obstacle.orientation)
        else:
            row[KIND] = _KINDS[obstacle.kind]
            row[PLACE : PLACE + 3] = obstacle.direction
            row[BORESIGHT : BORESIGHT + 3] = obstacle.boresight
        row[RATE : RATE + 3] = obstacle.rate
        row[RADIUS] = obstacle.radius
        if obstacle.range is not None:
            row[RANGE_ON], row[RANGE_OFF] = obstacle.range
        row[GROUP] = group
    return rows


def normalised(rows: Array, strengths: Sequence[float], duration: float) -> Array:
    """The same rows in units of a duration [s], with strengths `tau T^4` (n,)."""
    scaled = rows.copy()
    scaled[:, RATE : RATE + 3] *= duration
    scaled[:, STRENGTH] = strengths
    return scaled
