# SPDX-License-Identifier: Apache-2.0
"""Compact groups, symmetric spaces and R^n: geometry, extremals, clear errors."""

import numpy as np
import pytest
from scipy.linalg import expm

from riem_planner import S2, SO3, InvalidProblemError, OrientationObstacle, State, Zone
from riem_planner.extremals import extremal
from riem_planner.geometry import so3
from riem_planner.manifolds import GeneralProblem, GeneralState, PointObstacle
from riem_planner.manifolds.lie_groups import (
    CompactGroup,
    euclidean,
    special_orthogonal,
    special_unitary,
    unitary,
)
from riem_planner.manifolds.matrix_space import OutsideInjectivityRadiusError
from riem_planner.manifolds.symmetric_spaces import (
    SymmetricSpace,
    real_grassmannian,
    unit_sphere,
)

SPACES = [
    special_orthogonal(3),
    special_orthogonal(4),
    special_unitary(2),
    special_unitary(3),
    unitary(2),
    euclidean(3),
    unit_sphere(2),
    unit_sphere(3),
    real_grassmannian(2, 4),
    real_grassmannian(1, 3),
    SymmetricSpace("SU(3)/SO(3)", special_unitary(3), np.conj),
]
every_space = pytest.mark.parametrize("space", SPACES, ids=str)


@every_space
def test_exponential_is_that_of_the_matrix(space):
    v = np.random.default_rng(0).normal(size=space.dimension)
    np.testing.assert_allclose(space.exp(v), expm(space.algebra(v)), atol=1e-14)


@every_space
@pytest.mark.parametrize("length", [0.0, 1e-9, 1e-3, 0.7, 1.2])
def test_logarithm_inverts_the_exponential(space, length):
    v = np.random.default_rng(1).normal(size=(20, space.dimension))
    v *= length / np.linalg.norm(v, axis=1, keepdims=True)
    np.testing.assert_allclose(space.log(space.exp(v)), v, atol=4e-15)


@every_space
def test_distance_is_symmetric_and_left_invariant(space):
    rng = np.random.default_rng(2)
    g, h, left = (space.exp(0.5 * rng.normal(size=space.dimension)) for _ in range(3))
    assert space.distance(g, h) == pytest.approx(float(space.distance(h, g)), abs=1e-14)
    assert space.distance(left @ g, left @ h) == pytest.approx(float(space.distance(g, h)))


@every_space
def test_basis_is_orthonormal_in_the_stated_metric(space):
    inner = space.scale * np.real(np.einsum("iab,jab->ij", np.conj(space.basis), space.basis))
    np.testing.assert_allclose(inner, np.eye(space.dimension), atol=1e-14)


def test_dimensions_are_the_textbook_ones():
    found = [space.dimension for space in SPACES]
    assert found == [3, 6, 3, 8, 4, 3, 2, 3, 4, 2, 5]


