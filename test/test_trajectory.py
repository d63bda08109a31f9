# SPDX-License-Identifier: Apache-2.0
"""The published trajectory: consistent, continuous, and honest about its ends."""

import numpy as np
import pytest

from riem_planner import SO3, InvalidProblemError, OrientationObstacle, State, Trajectory
from riem_planner.extremals import extremal
from riem_planner.geometry import so3

Q = so3.exp([0.5, 0.9, -0.3])


def samples(times, rate=(0.3, 0.8, -0.4)):
    curve = extremal(
        SO3,
        State(np.eye(3), rate),
        [0.2, -0.5, 0.1],
        [0.3, 0.2, -1.0],
        (OrientationObstacle(Q, strength=0.5),),
        duration=float(times[-1]),
        tolerance=1e-12,
    )
    R, v, a, _ = curve.evaluate(times)
    q = so3.matrix_to_quaternion(R)
    for k in range(1, len(q)):
        q[k] *= 1.0 if q[k] @ q[k - 1] > 0.0 else -1.0
    return curve, (times, q, v, a)


CURVE, SAMPLES = samples(np.linspace(0.0, 2.0, 41))
TRAJECTORY = Trajectory(*SAMPLES)


def derivative(function, t, h):
    values = [np.asarray(function(t + k * h)) for k in (-3, -2, -1, 1, 2, 3)]
    return (45 * (values[3] - values[2]) - 9 * (values[4] - values[1]) + values[5] - values[0]) / (
        60 * h
    )


def within(rng, n):
    """Times at least 4e-3 s from every sample, where the polynomials meet."""
    left = rng.integers(0, 40, n) * 0.05
    return left + rng.uniform(0.006, 0.044, n)


def test_samples_are_reproduced():
    times, q, v, a = SAMPLES
    found = TRAJECTORY.evaluate_quaternion(times)
    for mine, theirs in zip(found, (q, v, a), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-13)


def test_attitude_rate_is_the_angular_velocity():
    t = within(np.random.default_rng(0), 200)
    R, v, _ = TRAJECTORY.evaluate(t)
    rate = derivative(lambda s: TRAJECTORY.evaluate(s)[0], t, 1e-3)
    np.testing.assert_allclose(rate, R @ so3.hat(v), atol=1e-9)


def test_rate_of_the_angular_velocity_is_the_acceleration():
    t = within(np.random.default_rng(1), 200)
    rate = derivative(lambda s: TRAJECTORY.evaluate(s)[1], t, 1e-3)
    np.testing.assert_allclose(rate, TRAJECTORY.evaluate(t)[2], atol=1e-9)


def test_large_steps_between_samples_stay_consistent():
    """Intervals of up to 2.5 rad, where the coefficients leave their series."""
    rng = np.random.default_rng(2)
    q = [np.array([0.0, 0.0, 0.0, 1.0])]
    for _ in range(8):
        axis = rng.normal(size=3)
        step = so3.quaternion_exp(rng.uniform(0.0, 2.5) * axis / np.linalg.norm(axis))
        q.append(so3.quaternion_multiply(q[-1], step))
    wild = Trajectory(np.arange(9.0), np.stack(q), *rng.normal(size=(2, 9, 3)))
    t = rng.integers(0, 8, 100) + rng.uniform(0.05, 0.95, 100)
    R, v, a = wild.evaluate(t)
    rate = derivative(lambda s: wild.evaluate(s)[0], t, 1e-3)
    np.testing.assert_allclose(rate, R @ so3.hat(v), atol=1e-9)
    np.testing.assert_allclose(derivative(lambda s: wild.evaluate(s)[1], t, 1e-3), a, atol=1e-7)


def test_everything_is_continuous_at_the_samples():
    inner = SAMPLES[0][1:-1]
    below, above = (TRAJECTORY.evaluate_quaternion(inner + d) for d in (-1e-11, 1e-11))
    for left, right in zip(below, above, strict=True):
        np.testing.assert_allclose(left, right, atol=1e-9)


