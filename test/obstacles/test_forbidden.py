# SPDX-License-Identifier: Apache-2.0
"""What is forbidden is said once: margins, sets and repulsion of each kind of obstacle."""

import numpy as np
import pytest

from riem_planner import SO3, OrientationObstacle, Problem, State, Trajectory, Zone, certify
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.obstacles import Forbidden

AHEAD = [1.0, 0.0, 0.0]
SIDE = so3.exp([0.0, 0.0, 0.9])
KINDS = {
    "orientation": (OrientationObstacle(SIDE, 1.0, radius=0.3, name="here"),),
    "keep_out": (Zone(SIDE @ AHEAD, 0.3, strength=1.0, name="here"),),
    "moving": (
        Zone(so3.exp([0, 0, 0.4]) @ AHEAD, 0.3, strength=1.0, rate=[0, 0, 1.0], name="here"),
    ),
    "keep_in": (Zone(AHEAD, 0.6, strength=1.0, kind="keep_in", name="here"),),
    "group": tuple(
        Zone(d, 0.6, strength=1.0, kind="keep_in", group="here", name=name)
        for name, d in (("ahead", AHEAD), ("behind", [-1.0, 0.0, 0.0]))
    ),
}


def turn_of(angle, samples=41):
    """A slew about the third axis by an angle, within a second, at rest at both ends."""
    t = np.linspace(0.0, 1.0, samples)
    axis = np.array([0.0, 0.0, angle])
    q = so3.quaternion_exp((3 * t**2 - 2 * t**3)[:, None] * axis)
    return Trajectory(t, q, (6 * t - 6 * t**2)[:, None] * axis, (6 - 12 * t)[:, None] * axis)


def problem_of(trajectory, obstacles):
    ends = (State(R) for R in trajectory.evaluate(np.array([0.0, 1.0]))[0])
    return Problem(*ends, 1.0, SO3, obstacles=obstacles)


@pytest.mark.parametrize("kind", KINDS)
def test_extremality_is_no_number_where_a_path_enters(kind):
    entering, clear = turn_of(1.8), turn_of(0.4)
    problem = problem_of(entering, KINDS[kind])
    certificate = certify(entering, problem)
    assert min(certificate.clearance.values()) < -0.29
    assert np.isnan(certificate.extremality)
    V, F = problem.forbidden.repulsion(SIDE[None], 0.5, 1.0)
    assert V[0] == np.inf
    assert np.all(np.isnan(F))
    assert 0.0 < certify(clear, problem_of(clear, KINDS[kind])).extremality < np.inf


@pytest.mark.parametrize("kind", KINDS)
def test_margins_are_the_same_for_one_attitude_and_for_many(kind):
    forbidden = Forbidden(KINDS[kind])
    attitudes = so3.exp(np.random.default_rng(0).normal(size=(4, 5, 3)))
    times = np.linspace(0.0, 2.0, 5)
    margins = forbidden.margins(attitudes, times)
    assert list(margins) == ["here"] == list(forbidden.names)
    np.testing.assert_array_equal(forbidden.least_margin(attitudes, times), margins["here"])
    for i in range(4):
        for k in range(5):
            expected = forbidden.margins(attitudes[i, k], times[k])["here"]
            assert margins["here"][i, k] == pytest.approx(expected, abs=1e-14)


def test_nothing_is_forbidden_without_obstacles():
    forbidden = Forbidden()
    assert forbidden.margins(np.eye(3)) == {}
    np.testing.assert_array_equal(forbidden.least_margin(np.zeros((2, 3, 3)), 0.0), [np.inf] * 2)
    assert forbidden.table.shape[0] == 0
    assert not forbidden.moving


def test_of_a_group_the_best_member_counts():
    ahead, behind = KINDS["group"]
    margins = Forbidden((behind, ahead)).margins(so3.exp([[0.0, 0.0, 0.1], [0.0, 0.0, 1.5]]))
    np.testing.assert_allclose(margins["here"], [0.5, -0.9], atol=1e-15)


def test_a_problem_and_a_world_complete_obstacles_alike():
    zones = (Zone(AHEAD, 0.1, strength=1.0), Zone([0, 1, 0], 0.2, [0, 0, 1], strength=1.0))
    forbidden = Forbidden(zones, boresight=[0.0, 2.0, 0.0])
    assert [zone.name for zone in forbidden.obstacles] == ["0", "1"]
    np.testing.assert_array_equal(forbidden.obstacles[0].boresight, [0.0, 1.0, 0.0])
    assert zones[0].name is None
    state = State(np.eye(3))
    problem = Problem(state, state, 1.0, obstacles=zones, boresight=[0.0, 2.0, 0.0])
    np.testing.assert_array_equal(problem.forbidden.table, forbidden.table)


def test_what_is_no_obstacle_is_refused():
    with pytest.raises(InvalidProblemError, match=r"obstacles\[0\]: expected .* got str"):
        Forbidden(("sun",))
    with pytest.raises(InvalidProblemError, match="depend on the roll"):
        Forbidden(KINDS["orientation"], pointing=True)
    with pytest.raises(InvalidProblemError, match="used twice"):
        Forbidden(KINDS["keep_out"] * 2)


def test_normalised_rows_hold_what_was_stated():
    zone = Zone(AHEAD, 0.1, normalized_strength=0.01, rate=[0.0, 0.0, 1e-3])
    row = Forbidden((zone,)).normalised_table(60.0)[0]
    stated = Forbidden((Zone(AHEAD, 0.1, strength=0.01 / 60.0**4, rate=[0.0, 0.0, 1e-3]),))
    assert 0.01 in row
    np.testing.assert_allclose(row, stated.normalised_table(60.0)[0], rtol=1e-15)
