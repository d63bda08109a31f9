# SPDX-License-Identifier: Apache-2.0
"""Boundary-value problems on general spaces, against each other and against exact answers."""

import numpy as np
import pytest

from riem_planner import (
    S2,
    InvalidProblemError,
    OrientationObstacle,
    Problem,
    State,
    Status,
    Zone,
    solve,
)
from riem_planner.geometry import so3, sphere
from riem_planner.manifolds import GeneralProblem, GeneralState, PointObstacle, solve_general
from riem_planner.manifolds.lie_groups import (
    CompactGroup,
    euclidean,
    special_orthogonal,
    special_unitary,
)
from riem_planner.manifolds.matrix_space import OutsideInjectivityRadiusError
from riem_planner.manifolds.symmetric_spaces import (
    SymmetricSpace,
    real_grassmannian,
    unit_sphere,
)

V0, V1 = np.array([0.3, 0.8, -0.4]), np.array([-0.5, 0.2, 0.9])
X1, XQ = np.array([0.2, -1.1, 0.4]), np.array([0.15, -0.5, 0.05])


def stated(space, obstacles=True, **changes):
    """The same problem in the coordinates of any three-dimensional space."""
    values = {
        "space": space,
        "start": GeneralState(space.identity, V0),
        "goal": GeneralState(space.exp(X1), V1),
        "duration": 2.0,
        "tension": 0.5,
        "obstacles": (PointObstacle(space.exp(XQ), 0.05, 0.02, "q"),) if obstacles else (),
    }
    return GeneralProblem(**(values | changes))


def solved(problem, detours=0):
    solution = solve_general(problem, detours=detours)
    assert solution.solved, solution.message
    assert max(solution.boundary_error) < 1e-10
    return solution


def test_euclidean_space_gives_the_hermite_cubic():
    space = euclidean(3)
    solution = solved(stated(space, obstacles=False, tension=0.0))
    t = np.linspace(0.0, 2.0, 9)
    g, _, a = solution.trajectory.evaluate(t)
    s = t[:, None] / 2.0
    cubic = (s**3 - 2 * s**2 + s) * 2 * V0 + (3 * s**2 - 2 * s**3) * X1 + (s**3 - s**2) * 2 * V1
    np.testing.assert_allclose(g[:, :3, 3], cubic, atol=1e-12)
    np.testing.assert_allclose(a[0], 3 * X1 / 2 - (2 * V0 + V1), atol=1e-10)


