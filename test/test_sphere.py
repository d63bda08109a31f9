# SPDX-License-Identifier: Apache-2.0
"""The sphere of directions: angle, exponential and logarithm near 0, near pi, between."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from riem_planner.geometry import sphere

settings.register_profile("geometry", derandomize=True, max_examples=50, deadline=None)
settings.load_profile("geometry")

ABSOLUTE = 2e-15
ANGLES = [1e-12, 1e-7, 1e-3, 0.5, 1.5, 3.0, np.pi - 1e-3, np.pi - 1e-7]


@st.composite
def frames(draw):
    """A direction and a unit tangent vector at it."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q[:, 0], q[:, 1]


@pytest.mark.parametrize("angle", [0.0, *ANGLES, np.pi])
@given(frames())
def test_angle_between_rounded_directions(angle, frame):
    x, u = frame
    assert abs(sphere.angle(x, np.cos(angle) * x + np.sin(angle) * u) - angle) < ABSOLUTE


@given(frames())
def test_angle_does_not_depend_on_lengths(frame):
    x, u = frame
    y = 0.3 * x + 0.7 * u
    assert sphere.angle(5.0 * x, 1e-3 * y) == pytest.approx(np.arctan2(0.7, 0.3), abs=ABSOLUTE)


@pytest.mark.parametrize("angle", [0.0, *ANGLES])
@given(frames())
def test_logarithm_inverts_the_exponential(angle, frame):
    x, u = frame
    tangent = sphere.log(x, sphere.exp(x, angle * u))
    # Near the antipode the direction of the arc is as uncertain as the point is rounded.
    assert np.linalg.norm(tangent) == pytest.approx(angle, abs=ABSOLUTE)
    assert np.linalg.norm(tangent - angle * u) <= 1e-15 * (4.0 + angle / max(np.sin(angle), 1e-99))


@pytest.mark.parametrize("angle", ANGLES)
@given(frames())
def test_logarithm_is_tangent(angle, frame):
    x, u = frame
    assert abs(sphere.log(x, sphere.exp(x, angle * u)) @ x) < ABSOLUTE * angle


def test_exponential_stays_on_the_sphere_and_starts_along_the_tangent():
    x, u = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])
    assert np.linalg.norm(sphere.exp(x, 100.0 * u)) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose((sphere.exp(x, 1e-6 * u) - x) / 1e-6, u, atol=1e-6)


def test_logarithm_of_the_antipode_is_zero():
    np.testing.assert_array_equal(sphere.log([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]), np.zeros(3))


def test_batches_broadcast():
    x = np.eye(3)[:, None]
    assert sphere.angle(x, np.eye(3)).shape == (3, 3)
    np.testing.assert_allclose(sphere.angle(x, np.eye(3)), np.pi / 2 * (1 - np.eye(3)))