def test_distances_have_the_stated_normalisation():
    assert special_orthogonal(3).distance(np.eye(3), so3.exp([0, 0, 1.1])) == pytest.approx(1.1)
    turn = expm(-0.5j * 1.1 * np.diag([1.0, -1.0]))
    assert special_unitary(2).distance(np.eye(2), turn) == pytest.approx(0.55)
    assert special_unitary(2, scale=2.0).distance(np.eye(2), turn) == pytest.approx(1.1)
    sphere = unit_sphere(3)
    x = np.array([0.6, 0.0, 0.8, 0.0])
    assert sphere.distance(sphere.identity, sphere.lift(x)) == pytest.approx(np.arccos(0.6))
    np.testing.assert_allclose(sphere.point(sphere.lift(x)), x, atol=1e-15)
    grassmannian = real_grassmannian(2, 4)
    g = np.eye(4)
    for angle, (i, j) in ((0.3, (0, 2)), (0.4, (1, 3))):
        g[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    assert grassmannian.distance(np.eye(4), g) == pytest.approx(0.5)


def test_special_unitary_logarithm_has_no_trace():
    group = special_unitary(3)
    h = np.diag(np.exp(1j * np.array([2.6, 2.2, -4.8])))
    X = group.algebra(group.log(h))
    assert abs(np.trace(X)) < 1e-13
    np.testing.assert_allclose(expm(X), h, atol=1e-13)
    # The shortest: reducing the largest angle beats every other choice of branches.
    assert np.linalg.norm(X) <= np.linalg.norm([2.6, 2.2, -4.8]) + 1e-12


@every_space
def test_hamiltonian_constant_along_extremals(space):
    rng = np.random.default_rng(3)
    n = space.dimension
    v, a, j = (0.5 * rng.normal(size=n) for _ in range(3))
    obstacle = PointObstacle(space.exp(0.6 * rng.normal(size=n) / np.sqrt(n) + 0.4 * v), 0.05)
    curve = extremal(
        space,
        GeneralState(space.identity, v),
        a,
        j,
        (obstacle,),
        0.4,
        duration=1.0,
        tolerance=1e-11,
    )
    t = np.linspace(0.0, 1.0, 7)
    assert np.ptp(curve.hamiltonian(t)) < 1e-8 * np.max(np.abs(curve.hamiltonian(t)))
    assert np.ptp(np.sum(curve.evaluate(t)[2] ** 2, axis=1)) > 0.01


def test_so3_extremal_is_the_general_one():
    Q = so3.exp([0.5, 0.9, -0.3])
    v, a, j = [0.3, 0.8, -0.4], [0.2, -0.5, 0.1], [0.3, 0.2, -1.0]
    core = extremal(
        SO3,
        State(np.eye(3), v),
        a,
        j,
        (OrientationObstacle(Q, strength=0.5, radius=0.1),),
        0.7,
        duration=1.5,
    )
    general = extremal(
        special_orthogonal(3),
        GeneralState(np.eye(3), v),
        a,
        j,
        (PointObstacle(Q, 0.5, 0.1),),
        0.7,
        duration=1.5,
    )
    t = np.linspace(0.0, 1.5, 16)
    for mine, theirs in zip(general.evaluate(t), core.evaluate(t), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-10)


def test_s2_extremal_is_the_general_one():
    start, place = so3.exp([0.4, -0.2, 0.3]), so3.exp([0.1, 0.9, 0.5])
    v, a, j = [0.8, -0.4], [-0.5, 0.1], [0.2, -1.0]
    core = extremal(
        S2,
        State(start, [0, *v]),
        [0, *a],
        [0, *j],
        (Zone(place[:, 0], 0.1, strength=0.5),),
        0.7,
        duration=1.5,
    )
    general = extremal(
        unit_sphere(2),
        GeneralState(start, v),
        a,
        j,
        (PointObstacle(place, 0.5, 0.1),),
        0.7,
        duration=1.5,
    )
    t = np.linspace(0.0, 1.5, 16)
    R, *rates = core.evaluate(t)
    g, *general_rates = general.evaluate(t)
    np.testing.assert_allclose(g, R, atol=1e-10)
    for mine, theirs in zip(general_rates, rates, strict=True):
        np.testing.assert_allclose(mine, theirs[:, 1:], atol=1e-10)


def test_projective_line_is_half_the_sphere():
    """Gr(1, 3) is S^2 with opposite points the same: extremals agree."""
    sphere, line = unit_sphere(2), real_grassmannian(1, 3)
    v, a, j = np.array([[0.8, -0.4], [-0.5, 0.1], [0.2, -1.0]])
    place = sphere.exp(np.array([0.3, 0.6]))
    same = line.coordinates(sphere.basis).T  # coordinates on the sphere to those of the line
    on_sphere = extremal(
        sphere, GeneralState(np.eye(3), v), a, j, (PointObstacle(place, 0.1),), duration=1.0
    )
    on_line = extremal(
        line,
        GeneralState(np.eye(3), same @ v),
        same @ a,
        same @ j,
        (PointObstacle(place, 0.1),),
        duration=1.0,
    )
    np.testing.assert_allclose(on_line.evaluate(1.0)[0], on_sphere.evaluate(1.0)[0], atol=1e-10)


@pytest.mark.parametrize(
    ("space", "h"),
    [
        (special_orthogonal(3), np.diag([1.0, -1.0, -1.0])),
        (special_unitary(2), -np.eye(2)),
        (special_unitary(3), np.exp(2j * np.pi / 3) * np.eye(3)),
        (unitary(2), np.diag([1.0, -1.0])),
        (unit_sphere(2), np.diag([-1.0, -1.0, 1.0])),
        (real_grassmannian(1, 3), so3.exp([0.0, 0.0, np.pi / 2])),
    ],
    ids=str,
)
def test_logarithm_at_the_cut_locus_is_an_error(space, h):
    with pytest.raises(OutsideInjectivityRadiusError, match="logarithm is undefined"):
        space.log(h)


def test_distance_across_the_cut_locus_is_continuous():
    space = special_orthogonal(3)
    for angle in (np.pi - 1e-9, np.pi):
        assert space.distance(np.eye(3), so3.exp([0, 0, angle])) == pytest.approx(np.pi, abs=2e-6)
    assert space.distance(np.eye(3), np.diag([1.0, -1.0, -1.0])) == pytest.approx(np.pi, abs=2e-6)


@pytest.mark.parametrize(
    ("space", "g", "reason"),
    [
        (special_orthogonal(3), np.diag([1.0, 1.0, -1.0]), "determinant -1"),
        (special_orthogonal(3), 1.01 * np.eye(3), r"\|g g\^\* - I\|"),
        (special_orthogonal(3), np.eye(2), r"shape \(2, 2\)"),
        (special_orthogonal(3), np.full((3, 3), np.nan), "finite"),
        (special_unitary(2), 1j * np.eye(2), "determinant"),
        (unit_sphere(2), np.diag([1.0, 1.0, -1.0]), "determinant -1"),
        (euclidean(2), 2.0 * np.eye(3), "translation|that is not"),
        (
            CompactGroup("T^2", [np.diag([1j, 0]), np.diag([0, 1j])]),
            np.array([[0, 1], [-1, 0]]),
            "leaves the Lie algebra",
        ),
    ],
)
def test_matrix_outside_the_group_is_an_error(space, g, reason):
    with pytest.raises(InvalidProblemError, match=reason):
        GeneralProblem(space, GeneralState(g), GeneralState(space.identity), 1.0)


def test_problem_values_are_checked():
    space = special_orthogonal(3)
    rest = GeneralState(np.eye(3))
    for values, key in (
        ({"duration": 0.0}, "duration"),
        ({"tension": -1.0}, "tension"),
        ({"start": GeneralState(np.eye(3), [1.0])}, "start.rate"),
        ({"obstacles": (PointObstacle(np.eye(3), -1.0),)}, "obstacles.0..strength"),
        ({"obstacles": (PointObstacle(np.eye(3), 1.0, name="a"),) * 2}, "used twice"),
        ({"space": SO3}, "MatrixSpace"),
    ):
        stated = {"space": space, "start": rest, "goal": rest, "duration": 1.0} | values
        with pytest.raises(InvalidProblemError, match=key):
            GeneralProblem(**stated)
    with pytest.raises(InvalidProblemError, match="outside of every obstacle"):
        extremal(
            space,
            rest,
            np.zeros(3),
            np.zeros(3),
            (PointObstacle(np.eye(3), 1.0, 0.1),),
            duration=1.0,
        )


def test_a_basis_that_is_no_algebra_is_an_error():
    with pytest.raises(ValueError, match="does not span a Lie algebra"):
        CompactGroup("half of SO(3)", so3.hat(np.eye(3))[:2])
    with pytest.raises(ValueError, match="no automorphism"):
        SymmetricSpace("wrong", special_orthogonal(3), lambda g: np.diag([1.0, 2.0, 3.0]) @ g)
