# SPDX-License-Identifier: Apache-2.0
"""Certified bounds hold between any samples, and are tight."""

import math
import time

import numpy as np
import pytest
from curves import problem_of, random_curve, random_quaternion, slew

from riem_planner import OrientationObstacle, Trajectory, Zone, certify
from riem_planner.certificate import certify_clearance, clearance_along
from riem_planner.certificate.distance_bounds import LEAST_TIGHTNESS, RELATIVE_TIGHTNESS, TIGHTNESS
from riem_planner.geometry import so3


def random_obstacles(rng, moving):
    def common():
        return {"strength": 1.0, "rate": moving * rng.normal(size=3)}

    def places():
        return rng.normal(size=3), rng.uniform(0.05, 0.5), rng.normal(size=3)

    zones = [Zone(*places(), name=f"z{i}", **common()) for i in range(2)]
    members = [
        Zone(
            rng.normal(size=3),
            rng.uniform(0.8, 2.5),
            rng.normal(size=3),
            group="g",
            kind="keep_in",
            **common(),
        )
        for _ in range(3)
    ]
    attitude = OrientationObstacle(
        so3.quaternion_to_matrix(random_quaternion(rng)), radius=0.2, name="q", **common()
    )
    alone = Zone(rng.normal(size=3), 2.8, rng.normal(size=3), name="k", kind="keep_in", **common())
    return (*members[:1], zones[0], attitude, *members[1:], alone, zones[1])


def sampled_margins(trajectory, problem, times, since=0.0):
    return clearance_along(trajectory, problem, times, from_time=since)


def slack(least):
    if least <= 0.0:
        return TIGHTNESS
    return max(LEAST_TIGHTNESS, min(TIGHTNESS, RELATIVE_TIGHTNESS * least))


@pytest.mark.parametrize("seed", range(10))
def test_clearance_is_a_lower_bound_and_tight(seed):
    rng = np.random.default_rng(seed)
    for trial in range(30):
        samples = (51, 2, 7, int(rng.integers(2, 120)))[trial % 4]
        trajectory = random_curve(rng, samples)
        problem = problem_of(trajectory, random_obstacles(rng, 0.04 * (trial % 2)))
        certificate = certify(trajectory, problem)
        times = np.linspace(0.0, trajectory.duration, 2001)
        margins = sampled_margins(trajectory, problem, times)
        fastest = np.max(np.linalg.norm(trajectory.evaluate(times)[1], axis=1))
        assert certificate.clearance.keys() == margins.keys()
        assert fastest <= certificate.rate_bound * (1.0 + 1e-14)
        # Of one interval over a whole slew |xi'| is a coarse bound.
        assert certificate.rate_bound <= fastest * (1.15 if samples == 2 else 1.01)
        for name, margin in margins.items():
            least, bound = margin.min(), certificate.clearance[name]
            # Sampling itself may miss the least distance by this much.
            missed = 0.5 * (certificate.rate_bound + 0.2) * times[1]
            assert bound <= least
            assert bound >= least - slack(least - missed) - missed - 2e-12
            # At the time named, the margin is the least one to within the same.
            t = certificate.least_clearance_times[name]
            there = sampled_margins(trajectory, problem, np.array([t]))[name][0]
            assert there == pytest.approx(bound, abs=slack(bound) * 1.02 + 2e-12)


def test_the_bound_is_tight_to_the_last_interval_for_one_smooth_margin():
    # Without kinks the least sampled margin is exact to second order in the step.
    rng = np.random.default_rng(3)
    for _ in range(20):
        trajectory = random_curve(rng, 31)
        zone = Zone(rng.normal(size=3), 0.01, rng.normal(size=3), strength=1.0, name="z")
        problem = problem_of(trajectory, (zone,))
        times = np.linspace(0.0, trajectory.duration, 20001)
        least = sampled_margins(trajectory, problem, times)["z"].min()
        if least > 0.05:
            bound = certify(trajectory, problem).clearance["z"]
            assert least - slack(least) - 1e-7 <= bound <= least


