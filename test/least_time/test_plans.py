# SPDX-License-Identifier: Apache-2.0
"""Plans of least time: certified, in files, under a deadline; what is wrong with one is seen."""

import json
from dataclasses import replace

import numpy as np
import pytest

from riem_planner import (
    InvalidProblemError,
    Limits,
    OrientationObstacle,
    Problem,
    State,
    Trajectory,
    Wheel,
    Zone,
    certify,
    solve,
)
from riem_planner.files.plan_files import check_plan, plan_document
from riem_planner.files.problem_files import parse_problem
from riem_planner.geometry import so3
from riem_planner.riem_plan.planning import plan_problem

REST = State(np.eye(3))
GOAL = State(so3.exp([0.3, 1.8, -0.4]))
BOX = Limits(rate=[0.05, 0.04, 0.06], acceleration=[2e-3, 3e-3, 2.5e-3])
SUN = Zone([0.75, 0.0, -0.66], 0.4, [1.0, 0.0, 0.0], normalized_strength=0.01, name="sun")
SENSORS = [
    Zone(R @ axis, 1.2, axis, normalized_strength=0.01, kind="keep_in", group="sensors", name=name)
    for name, axis, R in (
        ("x", np.array([1.0, 0.0, 0.0]), np.eye(3)),
        ("z", np.array([0.0, 0.0, 1.0]), GOAL.orientation),
    )
]


def problem(limits=BOX, obstacles=(), start=REST, goal=GOAL, **options):
    return Problem(
        start, goal, "auto", limits=limits, obstacles=obstacles, objective="least_time", **options
    )


