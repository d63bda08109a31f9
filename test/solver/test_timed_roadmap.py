# SPDX-License-Identifier: Apache-2.0
"""Doors that open later: a search in space and time."""

import numpy as np
import pytest

from riem_planner import S2, SO3, Problem, State, Zone, certify, solve
from riem_planner.geometry import so3
from riem_planner.solver.setup import set_up
from riem_planner.solver.timed_roadmap import timed_curves
from riem_planner.solver.watch import Watch


def wall(space, swing):
    """A wall of zones about the meridian x = 0, one of which swings out of it by an angle."""
    b = [1.0, 0.0, 0.0]
    zones = []
    for k in range(20):
        angle = 2.0 * np.pi * k / 20
        direction = [0.0, np.cos(angle), np.sin(angle)]
        rate = [0.0, 0.0, swing] if k == 0 else [0.0, 0.0, 0.0]
        zones.append(Zone(direction, 0.2, b, normalized_strength=0.001, rate=rate))
    start, goal = State(np.eye(3)), State(so3.exp([0.0, 0.0, 0.9 * np.pi]))
    return Problem(start, goal, 1.0, space, obstacles=tuple(zones))


@pytest.mark.parametrize("space", [S2, SO3], ids=["s2", "so3"])
def test_the_way_through_is_taken_when_it_is_open(space):
    problem = wall(space, -1.2)
    _, curves = timed_curves(set_up(problem), Watch(None, None))
    assert len(curves) >= 1
    solution = solve(problem)
    assert solution.solved
    assert certify(solution.trajectory, problem).certified


def test_a_wall_that_never_opens_has_no_way():
    assert timed_curves(set_up(wall(S2, 0.0)), Watch(None, None))[1] == []