@pytest.mark.parametrize(
    ("half_angle", "distance"),
    [(0.5, 1e-3), (0.5, 1e-6), (0.5, 1e-8), (1e-4, 1e-6), (1e-4, 1e-8)],
)
def test_a_zone_grazed_is_told_from_one_touched(distance, half_angle):
    # The boresight x sweeps the equator; the zone's edge is a hair beside it, between samples.
    trajectory = slew(samples=14)

    def grazing(by):
        height = half_angle + by
        longitude = 0.777
        axis = [
            math.cos(height) * math.cos(longitude),
            math.cos(height) * math.sin(longitude),
            math.sin(height),
        ]
        zone = Zone(axis, half_angle, [1, 0, 0], strength=1.0, name="edge")
        return certify(trajectory, problem_of(trajectory, (zone,)))

    beside = grazing(distance)
    assert beside.certified
    assert 0.9 * distance - 1e-9 <= beside.clearance["edge"] <= distance
    across = grazing(-distance)
    assert not across.certified
    assert "enters the zone by" in across.reasons[0]
    assert across.clearance["edge"] <= -distance


def test_what_is_within_rounding_of_a_zone_is_not_certified():
    trajectory = slew(samples=14)
    height = 0.5 + 1e-13
    axis = [math.cos(height), 0.0, math.sin(height)]
    turned = so3.exp([0.0, 0.0, 0.777]) @ axis
    zone = Zone(turned, 0.5, [1, 0, 0], strength=1.0, name="edge")
    certificate = certify(trajectory, problem_of(trajectory, (zone,)))
    assert not certificate.certified
    assert "no clearance can be proven" in certificate.reasons[0]


def test_a_path_along_the_edge_of_a_zone_is_bounded_without_much_work():
    # Constant distance: no interval can be dismissed.
    trajectory = slew(angle=3.0, samples=51)
    axis = [0.0, 0.0, 1.0]
    zone = Zone(axis, math.pi / 2 - 1e-5, [1, 0, 0], strength=1.0, name="edge")
    begin = time.perf_counter()
    certificate = certify(trajectory, problem_of(trajectory, (zone,)))
    assert time.perf_counter() - begin < 0.5
    assert 0.99e-5 - 2e-12 <= certificate.clearance["edge"] <= 1e-5


def test_distances_up_to_half_a_turn_are_bounded():
    # Through the antipode of a direction, and the cut locus of an attitude, both kinks.
    trajectory = slew(angle=2.0, samples=15)
    middle = trajectory.evaluate(4.567)[0]
    obstacles = (
        Zone(-middle[:, 0], 0.3, [1, 0, 0], strength=1.0, name="behind"),
        OrientationObstacle(middle @ so3.exp([math.pi, 0.0, 0.0]), strength=1.0, name="far"),
        Zone(middle[:, 0], 3.0, [1, 0, 0], strength=1.0, kind="keep_in", name="centre"),
        Zone(-middle[:, 0], 3.141, [1, 0, 0], strength=1.0, kind="keep_in", name="edge"),
    )
    problem = problem_of(trajectory, obstacles)
    certificate = certify(trajectory, problem)
    times = np.linspace(0.0, 10.0, 5001)
    for name, margin in sampled_margins(trajectory, problem, times).items():
        least = margin.min()
        assert least - 1e-4 - 3e-4 <= certificate.clearance[name] <= least
    assert not certificate.certified
    assert "edge" in certificate.reasons[0]


def test_a_moving_zone_is_met_where_it_is_when_the_path_is_there():
    trajectory = slew(samples=21)
    crossing = trajectory.evaluate(6.3)[0][:, 0]
    rate = np.array([0.05, 0.11, -0.2])
    start = so3.exp(-6.3 * rate) @ crossing
    moving = Zone(start, 1e-4, [1, 0, 0], strength=1.0, rate=rate, name="moon")
    certificate = certify(trajectory, problem_of(trajectory, (moving,)))
    assert certificate.reasons[0].startswith("moon: enters the zone")
    assert certificate.least_clearance_times["moon"] == pytest.approx(6.3, abs=1e-2)
    still = Zone(crossing, 1e-4, [1, 0, 0], strength=1.0, name="moon")
    assert not certify(trajectory, problem_of(trajectory, (still,))).certified
    elsewhere = Zone(start, 1e-4, [1, 0, 0], strength=1.0, name="moon")
    assert certify(trajectory, problem_of(trajectory, (elsewhere,))).certified