def random_problem(seed):
    """One of each kind of zone and limit, in turn."""
    rng = np.random.default_rng(seed)
    inertia = np.diag(rng.uniform(2.0, 3.5, 3))
    wheels = [Wheel(axis, 0.005, 0.15) for axis in (*np.eye(3), [1.0, 1.0, 1.0])]
    limits = (
        Limits(rate=0.05, acceleration=2e-3),
        Limits(torque=[5e-3, 6e-3, 7e-3], momentum=0.15, inertia=inertia),
        Limits(wheels=wheels, rate=0.06, inertia=inertia),
        Limits(rate=[0.04, 0.05, 0.06], acceleration=[2e-3, 1e-3, 3e-3], jerk=5e-4),
        Limits(torque=6e-3, torque_rate=2e-3, momentum=0.2, inertia=inertia),
    )[seed % 5]
    goal = State(so3.exp(rng.normal(size=3)))
    middle = so3.exp(0.5 * so3.log(goal.orientation))
    axis = middle @ np.array([0.0, 0.0, 1.0]) + 0.3 * rng.normal(size=3)
    obstacles = (
        (Zone(axis, 0.2, [0.0, 0.0, 1.0], normalized_strength=0.01),),
        (Zone(axis, 0.15, [0.0, 0.0, 1.0], normalized_strength=0.01, rate=[1e-3, 0.0, 0.0]),),
        (OrientationObstacle(middle, normalized_strength=0.01, radius=0.2),),
        (Zone(axis, 1.4, [0.0, 0.0, 1.0], normalized_strength=0.01, kind="keep_in"),),
        (),
    )[(seed // 2) % 5]
    clear = [
        o for o in obstacles if min(o.margin(R, 0.0) for R in (np.eye(3), goal.orientation)) > 0.05
    ]
    momentum = [0.02, -0.03, 0.01] if limits.wheels and seed % 2 else [0.0] * 3
    return problem(limits, tuple(clear), goal=goal, total_momentum=momentum)


@pytest.mark.parametrize("seed", range(10))
def test_random_problems_are_certified_and_not_below_the_bound(seed):
    asked = random_problem(seed)
    solution = solve(asked)
    assert solution.solved, solution.message
    assert solution.certificate.certified
    assert certify(solution.trajectory, asked).certified
    assert solution.level == "free path"
    assert solution.least_possible_duration <= solution.cost * (1.0 + 1e-9)
    steps = np.diff(solution.trajectory.times)
    assert np.ptp(steps) < 1e-9 * solution.cost


def test_ends_with_rates_and_a_free_path_no_slower_than_the_retimed_one():
    start = State(np.eye(3), [0.004, -0.006, 0.002])
    goal = State(GOAL.orientation, [0.002, 0.004, -0.003])
    asked = problem(start=start, goal=goal)
    free, along = solve(asked), solve(asked, search="local")
    assert free.certificate.certified
    assert along.certificate.certified
    assert free.cost <= along.cost * (1.0 + 1e-6)


def test_a_group_of_sensors_and_a_zone_are_kept():
    asked = problem(obstacles=(SUN, *SENSORS))
    solution = solve(asked)
    assert solution.certificate.certified
    assert set(solution.certificate.clearance) == {"sun", "sensors"}
    assert min(solution.certificate.clearance.values()) > 0.0
    straight = solve(problem())
    assert solution.cost > straight.cost


def test_the_same_problem_gives_the_same_bits():
    first, second = (solve(problem(obstacles=(SUN,))).trajectory for _ in range(2))
    np.testing.assert_array_equal(first.quaternions_xyzw, second.quaternions_xyzw)
    assert first.duration == second.duration


@pytest.mark.parametrize("obstacles", [(), (SUN,)])
def test_a_deadline_is_answered_by_a_certified_plan(obstacles):
    asked = problem(obstacles=obstacles)
    solve(asked)  # the compiled code is loaded
    solution = solve(asked, deadline=1e-4)
    assert solution.level in ("retimed path", "least_acceleration")
    assert solution.certificate.certified
    assert not solution.converged


def test_strengths_ranges_and_points_play_no_part():
    strong = replace(SUN, normalized_strength=10.0)
    assert solve(problem(obstacles=(strong,))).cost == solve(problem(obstacles=(SUN,))).cost
    point = Zone([0.75, 0.0, -0.66], 0.0, [1.0, 0.0, 0.0], normalized_strength=1.0, name="star")
    solution = solve(problem(obstacles=(point,)))
    assert solution.cost == pytest.approx(solve(problem()).cost, rel=1e-3)
    assert any(
        "without a radius play no part" in note and "star" in note for note in solution.notes
    )


def test_the_plan_file_says_what_it_is_and_is_checked():
    document = {
        "space": "so3", "objective": "least_time", "duration": "auto",
        "start": {"orientation": [0, 0, 0, 1]}, "goal": {"orientation": [0, 0.6, 0, 0.8]},
        "limits": {"rate": 0.05, "acceleration": [2e-3, 1e-3, 1e-3]},
    }  # fmt: skip
    asked = parse_problem(document)
    plan = json.loads(json.dumps(plan_document(plan_problem(asked, 101))))
    assert plan["certified"]
    assert plan["cost"] == plan["duration"] == plan["times"][-1]
    assert len(plan["times"]) == 101
    assert plan["level"] == "free path"
    assert 0.0 < plan["least_possible_duration"] <= plan["cost"]
    assert set(plan["limits_left"]) == {"rate", "acceleration"}
    assert "bound by limits.acceleration (free path)" in plan["message"]
    assert plan["problem"]["objective"] == "least_time"
    assert plan["problem"]["duration"] == "auto"
    certificate, claims = check_plan(plan, parse_problem(plan["problem"]))
    assert certificate.certified
    assert claims == []


def test_the_certificate_sees_a_jerk_and_a_wheel_between_the_samples():
    inertia = np.diag([2.0, 3.0, 2.5])
    wheels = [Wheel(axis, 0.006, 0.3) for axis in (*np.eye(3), [1.0, 1.0, 1.0])]
    asked = problem(Limits(jerk=2e-4, wheels=wheels, inertia=inertia))
    trajectory = solve(asked).trajectory
    assert certify(trajectory, asked).certified
    a = trajectory.angular_accelerations.copy()
    a[60] *= 1.03
    spoiled = Trajectory(
        trajectory.times, trajectory.quaternions_xyzw, trajectory.angular_velocities, a
    )
    assert any("limits.jerk" in reason for reason in certify(spoiled, asked).reasons)
    fast = Trajectory(
        0.97 * trajectory.times, trajectory.quaternions_xyzw,
        trajectory.angular_velocities / 0.97, trajectory.angular_accelerations / 0.97**2,
    )  # fmt: skip
    assert any("a wheel's torque" in reason for reason in certify(fast, asked).reasons)
    a = trajectory.angular_accelerations.copy()
    a[0] = [0.0, 1e-4, 0.0]
    rough = Trajectory(
        trajectory.times, trajectory.quaternions_xyzw, trajectory.angular_velocities, a
    )
    assert any(
        reason.startswith("start: an acceleration") for reason in certify(rough, asked).reasons
    )


@pytest.mark.parametrize(
    ("options", "key", "words"),
    [
        ({"duration": 12.0}, "duration", ["expected auto", "12", "least_time"]),
        ({"limits": Limits(rate=0.1)}, "limits.acceleration", ["missing", "jerk", "wheels"]),
        ({"limits": None}, "limits", ["missing"]),
        ({"objective": "quickest"}, "objective", ["least_time", "'quickest'"]),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(options, key, words):
    stated = {"duration": "auto", "limits": BOX, "objective": "least_time"} | options
    with pytest.raises(InvalidProblemError) as refusal:
        Problem(REST, GOAL, **stated)
    assert refusal.value.key == key
    assert all(word in str(refusal.value) for word in words)


def test_least_torque_asks_for_another_curve():
    asked = problem(Limits(torque=0.01, inertia=np.eye(3)))
    with pytest.raises(InvalidProblemError, match="--least-torque ask for different curves"):
        plan_problem(asked, least_torque=True)


def test_nothing_to_do_and_a_rate_beyond_the_limits_are_told():
    assert "same state at rest" in solve(problem(goal=REST)).message
    fast = State(np.eye(3), [0.2, 0.0, 0.0])
    assert "times limits.rate" in solve(problem(start=fast)).message
