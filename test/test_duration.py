# SPDX-License-Identifier: Apache-2.0
"""The least duration within limits, and the refusal of a shorter one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from riem_planner import (
    S2,
    Limits,
    OrientationObstacle,
    Problem,
    Solution,
    State,
    Status,
    Wheel,
    Zone,
    solve,
)
from riem_planner.duration import least_duration, search
from riem_planner.geometry import so3

PRINCIPAL = np.diag([2.0, 3.0, 4.0])
REST = State(np.eye(3))


def about_z(angle):
    return State(so3.exp([0.0, 0.0, angle]))


@pytest.mark.parametrize("angle", [0.05, 1.0, 2.5])
@pytest.mark.parametrize(
    ("limits", "binding", "exact"),
    [
        (Limits(rate=0.1), "rate", lambda x: 1.5 * x / 0.1),
        (Limits(acceleration=0.02), "acceleration", lambda x: math.sqrt(6.0 * x / 0.02)),
        (Limits(torque=0.03, inertia=PRINCIPAL), "torque", lambda x: math.sqrt(24.0 * x / 0.03)),
        (Limits(momentum=0.3, inertia=PRINCIPAL), "momentum", lambda x: 6.0 * x / 0.3),
        (Limits(momentum=[1e-3, 1e-3, 0.3], inertia=PRINCIPAL), "momentum", lambda x: 6 * x / 0.3),
        (Limits(jerk=0.01), "jerk", lambda x: (12.0 * x / 0.01) ** (1 / 3)),
        (
            Limits(wheels=[Wheel(axis, 0.03, 9.0) for axis in np.eye(3)], inertia=PRINCIPAL),
            "wheels",
            lambda x: math.sqrt(24.0 * x / 0.03),
        ),
    ],
)
def test_about_a_principal_axis_it_is_that_of_the_cubic(angle, limits, binding, exact):
    solution = solve(Problem(REST, about_z(angle), "auto", limits=limits))
    assert solution.solved
    assert solution.trajectory.duration == pytest.approx(exact(angle), rel=1e-3)
    assert f"bound by limits.{binding}" in solution.message
    assert 0.0 <= solution.certificate.limits_left[binding] < 2e-3


def test_the_slowest_limit_binds():
    limits = Limits(rate=0.1, acceleration=0.01)
    quick = solve(Problem(REST, about_z(0.2), "auto", limits=limits))
    slow = solve(Problem(REST, about_z(3.0), "auto", limits=limits))
    assert "bound by limits.acceleration" in quick.message
    assert "bound by limits.rate" in slow.message
    assert set(slow.certificate.limits_left) == {"rate", "acceleration"}


@pytest.mark.parametrize("part", [0.5, 0.98])
def test_a_duration_that_breaks_a_limit_is_refused_with_the_least_that_does_not(part):
    least = 1.5 * 2.0 / 0.1
    problem = Problem(REST, about_z(2.0), part * least, limits=Limits(rate=0.1))
    solution = solve(problem)
    assert solution.status is Status.LIMITS_EXCEEDED
    assert solution.trajectory is None
    assert solution.certificate.breaks_only_limits
    assert "limits.rate" in solution.message
    stated = float(solution.message.split("least-acceleration curves found is ")[1].split()[0])
    assert stated == pytest.approx(least, rel=1e-3)
    assert solve(replace(problem, duration=stated)).solved


def test_a_duration_within_the_limits_is_kept():
    solution = solve(Problem(REST, about_z(2.0), 31.0, limits=Limits(rate=0.1)))
    assert solution.solved
    assert solution.trajectory.duration == 31.0
    assert solution.certificate.limits_left["rate"] == pytest.approx(1.0 - 30.0 / 31.0, abs=2e-4)


def least_is_sharp(problem):
    solution = solve(problem)
    T = solution.trajectory.duration
    assert solution.solved
    assert 0.0 <= min(solution.certificate.limits_left.values()) < 0.02
    assert solve(replace(problem, duration=0.99 * T)).status is Status.LIMITS_EXCEEDED
    return T


def test_with_tension_the_path_depends_on_the_duration():
    # Tension flattens the rate, so the least duration is below the cubic's.
    problem = Problem(REST, about_z(2.0), "auto", tension=0.05, limits=Limits(rate=0.1))
    assert 20.0 < least_is_sharp(problem) < 0.9 * 30.0


def test_with_a_moving_zone_the_path_depends_on_the_duration():
    # How far the zone has come when the boresight passes decides how wide the detour is, and
    # the slow axis y how long that takes.
    zone = Zone(
        [0.5, 0.8, 0.1], 0.3, [1.0, 0.0, 0.0], normalized_strength=0.01, rate=[0.0, 0.0, -0.01]
    )
    limits = Limits(rate=[0.1, 0.01, 0.1])
    least_is_sharp(Problem(REST, about_z(2.0), "auto", obstacles=(zone,), limits=limits))


def test_a_costlier_class_of_paths_may_be_the_quicker_one():
    # The cheap way round the zone turns about the slow axis x, the long way round does not.
    zone = Zone([math.cos(1.3), math.sin(1.3), 0.1], 0.5, [1.0, 0.0, 0.0], normalized_strength=0.3)
    limits = Limits(rate=[0.002, 0.1, 0.1])
    problem = Problem(REST, about_z(2.6), "auto", obstacles=(zone,), limits=limits)
    long_way = 2.0 * math.pi - 2.6
    assert least_is_sharp(problem) == pytest.approx(1.5 * long_way / 0.1, rel=0.01)
    cheapest = solve(replace(problem, duration=100.0, limits=None)).trajectory
    assert np.max(np.abs(cheapest.angular_velocities[:, 0])) > 0.002


def test_on_s2_too():
    start = State.from_direction([1.0, 0.0, 0.0])
    goal = State.from_direction([-0.6, 0.8, 0.0])
    problem = Problem(start, goal, "auto", S2, limits=Limits(rate=0.05))
    angle = math.atan2(0.8, -0.6)
    assert solve(problem).trajectory.duration == pytest.approx(1.5 * angle / 0.05, rel=1e-3)
    zone = Zone([0.3, 0.9, 0.05], 0.3, normalized_strength=0.01, name="sun")
    detour = solve(replace(problem, obstacles=(zone,)))
    assert detour.solved
    assert detour.trajectory.duration > 1.01 * 1.5 * angle / 0.05
    antipode = replace(problem, goal=State.from_direction([-1.0, 0.0, 0.0]))
    assert solve(antipode).trajectory.duration == pytest.approx(1.5 * np.pi / 0.05, rel=1e-3)


def test_a_rate_at_an_end_beyond_the_limits_is_refused_for_every_duration():
    start = State(np.eye(3), [0.2, 0.0, 0.0])
    limits = Limits(rate=0.1)
    automatic = solve(Problem(start, about_z(1.0), "auto", limits=limits))
    assert automatic.status is Status.LIMITS_EXCEEDED
    assert "start.angular_velocity: 2 times limits.rate" in automatic.message
    fixed = solve(Problem(start, about_z(1.0), 50.0, limits=limits))
    assert fixed.status is Status.LIMITS_EXCEEDED
    assert "no duration helps" in fixed.message


def test_staying_where_one_is_has_no_least_duration():
    solution = solve(Problem(REST, REST, "auto", limits=Limits(rate=0.1)))
    assert solution.status is Status.LIMITS_EXCEEDED
    assert "any duration keeps the limits" in solution.message


def test_a_start_in_a_zone_is_that_with_any_duration():
    zone = Zone([1.0, 0.0, 0.0], 0.3, [1.0, 0.0, 0.0], strength=1.0, name="sun")
    for tension in (None, 1.0):
        problem = Problem(
            REST, about_z(1.0), "auto", obstacles=(zone,), limits=Limits(rate=0.1), tension=tension
        )
        assert solve(problem).status is Status.START_IN_ZONE
        durations = []

        def counted(each, near, durations=durations):
            durations.append(each.duration)
            return solve(each, warm_start=near)

        assert least_duration(problem, counted).failure.status is Status.START_IN_ZONE
        assert len(durations) == 1


def test_deadline_and_cancellation_are_kept_while_the_duration_is_searched():
    Q = so3.exp([0.2, 0.3, 0.5])
    problem = Problem(
        REST,
        about_z(1.5),
        "auto",
        obstacles=(OrientationObstacle(Q, strength=1e-6),),
        limits=Limits(rate=0.05),
    )
    assert solve(problem).solved
    assert solve(problem, deadline=1e-4).status is Status.OUT_OF_TIME
    assert solve(problem, should_stop=lambda: True).status is Status.CANCELLED
    calls = iter(range(10_000))
    late = solve(replace(problem, duration=20.0), should_stop=lambda: next(calls) > 60)
    assert late.status is Status.CANCELLED


def test_least_duration_without_limits_is_a_mistake():
    with pytest.raises(ValueError, match="needs limits"):
        least_duration(Problem(REST, about_z(1.0), 1.0), lambda problem, near: solve(problem))


def test_a_failure_tells_the_time_and_the_iterations_of_all_its_solves(monkeypatch):
    monkeypatch.setattr(search, "_LONGEST", 2.0)
    # A repulsion of fixed strength asks for an acceleration that no duration lowers.
    zone = Zone([1.0, 0.3, 0.0], 0.1, [1.0, 0.0, 0.0], strength=1e-2)
    limits = Limits(acceleration=1e-4)
    problem = Problem(REST, about_z(-1.0), "auto", obstacles=(zone,), limits=limits)
    failed = solve(problem)
    assert failed.status is Status.LIMITS_EXCEEDED
    assert "no duration from" in failed.message
    assert "or give normalized_strength" in failed.message
    once = solve(replace(problem, duration=122.5, limits=None))
    assert failed.iterations > 2 * once.iterations > 0
    assert failed.solve_time > once.solve_time > 0.0
    # A refusal with a fixed duration includes the search for the least one.
    refused = solve(replace(problem, duration=122.5))
    assert "no duration from" in refused.message
    assert refused.iterations >= failed.iterations + once.iterations
    turning = State(np.eye(3), [0.2, 0.0, 0.0])
    refused = solve(Problem(turning, about_z(1.0), "auto", limits=Limits(rate=0.1)))
    assert refused.status is Status.LIMITS_EXCEEDED
    assert refused.solve_time > 0.0


def test_a_search_ends_where_no_duration_will_do():
    zone = Zone([1.0, 0.3, 0.0], 0.1, [1.0, 0.0, 0.0], strength=1e-2)
    limits = Limits(acceleration=1e-4)
    problem = Problem(REST, about_z(-1.0), 1.0, obstacles=(zone,), limits=limits)
    durations = []

    def sealed_later(each, near):
        durations.append(each.duration)
        if len(durations) > 3:
            return Solution(Status.NO_CERTIFIED_TRAJECTORY, "no path")
        return solve(each, warm_start=near)

    found = least_duration(problem, sealed_later)
    assert found.failure.status is Status.LIMITS_EXCEEDED
    assert len(durations) == 3 + 12


def test_back_to_the_start_at_the_same_rate_has_a_least_duration():
    turning = State(np.eye(3), [0.0, 0.0, 0.02])
    least_is_sharp(Problem(turning, turning, "auto", limits=Limits(acceleration=0.01)))


def test_pushed_out_and_back_the_excursion_tells_the_least_duration():
    zone = Zone([1.0, 0.3, 0.0], 0.1, [1.0, 0.0, 0.0], normalized_strength=0.01)
    problem = Problem(REST, REST, "auto", obstacles=(zone,), limits=Limits(rate=0.001))
    assert least_is_sharp(problem) > 5.0
    fixed = replace(zone, normalized_strength=None, strength=1e-2)
    assert "the shorter the better" in solve(replace(problem, obstacles=(fixed,))).message
    # In the middle of a zone to keep in nothing pushes.
    middle = Zone([1.0, 0.0, 0.0], 0.3, [1.0, 0.0, 0.0], kind="keep_in", normalized_strength=0.01)
    assert "the same state at rest" in solve(replace(problem, obstacles=(middle,))).message


@pytest.mark.parametrize("rate", [1e-300, 1e300])
def test_limits_beyond_any_slew_are_a_value_that_names_the_units(rate):
    solution = solve(Problem(REST, about_z(1.0), "auto", limits=Limits(rate=rate)))
    assert solution.status is Status.LIMITS_EXCEEDED
    assert "check their units" in solution.message