def test_a_union_is_kept_as_long_as_one_member_is():
    trajectory = slew(angle=2.0, samples=9)
    member = {"boresight": [1, 0, 0], "strength": 1.0, "kind": "keep_in", "group": "sensors"}

    def at(longitude, r):
        return Zone([math.cos(longitude), math.sin(longitude), 0.0], r, **member)

    # The two cones overlap by 0.02 rad at longitude 1.
    both = problem_of(trajectory, (at(0.2, 0.81), at(1.8, 0.81)))
    certificate = certify(trajectory, both)
    assert certificate.certified
    assert certificate.clearance["sensors"] == pytest.approx(0.01, abs=1.1e-4)
    gap = problem_of(trajectory, (at(0.2, 0.799), at(1.8, 0.799)))
    certificate = certify(trajectory, gap)
    assert not certificate.certified
    assert certificate.least_clearance_times["sensors"] == pytest.approx(5.0, abs=0.02)
    assert not certify(trajectory, problem_of(trajectory, (at(0.2, 0.81),))).certified


@pytest.mark.parametrize("from_time", [0.0, 3.3, 10.0, 17.77, 20.0])
def test_from_a_time_on_the_obstacles_start_where_they_are_then(from_time):
    rng = np.random.default_rng(8)
    for _ in range(10):
        trajectory = random_curve(rng, 11)
        problem = problem_of(trajectory, random_obstacles(rng, 0.05))
        cleared = certify_clearance(trajectory, problem, from_time=from_time)
        times = np.linspace(from_time, 20.0, 3001)
        for name, margin in sampled_margins(trajectory, problem, times, from_time).items():
            least, bound = margin.min(), cleared.clearance[name]
            step = (20.0 - from_time) / 3000
            assert least - slack(least) - 0.3 * step - 2e-12 <= bound <= least
            assert cleared.least_clearance_times[name] >= from_time
        assert cleared.certified == all(b > 0.0 for b in cleared.clearance.values())


def test_from_a_time_on_forgets_what_was_before():
    trajectory = slew(samples=11)
    passed = Zone(trajectory.evaluate(4.5)[0][:, 0], 0.05, [1, 0, 0], strength=1.0, name="sun")
    problem = problem_of(trajectory, (passed,))
    assert not certify_clearance(trajectory, problem).certified
    assert not certify_clearance(trajectory, problem, from_time=4.5).certified
    later = certify_clearance(trajectory, problem, from_time=4.9)
    assert later.certified
    assert later.least_clearance_times["sun"] == 4.9
    for outside in (-0.1, 10.1, math.nan):
        with pytest.raises(ValueError, match="from_time must lie in"):
            certify_clearance(trajectory, problem, from_time=outside)


def test_a_trajectory_at_rest_is_bounded():
    q = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))
    rest = np.zeros((3, 3))
    hold = Trajectory([0.0, 1.0, 5.0], q, rest, rest)
    obstacles = (
        Zone([0, 1, 0], 0.5, [1, 0, 0], strength=1.0, name="far"),
        OrientationObstacle(np.eye(3), strength=1.0, name="on it"),
    )
    certificate = certify(hold, problem_of(hold, obstacles))
    assert certificate.clearance["far"] == pytest.approx(math.pi / 2 - 0.5, abs=1e-4)
    assert certificate.clearance["on it"] == pytest.approx(0.0, abs=1e-4)
    assert len(certificate.reasons) == 1
    assert certificate.rate_bound == 0.0


def test_certifying_is_fast():
    rng = np.random.default_rng(1)
    trajectory = random_curve(rng, 51)
    problem = problem_of(trajectory, random_obstacles(rng, 0.0)[1:3])
    times = np.linspace(0.0, trajectory.duration, 1000)

    def fastest(run):
        durations = []
        for _ in range(200):
            begin = time.perf_counter()
            run()
            durations.append(time.perf_counter() - begin)
        return min(durations)

    # A ratio, since machines differ: two zones in continuous time for a thousand bare samples.
    certifying = fastest(lambda: certify(trajectory, problem))
    assert certifying < 2.5 * fastest(lambda: trajectory.evaluate_quaternion(times))


def test_margins_along_a_trajectory_are_those_of_the_problem():
    rng = np.random.default_rng(5)
    trajectory = random_curve(rng, 21)
    problem = problem_of(trajectory, random_obstacles(rng, 0.05))
    times = np.linspace(0.0, 20.0, 7)
    margins = clearance_along(trajectory, problem, times.reshape(7, 1))
    for i, t in enumerate(times):
        for name, margin in problem.margins(trajectory.evaluate(t)[0], t).items():
            assert margins[name][i, 0] == pytest.approx(margin, abs=1e-14)
