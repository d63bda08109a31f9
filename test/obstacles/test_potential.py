# SPDX-License-Identifier: Apache-2.0
"""The compiled potential: its values, and its gradient and Hessian by Taylor's theorem."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import betainc
from taylor import remainder_order

from riem_planner import OrientationObstacle, Zone
from riem_planner.geometry import so3
from riem_planner.obstacles import Forbidden
from riem_planner.obstacles.potential import (
    CUT_WIDTH,
    first_derivatives,
    potential,
    row_margins,
)

DURATION = 3.0
Q = so3.exp([0.5, 0.9, -0.3])
RATE = [0.1, -0.2, 0.3]
KEEP_IN = {"kind": "keep_in", "strength": 0.3}
OBSTACLES = {
    "orientation": [OrientationObstacle(Q, strength=0.5)],
    "orientation with radius": [OrientationObstacle(Q, strength=0.5, radius=0.2)],
    "orientation with range": [OrientationObstacle(Q, strength=0.5, range=(0.4, 2.9))],
    "moving orientation": [OrientationObstacle(Q, strength=0.5, radius=0.2, rate=RATE)],
    "keep_out": [Zone([0.0, 1.0, 0.3], 0.4, [1.0, 2.0, 0.0], normalized_strength=2.0)],
    "point": [Zone([0.0, 1.0, 0.3], 0.0, strength=0.1)],
    "keep_out with range": [Zone([0.0, 1.0, 0.3], 0.4, strength=0.3, range=(0.5, 2.9))],
    "moving keep_out": [Zone([0.0, 1.0, 0.3], 0.4, strength=0.3, rate=RATE)],
    "keep_in": [Zone([0.9, 0.4, 0.3], 2.5, **KEEP_IN)],
    "moving keep_in": [Zone([0.9, 0.4, 0.3], 2.5, rate=RATE, **KEEP_IN)],
    "group": [
        Zone([0.9, 0.4, 0.3], 2.2, [0, 1, 0], group="g", **KEEP_IN),
        Zone([0.2, 0.4, -0.3], 2.4, [0, 0, 1], group="g", kind="keep_in", strength=0.7),
        Zone([0.2, -0.9, -0.3], 1.1, [0, 0, 1], group="g", rate=RATE, **KEEP_IN),
    ],
}
OBSTACLES["all"] = [
    *OBSTACLES["moving orientation"], *OBSTACLES["keep_out"], *OBSTACLES["keep_in"],
    *OBSTACLES["group"],
]  # fmt: skip
SOFTS = (0.0, 0.05, 0.35, 1.0)


def table_of(obstacles):
    return Forbidden(tuple(obstacles)).normalised_table(DURATION)


def stated_distances(obstacles, attitude, time):
    """By SciPy's rotations, at a physical time."""
    distances = []
    for obstacle in obstacles:
        moved = Rotation.from_rotvec(time * obstacle.rate)
        if isinstance(obstacle, OrientationObstacle):
            place = moved * Rotation.from_matrix(obstacle.orientation)
            distances.append((attitude.inv() * place).magnitude())
        else:
            boresight = [1, 0, 0] if obstacle.boresight is None else obstacle.boresight
            x, s = attitude.as_matrix() @ boresight, moved.as_matrix() @ obstacle.direction
            distances.append(np.arctan2(np.linalg.norm(np.cross(x, s)), x @ s))
    return np.array(distances)


def stated_potential(obstacles, attitude, time):
    """Section 2 of the mathematics word by word, in normalised time."""
    total, groups = 0.0, {}
    for obstacle, d in zip(obstacles, stated_distances(obstacles, attitude, time), strict=True):
        r = obstacle.radius
        tau = obstacle.normalized_strength or obstacle.strength * DURATION**4
        if obstacle.kind == "keep_in":
            m = max(0.0, (r * r - d * d) / (2.0 * r))
            groups.setdefault(obstacle.group, []).append(m**4 / tau**2)
            continue
        value = tau / (d - r) ** 2 if d > r else np.inf
        if obstacle.range is not None:
            on, off = obstacle.range
            # The least polynomial step that is C^3 is the incomplete beta function of (4, 4).
            value *= 1.0 - betainc(4, 4, np.clip((d - on) / (off - on), 0.0, 1.0))
        total += value
    for members in groups.values():
        total += sum(members) ** -0.5 if sum(members) > 0.0 else np.inf
    return total


