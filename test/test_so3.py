# SPDX-License-Identifier: Apache-2.0
"""The rotation group: its axioms near the identity, near half a turn, and everywhere else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from riem_planner.geometry import so3

settings.register_profile("geometry", derandomize=True, max_examples=50, deadline=None)
settings.load_profile("geometry")

ABSOLUTE = 2e-15  # between rounded attitudes
RELATIVE = 1e-14  # where the relative rotation itself is given


def uniform(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def tangent_normal(rng):
    return so3.quaternion_exp(rng.normal(size=3))


def near_identity(rng):
    return so3.quaternion_exp(1e-7 * rng.normal(size=3))


@st.composite
def attitudes(draw):
    """Unit quaternions: uniform, exponentials of normal vectors, and within 1e-7 of identity."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return draw(st.sampled_from([uniform, tangent_normal, near_identity]))(rng)


@st.composite
def axes(draw):
    vector = np.random.default_rng(draw(st.integers(0, 2**32 - 1))).normal(size=3)
    return vector / np.linalg.norm(vector)


def same_rotation(p, q):
    """Largest difference of two quaternions, which are the same rotation up to sign."""
    return min(np.abs(p - q).max(), np.abs(p + q).max())


@given(attitudes(), attitudes(), attitudes())
def test_product_is_associative(p, q, r):
    left = so3.quaternion_multiply(so3.quaternion_multiply(p, q), r)
    right = so3.quaternion_multiply(p, so3.quaternion_multiply(q, r))
    np.testing.assert_allclose(left, right, atol=ABSOLUTE)


@given(attitudes())
def test_identity_and_inverse(q):
    identity = np.array([0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(so3.quaternion_multiply(q, identity), q)
    product = so3.quaternion_multiply(q, so3.quaternion_conjugate(q))
    np.testing.assert_allclose(product, identity, atol=ABSOLUTE)


@given(attitudes(), attitudes())
def test_matrix_of_a_product_is_the_product_of_matrices(p, q):
    product = so3.quaternion_to_matrix(so3.quaternion_multiply(p, q))
    matrices = so3.quaternion_to_matrix(p) @ so3.quaternion_to_matrix(q)
    np.testing.assert_allclose(product, matrices, atol=2 * ABSOLUTE)


@given(attitudes())
def test_matrix_is_a_rotation(q):
    R = so3.quaternion_to_matrix(q)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=2 * ABSOLUTE)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=4 * ABSOLUTE)


@given(attitudes())
def test_opposite_quaternions_are_the_same_rotation(q):
    np.testing.assert_array_equal(so3.quaternion_to_matrix(q), so3.quaternion_to_matrix(-q))
    np.testing.assert_array_equal(so3.quaternion_log(q), so3.quaternion_log(-q))
    assert so3.quaternion_distance(q, -q) < ABSOLUTE
    turned = so3.quaternion_multiply(q, so3.quaternion_exp([0.3, 0.1, -0.2]))
    assert so3.quaternion_distance(q, turned) == so3.quaternion_distance(-q, turned)


@given(attitudes())
def test_quaternion_of_a_matrix_inverts_the_matrix(q):
    assert same_rotation(so3.matrix_to_quaternion(so3.quaternion_to_matrix(q)), q) < ABSOLUTE


@given(attitudes())
def test_exponential_inverts_the_logarithm(q):
    assert same_rotation(so3.quaternion_exp(so3.quaternion_log(q)), q) < ABSOLUTE


ANGLES = [1e-150, 1e-12, 1e-7, 2e-8, 5e-9, 1e-3, 0.5, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-8, np.pi]


@pytest.mark.parametrize("angle", ANGLES)
@given(axes())
def test_logarithm_inverts_the_exponential_to_1e_14_relative(angle, axis):
    xi = so3.quaternion_log(so3.quaternion_exp(angle * axis))
    if angle == np.pi and xi @ axis < 0.0:
        xi = -xi  # half a turn either way is the same rotation
    assert np.linalg.norm(xi - angle * axis) <= RELATIVE * angle


@pytest.mark.parametrize("angle", ANGLES)
@given(axes())
def test_distance_of_a_given_rotation_to_1e_14_relative(angle, axis):
    identity = np.array([0.0, 0.0, 0.0, 1.0])
    distance = so3.quaternion_distance(identity, so3.quaternion_exp(angle * axis))
    assert abs(distance - angle) <= RELATIVE * angle


@pytest.mark.parametrize("angle", [0.0, *ANGLES])
@given(attitudes(), axes())
def test_distance_between_rounded_attitudes(angle, q, axis):
    turned = so3.quaternion_multiply(q, so3.quaternion_exp(angle * axis))
    turned = turned / np.linalg.norm(turned)
    assert abs(so3.quaternion_distance(q, turned) - angle) < ABSOLUTE


