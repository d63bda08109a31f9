# SPDX-License-Identifier: Apache-2.0
"""The straight slew: what a planner that knows no zones would fly; for comparison only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from riem_planner.geometry import so3
from riem_planner.problem import S2, Problem
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]


def straight_slew(problem: Problem, samples: int = 201, end: Array | None = None) -> Trajectory:
    """Shortest rotation from start to goal, from rest to rest.

    About one axis, by the angle `theta (3 s^2 - 2 s^3)` with `s = t / T`: the extremal of the
    problem without obstacles and tension between states of rest. On S^2, and where the
    roll at the end is free, the shortest way of the boresight.

    Parameters
    ----------
    problem
        Its end attitudes and its duration count; rates and obstacles do not.
    samples
        Number of evenly spaced samples.
    end : (3, 3)
        Attitude that the planned slew ends in: of several goals the nearest is taken.
    """
    q = problem.start.quaternion_xyzw
    axis = problem.boresight if problem.space == S2 else problem.roll_axis
    arrival = problem.shown_arrival(end)
    if axis is not None:
        ends = (state.orientation @ axis for state in (problem.start, arrival))
        turn_reference = so3.quaternion_log(so3.minimal_rotation(*ends))
        turn = problem.start.orientation.T @ turn_reference
    else:
        turn = so3.quaternion_log(
            so3.quaternion_multiply(so3.quaternion_conjugate(q), arrival.quaternion_xyzw)
        )
    T = problem.duration
    s = np.linspace(0.0, 1.0, samples)[:, None]
    quaternions = so3.quaternion_multiply(q, so3.quaternion_exp(turn * s**2 * (3.0 - 2.0 * s)))
    rates = turn * 6.0 * s * (1.0 - s) / T
    accelerations = turn * (6.0 - 12.0 * s) / T**2
    return Trajectory(T * s[:, 0], quaternions, rates, accelerations)
