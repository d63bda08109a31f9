# SPDX-License-Identifier: Apache-2.0
"""End states in units of the slew, and roll about the boresight at all times."""

import numpy as np
import pytest

from riem_planner import S2, SO3, Problem, State, Trajectory, certify, solve
from riem_planner.geometry import so3

TURN = so3.exp([0.0, 0.0, 1.0])


@pytest.mark.parametrize("space", [SO3, S2], ids=["so3", "s2"])
@pytest.mark.parametrize("duration", [1e-3, 1.0, 1e6])
def test_end_rates_count_by_the_slew_however_long_it_is(space, duration):
    problem = Problem(State(np.eye(3)), State(TURN), duration, space)
    trajectory = solve(problem).trajectory
    assert certify(trajectory, problem).certified
    for share, accepted in ((1e-10, True), (1e-8, False)):
        rate = np.array([0.0, 0.0, share / duration])
        state = State(TURN, rate)
        moved = Problem(State(np.eye(3)), state, duration, space)
        certificate = certify(trajectory, moved)
        assert certificate.certified is accepted
        assert accepted or "goal: angular velocity missed" in certificate.reasons[0]


def test_end_attitudes_count_by_a_billionth():
    problem = Problem(State(np.eye(3)), State(TURN), 1.0)
    trajectory = solve(problem).trajectory
    for angle, accepted in ((3e-10, True), (3e-9, False)):
        goal = State(TURN @ so3.exp([angle, 0.0, 0.0]))
        moved = Problem(State(np.eye(3)), goal, 1.0)
        assert certify(trajectory, moved).certified is accepted


def rolling(per_rate, at=0.37):
    """A pointing slew that rolls between two of its samples, and its problem."""
    problem = Problem(State(np.eye(3)), State(TURN), 10.0, S2)
    flat = solve(problem).trajectory
    times = np.linspace(0.0, 10.0, 201)
    q, v, a = flat.evaluate_quaternion(times)
    k = int(at * 200)
    # Opposite roll accelerations at both ends roll there and back within the interval.
    h = times[1]
    size = 16.0 * per_rate * np.abs(v).max() / h
    a = a.copy()
    a[k] += [size, 0.0, 0.0]
    a[k + 1] -= [size, 0.0, 0.0]
    return Trajectory(times, q, v, a), problem


def test_roll_between_samples_is_seen_wherever_it_is():
    for per_rate, accepted in ((1e-8, True), (1e-5, False), (6.0, False)):
        trajectory, problem = rolling(per_rate)
        certificate = certify(trajectory, problem)
        rolls = any("roll" in reason for reason in certificate.reasons)
        assert rolls is not accepted, per_rate
    assert any("roll: up to" in reason for reason in certificate.reasons)


def test_the_roll_stated_is_an_upper_bound():
    trajectory, problem = rolling(1e-4)
    reason = next(r for r in certify(trajectory, problem).reasons if r.startswith("roll"))
    times = np.linspace(0.0, 10.0, 20001)
    _, v, _ = trajectory.evaluate_quaternion(times)
    assert float(reason.split("up to ")[1].split()[0]) >= 0.2 * np.abs(v[:, 0]).max() > 0.0
