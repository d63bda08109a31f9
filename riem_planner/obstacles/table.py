"""Obstacles as arrays in normalised time, the form that compiled code reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.obstacles.kinds import OrientationObstacle, Zone

if TYPE_CHECKING:
    from riem_planner.problem import Problem

Array = NDArray[np.float64]

ORIENTATION, KEEP_OUT, KEEP_IN = 0, 1, 2


class ObstacleTable(NamedTuple):
    """n obstacles in normalised time s = t / T; keep-in zones last, group by group.

    Attributes
    ----------
    kind : (n,)
        ORIENTATION, KEEP_OUT or KEEP_IN.
    place : (n, 4)
        Quaternion x, y, z, w of an attitude, or a unit vector and 0, at s = 0.
    boresight : (n, 3)
        Body axis of a zone.
    rate : (n, 3)
        Angular velocity in the reference frame [rad per unit of s].
    radius : (n,)
        [rad].
    strength : (n,)
        `tau T^4`.
    range_on, range_off : (n,)
        Taper [rad]; infinite where there is none.
    group : (n,)
        Index of the keep-in group, -1 for what is kept out.
    """

    kind: NDArray[np.int64]
    place: Array
    boresight: Array
    rate: Array
    radius: Array
    strength: Array
    range_on: Array
    range_off: Array
    group: NDArray[np.int64]


def obstacle_table(problem: Problem) -> tuple[ObstacleTable, list[str]]:
    """Table of a problem's obstacles, and the name of each row's forbidden set.

    The name is the obstacle's, or its group's: rows of one group share it.
    """
    n = len(problem.obstacles)
    T = problem.duration
    table = ObstacleTable(
        kind=np.zeros(n, dtype=np.int64),
        place=np.zeros((n, 4)),
        boresight=np.zeros((n, 3)),
        rate=np.zeros((n, 3)),
        radius=np.zeros(n),
        strength=np.zeros(n),
        range_on=np.full(n, np.inf),
        range_off=np.full(n, np.inf),
        group=np.full(n, -1, dtype=np.int64),
    )
    names: list[str] = []
    groups: dict[str, int] = {}

    def set_name(obstacle: OrientationObstacle | Zone) -> str:
        group = obstacle.group if isinstance(obstacle, Zone) else None
        return group if group is not None else str(obstacle.name)

    def order(obstacle: OrientationObstacle | Zone) -> int:
        if obstacle.kind != "keep_in":
            return -1
        return groups.setdefault(set_name(obstacle), len(groups))

    for row, obstacle in enumerate(sorted(problem.obstacles, key=order)):
        if isinstance(obstacle, OrientationObstacle):
            table.place[row] = so3.matrix_to_quaternion(obstacle.orientation)
        else:
            table.kind[row] = KEEP_OUT if obstacle.kind == "keep_out" else KEEP_IN
            table.place[row, :3] = obstacle.direction
            table.boresight[row] = obstacle.boresight
            table.group[row] = order(obstacle)
        table.rate[row] = obstacle.rate * T
        table.radius[row] = obstacle.radius
        table.strength[row] = problem.strength_of(obstacle) * T**4
        if obstacle.range is not None:
            table.range_on[row], table.range_off[row] = obstacle.range
        names.append(set_name(obstacle))
    return table, names


KIND, PLACE, BORESIGHT, RATE, RADIUS, STRENGTH, RANGE_ON, RANGE_OFF, GROUP = (
    0, 1, 5, 8, 11, 12, 13, 14, 15,
)  # fmt: skip
"""First column of each quantity in a packed table."""


def packed(table: ObstacleTable) -> Array:
    """The table as one array (n, 16), which compiled code reads without reference counts."""
    rows = np.empty((table.kind.size, 16))
    first = (KIND, PLACE, BORESIGHT, RATE, RADIUS, STRENGTH, RANGE_ON, RANGE_OFF, GROUP, 16)
    for column, begin, end in zip(table, first[:-1], first[1:], strict=True):
        rows[:, begin:end] = column.reshape(-1, end - begin)
    return rows
