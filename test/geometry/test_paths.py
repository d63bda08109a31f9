# SPDX-License-Identifier: Apache-2.0
"""Directions that move: sampled ones are C^2, and their motion is that of the unit vector."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3, sphere
from riem_planner.geometry.paths import Path, Turning, as_direction


def an_orbit(times):
    """Direction to the Earth along an inclined circular orbit of 5600 s."""
    angle = 2 * np.pi * np.asarray(times) / 5600.0
    return np.stack([-np.cos(angle), -0.6 * np.sin(angle), -0.8 * np.sin(angle)], axis=-1)


def sampled(step, end=1200.0):
    times = np.arange(0.0, end + 0.5 * step, step)
    return Path(times, 7000.0 * an_orbit(times))


def test_a_path_is_the_not_a_knot_spline_through_unit_vectors():
    path = sampled(60.0)
    t = np.linspace(0.0, 1200.0, 501)
    p = CubicSpline(path.times, an_orbit(path.times), bc_type="not-a-knot")(t)
    expected = p / np.linalg.norm(p, axis=1)[:, None]
    np.testing.assert_allclose(path.direction_at(t), expected, atol=1e-15)


def test_a_path_converges_with_the_fourth_power_of_its_step():
    t = np.linspace(0.0, 1200.0, 997)
    errors = [sphere.angle(sampled(h).direction_at(t), an_orbit(t)).max() for h in (120, 60, 30)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(orders > 3.5)
    assert np.degrees(errors[2]) < 1e-6


@pytest.mark.parametrize("place", [sampled(60.0), Turning([1.0, 2.0, 0.5], [1e-3, -2e-3, 5e-4])])
def test_motion_is_the_derivative_of_the_direction(place):
    t, h = np.linspace(100.0, 1000.0, 37), 1e-1
    s, s_1, s_2 = place.motion_at(t)
    np.testing.assert_allclose(s, place.direction_at(t), atol=1e-15)
    first = (place.direction_at(t + h) - place.direction_at(t - h)) / (2 * h)
    second = (place.motion_at(t + h)[1] - place.motion_at(t - h)[1]) / (2 * h)
    np.testing.assert_allclose(s_1, first, atol=1e-10)
    np.testing.assert_allclose(s_2, second, atol=1e-9)
    np.testing.assert_allclose(np.sum(s * s_1, axis=1), 0.0, atol=1e-18)


def test_second_derivatives_are_continuous_where_pieces_meet():
    path = sampled(120.0)
    knots = path.times[1:-1]
    before, after = path.motion_at(knots - 1e-7)[2], path.motion_at(knots + 1e-7)[2]
    np.testing.assert_allclose(before, after, atol=1e-14)


def test_a_turning_direction_turns_by_its_rotation_vector():
    turning = Turning([0.0, 3.0, 0.0], [0.0, 0.0, 0.1])
    np.testing.assert_allclose(
        turning.direction_at([0.0, 5.0]), [[0, 1, 0], so3.exp([0, 0, 0.5])[:, 1]], atol=1e-15
    )
    assert not np.any(as_direction("direction", [0, 0, 2]).rate)


@pytest.mark.parametrize(
    ("times", "directions", "key", "said"),
    [
        ([0, 1, 2], np.eye(3), "times", "at least 4"),
        ([0, 1, 1, 2], an_orbit([0, 1, 2, 3]), "times[2]", "increasing times, got 1 s after 1 s"),
        ([0, 1, 2, 3], [[1, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0]], "directions[1]", "zero"),
        ([0, 1, 2, 3], [[1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 0, 0]], "directions[1]", "60 degrees"),
        ([0, 1, 2, np.nan], an_orbit([0, 1, 2, 3]), "times", "finite"),
    ],
)
def test_wrong_samples_are_named(times, directions, key, said):
    with pytest.raises(InvalidProblemError, match=said) as caught:
        Path(times, directions)
    assert caught.value.key == key


def test_a_path_says_nothing_beyond_its_samples():
    with pytest.raises(ValueError, match=r"from 0 to 1201"):
        sampled(60.0).direction_at([0.0, 1201.0])
