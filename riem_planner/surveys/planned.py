# SPDX-License-Identifier: Apache-2.0
"""Slews that no closed form gives: planned, one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from riem_planner.limits import Limits
from riem_planner.obstacles import Zone
from riem_planner.problem import AUTO, Problem, State
from riem_planner.solve import solve
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]

_STRENGTH = 0.01  # normalised: paths keep a little off the zones and take little longer for it


def planned_slew(
    start: Array, goal: Array, zones: Array, boresights: Array, limits: Limits
) -> Trajectory | None:
    """A certified slew from rest to rest round zones within limits; None if none is found.

    Parameters
    ----------
    start, goal : (4,)
        Quaternions x, y, z, w.
    zones : (k, 5)
        Axes, half-angles [rad] and their cosines.
    boresights : (k, 3)
        The body axis that each concerns.
    """
    obstacles = tuple(
        Zone(row[:3], float(row[3]), boresight=boresight, normalized_strength=_STRENGTH)
        for row, boresight in zip(zones, boresights, strict=True)
    )
    problem = Problem(
        State.from_quaternion_xyzw(start),
        State.from_quaternion_xyzw(goal),
        AUTO,  # type: ignore[arg-type]
        obstacles=obstacles,
        limits=limits,
    )
    return solve(problem).trajectory
