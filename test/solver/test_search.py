# SPDX-License-Identifier: Apache-2.0
"""What coarse nodes hide from the search."""

import numpy as np
import pytest

from riem_planner import SO3, Problem, State, Zone
from riem_planner.geometry import so3
from riem_planner.solver.curves import coarseness
from riem_planner.solver.setup import set_up


def _seen(half_angle, nodes):
    """A turn of the x axis by 2 rad over a zone about its middle."""
    at_rest = State(np.eye(3))
    zone = Zone([1.0, 0.0, 0.0], half_angle, [1.0, 0.0, 0.0], strength=1.0)
    setup = set_up(Problem(at_rest, at_rest, 1.0, SO3, obstacles=(zone,)))
    angles = np.linspace(-1.0, 1.0, nodes)
    q = so3.quaternion_exp(np.outer(angles, [0.0, 0.0, 1.0]))
    return coarseness(setup.table, np.linspace(0.0, 1.0, nodes), q)


def test_a_leap_over_an_obstacle_between_nodes_is_seen_with_its_depth():
    ratio, depth = _seen(0.15, 4)  # nodes 1/3 rad to either side of the zone's middle
    assert ratio > 1.0
    assert depth == pytest.approx(0.15, abs=1e-6)


def test_enough_nodes_clear_of_the_obstacle_leave_nothing_hidden():
    _, depth = _seen(0.15, 41)
    assert depth == pytest.approx(0.15, abs=1e-6)  # nodes inside it count as well
    at_rest = State(np.eye(3))
    zone = Zone([0.0, 0.0, 1.0], 0.5, [1.0, 0.0, 0.0], strength=1.0)
    setup = set_up(Problem(at_rest, at_rest, 1.0, SO3, obstacles=(zone,)))
    q = so3.quaternion_exp(np.outer(np.linspace(-1.0, 1.0, 41), [0.0, 0.0, 1.0]))
    ratio, depth = coarseness(setup.table, np.linspace(0.0, 1.0, 41), q)
    assert ratio == pytest.approx(0.05 / (np.pi / 2 - 0.5), rel=1e-6)
    assert depth == 0.0