def random_attitudes(seed, count):
    q = np.random.default_rng(seed).normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def turned(q, delta):
    return so3.quaternion_multiply(q, so3.quaternion_exp(delta))


def derivatives(table, time, q, soft):
    V, *rest = potential(table, time, *q, soft)
    g, (a, b, c, d, e, f) = np.array(rest[:3]), rest[3:]
    return V, g, np.array([[a, d, e], [d, b, f], [e, f, c]])


def order_of_remainder(table, time, q, soft, largest, seed=0):
    """Order of V(exp(h d)) - V - h g.d - h^2 d.H d / 2 over random unit directions."""
    directions = np.random.default_rng(seed).normal(size=(8, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    V, g, H = derivatives(table, time, q, soft)

    def remainder(h):
        values = np.array([potential(table, time, *turned(q, h * d), soft)[0] for d in directions])
        quadratic = np.einsum("ni,ij,nj->n", directions, H, directions)
        return values - V - h * directions @ g - 0.5 * h * h * quadratic

    return remainder_order(remainder, largest, 1e-15 * (abs(V) + np.linalg.norm(g)))


@pytest.mark.parametrize("name", OBSTACLES)
def test_value_is_the_stated_one(name):
    obstacles = OBSTACLES[name]
    table = table_of(obstacles)
    compared = 0
    for q in random_attitudes(1, 200):
        for time in (0.0, 1.1):
            attitude = Rotation.from_quat(q)
            d = stated_distances(obstacles, attitude, time)
            if d.max() > np.pi - CUT_WIDTH:
                continue
            stated = stated_potential(obstacles, attitude, time)
            assert potential(table, time / DURATION, *q, 0.0)[0] == pytest.approx(stated, rel=1e-11)
            compared += np.isfinite(stated) and stated > 0.0
    assert compared > 50


@pytest.mark.parametrize("soft", SOFTS)
@pytest.mark.parametrize("name", OBSTACLES)
def test_gradient_and_hessian_leave_a_third_order_remainder(name, soft):
    obstacles = OBSTACLES[name]
    table = table_of(obstacles)
    tried = 0
    for q in random_attitudes(2, 300):
        margins = row_margins(table, 0.4, q)
        violated = not np.isfinite(potential(table, 0.4, *q, 0.0)[0])
        # Where a margin is small the steps would have to be smaller; the softened potential is
        # meant for such places.
        clear = np.abs(margins).min() > 0.2 if soft == 0.0 else np.abs(margins - soft).min() > 0.05
        if (violated and soft == 0.0) or not clear:
            continue
        if potential(table, 0.4, *q, soft)[0] == 0.0:
            continue  # beyond its range
        d = stated_distances(obstacles, Rotation.from_quat(q), 0.4 * DURATION)
        if np.any(np.abs(d - (np.pi - CUT_WIDTH)) < 0.05):
            continue  # the next tests look there
        assert order_of_remainder(table, 0.4, q, soft, 0.02) == pytest.approx(3.0, abs=0.2)
        tried += 1
        if tried == 4:
            return
    pytest.fail(f"only {tried} attitudes were fit for the test")


@pytest.mark.parametrize("soft", [0.0, 0.1])
@pytest.mark.parametrize("kind", ["orientation", "zone"])
@pytest.mark.parametrize("eta", [0.5, 0.12, 0.09, 0.05, 0.02])
def test_remainder_is_third_order_near_the_cut_locus(kind, eta, soft):
    table, q = at_distance(kind, np.pi - eta)
    assert order_of_remainder(table, 0.0, q, soft, 0.1 * eta) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("kind", ["orientation", "zone"])
@pytest.mark.parametrize("eta", [1e-4, 1e-8, 0.0])
def test_potential_is_even_at_the_cut_locus(kind, eta):
    table, q = at_distance(kind, np.pi - eta)
    order = order_of_remainder(table, 0.0, q, 0.0, 0.04)
    # No third order there by symmetry: a wrong gradient leaves 1, a wrong Hessian 2.
    assert order > 2.8
    # Least on the plane of attitudes at distance pi, and at the one antipode of a direction.
    V, g, H = derivatives(table, 0.0, q, 0.0)
    assert np.linalg.norm(g) <= 100.0 * (eta + 1e-15) * V
    curvatures = np.linalg.eigvalsh(H) / V
    flat = 2 if kind == "orientation" else 1
    np.testing.assert_allclose(curvatures[:flat], 0.0, atol=1e-3)
    assert np.all(curvatures[flat:] > 1.0)


def at_distance(kind, d):
    """Table of one obstacle, and an attitude at a distance from it."""
    q = random_attitudes(5, 1)[0]
    R = so3.quaternion_to_matrix(q)
    axis = so3.exp([0.3, -0.5, 0.2])[0]
    if kind == "orientation":
        return table_of([OrientationObstacle(R @ so3.exp(d * axis), strength=0.5)]), q
    b = so3.exp([0.1, 0.9, 0.4])[1]
    square = np.cross(axis, b)
    direction = R @ so3.exp(d * square / np.linalg.norm(square)) @ b
    options = {"half_angle": 0.7, "kind": "keep_in"} if kind == "keep_in" else {"half_angle": 0.0}
    return table_of([Zone(direction, boresight=b, strength=0.5, **options)]), q


@pytest.mark.parametrize("soft", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("d", [0.0, 1e-9, 1e-4, 0.02, 0.029, 0.031, 0.1])
def test_keep_in_is_smooth_through_its_centre(d, soft):
    table, q = at_distance("keep_in", d)
    assert order_of_remainder(table, 0.0, q, soft, 0.05) > 2.8
    V, g, H = derivatives(table, 0.0, q, 0.0)
    r, tau = 0.7, 0.5 * DURATION**4
    np.testing.assert_allclose(V, 4.0 * tau * r**2 / (r**2 - d**2) ** 2, rtol=1e-12)
    assert np.linalg.norm(g) == pytest.approx(16.0 * tau * r**2 * d / (r**2 - d**2) ** 3, abs=1e-7)
    # About the boresight nothing changes; across it, at the centre, V'' both ways.
    radial, across = np.linalg.eigvalsh(H)[[2, 1]]
    if d == 0.0:
        assert radial == pytest.approx(16.0 * tau / r**4, rel=1e-9)
        assert across == pytest.approx(radial, rel=1e-9)


@pytest.mark.parametrize("kind", ["orientation", "zone"])
@pytest.mark.parametrize("d", [0.3, 1e-2, 1e-4])
def test_potential_near_a_point_obstacle(kind, d):
    table, q = at_distance(kind, d)
    V, g, H = derivatives(table, 0.0, q, 0.0)
    tau = 0.5 * DURATION**4
    np.testing.assert_allclose(V, tau / d**2, rtol=1e-10 / d)
    assert np.linalg.norm(g) == pytest.approx(2.0 * tau / d**3, rel=1e-10 / d)
    assert np.linalg.eigvalsh(H)[2] == pytest.approx(6.0 * tau / d**4, rel=1e-10 / d)
    assert order_of_remainder(table, 0.0, q, 0.0, 0.02 * d) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("soft", [0.05, 0.25])
@pytest.mark.parametrize("kind", ["orientation", "zone", "keep_in"])
def test_softened_potential_is_the_exact_one_above_the_margin_and_joins_it_c2(kind, soft):
    edge = {"keep_in": np.sqrt(0.7**2 - 1.4 * soft)}.get(kind, soft)
    inner = -1.0 if kind == "keep_in" else 1.0
    table, q = at_distance(kind, edge + inner * 0.02)
    for exact, softened in zip(
        derivatives(table, 0.0, q, 0.0), derivatives(table, 0.0, q, soft), strict=True
    ):
        np.testing.assert_allclose(softened, exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())
    near = [
        derivatives(*swapped(at_distance(kind, edge + side * 1e-9)), soft) for side in (1.0, -1.0)
    ]
    for above, below in zip(*near, strict=True):
        np.testing.assert_allclose(above, below, atol=3e-6 * np.abs(above).max())


def swapped(table_and_attitude):
    table, q = table_and_attitude
    return table, 0.0, q


@pytest.mark.parametrize("soft", [0.02, 0.35])
@pytest.mark.parametrize("kind", ["orientation", "zone", "keep_in"])
def test_softened_potential_is_finite_and_pushes_out_everywhere(kind, soft):
    distances = np.linspace(0.01, 2.9, 120)
    if kind == "keep_in":
        distances = np.linspace(0.01, 3.1, 120)
    values = [potential(t, 0.0, *q, soft)[0] for t, q in (at_distance(kind, d) for d in distances)]
    assert np.all(np.isfinite(values))
    steps = np.diff(values)
    assert np.all(steps > 0.0) if kind == "keep_in" else np.all(steps < 0.0)


def test_a_softened_group_takes_its_best_member():
    obstacles = OBSTACLES["group"]
    strongest = max(o.strength for o in obstacles) * DURATION**4
    table = table_of(obstacles)
    compared = 0
    for q in random_attitudes(7, 200):
        d = stated_distances(obstacles, Rotation.from_quat(q), 0.0)
        r = np.array([o.radius for o in obstacles])
        best = np.max((r * r - d * d) / (2.0 * r))
        for soft in (0.1, 0.01):
            if best > soft:
                M = np.sqrt(strongest / potential(table, 0.0, *q, soft)[0])
                assert best - 1e-12 <= M <= best + soft * np.log(len(obstacles))
                compared += 1
    assert compared > 100


def test_violated_potential_is_infinite():
    for obstacle in (
        OrientationObstacle(np.eye(3), strength=0.5, radius=0.2),
        OrientationObstacle(np.eye(3), strength=0.5),
        Zone([1.0, 0.1, 0.0], 0.2, strength=0.5),
        Zone([1.0, 1.0, 0.0], 0.7, **KEEP_IN),
    ):
        assert potential(table_of([obstacle]), 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)[0] == np.inf


def test_a_tapered_potential_ends_with_its_range():
    table = table_of([OrientationObstacle(np.eye(3), strength=0.5, range=(0.4, 2.0))])
    inside = potential(table, 0.0, *so3.quaternion_exp(np.array([0.39, 0.0, 0.0])), 0.0)[0]
    assert inside == pytest.approx(0.5 * DURATION**4 / 0.39**2, rel=1e-12)
    for angle in (2.0, 2.5, np.pi):
        q = so3.quaternion_exp(np.array([angle, 0.0, 0.0]))
        np.testing.assert_array_equal(potential(table, 0.0, *q, 0.0), np.zeros(10))


@pytest.mark.parametrize("soft", [0.0, 0.2])
@pytest.mark.parametrize("name", OBSTACLES)
def test_turning_the_whole_problem_changes_nothing(name, soft):
    G = so3.exp([0.7, -1.9, 0.4])
    g = so3.matrix_to_quaternion(G)
    table = table_of(OBSTACLES[name])
    other = table_of([with_frame(obstacle, G) for obstacle in OBSTACLES[name]])
    for q in random_attitudes(3, 30):
        before = derivatives(table, 0.6, q, soft)
        after = derivatives(other, 0.6, so3.quaternion_multiply(g, q), soft)
        for value, expected in zip(after, before, strict=True):
            np.testing.assert_allclose(
                value, expected, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(before[2]).max())
            )


def with_frame(obstacle, G):
    if isinstance(obstacle, OrientationObstacle):
        return replace(obstacle, orientation=G @ obstacle.orientation, rate=G @ obstacle.rate)
    return replace(obstacle, direction=G @ obstacle.direction, rate=G @ obstacle.rate)


def test_first_derivatives_alone_are_those_of_the_potential():
    table = table_of(OBSTACLES["all"])
    rng = np.random.default_rng(5)
    for q in rng.normal(size=(50, 4)):
        q /= np.linalg.norm(q)
        both = potential(table, 0.3, *q, 0.0)
        np.testing.assert_allclose(first_derivatives(table, 0.3, *q), both[:4], rtol=1e-12)


def test_both_signs_of_a_quaternion_are_the_same_attitude():
    table = table_of(OBSTACLES["all"])
    for q in random_attitudes(4, 20):
        np.testing.assert_array_equal(
            potential(table, 0.2, *q, 0.3), potential(table, 0.2, *(-q), 0.3)
        )
