# SPDX-License-Identifier: Apache-2.0
"""Every exact fact of the mathematics, section 5, that an initial-value extremal can show."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from variation import first_variation, pointing_jet, quaternion_jet

from riem_planner import S2, SO3, InvalidProblemError, OrientationObstacle, State, Zone
from riem_planner.extremals import (
    ExtremalEndsError,
    attitude_momentum,
    extremal,
    first_biconjugate_time,
    orientation_momentum,
    pointing_momentum,
)
from riem_planner.geometry import so3, sphere

I3 = np.eye(3)
R0 = so3.exp([0.4, -0.2, 0.3])
Q = so3.exp([0.5, 0.9, -0.3])
S = np.array([0.6, 0.8, 0.0])
B = np.array([1.0, 0.0, 0.0])
V0, A0, J0 = [0.3, 0.8, -0.4], [0.2, -0.5, 0.1], [0.3, 0.2, -1.0]
H0, HA0, HJ0 = [0.0, 0.8, -0.4], [0.0, -0.5, 0.1], [0.0, 0.2, -1.0]
T = 1.5
TIMES = np.linspace(0.0, T, 41)


ORIENTATION = (OrientationObstacle(Q, strength=0.5),)
ZONE = (Zone(S, 0.1, strength=0.5),)


def attitude_extremal(obstacles=ORIENTATION, tension=0.7, **options):
    state = options.pop("state", State(I3, V0))
    return extremal(SO3, state, A0, J0, obstacles, tension, duration=T, **options)


def pointing_extremal(obstacles=ZONE, tension=0.7, **options):
    state = options.pop("state", State(R0, H0))
    return extremal(S2, state, HA0, HJ0, obstacles, tension, duration=T, **options)


@pytest.mark.parametrize(
    "obstacles",
    [
        (),
        (OrientationObstacle(Q, strength=0.5, radius=0.1),),
        (Zone(S, 0.3, strength=0.5), Zone(B, 2.8, [0, 1, 0], kind="keep_in", strength=0.2)),
        (OrientationObstacle(Q, strength=0.5, range=(0.6, 2.0)),),
    ],
)
def test_so3_hamiltonian_constant(obstacles):
    assert np.ptp(attitude_extremal(obstacles).hamiltonian(TIMES)) < 1e-10


@pytest.mark.parametrize(
    "obstacles", [(), (Zone(S, 0.1, strength=0.5),), (Zone(B, 2.5, kind="keep_in", strength=0.2),)]
)
def test_s2_hamiltonian_constant(obstacles):
    assert np.ptp(pointing_extremal(obstacles).hamiltonian(TIMES)) < 1e-10


def test_moving_obstacle_changes_the_hamiltonian():
    moving = (OrientationObstacle(Q, strength=0.5, rate=[0.0, 0.3, 0.0]),)
    assert np.ptp(attitude_extremal(moving).hamiltonian(TIMES)) > 1e-3


def test_so3_orientation_momentum_constant():
    R, v, a, j = attitude_extremal().evaluate(TIMES)
    assert np.ptp(orientation_momentum(R, v, a, j, Q, 0.7), axis=0).max() < 1e-11
    assert np.ptp(attitude_momentum(R, v, j, 0.7), axis=0).max() > 1e-2


def test_so3_free_momentum_constant():
    R, v, a, j = attitude_extremal(()).evaluate(TIMES)
    assert np.ptp(attitude_momentum(R, v, j, 0.7), axis=0).max() < 1e-11
    assert np.ptp(np.sum(j**2 - 0.7 * a**2, axis=1)) < 1e-11


def test_s2_pointing_momentum_constant():
    R, v, a, j = pointing_extremal(()).evaluate(TIMES)
    assert np.ptp(pointing_momentum(R, v, a, j, 0.7), axis=0).max() < 1e-11


def test_s2_momentum_about_the_obstacle_constant():
    R, v, a, j = pointing_extremal().evaluate(TIMES)
    N = pointing_momentum(R, v, a, j, 0.7)
    assert np.ptp(N @ S) < 1e-11
    assert np.ptp(N, axis=0).max() > 1e-2


def test_s2_lift_never_rolls():
    _, v, a, j = pointing_extremal().evaluate(TIMES)
    for vector in (v, a, j):
        np.testing.assert_allclose(vector @ B, 0.0, atol=1e-14)


@pytest.mark.parametrize("tension", [0.0, 0.7])
def test_so3_first_variation_vanishes(tension):
    curve = attitude_extremal(tension=tension)
    centre = so3.matrix_to_quaternion(Q)

    def potential(q):
        return 0.5 / so3.quaternion_distance(q, centre) ** 2

    def jet(t):
        return quaternion_jet(*curve.evaluate(t)[:3])

    assert first_variation(jet, T, 4.0, tension, potential) < 1e-6
    assert first_variation(jet, T, 4.0, tension + 0.01, potential) > 1e-4


@pytest.mark.parametrize("tension", [0.0, 0.7])
def test_s2_first_variation_vanishes(tension):
    curve = pointing_extremal(tension=tension)

    def potential(x):
        return 0.5 / (sphere.angle(x, S) - 0.1) ** 2

    def jet(t):
        return pointing_jet(*curve.evaluate(t)[:3], B)

    assert first_variation(jet, T, 1.0, tension, potential) < 1e-6
    assert first_variation(jet, T, 1.0, tension + 0.01, potential) > 1e-4


def test_rest_to_rest_about_one_axis_is_the_hermite_cubic():
    axis, angle = np.array([2.0, -1.0, 2.0]) / 3.0, 2.2
    curve = extremal(SO3, State(R0), 6 * angle / T**2 * axis, -12 * angle / T**3 * axis, duration=T)
    s = TIMES / T
    expected = R0 @ so3.exp((angle * s**2 * (3 - 2 * s))[:, None] * axis)
    np.testing.assert_allclose(so3.distance(curve.evaluate(TIMES)[0], expected), 0, atol=1e-12)


@pytest.mark.parametrize("space", [SO3, S2])
def test_same_axis_obstacle_gives_the_scalar_equation(space):
    axis, place, sigma, tau = np.array([0.0, 0.0, 1.0]), 1.2, 0.4, 0.3

    def scalar(t, y):
        return [y[1], y[2], y[3], sigma * y[2] + tau / (y[0] - place) ** 3]

    x = solve_ivp(scalar, (0, T), [0.0, 0.5, -0.2, 0.1], "DOP853", TIMES, rtol=1e-13, atol=1e-14)
    end = so3.exp(place * axis)
    obstacle = (
        OrientationObstacle(end, strength=tau) if space == SO3 else Zone(end @ B, 0, strength=tau)
    )
    curve = extremal(
        space, State(I3, 0.5 * axis), -0.2 * axis, 0.1 * axis, (obstacle,), sigma, duration=T
    )
    R, v, _, _ = curve.evaluate(TIMES)
    np.testing.assert_allclose(so3.log(R), x.y[0][:, None] * axis, atol=1e-11)
    np.testing.assert_allclose(v, x.y[1][:, None] * axis, atol=1e-11)


def test_left_translation_turns_the_extremal():
    L = so3.exp([1.0, -0.7, 0.4])
    original = attitude_extremal().evaluate(TIMES)
    turned = attitude_extremal(
        (OrientationObstacle(L @ Q, strength=0.5),), state=State(L, V0)
    ).evaluate(TIMES)
    np.testing.assert_allclose(turned[0], L @ original[0], atol=1e-11)
    np.testing.assert_allclose(turned[1], original[1], atol=1e-11)


@pytest.mark.parametrize("space", [SO3, S2])
def test_time_reversal_reverses_the_extremal(space):
    obstacle = (Zone(S, 0.1, strength=0.5),)
    forward = attitude_extremal(obstacle) if space == SO3 else pointing_extremal(obstacle)
    R, v, a, j = forward.evaluate(TIMES)
    backward = extremal(space, State(R[-1], -v[-1]), a[-1], -j[-1], obstacle, 0.7, duration=T)
    Rb, vb, ab, jb = backward.evaluate(TIMES)
    np.testing.assert_allclose(Rb[::-1], R, atol=1e-10)
    for reverse, original in ((-vb, v), (ab, a), (-jb, j)):
        np.testing.assert_allclose(reverse[::-1], original, atol=1e-9)


def test_time_scaling_keeps_the_curve():
    c = 40.0
    slow = extremal(
        SO3,
        State(I3, np.array(V0) / c),
        np.array(A0) / c**2,
        np.array(J0) / c**3,
        (OrientationObstacle(Q, strength=0.5 / c**4),),
        0.7 / c**2,
        duration=c * T,
        tolerance=1e-16,
    )
    fast = attitude_extremal().evaluate(TIMES)
    np.testing.assert_allclose(slow.evaluate(c * TIMES)[0], fast[0], atol=1e-10)


def test_normalized_strength_is_strength_times_duration_to_the_fourth():
    stated = attitude_extremal((OrientationObstacle(Q, strength=0.5),)).evaluate(T)[0]
    normal = attitude_extremal((OrientationObstacle(Q, normalized_strength=0.5 * T**4),))
    np.testing.assert_allclose(normal.evaluate(T)[0], stated, atol=1e-13)


def test_attitude_rate_is_consistent():
    curve = attitude_extremal()
    t, h = np.linspace(0.1, T - 0.1, 23), 1e-3
    steps = [curve.evaluate(t + k * h)[0] for k in (-2, -1, 1, 2)]
    rate = (steps[0] - 8 * steps[1] + 8 * steps[2] - steps[3]) / (12 * h)
    R, v, _, _ = curve.evaluate(t)
    np.testing.assert_allclose(rate, R @ so3.hat(v), atol=1e-9)


@pytest.mark.parametrize("space", [SO3, S2])
def test_integrator_converges_with_order_eight(space):
    state, zone = State(R0, [0.0, 3.0, -1.5]), Zone([0.0, 1.0, 0.2], 0.0, strength=0.5)

    def end(**options):
        curve = extremal(space, state, HA0, HJ0, (zone,), 0.7, duration=T, **options)
        return np.concatenate([np.ravel(x) for x in curve.evaluate(T)])

    steps = T / np.array([8, 10, 12, 14])
    errors = [np.linalg.norm(end(step=h) - end()) for h in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(8.0, abs=0.2), errors


def a_priori_clearance(cost, speed, tau, duration):
    b = duration / 2 * (speed + np.sqrt(2 * cost * duration))
    return (-b + np.sqrt(b * b + tau * duration / cost)) / 2


def test_a_priori_clearance_holds():
    for seed in range(5):
        rng = np.random.default_rng(seed)
        v0, a0, j0 = rng.normal(size=(3, 3))
        place = so3.exp(rng.uniform(0.5, 1.5) * v0 / np.linalg.norm(v0))
        curve = extremal(
            SO3, State(I3, v0), a0, j0, (OrientationObstacle(place, strength=0.1),), duration=1.0
        )
        t = np.linspace(0, 1, 150)
        R, _, a, _ = curve.evaluate(t)
        density = np.sum(a * a, axis=1) + curve.potential(t)
        cost = 0.5 * np.sum(0.5 * (density[1:] + density[:-1])) * t[1]
        bound = a_priori_clearance(1.01 * cost, np.linalg.norm(v0), 0.1, 1.0)
        assert 0.0 < bound < so3.distance(R, place).min()


BICONJUGATE = [
    (1.0, 2.0, 4.730040744862704),
    (1.0, 5.0, 4.069355175139395),
    (1.0, 0.5, 20.275177591916513),
    (0.5, 0.5, 9.460081489725408),
    (0.5, 1.0, 8.380023460992886),
    (1.0, 1.0, 2 * np.pi),
    (1.0, 0.75, 4 * np.pi),
]


@pytest.mark.parametrize(("a", "sigma", "expected"), BICONJUGATE)
def test_first_biconjugate_time(a, sigma, expected):
    assert first_biconjugate_time(a * a, sigma) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("sigma", [0.3, 0.5, 0.62, 0.9, 1.5, 4.0])
def test_first_biconjugate_time_is_the_first_zero_of_the_determinant(sigma):
    """The determinant of section 5 for a = 1, scanned without its factors."""
    b = np.sqrt(abs(sigma - 1.0))
    sign = 1.0 if sigma > 1.0 else -1.0
    sine, cosine = (np.sinh, np.cosh) if sigma > 1.0 else (np.sin, np.cos)

    def determinant(T):
        product = (1 - sign * b**2) * np.sin(T) * sine(b * T)
        return 2 * b * (1 - np.cos(T) * cosine(b * T)) - product

    expected = first_biconjugate_time(1.0, sigma)
    before = determinant(np.linspace(0.1, 0.9999 * expected, 20_000))
    assert np.all(np.sign(before) == np.sign(before[0]))
    assert np.sign(determinant(1.0001 * expected)) == -np.sign(before[0])


def test_geodesics_without_tension_have_no_biconjugate_time():
    assert first_biconjugate_time(1.0, 0.0) == np.inf


@pytest.mark.parametrize(("a", "sigma", "expected"), BICONJUGATE)
def test_second_variation_loses_a_sign_at_the_biconjugate_time(a, sigma, expected):
    def negative_eigenvalues(duration, n=400):
        h, k = duration / n, a * a
        second = (np.eye(n + 1, k=1) + np.eye(n + 1, k=-1) - 2 * np.eye(n + 1)) / h**2
        # The clamped ends: y = y' = 0, so the ghost value beyond an end mirrors the inner one.
        second[0, 1] = second[-1, -2] = 2 / h**2
        acceleration = (second + k * np.eye(n + 1))[:, 1:-1]
        rate = ((np.eye(n, n + 1, k=1) - np.eye(n, n + 1)) / h)[:, 1:-1]
        weight = np.ones(n + 1)
        weight[0] = weight[-1] = 0.5
        form = acceleration.T @ (weight[:, None] * acceleration)
        form += sigma * (rate.T @ rate - k * np.eye(n - 1))
        return int(np.sum(np.linalg.eigvalsh(form) < 0.0))

    # At (1, 0.75) the determinant touches zero without a change of sign: two signs are lost
    # at once, one of them so slowly that the discretisation has to be given room.
    lost, share = (2, 0.04) if sigma == 0.75 else (1, 0.01)
    assert negative_eigenvalues((1.0 - share) * expected) == 0
    assert negative_eigenvalues((1.0 + share) * expected) == lost


def test_collision_course_ends_with_an_error_that_names_the_time(monkeypatch):
    monkeypatch.setattr("riem_planner.integration._MOST_EVALUATIONS", 2000)
    with pytest.raises(ExtremalEndsError, match=r"ends at t = \d\.\d+ s of 5 s") as error:
        extremal(
            SO3,
            State(I3, [3.0, 0, 0]),
            [5.0, 0, 0],
            [0, 300.0, 0],
            (OrientationObstacle(so3.exp([0.5, 0, 0]), strength=1e-3),),
            50.0,
            duration=5.0,
        )
    assert 0.0 < error.value.time < 5.0


def test_bad_initial_values_are_refused():
    with pytest.raises(InvalidProblemError, match=r"jerk.*roll"):
        extremal(S2, State(I3), [0, 0, 1], [0.1, 0, 0], duration=1.0)
    with pytest.raises(InvalidProblemError, match="acceleration"):
        extremal(SO3, State(I3), [0, 0, np.nan], [0, 0, 0], duration=1.0)
    with pytest.raises(InvalidProblemError, match="outside of obstacle '0'"):
        extremal(SO3, State(I3), [0, 0, 1], [0, 0, 0], (Zone(B, 0.2, strength=1),), duration=1.0)
    with pytest.raises(InvalidProblemError, match="orientation obstacle"):
        extremal(S2, State(I3), [0, 0, 1], [0, 0, 0], (OrientationObstacle(Q, 1.0),), duration=1)


def test_evaluate_beyond_the_ends_is_refused():
    for t in (-1e-9, T + 1e-9, np.nan):
        with pytest.raises(ValueError, match=r"\[0, 1\.5\] s"):
            attitude_extremal().evaluate(t)
