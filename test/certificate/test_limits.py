# SPDX-License-Identifier: Apache-2.0
"""Limits are judged in continuous time, by bounds that hold between samples and are tight."""

import math

import numpy as np
import pytest
from curves import curve, problem_of, random_curve, replaced, slew

from riem_planner import (
    InvalidProblemError,
    Limits,
    Problem,
    State,
    Trajectory,
    Wheel,
    Zone,
    certify,
    solve,
)
from riem_planner.certificate import certify_clearance, certify_limits
from riem_planner.certificate.limit_bounds import TIGHTNESS
from riem_planner.geometry import so3

J = np.array([[2.0, 0.1, 0.05], [0.1, 3.0, 0.2], [0.05, 0.2, 4.0]])


AXES = np.array([[1.0, 0.2, 0.6], [-0.3, 1.0, 0.6], [-1.0, -0.2, 0.6], [0.3, -1.0, 0.6]])
TOTAL = np.array([0.3, -0.2, 0.5])


def random_limits(rng):
    values = {"rate": 0.1, "acceleration": 0.02, "torque": 0.05, "momentum": 0.4}
    values |= {"jerk": 0.01, "torque_rate": 0.03}
    if rng.random() < 0.5:
        values = {key: value * rng.uniform(0.2, 2.0, 3) for key, value in values.items()}
    wheels = [Wheel(axis, *rng.uniform(0.1, 1.0, 2)) for axis in AXES]
    return Limits(**values, inertia=J, wheels=wheels)


def jerk_along(trajectory, times):
    """By differences within the intervals, a few steps from their ends."""
    step = 1e-6 * trajectory.duration
    inner = times.copy()
    for end in trajectory.times:
        inner = np.where(np.abs(inner - end) <= step, end + 2.0 * step, inner)
    inner = np.minimum(inner, trajectory.duration - 2.0 * step)
    ahead, behind = (trajectory.evaluate(inner + sign * step)[2] for sign in (1.0, -1.0))
    return (ahead - behind) / (2.0 * step)


@pytest.mark.parametrize("seed", range(4))
def test_parts_used_are_upper_bounds_and_tight(seed):
    rng = np.random.default_rng(seed)
    for trial in range(25):
        samples = (51, 2, 7, int(rng.integers(2, 120)))[trial % 4]
        trajectory = random_curve(rng, samples)
        limits = random_limits(rng)
        use = certify_limits(trajectory, limits, TOTAL)
        times = np.linspace(0.0, trajectory.duration, 8001)
        R, v, a = trajectory.evaluate(times)
        h = np.einsum("nij,i->nj", R, TOTAL)
        sampled = limits.used(v, a, jerk_along(trajectory, times), h)
        assert tuple(use.parts) == tuple(sampled) == limits.keys
        for key, part in use.parts.items():
            # Differences are right to 1e-6 or so, and jerk is sampled beside its jumps.
            jumps = key in ("jerk", "torque_rate")
            assert sampled[key] * (1.0 - (1e-5 if jumps else 1e-12)) <= part
            assert part <= sampled[key] * (1.0 + TIGHTNESS + (2e-3 if jumps else 1e-5))
            if jumps:
                continue
            R, v_1, a_1 = trajectory.evaluate(use.worst_times[key])
            assert limits.used(v_1, a_1, h=R.T @ TOTAL)[key] == pytest.approx(part, rel=2e-4)


def test_the_torque_is_that_of_the_rigid_body():
    rng = np.random.default_rng(5)
    trajectory = random_curve(rng, 41)
    limits = Limits(torque=1.0, momentum=1.0, inertia=J)
    times = np.linspace(1.0, 19.0, 500)
    step = 1e-4
    R, v, _ = trajectory.evaluate(times)
    ahead, behind = trajectory.evaluate(times + step), trajectory.evaluate(times - step)
    # The rate of change of the angular momentum in the reference frame.
    momentum = [np.einsum("nij,nj->ni", x[0], x[1] @ J) for x in (ahead, behind)]
    torque = np.linalg.norm((momentum[0] - momentum[1]) / (2.0 * step), axis=1)
    _, _, a = trajectory.evaluate(times)
    used = limits.used(v, a)
    assert used["torque"] == pytest.approx(torque.max(), rel=1e-6)
    momenta = np.linalg.norm(np.einsum("nij,nj->ni", R, v @ J), axis=1)
    assert used["momentum"] == pytest.approx(momenta.max(), rel=1e-12)


