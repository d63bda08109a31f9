# SPDX-License-Identifier: Apache-2.0
"""The way out of a zone: the margin never falls until it is positive."""

import numpy as np
import pytest

from riem_planner import S2, SO3, Limits, OrientationObstacle, Zone
from riem_planner.escape import fall_before_exit, way_out
from riem_planner.geometry import so3
from riem_planner.obstacles import Forbidden

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
REST = np.zeros(3)
GENTLE = 1e-3


def _forbidden(*obstacles, space=SO3):
    return Forbidden(obstacles, pointing=space == S2)


def _out_zone(direction, half_angle=0.3, **more):
    return Zone(direction, half_angle, normalized_strength=0.01, **more)


def _margins(forbidden, trajectory):
    times = np.linspace(0.0, trajectory.duration, 1000)
    return forbidden.least_margin(trajectory.evaluate(times)[0], times)


def _checked(forbidden, target=0.02):
    trajectory = way_out(IDENTITY, REST, REST, forbidden, GENTLE, target).trajectory
    margins = _margins(forbidden, trajectory)
    assert margins[0] < 0.0
    assert margins[-1] >= target - 1e-3
    assert fall_before_exit(margins) < 1e-6
    assert not trajectory.angular_velocities[[0, -1]].any()
    return trajectory


@pytest.mark.parametrize("offset", [0.0, 1e-6, 0.1, 0.29])
def test_out_of_one_zone_straight_away_from_its_axis(offset):
    forbidden = _forbidden(_out_zone([1.0, offset, 0.0]))
    trajectory = _checked(forbidden)
    turn = so3.distance(np.eye(3), trajectory.evaluate(trajectory.duration)[0])
    assert turn == pytest.approx(0.3 - np.arctan(offset) + 0.02, abs=0.05)


def test_out_of_two_zones_that_overlap():
    forbidden = _forbidden(
        _out_zone([1.0, 0.15, 0.0], name="sun"), _out_zone([1.0, -0.15, 0.05], name="moon")
    )
    _checked(forbidden)


def test_back_into_a_keep_in_zone_and_group():
    single = _out_zone([0.0, 1.0, 0.0], 1.2, kind="keep_in", name="in")
    _checked(_forbidden(single))
    group = [
        _out_zone([0.0, 1.0, 0.0], 1.0, kind="keep_in", group="sensors", name="a"),
        _out_zone([0.0, 0.6, 0.8], 0.9, kind="keep_in", group="sensors", name="b"),
    ]
    _checked(_forbidden(*group))


def test_away_from_an_attitude():
    Q = so3.exp(np.array([0.0, 0.05, 0.1]))
    _checked(_forbidden(OrientationObstacle(Q, normalized_strength=0.01, radius=0.2)))


def test_without_roll_on_s2():
    forbidden = _forbidden(_out_zone([1.0, 0.1, 0.05]), space=S2)
    trajectory = _checked(forbidden)
    assert np.abs(trajectory.angular_velocities[:, 0]).max() < 1e-12


def test_begins_with_the_rate_it_comes_with():
    forbidden = _forbidden(_out_zone([1.0, 0.1, 0.0]))
    v, a = np.array([0.0, 0.01, 0.005]), np.array([1e-3, 0.0, 0.0])
    trajectory = way_out(IDENTITY, v, a, forbidden, GENTLE, 0.02).trajectory
    assert np.allclose(trajectory.angular_velocities[0], v, atol=1e-15)
    assert np.allclose(trajectory.angular_accelerations[0], a, atol=1e-15)
    assert _margins(forbidden, trajectory)[-1] >= 0.019


LIMITS = [
    Limits(rate=0.105, acceleration=0.05),
    Limits(rate=[0.05, 0.1, 0.02], acceleration=[0.01, 0.05, 0.02]),
    Limits(rate=0.1, torque=[0.02, 0.1, 0.05], inertia=np.diag([1.0, 2.0, 1.5])),
    Limits(torque=0.05, momentum=0.15, inertia=[[2.0, 0.3, 0.0], [0.3, 1.5, 0.2], [0.0, 0.2, 1.0]]),
]


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("seed", range(6))
def test_the_limits_hold_and_what_exceeds_them_is_only_reduced(limits, seed):
    rng = np.random.default_rng(seed)
    forbidden = _forbidden(_out_zone([1.0, *rng.uniform(-0.2, 0.2, 2)]))
    v = rng.normal(size=3) * (0.0 if seed == 0 else 0.05 if seed < 4 else 0.3)
    trajectory, binds = way_out(IDENTITY, v, REST, forbidden, GENTLE, 0.01, limits)
    assert binds.startswith("limits.")
    times = np.linspace(0.0, trajectory.duration, 2000)
    _, rates, accelerations = trajectory.evaluate(times)
    start = limits.used(v, REST)
    used = limits.used(rates, accelerations)
    for key, part in used.items():
        if key in ("rate", "momentum"):
            assert part <= max(1.0, start[key]) + 1e-6, key
        elif max(start.values()) < 1.0:
            assert part <= 1.0 + 1e-3, key
    assert _margins(forbidden, trajectory)[-1] > 0.0


@pytest.mark.parametrize(
    ("rate", "offset"), [(0.0, 0.0), (0.0, 0.2), (0.03, 0.1), (0.1, 0.1), (-0.1, 0.1)]
)
@pytest.mark.parametrize(("fastest", "hardest"), [(0.105, 0.05), (0.02, 0.05), (1.0, 0.01)])
def test_the_edge_is_crossed_nearly_as_soon_as_bang_coast_bang_could(
    rate, offset, fastest, hardest
):
    rate = np.clip(rate, -fastest, fastest)
    limits = Limits(rate=fastest, acceleration=hardest)
    forbidden = _forbidden(_out_zone([1.0, offset, 0.0]))
    v = np.array([0.0, 0.0, rate])
    way = way_out(IDENTITY, v, REST, forbidden, GENTLE, 0.01, limits).trajectory
    times = np.linspace(0.0, way.duration, 4000)
    margins = forbidden.least_margin(way.evaluate(times)[0], times)
    crossed = times[np.flatnonzero(margins <= 0.0)[-1]]
    # The measure: brake, then from rest to rest to 0.01 rad past the edge.
    stopped = so3.exp(v * abs(rate) / hardest / 2)
    missing = 0.01 - float(forbidden.least_margin(stopped))
    measure = abs(rate) / hardest
    if missing > 0.0:
        peak = min(fastest, np.sqrt(missing * hardest))
        measure += missing / peak + peak / hardest
    assert crossed <= 1.3 * measure


def test_without_limits_it_takes_sixteen_times_the_gentle_acceleration():
    forbidden = _forbidden(_out_zone([1.0, 0.1, 0.0]))
    way, binds = way_out(IDENTITY, [0.0, 0.02, 0.0], REST, forbidden, GENTLE, 0.02)
    _, _, a = way.evaluate(np.linspace(0.0, way.duration, 1000))
    peak = np.linalg.norm(a, axis=1).max()
    assert 8.0 * GENTLE < peak <= 16.0 * GENTLE * (1.0 + 1e-3)
    assert binds == "no limit"


def test_a_fall_counts_only_before_the_exit():
    assert fall_before_exit(np.array([-0.2, -0.1, 0.1, 0.3, 0.2])) == 0.0
    assert fall_before_exit(np.array([-0.1, -0.2, 0.1])) == pytest.approx(0.1)
    assert fall_before_exit(np.array([-0.1, 0.1, -0.2])) > 6.0
    assert fall_before_exit(np.array([0.3, 0.1, 0.2])) == 0.0
