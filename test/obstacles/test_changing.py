# SPDX-License-Identifier: Apache-2.0
"""Zones that truly move and change: along samples, in size, in windows of time, in groups."""

from dataclasses import replace

import numpy as np
import pytest

from riem_planner import SO3, Limits, Problem, State, Zone, certify, solve
from riem_planner.certificate import certify_clearance
from riem_planner.certificate.distance_bounds import TIGHTNESS
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path, Turning

T = 60.0
TIMES = np.linspace(0.0, T, 31)
AHEAD, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
START, GOAL = State(np.eye(3)), State(so3.exp([0.0, 0.0, 1.5]))


def path_of(rate, axis=AHEAD, bend=0.0, times=TIMES):
    turns = times[:, None] * np.asarray(rate) + bend * np.sin(times / 9.0)[:, None] * UP
    return Path(times, so3.exp(turns) @ (so3.exp([0.0, 0.05, 0.75]) @ axis))


def problem_of(*zones, **more):
    return Problem(START, GOAL, T, SO3, obstacles=zones, **more)


def margins_of(trajectory, forbidden, samples=20001):
    times = np.linspace(0.0, T, samples)
    return {
        name: float(margin.min())
        for name, margin in forbidden.margins(trajectory.evaluate(times)[0], times).items()
    }


def test_a_path_at_constant_rate_is_the_constant_rate():
    rate = np.array([0.002, -0.004, 0.003])
    sampled = problem_of(Zone(path_of(rate), 0.2, name="moon"))
    turning = Turning(so3.exp([0.0, 0.05, 0.75]) @ AHEAD, rate)
    constant = problem_of(Zone(turning, 0.2, name="moon"))
    np.testing.assert_array_equal(constant.obstacles[0].rate, rate)
    first, second = solve(sampled), solve(constant)
    assert first.solved
    assert first.cost == pytest.approx(second.cost, rel=1e-7)
    assert first.converged


CHANGING = {
    "path": (Zone(path_of([0.004, 0.0, 0.006], bend=0.1), 0.3, name="a"),),
    "size": (Zone(path_of([0.0, 0.002, 0.0]), 0.25 + 0.1 * np.sin(TIMES / 8), name="a"),),
    "inside": (Zone(path_of([0.0, 0.002, 0.0]), 1.1 - 0.003 * TIMES, kind="keep_in", name="a"),),
    "window": (Zone(path_of([0.0, 0.0, 0.0]), 0.3, active=((20.0, 33.3),), name="a"),),
    "windows": (Zone(path_of([0.004, 0, 0]), 0.3, active=((0, 7), (24, 31), (50, 99)), name="a"),),
    "group": (
        Zone(path_of([0.0, 0.001, 0.0]), 0.4, AHEAD, group="t", member="one", name="sun one"),
        Zone([-1, 1, 1], 0.5, AHEAD, group="t", member="one", name="earth one"),
        Zone(path_of([0.0, 0.001, 0.0]), 0.4, [-1, 1, 0], group="t", member="two", name="sun two"),
        Zone([-1, 1, 1], 0.5, [0, 1, 0], group="t", member="two", name="earth two"),
    ),
}


@pytest.mark.parametrize("kind", CHANGING)
def test_changing_zones_are_kept_and_certified(kind):
    problem = problem_of(*CHANGING[kind])
    solution = solve(problem)
    assert solution.solved, solution.message
    name = problem.forbidden.names[0]
    sampled = margins_of(solution.trajectory, problem.forbidden)[name]
    bound = solution.certificate.clearance[name]
    assert 0.0 < bound <= sampled + 1e-12
    assert bound > sampled - 2.0 * TIGHTNESS


@pytest.mark.parametrize("kind", CHANGING)
def test_a_path_through_a_changing_zone_is_refused(kind):
    straight = solve(problem_of()).trajectory
    grown = [
        replace(z, half_angle=np.asarray(z.half_angle) + (-0.9 if z.kind == "keep_in" else 0.5))
        for z in CHANGING[kind]
    ]
    problem = problem_of(*grown)
    cleared = certify_clearance(straight, problem)
    sampled = margins_of(straight, problem.forbidden)
    assert not cleared.certified
    for name, bound in cleared.clearance.items():
        assert sampled[name] - 2.0 * TIGHTNESS < bound <= sampled[name] + 1e-12


def test_bounds_hold_between_samples_of_wild_paths():
    rng = np.random.default_rng(4)
    straight = solve(problem_of()).trajectory
    for _ in range(20):
        times = np.linspace(0.0, T, 10) + np.append(0.0, np.append(rng.uniform(-2, 2, 8), 0.0))
        steps = np.cumsum(0.25 * rng.normal(size=(10, 3)), axis=0)
        zone = Zone(
            Path(times, so3.exp(steps) @ [0.3, 0.9, 0.3]),
            rng.uniform(0.1, 0.4, 10),
            name="a",
            active=((5.0, 21.0), (30.0, 70.0)),
        )
        forbidden = problem_of(zone).forbidden
        bound = certify_clearance(straight, forbidden).clearance["a"]
        sampled = margins_of(straight, forbidden)["a"]
        assert sampled - 1e-3 * abs(sampled) - 2.0 * TIGHTNESS < bound <= sampled + 1e-12