def test_the_closed_form_of_the_cubic():
    angle, T, moment = 2.0, 10.0, 4.0
    trajectory = slew(angle, T)
    exact = {
        "rate": 1.5 * angle / T,
        "acceleration": 6.0 * angle / T**2,
        "torque": moment * 6.0 * angle / T**2,
        "momentum": moment * 1.5 * angle / T,
        "jerk": 12.0 * angle / T**3,
        "torque_rate": moment * 12.0 * angle / T**3,
    }
    inertia = np.diag([2.0, 3.0, moment])
    for key, value in exact.items():
        tight = certify_limits(trajectory, Limits(**{key: value}, inertia=inertia))
        assert tight.parts[key] == pytest.approx(1.0, abs=1.1e-4)
        assert (
            certify_limits(trajectory, Limits(**{key: 1.001 * value}, inertia=inertia)).reasons
            == ()
        )
        broken = certify_limits(trajectory, Limits(**{key: 0.999 * value}, inertia=inertia))
        assert len(broken.reasons) == 1
        assert broken.reasons[0].startswith(f"limits.{key}: 1.00")


def test_a_limit_broken_only_between_samples_is_broken():
    # One quintic from rest to rest: at its two samples nothing moves.
    rest = np.zeros((2, 3))
    q = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, math.sin(0.5), math.cos(0.5)]]
    trajectory = Trajectory([0.0, 10.0], q, rest, rest)
    peak = 1.875 / 10.0
    problem = problem_of(trajectory)
    refused = certify(trajectory, problem, Limits(rate=0.999 * peak))
    assert not refused.certified
    assert refused.breaks_only_limits
    assert refused.limits_left["rate"] == pytest.approx(-0.001, abs=2e-4)
    assert "limits.rate: 1.001 times the limit" in refused.reasons[0]
    assert "t = 5 s" in refused.reasons[0]
    each = certify(trajectory, problem, Limits(rate=[1.0, 1.0, 0.999 * peak])).reasons[0]
    assert "times the limit of [1, 1, 0.187312] rad/s per axis at t = 5 s" in each
    allowed = certify(trajectory, problem, Limits(rate=1.001 * peak))
    assert allowed.certified
    assert not allowed.breaks_only_limits
    assert 0.0 < allowed.limits_left["rate"] < 0.0011


def test_each_axis_has_its_own_limit():
    trajectory = slew(axis=(0.0, 0.6, 0.8))
    peak = 0.3
    assert certify_limits(trajectory, Limits(rate=[1e-6, 0.61 * peak, 0.81 * peak])).reasons == ()
    for broken in ([1e-6, 0.59 * peak, 1.0], [1e-6, 1.0, 0.79 * peak]):
        assert len(certify_limits(trajectory, Limits(rate=broken)).reasons) == 1


def test_the_problem_s_limits_count_unless_others_are_given():
    trajectory = slew()
    problem = problem_of(trajectory, limits=Limits(rate=0.2, acceleration=1.0))
    certificate = certify(trajectory, problem)
    assert not certificate.certified
    assert certificate.limits_left["rate"] == pytest.approx(-0.5, abs=1e-3)
    assert certificate.limits_left["acceleration"] == pytest.approx(0.88, abs=1e-3)
    assert certify(trajectory, problem, Limits(rate=0.4)).certified
    assert certify(trajectory, problem_of(trajectory)).limits_left == {}


def test_with_an_automatic_duration_the_trajectory_s_own_counts():
    trajectory = slew(rate=True)
    moving = Zone([0, 0, 1], 0.5, [1, 0, 0], strength=1.0, rate=[0.01, 0, 0], name="moon")
    fixed = problem_of(trajectory, (moving,), limits=Limits(rate=1.0), tension=0.5)
    automatic = problem_of(
        trajectory, (moving,), limits=Limits(rate=1.0), tension=0.5, duration="auto"
    )
    expected, certificate = certify(trajectory, fixed), certify(trajectory, automatic)
    assert certificate.certified
    assert certificate.clearance == expected.clearance
    assert certificate.extremality == expected.extremality
    assert certify_clearance(trajectory, automatic).clearance == expected.clearance


def test_more_than_limits_stands_against_a_bad_end():
    trajectory = slew()
    problem = problem_of(trajectory, limits=Limits(rate=0.2))
    object.__setattr__(problem, "goal", State(problem.goal.orientation @ so3.exp([0.1, 0.0, 0.0])))
    certificate = certify(trajectory, problem)
    assert len(certificate.reasons) == 2
    assert not certificate.breaks_only_limits


def test_what_is_not_finite_breaks_every_limit():
    trajectory = curve([0.0, 0.0, 0.0, 1.0], np.ones((2, 3)), 5.0, 5)
    coefficients = trajectory.coefficients.copy()
    coefficients[2, 3, 1] = np.nan
    coefficients.setflags(write=False)
    object.__setattr__(trajectory, "_coefficients", coefficients)
    use = certify_limits(trajectory, Limits(rate=1e9, torque=1e9, inertia=J))
    assert len(use.reasons) == 2