def test_su2_agrees_with_so3_under_the_covering():
    cover, group = special_unitary(2, scale=2.0), special_orthogonal(3)
    above, below = solved(stated(cover)), solved(stated(group))
    assert above.cost == pytest.approx(below.cost, rel=1e-9)
    t = np.linspace(0.0, 2.0, 7)
    U, *rates = above.trajectory.evaluate(t)
    R, *others = below.trajectory.evaluate(t)
    pauli = 1j * np.sqrt(2.0 / 0.5) * cover.basis
    turned = 0.5 * np.real(np.einsum("iab,tbc,jcd,tad->tij", pauli, U, pauli, np.conj(U)))
    np.testing.assert_allclose(turned, R, atol=1e-9)
    for mine, theirs in zip(rates, others, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_s3_as_a_group_agrees_with_s3_as_a_quotient():
    group, sphere = special_unitary(2), unit_sphere(3)

    def point(g):
        return np.array([g[0, 0].real, g[0, 0].imag, g[1, 0].real, g[1, 0].imag])

    def on_sphere(state):
        lift = sphere.lift(point(state.element))
        velocity = point(state.element @ group.algebra(state.rate))
        return GeneralState(lift, (lift.T @ velocity)[1:])

    problem = stated(group)
    quotient = GeneralProblem(
        sphere,
        on_sphere(problem.start),
        on_sphere(problem.goal),
        2.0,
        0.5,
        (PointObstacle(sphere.lift(point(problem.obstacles[0].element)), 0.05, 0.02),),
    )
    first, second = solved(problem), solved(quotient)
    assert first.cost == pytest.approx(second.cost, rel=1e-9)
    t = np.linspace(0.0, 2.0, 7)
    U, x = first.trajectory.evaluate(t)[0], sphere.point(second.trajectory.evaluate(t)[0])
    np.testing.assert_allclose([point(g) for g in U], x, atol=1e-9)


def test_lift_is_horizontal_on_a_quotient():
    space = real_grassmannian(1, 4)
    rng = np.random.default_rng(0)
    v0, v1, x = 0.4 * rng.normal(size=(3, 3))
    solution = solved(
        GeneralProblem(space, GeneralState(np.eye(4), v0), GeneralState(space.exp(2 * x), v1), 1.0)
    )
    t, h = np.linspace(0.05, 0.95, 5), 1e-3
    g, v, _ = solution.trajectory.evaluate(t)
    steps = [solution.trajectory.evaluate(t + k * h)[0] for k in (-2, -1, 1, 2)]
    rate = (steps[0] - 8 * steps[1] + 8 * steps[2] - steps[3]) / (12 * h)
    np.testing.assert_allclose(np.swapaxes(g, 1, 2) @ rate, space.algebra(v), atol=1e-9)


def test_detours_find_another_extremal_and_keep_the_cheaper():
    solution = solved(stated(special_orthogonal(3), obstacles=False), detours=2)
    direct = solved(stated(special_orthogonal(3), obstacles=False))
    assert solution.cost <= direct.cost * (1 + 1e-9)
    assert all(cost > solution.cost for cost, _ in solution.alternatives)


def test_clearance_is_a_lower_bound():
    solution = solved(stated(special_orthogonal(3)))
    t = np.linspace(0.0, 2.0, 2001)
    g = solution.trajectory.evaluate(t)[0]
    least = np.min(so3.distance(g, so3.exp(XQ))) - 0.02
    assert least - 0.02 < solution.clearance["q"] <= least


def test_solves_are_the_same_bits():
    problem = stated(unit_sphere(3))
    assert solved(problem).cost == solved(problem).cost


def test_so3_compiled_and_general_solutions_agree():
    zone = OrientationObstacle(so3.exp(XQ), 0.05, radius=0.02)
    problem = Problem(
        State(np.eye(3), V0), State(so3.exp(X1), V1), 2.0, tension=0.5, obstacles=(zone,)
    )
    compiled = solve(problem, tolerance=1e-11)
    general = solve(stated(special_orthogonal(3)), search="local")
    assert general.cost == pytest.approx(compiled.cost, rel=1e-9)
    t = compiled.trajectory.times
    mine, theirs = general.trajectory.evaluate(t), compiled.trajectory.evaluate(t)
    assert so3.distance(mine[0], theirs[0]).max() < 1e-9
    np.testing.assert_allclose(mine[1], theirs[1], atol=1e-9)


def test_s2_compiled_and_general_solutions_agree():
    start, goal, place = (so3.exp([0, *x]) for x in ([0.4, 0.2], [-0.7, 1.2], [-0.1, 0.75]))
    problem = Problem(
        State(start, [0, 0.5, 0.3]),
        State(goal, [0, -0.2, 0.6]),
        2.0,
        space=S2,
        tension=0.5,
        obstacles=(Zone(place[:, 0], 0.05, strength=0.05),),
    )
    same = GeneralProblem(
        unit_sphere(2),
        GeneralState(start, [0.5, 0.3]),
        GeneralState(goal, [-0.2, 0.6]),
        2.0,
        0.5,
        (PointObstacle(place, 0.05, 0.05),),
    )
    compiled, general = solve(problem, tolerance=1e-11), solve(same, search="local")
    assert general.cost == pytest.approx(compiled.cost, rel=1e-9)
    t = compiled.trajectory.times
    mine, theirs = general.trajectory.evaluate(t), compiled.trajectory.evaluate(t)
    assert sphere.angle(mine[0][:, :, 0], theirs[0][:, :, 0]).max() < 1e-9
    # Both lifts are horizontal and start at the same attitude: they agree as attitudes.
    np.testing.assert_allclose(mine[0], theirs[0], atol=1e-9)


# A new compact group in a few lines: Sp(n), the unitary matrices with U^T J U = J.
def symplectic(n):
    J = np.kron([[0, 1], [-1, 0]], np.eye(n))
    raw = np.random.default_rng(0).normal(size=(2, 40, 2 * n, 2 * n))
    skew = raw[0] - np.swapaxes(raw[0], 1, 2) + 1j * (raw[1] + np.swapaxes(raw[1], 1, 2))
    basis = [X + J @ X.T @ J for X in skew]
    return CompactGroup(
        f"Sp({n})", basis, equation=lambda g: "" if np.allclose(g.T @ J @ g, J) else "off Sp"
    )


# A new symmetric space in one line.
complex_plane = SymmetricSpace(
    "CP^1", special_unitary(2), lambda g: np.diag([1, -1]) @ g @ np.diag([1, -1])
)


def test_new_group_sp1_is_su2():
    group = symplectic(1)
    assert symplectic(2).dimension == 10
    assert symplectic(2).why_not_element(np.diag([1j, 1, 1, 1]))
    rates = [group.coordinates(special_unitary(2).algebra(v)) for v in (V0, V1, X1, XQ)]
    problem = GeneralProblem(
        group,
        GeneralState(np.eye(2), rates[0]),
        GeneralState(group.exp(rates[2]), rates[1]),
        2.0,
        0.5,
        (PointObstacle(group.exp(rates[3]), 0.05, 0.02),),
    )
    assert solved(problem).cost == pytest.approx(solved(stated(special_unitary(2))).cost, rel=1e-9)


def test_new_space_cp1_is_a_sphere():
    """CP^1 in this metric is a unit sphere: the bases are matched by a rotation of m."""
    sphere = unit_sphere(2)
    assert complex_plane.dimension == 2
    v0, v1, x = np.array([[0.3, 0.8], [-0.5, 0.2], [0.4, -0.9]])
    radius = 0.5  # SU(2) with this metric is S^3 of radius 1, and its Hopf quotient half as large

    def problem(space, scale):
        return GeneralProblem(
            space,
            GeneralState(space.identity, v0 * scale),
            GeneralState(space.exp(x * scale), v1 * scale),
            1.0,
        )

    found = solved(problem(complex_plane, radius)).cost
    assert found == pytest.approx(radius**2 * solved(problem(sphere, 1.0)).cost, rel=1e-9)


def test_outcomes_are_values():
    space = special_orthogonal(3)
    inside = stated(space, start=GeneralState(space.exp(XQ), V0))
    assert solve_general(inside).status is Status.START_IN_ZONE
    inside = stated(space, goal=GeneralState(space.exp(XQ), V0))
    assert solve_general(inside).status is Status.GOAL_IN_ZONE
    assert solve_general(stated(space), should_stop=lambda: True).status is Status.CANCELLED
    assert solve_general(stated(space), deadline=0.0).status is Status.OUT_OF_TIME


def test_goal_on_the_cut_locus():
    space = unit_sphere(2)
    antipode = GeneralState(so3.exp([0.0, np.pi, 0.0]), [0.0, 0.0])
    problem = GeneralProblem(space, GeneralState(np.eye(3), [0.0, 0.0]), antipode, 1.0)
    with pytest.raises(OutsideInjectivityRadiusError):
        solve_general(problem, detours=0)
    # By way of a point off it there is nothing wrong: half a great circle, at rest at both ends.
    assert solve_general(problem).cost == pytest.approx(6 * np.pi**2, rel=1e-9)


def test_evaluate_beyond_the_ends_is_refused():
    trajectory = solved(stated(euclidean(3))).trajectory
    with pytest.raises(ValueError, match=r"\[0, 2\] s"):
        trajectory.evaluate(2.1)


def test_start_outside_the_group_is_refused():
    with pytest.raises(InvalidProblemError, match=r"start\.element"):
        stated(special_orthogonal(3), start=GeneralState(2 * np.eye(3), V0))