def test_a_zone_counts_in_its_windows_only():
    zone = Zone(so3.exp([0.0, 0.05, 0.75]) @ AHEAD, 0.3, name="a")
    costs = [
        solve(problem_of(*zones)).cost
        for zones in ((), (replace(zone, active=((25, 32),)),), (zone,))
    ]
    assert costs[0] < 0.99 * costs[1] < 0.98 * costs[2]
    never = solve(problem_of(replace(zone, active=((70.0, 80.0),))))
    assert never.cost == pytest.approx(costs[0], rel=1e-10)
    assert never.certificate.clearance["a"] == pytest.approx(np.pi)


def test_an_answer_with_a_window_is_an_extremal_on_both_sides_of_its_edges():
    zone = Zone(so3.exp([0.0, 0.05, 0.75]) @ AHEAD, 0.3, name="a", active=((22.2, 41.7),))
    solution = solve(problem_of(zone))
    assert solution.certificate.extremality < 1e-5
    times = solution.trajectory.times
    assert np.min(np.abs(times - 22.2)) < 1e-9
    assert np.min(np.abs(times - 41.7)) < 1e-9


def test_of_a_group_one_member_is_enough():
    sun, earth = so3.exp([0.0, 0.02, 0.75]) @ AHEAD, [0.0, 0.2, -1.0]
    zones = [
        Zone(direction, angle, boresight, group="trackers", member=member, name=f"{member} {body}")
        for member, boresight in (("one", AHEAD), ("two", UP))
        for body, direction, angle in (("sun", sun, 0.5), ("earth", earth, 0.3))
    ]
    together = solve(problem_of(*zones))
    assert list(together.certificate.clearance) == ["trackers"]
    straight = solve(problem_of())
    alone = solve(problem_of(zones[0]))
    assert together.cost < straight.cost + 0.2 * (alone.cost - straight.cost)
    margins = problem_of(*zones).margins(so3.exp([0.0, 0.0, 0.75]))
    one = min(zone.margin(so3.exp([0.0, 0.0, 0.75])) for zone in zones[:2])
    two = min(zone.margin(so3.exp([0.0, 0.0, 0.75])) for zone in zones[2:])
    assert margins["trackers"] == max(one, two) == two


@pytest.mark.parametrize(
    ("wrong", "key", "said"),
    [
        ({"direction": path_of([0, 0, 0], times=TIMES / 2)}, "obstacles[0].times", "end at 30 s"),
        ({"direction": path_of([0, 0, 0], times=TIMES + 1)}, "obstacles[0].times", "begin at 1 s"),
    ],
)
def test_samples_cover_the_slew(wrong, key, said):
    with pytest.raises(InvalidProblemError, match=said) as caught:
        problem_of(Zone(half_angle=0.1, **wrong))
    assert caught.value.key == key


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"active": ((3.0, 2.0),)}, r"expected \[start, end\] with start < end"),
        ({"active": (3.0, 2.0)}, "windows"),
        ({"member": "one"}, "group"),
        ({"half_angle": [0.1, 0.2]}, "need a Path"),
        ({"direction": path_of([0, 0, 0]), "half_angle": [0.1] * 30}, "half_angle"),
        ({"direction": path_of([0, 0, 0]), "half_angle": [3.1, 0.1] * 15 + [3.1]}, "more samples"),
        ({"direction": path_of([0, 0, 0]), "rate": [0, 0, 1]}, "beside a Path"),
        ({"strength": 1.0, "normalized_strength": 1.0}, "at most one"),
    ],
)
def test_what_a_zone_cannot_be_is_refused(wrong, said):
    with pytest.raises(InvalidProblemError, match=said):
        Zone(**{"direction": AHEAD, "half_angle": 0.1, **wrong})


def test_the_usual_strength_is_a_hundredth():
    assert Zone(AHEAD, 0.1).normalized_strength == 0.01
    assert Zone(AHEAD, 0.1, strength=2.0).normalized_strength is None


def test_certificates_start_where_they_are_told():
    zone = Zone(path_of([0.004, 0.0, 0.006]), 0.2, active=((0.0, 20.0),), name="a")
    problem = problem_of(zone)
    trajectory = solve(problem_of()).trajectory
    cleared = certify_clearance(trajectory, problem, from_time=40.0)
    times = np.linspace(40.0, T, 5001)
    margins = problem.forbidden.margins(trajectory.evaluate(times)[0], times - 40.0)["a"]
    assert cleared.clearance["a"] == pytest.approx(margins.min(), abs=2 * TIGHTNESS)
    assert abs(certify(trajectory, problem).clearance["a"] - margins.min()) > 0.01


def test_the_least_duration_is_looked_for_where_samples_reach():
    problem = replace(
        problem_of(Zone(path_of([0.004, 0.0, 0.006]), 0.3, name="a")),
        duration="auto",
        limits=Limits(rate=0.06, acceleration=0.01),
    )
    solution = solve(problem)
    assert solution.solved
    assert 30.0 < solution.trajectory.duration < T
    slower = solve(replace(problem, limits=Limits(rate=0.01)))
    assert not slower.solved
    assert "they end there" in slower.message