def test_wheels_give_and_store_what_the_pseudo_inverse_says():
    # Four wheels on a pyramid about z: each has a quarter of a z torque, over the axis's z.
    tilt = 0.7
    axes = [[math.cos(tilt) * x, math.cos(tilt) * y, math.sin(tilt)]
            for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]  # fmt: skip
    angle, T, moment = 2.0, 10.0, 4.0
    share = moment / (4.0 * math.sin(tilt))
    torque, momentum = share * 6.0 * angle / T**2, share * 1.5 * angle / T
    for most, part in (
        ((2 * torque, 9.0), 0.5),
        ((9.0, momentum), 1.0),
        ((torque / 1.2, 9.0), 1.2),
    ):
        wheels = [Wheel(axis, *most) for axis in axes]
        use = certify_limits(slew(angle, T), Limits(wheels=wheels, inertia=np.diag([2, 3, moment])))
        assert use.parts == {"wheels": pytest.approx(part, abs=1.1e-4 * part)}
        assert len(use.reasons) == (use.parts["wheels"] > 1.0)


def test_a_body_that_holds_still_needs_no_torque_but_the_momentum_that_there_is():
    wheels = [Wheel(axis, 1.0, 0.5) for axis in np.eye(3)]
    still = slew(1e-12, 10.0)
    use = certify_limits(still, Limits(wheels=wheels, inertia=J), np.array([0.0, 0.0, 0.6]))
    assert use.parts["wheels"] == pytest.approx(1.2, rel=1e-6)
    assert "limits.wheels: 1.2 times the limit of a wheel's momentum" in use.reasons[0]


def test_a_jerk_between_samples_is_seen():
    # Samples of a smooth slew with one acceleration off by little: the jerk beside it is large.
    trajectory = slew(samples=41)
    a = trajectory.angular_accelerations.copy()
    a[20] += 0.002
    spoiled = replaced(trajectory, angular_accelerations=a)
    limits = Limits(jerk=1.01 * 12.0 * 2.0 / 10.0**3)
    assert certify_limits(trajectory, limits).reasons == ()
    use = certify_limits(spoiled, limits)
    assert use.parts["jerk"] > 1.3
    assert abs(use.worst_times["jerk"] - 5.0) < 0.3


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({}, "limits"),
        ({"inertia": J}, "limits"),
        ({"rate": 0.0}, "limits.rate"),
        ({"rate": [0.1, 0.1, -0.1]}, "limits.rate"),
        ({"rate": [0.1, 0.1]}, "limits.rate"),
        ({"acceleration": math.nan}, "limits.acceleration"),
        ({"torque": 1.0}, "inertia"),
        ({"torque_rate": 1.0}, "inertia"),
        ({"jerk": [1.0, -1.0, 1.0]}, "limits.jerk"),
        ({"wheels": [Wheel(axis, 1.0, 1.0) for axis in np.eye(3)]}, "inertia"),
        (
            {"wheels": [Wheel(axis, 1.0, 1.0) for axis in np.eye(3)[:2]], "inertia": J},
            "limits.wheels",
        ),
        (
            {"wheels": [Wheel([x, 1.0, 0.0], 1.0, 1.0) for x in range(4)], "inertia": J},
            "limits.wheels",
        ),
        ({"wheels": [1.0], "inertia": J}, "limits.wheels[0]"),
        ({"momentum": [1.0, 1.0, 1.0]}, "inertia"),
        ({"torque": 1.0, "inertia": -J}, "inertia"),
        ({"torque": 1.0, "inertia": np.triu(J)}, "inertia"),
        ({"torque": 1.0, "inertia": np.diag([1.0, 1.0, 3.0])}, "inertia"),
    ],
)
def test_limits_that_make_no_sense_are_refused_by_name(options, key):
    with pytest.raises(InvalidProblemError) as refusal:
        Limits(**options)
    assert refusal.value.key == key


def test_an_automatic_duration_needs_limits():
    rest = State(np.eye(3))
    with pytest.raises(InvalidProblemError, match="least within limits: give them"):
        Problem(rest, rest, "auto")
    with pytest.raises(InvalidProblemError, match="expected Limits"):
        Problem(rest, rest, 1.0, limits={"rate": 1.0})
    with pytest.raises(InvalidProblemError, match="finite"):
        Problem(rest, rest, math.inf)
    assert Problem(rest, rest, "auto", limits=Limits(rate=1.0)).has_auto_duration
    assert not Problem(rest, rest, 5.0, limits=Limits(rate=1.0)).has_auto_duration


def test_old_names_of_a_certificate_still_answer_with_a_warning():
    start = State.from_quaternion_xyzw([0.0, 0.0, 0.0, 1.0])
    goal = State.from_quaternion_xyzw([0.0, 0.0, 0.6, 0.8])
    certificate = solve(Problem(start, goal, 10.0, limits=Limits(rate=1.0))).certificate
    with pytest.warns(DeprecationWarning, match="limits_left"):
        assert certificate.limit_margins == certificate.limits_left
    with pytest.warns(DeprecationWarning, match="least_clearance_times"):
        assert certificate.worst == certificate.least_clearance_times
