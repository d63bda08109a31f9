# SPDX-License-Identifier: Apache-2.0
"""What is forbidden as one array, the form that compiled code reads.

Its first rows are obstacles, set after set and member after member; a zone that is active in
several windows of time has a row for each.

| columns | quantity |
|---|---|
| KIND | ORIENTATION, KEEP_OUT or KEEP_IN |
| PLACE | quaternion x, y, z, w of an attitude, or a unit vector and 0, at time 0 |
| BORESIGHT | body axis of a zone |
| RATE | angular velocity in the reference frame |
| RADIUS | [rad]; of one that changes, the greatest |
| STRENGTH | tau; 0 where only places count |
| RANGE_ON, RANGE_OFF | taper [rad]; infinite where there is none |
| GROUP | number of its set where that has several members, -1 for what is simply kept |
| SET, MEMBER | number of its set, and of its member in it |
| FROM, UNTIL | when it exists; without limits where infinite |
| SPEED | greatest angular speed of its place |
| PATH, PIECES | first row and number of the pieces of its path; -1 and 0 where it has none |
| COUNT | number of obstacle rows |

The rows behind are pieces of paths, in which a direction is `p / |p|` with the cubic
`p = sum_m c_m (t - BEGIN)^m`: BEGIN, four coefficients each (lowest first) of the components of p
from column CUBICS on, and of the radius behind them.

Times are in seconds, or in units of a duration.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path
from riem_planner.obstacles.kinds import Obstacle, OrientationObstacle, Zone

Array = NDArray[np.float64]

ORIENTATION, KEEP_OUT, KEEP_IN = 0, 1, 2

KIND, PLACE, BORESIGHT, RATE, RADIUS, STRENGTH, RANGE_ON, RANGE_OFF, GROUP = (
    0, 1, 5, 8, 11, 12, 13, 14, 15,
)  # fmt: skip
SET, MEMBER, FROM, UNTIL, SPEED, PATH, PIECES, COUNT, WIDTH = range(16, 25)
"""First column of each quantity, and the number of columns."""

BEGIN, CUBICS = 0, 1
"""First columns of a piece of a path."""
_ORDER = 4  # coefficients of a cubic
_PIECE = CUBICS + 4 * _ORDER

_KINDS = {"keep_out": KEEP_OUT, "keep_in": KEEP_IN}


class Row(NamedTuple):
    """One obstacle in one window of time, with the numbers of its set, member and group."""

    obstacle: Obstacle
    window: tuple[float, float]
    set: int
    member: int
    group: int


def packed(rows: Sequence[Row]) -> Array:
    """The table (n, WIDTH) of obstacles, in seconds and without strengths."""
    table = np.zeros((len(rows), WIDTH))
    table[:, RANGE_ON : RANGE_OFF + 1] = np.inf
    table[:, PATH] = -1.0
    table[:, COUNT] = len(rows)
    pieces: list[Array] = []
    known: dict[int, tuple[int, int]] = {}  # an obstacle's path, whatever its windows
    for row, (obstacle, window, *numbers) in zip(table, rows, strict=True):
        row[SET], row[MEMBER], row[GROUP] = numbers
        row[FROM], row[UNTIL] = window
        row[RATE : RATE + 3] = obstacle.rate
        row[SPEED] = obstacle.greatest_speed
        row[RADIUS] = obstacle.radius
        if obstacle.range is not None:
            row[RANGE_ON], row[RANGE_OFF] = obstacle.range
        if isinstance(obstacle, OrientationObstacle):
            row[PLACE : PLACE + 4] = so3.matrix_to_quaternion(obstacle.orientation)
            continue
        row[KIND] = _KINDS[obstacle.kind]
        row[BORESIGHT : BORESIGHT + 3] = obstacle.boresight
        if not isinstance(obstacle.direction, Path):
            row[PLACE : PLACE + 3] = np.asarray(obstacle.direction)
            continue
        if id(obstacle) not in known:
            first = len(rows) + sum(len(each) for each in pieces)
            pieces.append(_pieces(obstacle, obstacle.direction))
            known[id(obstacle)] = (first, len(pieces[-1]))
        row[PATH], row[PIECES] = known[id(obstacle)]
    return np.concatenate([table, *pieces])


def _pieces(zone: Zone, path: Path) -> Array:
    """Rows of the pieces of a zone's path and size."""
    count = path.times.size - 1
    rows = np.zeros((count, WIDTH))
    rows[:, BEGIN] = path.times[:-1]
    cubics = rows[:, CUBICS:_PIECE].reshape(count, 4, _ORDER)
    cubics[:, :3] = np.swapaxes(path.coefficients, 1, 2)
    cubics[:, 3] = zone.size_coefficients
    rows[:, CUBICS:_PIECE] = cubics.reshape(count, -1)
    return rows


def obstacle_rows(table: Array) -> Array:
    """The rows of a table that are obstacles, not pieces of paths; a view."""
    return table[: int(table[0, COUNT])] if table.shape[0] else table


def normalised(table: Array, strengths: Sequence[float], duration: float) -> Array:
    """The same table in units of a duration [s], with strengths `tau T^4`, one an obstacle row."""
    scaled = table.copy()
    obstacles = obstacle_rows(scaled)
    obstacles[:, RATE : RATE + 3] *= duration
    obstacles[:, SPEED] *= duration
    obstacles[:, FROM : UNTIL + 1] /= duration
    obstacles[:, STRENGTH] = strengths
    pieces = scaled[len(obstacles) :]
    pieces[:, BEGIN] /= duration
    pieces[:, CUBICS:_PIECE] *= np.tile(duration ** np.arange(float(_ORDER)), 4)
    return scaled


def depends_on_time(table: Array) -> bool:
    """Whether a place, a size or the existence of an obstacle changes with time."""
    obstacles = obstacle_rows(table)
    moving = np.any(obstacles[:, SPEED] > 0.0) or np.any(obstacles[:, PATH] >= 0.0)
    return bool(moving or edges(table).size)


def edges(table: Array) -> Array:
    """Times (m,) at which obstacles begin or cease to exist; there the potential jumps."""
    limits = np.unique(obstacle_rows(table)[:, FROM : UNTIL + 1])
    return np.asarray(limits[np.isfinite(limits)])


def breaks(table: Array) -> Array:
    """Times (m,) between which all that is forbidden moves smoothly, edges included."""
    return np.union1d(edges(table), table[len(obstacle_rows(table)) :, BEGIN])
