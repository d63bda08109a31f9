# SPDX-License-Identifier: Apache-2.0
"""Stops: begin with the state's rate and acceleration, end at rest, never jump."""

import numpy as np
import pytest

from riem_planner.geometry import so3
from riem_planner.stop import SHORTEST, certified_stop, stop_trajectory, stops

Q = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
V = np.array([0.05, -0.02, 0.03])
A = np.array([0.003, 0.001, -0.004])


def test_begins_at_the_state_and_ends_at_rest():
    stop = stop_trajectory(Q, V, A, 20.0)
    q, v, a = stop.evaluate_quaternion(np.array([0.0, stop.duration]))
    assert np.allclose(q[0], Q, atol=1e-15)
    assert np.allclose(v, [V, np.zeros(3)], atol=1e-15)
    assert np.allclose(a, [A, np.zeros(3)], atol=1e-15)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 10.0])
def test_rate_and_acceleration_are_the_derivatives_of_the_attitude(scale):
    stop = stop_trajectory(Q, scale * V, scale * A, 20.0)
    t = np.linspace(0.0, 20.0, 4001)
    R, v, a = stop.evaluate(t)
    h = t[1]
    turned = so3.log(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / h
    assert np.abs(turned - 0.5 * (v[1:] + v[:-1])).max() < 1e-6 * max(scale, 1e-3)
    assert np.abs(np.diff(v, axis=0) / h - 0.5 * (a[1:] + a[:-1])).max() < 1e-6 * max(scale, 1e-3)
    # The samples' own accelerations, which the quintics interpolate, agree as well.
    assert np.abs(stop.angular_accelerations[12] - stop.evaluate(stop.times[12])[2]).max() < 1e-14


def test_each_stop_is_harder_than_the_one_before():
    found = list(stops(Q, V, np.zeros(3), 1e-3))
    durations = np.array([stop.duration for stop in found])
    assert np.all(np.diff(durations) < 0.0)
    peak = np.linalg.norm(found[0].evaluate(np.linspace(0, found[0].duration, 500))[2], axis=1)
    assert peak.max() == pytest.approx(1e-3, rel=0.02)


def test_a_state_at_rest_stops_where_it_is():
    (stop,) = stops(Q, np.zeros(3), np.zeros(3), 1e-3)
    assert stop.duration == SHORTEST
    assert np.allclose(stop.quaternions_xyzw, Q, atol=1e-15)


def test_the_gentlest_stop_that_the_judge_accepts_is_taken():
    gentle, *rest = list(stops(Q, V, A, 1e-3))
    assert certified_stop(Q, V, A, 1e-3, lambda stop: True).duration == gentle.duration
    limit = rest[1].duration + 1e-9
    found = certified_stop(Q, V, A, 1e-3, lambda stop: stop.duration < limit)
    assert found.duration == rest[1].duration
    assert certified_stop(Q, V, A, 1e-3, lambda stop: False) is None