def test_interpolation_error_falls_with_the_sixth_power():
    t = np.linspace(0.0, 2.0, 401)
    R = CURVE.evaluate(t)[0]
    sizes = np.array([16, 24, 36])
    errors = []
    for n in sizes:
        times = np.linspace(0.0, 2.0, n + 1)
        errors.append(so3.distance(Trajectory(*samples(times)[1]).evaluate(t)[0], R).max())
    order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert order == pytest.approx(6.0, abs=0.2), errors


def test_quaternion_sign_is_continuous_through_more_than_a_turn():
    times = np.linspace(0.0, 10.0, 51)
    axis = np.array([0.0, 0.6, 0.8])
    q = so3.quaternion_exp(times[:, None] * axis)
    trajectory = Trajectory(times, q, np.broadcast_to(axis, (51, 3)), np.zeros((51, 3)))
    t = np.linspace(0.0, 10.0, 2001)
    dense = trajectory.evaluate_quaternion(t)[0]
    assert np.min(np.sum(dense[1:] * dense[:-1], axis=1)) > 0.99
    np.testing.assert_allclose(dense, so3.quaternion_exp(t[:, None] * axis), atol=1e-12)
    assert dense[:, 3].min() < -0.9  # the sign is kept, never forced to w >= 0


@pytest.mark.parametrize("t", [-1e-9, 2.0 + 1e-9, np.nan, [0.0, 3.0], np.inf])
def test_times_beyond_the_ends_are_refused(t):
    with pytest.raises(ValueError, match=r"t must lie in \[0, 2\] s"):
        TRAJECTORY.evaluate(t)


def test_ends_themselves_are_allowed_and_shapes_follow_the_times():
    R, v, a = TRAJECTORY.evaluate(2.0)
    assert (R.shape, v.shape, a.shape) == ((3, 3), (3,), (3,))
    R, v, a = TRAJECTORY.evaluate(np.zeros((4, 5)))
    assert (R.shape, v.shape, a.shape) == ((4, 5, 3, 3), (4, 5, 3), (4, 5, 3))
    assert TRAJECTORY.evaluate([])[0].shape == (0, 3, 3)


def test_resampled_passes_through_its_own_points():
    coarse = TRAJECTORY.resampled(11)
    assert coarse.duration == TRAJECTORY.duration
    for mine, theirs in zip(
        coarse.evaluate(coarse.times), TRAJECTORY.evaluate(coarse.times), strict=True
    ):
        np.testing.assert_allclose(mine, theirs, atol=1e-13)
    with pytest.raises(ValueError, match="at least 2"):
        TRAJECTORY.resampled(1)


def test_arrays_are_read_only_and_copies():
    times, q, v, a = (np.array(x) for x in SAMPLES)
    trajectory = Trajectory(times, q, v, a)
    q[:] = 0.0
    np.testing.assert_array_equal(trajectory.quaternions_xyzw, SAMPLES[1])
    with pytest.raises(ValueError, match="read-only"):
        trajectory.coefficients[0] = 0.0


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("times", [0.0]),
        ("times", [0.0, 1.0, 1.0]),
        ("times", [0.5, 1.0, 2.0]),
        ("times", [0.0, 1.0, np.inf]),
        ("quaternions_xyzw", np.zeros((3, 3))),
        ("angular_velocities", np.full((3, 3), np.nan)),
        ("angular_accelerations", np.zeros((2, 3))),
    ],
)
def test_wrong_samples_are_refused_by_name(key, value):
    good = {
        "times": [0.0, 1.0, 2.0],
        "quaternions_xyzw": np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)),
        "angular_velocities": np.zeros((3, 3)),
        "angular_accelerations": np.zeros((3, 3)),
    }
    Trajectory(**good)
    with pytest.raises(InvalidProblemError, match=key):
        Trajectory(**(good | {key: value}))
