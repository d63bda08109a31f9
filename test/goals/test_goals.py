# SPDX-License-Identifier: Apache-2.0
"""Goals that are an attitude, two axes or a list; goals that move; holds after the arrival."""

import math

import numpy as np
import pytest

from riem_planner import InvalidProblemError, Problem, State, Zone, solve
from riem_planner.certificate import certify
from riem_planner.geometry import so3, sphere
from riem_planner.geometry.paths import Path, Turning
from riem_planner.goals import AttitudeGoal, PointingGoal
from riem_planner.solution import Status

E = np.eye(3)
START = State(so3.exp([0.3, -0.2, 0.5]))
TIMES = np.linspace(0.0, 80.0, 81)
PATH = Path(TIMES, np.column_stack([np.cos(0.02 * TIMES), np.sin(0.02 * TIMES), 0.004 * TIMES]))
GOALS = {
    "turning attitude": AttitudeGoal(so3.exp([0.1, 0.9, -0.4]), [0.01, -0.02, 0.005]),
    "turning direction": PointingGoal([0.1, 0.2, 1.0], Turning([1.0, 0.3, 0.2], [0.01, 0.0, 0.02])),
    "path": PointingGoal([0.1, 0.2, 1.0], PATH),
    "two axes, one on a path": PointingGoal(
        [0.1, 0.2, 1.0], PATH, ([1.0, 0.0, 0.0], Turning([0.0, 0.3, 1.0], [0.0, 0.01, 0.0]))
    ),
}


def differences(motion, t, h=1e-3):
    """Reference-frame angular velocity of attitudes at a time, by central differences."""
    after, before = motion(t + h), motion(t - h)
    return so3.log(after @ before.T) / (2.0 * h)