@given(attitudes(), attitudes(), attitudes())
def test_distance_is_a_bi_invariant_metric(p, q, r):
    d = so3.quaternion_distance
    assert d(p, q) == pytest.approx(float(d(q, p)), abs=ABSOLUTE)
    assert d(p, r) <= d(p, q) + d(q, r) + 2 * ABSOLUTE
    for left, right in ((r, None), (None, r)):
        moved = [
            so3.quaternion_multiply(left, x) if right is None else so3.quaternion_multiply(x, right)
            for x in (p, q)
        ]
        assert d(*moved) == pytest.approx(float(d(p, q)), abs=2 * ABSOLUTE)
    matrices = so3.quaternion_to_matrix(np.stack([p, q]))
    assert so3.distance(*matrices) == pytest.approx(float(d(p, q)), abs=4 * ABSOLUTE)


def test_distance_has_no_kink_of_rounding_near_half_a_turn():
    steps = np.pi - np.array([1e-4, 1e-6, 1e-8, 1e-10])
    found = so3.distance(np.eye(3), so3.exp(steps[:, None] * np.array([0.6, 0.0, 0.8])))
    np.testing.assert_allclose(found, steps, atol=ABSOLUTE, rtol=0)


@given(axes())
def test_hat_is_the_cross_product_and_vee_its_inverse(axis):
    p = np.array([0.3, -0.7, 0.2])
    np.testing.assert_allclose(so3.hat(axis) @ p, np.cross(axis, p), atol=1e-16)
    np.testing.assert_array_equal(so3.vee(so3.hat(axis)), axis)


@pytest.mark.parametrize("angle", [1e-12, 1e-7, 1e-3, 0.49, 0.51, 2.0, 3.1, np.pi, 5.0])
@given(axes())
def test_right_jacobian_is_the_finite_difference(angle, axis):
    xi, h = angle * axis, 1e-4
    inverse = so3.quaternion_conjugate(so3.quaternion_exp(xi))
    columns = []
    for e in np.eye(3):
        values = [
            so3.quaternion_log(so3.quaternion_multiply(inverse, so3.quaternion_exp(xi + k * h * e)))
            for k in (-2, -1, 1, 2)
        ]
        columns.append((values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h))
    np.testing.assert_allclose(so3.right_jacobian(xi), np.stack(columns, axis=1), atol=1e-10)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-3, 0.49, 0.51, 2.0, 3.1, np.pi, 5.0])
@given(axes())
def test_jacobian_inverse_inverts_it(angle, axis):
    product = so3.right_jacobian(angle * axis) @ so3.right_jacobian_inverse(angle * axis)
    np.testing.assert_allclose(product, np.eye(3), atol=4e-15)


@given(axes(), axes())
def test_minimal_rotation_takes_one_direction_to_the_other(a, b):
    q = so3.minimal_rotation(a, b)
    np.testing.assert_allclose(so3.quaternion_to_matrix(q) @ a, b, atol=ABSOLUTE)
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
    assert np.linalg.norm(so3.quaternion_log(q)) == pytest.approx(angle, abs=ABSOLUTE)


@pytest.mark.parametrize("offset", [0.0, 1e-16, 1e-12, 1e-8, 1e-4])
def test_minimal_rotation_near_the_opposite_and_the_same_direction(offset):
    a = np.array([1.0, 0.0, 0.0])
    for sign in (1.0, -1.0):
        b = np.array([sign, offset, 0.0]) / np.hypot(1.0, offset)
        q = so3.minimal_rotation(a, b)
        np.testing.assert_allclose(so3.quaternion_to_matrix(q) @ a, b, atol=ABSOLUTE)


def test_minimal_rotation_of_opposite_directions_turns_about_the_least_aligned_axis():
    q = so3.minimal_rotation([0.9, 0.1, np.sqrt(0.18)], [-0.9, -0.1, -np.sqrt(0.18)])
    axis = np.array([-0.09, 0.99, -0.1 * np.sqrt(0.18)])
    np.testing.assert_allclose(q, [*axis / np.linalg.norm(axis), 0.0], atol=ABSOLUTE)


def test_batches_broadcast():
    rng = np.random.default_rng(0)
    xi = rng.normal(size=(4, 1, 3))
    q = so3.quaternion_exp(rng.normal(size=(5, 3)))
    product = so3.quaternion_multiply(so3.quaternion_exp(xi), q)
    assert product.shape == (4, 5, 4)
    assert so3.quaternion_distance(so3.quaternion_exp(xi), q).shape == (4, 5)
    assert so3.log(so3.exp(xi)).shape == (4, 1, 3)
    np.testing.assert_allclose(so3.exp(xi)[2, 0], so3.exp(xi[2, 0]), atol=1e-16)
