# SPDX-License-Identifier: Apache-2.0
"""Logarithms of groups and quotients that the principal one of matrices does not serve."""

import numpy as np
import pytest

from riem_planner import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.manifolds import GeneralProblem, GeneralState, solve_general
from riem_planner.manifolds.lie_groups import CompactGroup, special_orthogonal
from riem_planner.manifolds.matrices import unitary_log
from riem_planner.manifolds.matrix_space import OutsideInjectivityRadiusError
from riem_planner.manifolds.symmetric_spaces import SymmetricSpace

CIRCLE = CompactGroup("U(1) with weights 1, 2", [np.diag([1j, 2j])])


def spin(j):
    """The representation of SU(2) of dimension 2 j + 1."""
    m = np.arange(j, -j - 1.0, -1.0)
    up = np.diag(np.sqrt(j * (j + 1) - m[1:] * (m[1:] + 1)), 1)
    generators = ((up + up.T) / 2, (up - up.T) / 2j, np.diag(m))
    # In this scale the coordinates are rotation vectors.
    return CompactGroup(f"spin {j}", [-1j * X for X in generators], 1.0 / np.sum(m**2))


SPIN = spin(1.5)
FLIP = np.diag([-1.0, 1.0, 1.0])


def quotient(*, connected):
    return SymmetricSpace(
        "SO(3) by diag(-1, 1, 1)",
        special_orthogonal(3),
        lambda g: FLIP @ g @ FLIP,
        connected=connected,
    )


def turned(angle):
    return np.diag(np.exp(1j * angle * np.array([1.0, 2.0])))


@pytest.mark.parametrize("angle", [0.3, 1.5, np.pi / 2, 1.6, 2.0, -3.1])
def test_weights_the_principal_logarithm_does_not_serve(angle):
    v = CIRCLE.log(turned(angle))
    np.testing.assert_allclose(CIRCLE.algebra(v), np.diag([1j, 2j]) * angle, atol=1e-14)


@pytest.mark.parametrize("angle", [0.5, 1.5, 2.5, np.pi, 4.0, 6.0])
def test_spin_three_halves_counts_to_two_turns(angle):
    """Where eigenvalues coincide (pi) as well as where the principal logarithm leaves su(2)."""
    axis = np.array([0.6, -0.48, 0.64])
    h = SPIN.exp(angle * axis)
    np.testing.assert_allclose(SPIN.log(h), angle * axis, atol=1e-12)


def test_principal_logarithm_leaves_the_algebra_there():
    assert CIRCLE.span.outside(unitary_log(turned(2.0))[0]) > 1.0


@pytest.mark.parametrize(
    ("space", "start", "goal", "cost"),
    [
        # Rest to rest along a geodesic of length L costs 6 L^2 in unit time.
        (CIRCLE, turned(-1.0), turned(1.0), 6.0 * 2.5 * 4.0),
        (SPIN, SPIN.exp(np.array([0.0, 0.0, -1.5])), SPIN.exp(np.array([0.0, 0.0, 1.5])), 54.0),
    ],
    ids=["weights 1, 2", "spin 3/2"],
)
def test_solved_means_that_the_end_is_the_goal(space, start, goal, cost):
    solution = solve_general(GeneralProblem(space, GeneralState(start), GeneralState(goal), 1.0))
    assert solution.solved
    end = solution.trajectory.evaluate(1.0)[0]
    assert np.abs(end - goal).max() < 1e-9
    assert solution.boundary_error[0] < 1e-9
    assert solution.cost == pytest.approx(cost, rel=1e-9)


def test_boundary_error_is_measured_between_matrices():
    assert CIRCLE.gap(turned(1.0), turned(-1.0)) == pytest.approx(
        np.linalg.norm(turned(1.0) - turned(-1.0))
    )


def test_matrix_without_a_logarithm_in_the_algebra_is_refused():
    wrong = np.diag(np.exp(1j * np.array([1.0, 1.0])))
    with pytest.raises(InvalidProblemError, match="each logarithm of which leaves the Lie algebra"):
        GeneralProblem(CIRCLE, GeneralState(wrong), GeneralState(np.eye(2)), 1.0)
    with pytest.raises(OutsideInjectivityRadiusError, match="no logarithm of the element"):
        CIRCLE.log(wrong)


@pytest.mark.parametrize("angle", [0.3, 1.4, 1.7, 2.5, 3.1])
def test_quotient_by_the_identity_component_is_the_sphere(angle):
    h = so3.exp([0.0, angle, 0.0]) @ so3.exp([1.1, 0.0, 0.0])
    sphere, plane = quotient(connected=True), quotient(connected=False)
    assert sphere.distance(np.eye(3), h) == pytest.approx(angle, abs=1e-12)
    assert plane.distance(np.eye(3), h) == pytest.approx(min(angle, np.pi - angle), abs=1e-12)


def test_goal_of_a_quotient_by_all_fixed_elements_is_a_line():
    """2.5 rad away on the sphere; the whole fixed group takes the antipode for the goal."""
    goal = so3.exp([0.0, 2.5, 0.0])

    def solved(*, connected):
        space = quotient(connected=connected)
        return solve_general(
            GeneralProblem(space, GeneralState(np.eye(3)), GeneralState(goal), 1.0)
        )

    plane, sphere = solved(connected=False), solved(connected=True)
    assert plane.cost == pytest.approx(6.0 * (np.pi - 2.5) ** 2, rel=1e-9)
    assert "the same point" in plane.notes[0]
    assert sphere.cost == pytest.approx(6.0 * 2.5**2, rel=1e-9)
    assert sphere.notes == ()
    np.testing.assert_allclose(sphere.trajectory.evaluate(1.0)[0][:, 0], goal[:, 0], atol=1e-9)
    assert sphere.boundary_error[0] < 1e-9
