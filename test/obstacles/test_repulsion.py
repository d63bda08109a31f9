# SPDX-License-Identifier: Apache-2.0
"""The NumPy potential is the compiled one, and the force half its gradient."""

import numpy as np
import pytest

from riem_planner import S2, SO3, OrientationObstacle, Problem, State, Zone
from riem_planner.geometry import so3
from riem_planner.geometry.paths import Path
from riem_planner.obstacles.potential import potential
from riem_planner.obstacles.repulsion import distance_and_gradient

Q = so3.exp([0.5, 0.9, -0.3])
OBSTACLES = {
    "orientation": (OrientationObstacle(Q, strength=0.5, radius=0.2, rate=[0.1, 0.2, 0.3]),),
    "keep_out": (Zone([0.0, 1.0, 0.3], 0.4, boresight=[1.0, 2.0, 0.0], normalized_strength=2.0),),
    "tapered": (Zone([0.0, 1.0, 0.3], 0.4, strength=0.3, range=(0.5, 2.9)),),
    "keep_in": (Zone([0.9, 0.4, 0.3], 2.5, kind="keep_in", strength=0.3, rate=[0.2, 0.0, 0.1]),),
    "group": (
        Zone([0.9, 0.4, 0.3], 2.2, [0, 1, 0], kind="keep_in", group="g", strength=0.3),
        Zone([0.2, 0.4, -0.3], 2.4, [0, 0, 1], kind="keep_in", group="g", strength=0.7),
    ),
}
TIMES = np.linspace(0.0, 3.0, 7)
PATH = Path(TIMES, [so3.exp([0.1 * t * t, 0.3 * t, 0.0]) @ [0.0, 1.0, 0.3] for t in TIMES])
OBSTACLES["path"] = (Zone(PATH, 0.3, [1.0, 2.0, 0.0], normalized_strength=2.0),)
OBSTACLES["changing"] = (Zone(PATH, 0.3 + 0.1 * np.sin(TIMES), [0, 1, 1], strength=0.4),)
OBSTACLES["window"] = (Zone([0.0, 1.0, 0.3], 0.3, strength=0.3, active=((0.5, 1.0), (1.7, 2.6))),)
OBSTACLES["kept out"] = (
    Zone(PATH, 0.3, [1, 0, 0], group="t", member="a", strength=0.3),
    Zone([0.5, 1.0, 0.3], 0.2, [1, 0, 0], group="t", member="a", strength=0.6),
    Zone([0.5, -1.0, 0.3], 0.5, [0, 1, 0], group="t", member="b", strength=0.2),
    Zone([0.5, -1.0, 0.9], 2.8, [0, 1, 1], group="t", member="b", kind="keep_in", strength=0.2),
    Zone([0.5, 1.0, 0.3], 0.9, [0, 0, 1], group="t", strength=0.3, active=((1.0, 2.0),)),
)
OBSTACLES["all"] = sum(OBSTACLES.values(), ())


def problem_with(obstacles, space=SO3):
    state = State(np.eye(3))
    return Problem(start=state, goal=state, duration=3.0, space=space, obstacles=obstacles)


def potential_and_force(problem, attitude, time):
    V, F = problem.forbidden.repulsion(attitude[None], time, problem.duration)
    return V[0], F[0]


@pytest.mark.parametrize("name", OBSTACLES)
def test_numpy_and_compiled_potentials_agree(name):
    problem = problem_with(OBSTACLES[name])
    table = problem.forbidden.normalised_table(3.0)
    rng = np.random.default_rng(2)
    compared = 0
    while compared < 40:
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        R, time = so3.quaternion_to_matrix(q), rng.uniform(0.0, 3.0)
        V, F = potential_and_force(problem, R, time)
        near_cut = any(d > 3.0 for d in (o.distance(R, time) for o in problem.obstacles))
        if not np.isfinite(V) or near_cut:
            continue
        compiled, *derivatives = potential(table, time / 3.0, *q, 0.0)
        assert pytest.approx(compiled, rel=1e-11) == V * 3.0**4
        np.testing.assert_allclose(2 * F * 3.0**4, derivatives[:3], rtol=1e-9, atol=1e-9 * compiled)
        compared += 1


@pytest.mark.parametrize("name", OBSTACLES)
def test_force_is_half_the_body_gradient(name):
    problem = problem_with(OBSTACLES[name])
    rng = np.random.default_rng(3)
    R = so3.exp([-0.2, 0.3, -0.4])
    _, F = potential_and_force(problem, R, 0.7)
    for _ in range(5):
        direction = rng.normal(size=3)
        h = 1e-5
        above, below = (
            potential_and_force(problem, R @ so3.exp(sign * h * direction), 0.7)[0]
            for sign in (1, -1)
        )
        assert (above - below) / (2 * h) == pytest.approx(2 * F @ direction, rel=1e-6)


def test_force_is_infinite_potential_inside_a_zone():
    for obstacle in (Zone([1, 0, 0], 0.4, strength=1.0), OrientationObstacle(np.eye(3), 1.0)):
        assert potential_and_force(problem_with((obstacle,)), np.eye(3), 0.0)[0] == np.inf
    outside = Zone([-1, 0, 0], 0.4, kind="keep_in", strength=1.0)
    assert potential_and_force(problem_with((outside,)), np.eye(3), 0.0)[0] == np.inf


def test_keep_in_force_is_smooth_at_the_centre():
    zone = Zone([1, 0, 0], 0.4, kind="keep_in", strength=1.0)
    V, F = potential_and_force(problem_with((zone,)), np.eye(3), 0.0)
    np.testing.assert_allclose(V, 25.0)
    np.testing.assert_array_equal(F, np.zeros(3))


def test_sphere_force_is_horizontal():
    problem = problem_with((Zone([0.2, 1.0, 0.3], 0.1, strength=1.0),), space=S2)
    assert potential_and_force(problem, so3.exp([0.1, 0.2, 0.3]), 0.0)[1][0] == 0.0


def test_distance_and_gradient_near_zero_and_near_pi():
    for angle in (1e-9, 1e-4, np.pi - 1e-4, np.pi - 1e-9):
        R = so3.exp([0.0, angle, 0.0])
        for obstacle in (OrientationObstacle(np.eye(3), 1.0), Zone([1, 0, 0], 0.0, strength=1.0)):
            d, w = distance_and_gradient(obstacle, R[None], np.zeros(1))
            assert d[0] == pytest.approx(angle, abs=2e-15)
            np.testing.assert_allclose(w[0], [0.0, angle, 0.0], atol=1e-7 * angle)