@pytest.mark.parametrize("name", GOALS)
def test_moving_goal_is_met_with_its_rate(name):
    goal = GOALS[name]
    solution = solve(Problem(START, goal, 20.0))
    assert solution.solved, solution.message
    R, v, _ = solution.trajectory.evaluate(20.0)
    rate = R @ v
    if goal.roll_axis is None:
        assert so3.distance(R, goal.arrival(20.0).orientation) < 1e-9
        expected = differences(lambda t: goal.arrival(t).orientation, 20.0)
    else:
        d, velocity, _ = goal.direction.motion_at(20.0)
        assert sphere.angle(R @ goal.boresight, d) < 1e-9
        expected = np.cross(d, velocity)
    np.testing.assert_allclose(rate, expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", GOALS)
def test_hold_tracks_the_goal_without_a_jump(name):
    goal = GOALS[name]
    solution = solve(Problem(START, goal, 20.0, hold=50.0))
    slew, hold = solution.trajectory, solution.hold
    since = np.linspace(0.0, 50.0, 173)
    R, v, a = hold.evaluate(since)
    np.testing.assert_array_equal(hold.quaternions_xyzw[0], slew.quaternions_xyzw[-1])
    np.testing.assert_allclose(v[0], slew.angular_velocities[-1], atol=1e-9)
    if goal.roll_axis is None:
        wanted = np.array([goal.arrival(20.0 + t).orientation for t in since])
        assert np.max(so3.distance(R, wanted)) < 1e-8
    else:
        d = goal.direction.direction_at(20.0 + since)
        assert np.max(sphere.angle(R @ goal.boresight, d)) < 1e-8
        assert np.max(np.abs(v @ goal.boresight)) < 1e-8  # it does not roll
    # The stated accelerations are the derivatives of the rates, so the quintics bend as stated.
    slope = (solution.hold.evaluate(since[1:-1] + 1e-3)[1] - v[1:-1]) / 1e-3
    np.testing.assert_allclose(slope, a[1:-1], atol=1e-5)


def test_transport_of_a_circle_turns_by_the_area_it_encloses():
    # Parallel transport round a circle of half-angle r: by the area 2 pi (1 - cos r).
    r, T = 0.6, 100.0
    circle = Turning([math.sin(r), 0.0, math.cos(r)], [0.0, 0.0, 2.0 * math.pi / T])
    goal = PointingGoal([0.0, 0.0, 1.0], circle)
    L = goal.tracked(0.0, np.array([T]))[0][0]
    turn = so3.log(L)
    np.testing.assert_allclose(np.cross(turn, circle.direction), 0.0, atol=1e-9)
    assert abs(turn @ circle.direction) == pytest.approx(2 * math.pi * (1 - math.cos(r)), abs=1e-8)


def test_two_axes_leave_the_angle_that_no_attitude_can_close_and_say_so():
    goal = PointingGoal(E[2], E[0], (E[0], [1.0, 2.0, 0.0]))
    R = goal.arrival(0.0).orientation
    np.testing.assert_allclose(R @ E[2], E[0], atol=1e-15)
    np.testing.assert_allclose(R @ E[0], E[1], atol=1e-15)
    # The direction is 63.4 degrees from the first one, the axis at right angles to its own.
    assert math.degrees(goal.remaining_angle(0.0)) == pytest.approx(26.565, abs=1e-3)
    notes = solve(Problem(START, goal, 20.0)).notes
    assert any("goal.second: 26.57 degrees" in note for note in notes)
    exact = PointingGoal(E[2], E[0], (E[0], [0.0, 2.0, 0.0]))
    assert solve(Problem(START, exact, 20.0)).notes == ()


def test_cheapest_of_several_goals_wins_and_those_in_a_zone_drop_out():
    near, far = START.orientation @ so3.exp([0.0, 0.5, 0.0]), so3.exp([0.0, 0.0, 2.9])
    between = START.orientation @ so3.exp([0.0, 0.2, 0.0])
    zone = Zone(between[:, 2], 0.1, boresight=E[2], normalized_strength=1e-4, name="moon")
    goals = (State(far), State(between), State(near), PointingGoal(E[2], near[:, 2]))
    problem = Problem(START, goals, 20.0, obstacles=(zone,))
    solution = solve(problem)
    assert solution.solved
    assert solution.goal_index in (2, 3)
    costs = [solve(problem.with_goal(i)).cost for i in (0, 2, 3)]
    assert solution.cost == min(costs)
    assert [note for note in solution.notes if "any_of[1] drops out" in note and "moon" in note]
    assert certify(solution.trajectory, problem).certified
    inside = solve(Problem(START, (State(between), State(between)), 20.0, obstacles=(zone,)))
    assert inside.status is Status.GOAL_IN_ZONE
    assert "any_of[1]" in inside.message


MOON = Zone(
    [0.0, 1.0, 0.0], 0.2, boresight=E[0], normalized_strength=1e-3, name="moon",
    rate=[0.0, 0.0, -0.01],
)  # fmt: skip


def test_hold_that_a_zone_comes_over_is_refused_with_the_time_of_first_contact():
    # The moon is 90 degrees from the x axis at time 0 and comes nearer by 0.01 rad/s.
    goal = State(np.eye(3))
    assert solve(Problem(START, goal, 20.0, obstacles=(MOON,), hold=100.0)).solved
    refused = solve(Problem(START, goal, 20.0, obstacles=(MOON,), hold=150.0))
    assert refused.status is Status.GOAL_IN_ZONE
    contact = (0.5 * math.pi - 0.2) / 0.01
    assert f"t = {contact:.6g} s" in refused.message
    assert "'moon'" in refused.message


def test_hold_is_certified_with_the_slew_and_its_cost_counts():
    problem = Problem(START, State(np.eye(3)), 20.0, obstacles=(MOON,), hold=100.0)
    solution = solve(problem)
    certificate = solution.certificate
    # Nearest at the end of the hold.
    assert certificate.least_clearance_times["moon"] == pytest.approx(120.0, abs=0.01)
    margin = 0.5 * math.pi - 0.01 * 120.0 - 0.2
    assert certificate.clearance["moon"] == pytest.approx(margin, abs=1e-4)
    without = solve(Problem(START, State(np.eye(3)), 20.0, obstacles=(MOON,)))
    times = np.linspace(20.0, 120.0, 100_001)
    V = 1e-3 / 20.0**4 / (0.5 * math.pi - 0.01 * times - 0.2) ** 2
    held = 0.5 * float(np.sum(0.5 * (V[1:] + V[:-1]) * np.diff(times)))
    assert solution.cost == pytest.approx(without.cost + held, rel=1e-9)


def test_free_roll_keeps_clear_of_what_comes_during_the_hold():
    # The tracker is free at the arrival and would be in the moon later on, at every roll but few.
    goal = PointingGoal(E[2], E[2])
    turned = State(so3.exp([0.3, 0.0, 0.0]))
    solution = solve(Problem(turned, goal, 20.0, obstacles=(MOON,), hold=150.0))
    assert solution.solved, solution.message
    assert solution.certificate.clearance["moon"] > 0.0
    everywhere = Zone([0.0, 0.0, 1.0], 1.7, boresight=E[0], normalized_strength=1e-3, name="sky")
    refused = solve(Problem(State(so3.exp([0, 2.8, 0])), goal, 20.0, obstacles=(everywhere,)))
    assert refused.status is Status.GOAL_IN_ZONE
    assert "no other roll is clear" in refused.message


def test_direction_goal_with_an_automatic_duration_takes_the_least():
    from riem_planner import Limits

    goal = PointingGoal(E[2], START.orientation @ [0.0, math.sin(1.0), math.cos(1.0)])
    solution = solve(Problem(START, goal, "auto", limits=Limits(rate=0.05)))
    # From rest to rest the rate is 1.5 theta / T at most.
    assert solution.trajectory.duration == pytest.approx(1.5 / 0.05, rel=1e-3)


WRONG = {
    "no goal": (lambda: Problem(START, (), 20.0), "goal.any_of", "at least one goal"),
    "none of them": (lambda: Problem(START, (START, 3), 20.0), "goal.any_of[1]", "int"),
    "parallel axes": (
        lambda: PointingGoal(E[2], E[0], (-E[2], E[1])), "second.boresight",
        "parallel to goal.boresight: the roll is not determined",
    ),
    "parallel directions": (
        lambda: PointingGoal(E[2], E[0], (E[0], -2.0 * E[0])), "second.direction",
        "parallel to goal.direction: the roll is not determined",
    ),
    "no pair": (lambda: PointingGoal(E[2], E[0], E[1]), "second", "a boresight and a direction"),
    "zero boresight": (lambda: PointingGoal([0, 0, 0], E[0]), "boresight", "zero vector"),
    "hold with a rate": (
        lambda: Problem(START, State(E, [0.1, 0, 0]), 20.0, hold=5.0), "hold", "angular velocity",
    ),
    "negative hold": (lambda: Problem(START, START, 20.0, hold=-1.0), "hold", "at least 0"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_goal_is_named_with_its_key(case):
    make, key, words = WRONG[case]
    with pytest.raises(InvalidProblemError) as caught:
        make()
    assert caught.value.key == key
    assert words in str(caught.value)
