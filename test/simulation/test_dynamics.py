# SPDX-License-Identifier: Apache-2.0
"""The simulated body conserves what a body conserves, and its controller follows a plan."""

from itertools import pairwise

import numpy as np
import pytest

from riem_planner import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.simulation.dynamics import BodyState, Controller, SensorNoise, Spacecraft, Target

INERTIA = np.array([[2.0, 0.1, 0.0], [0.1, 3.0, -0.2], [0.0, -0.2, 4.0]])
TUMBLING = BodyState([0.1, -0.7, 0.1, 0.7], [0.9, -0.4, 0.6], [0.5, 1.0, -0.3])
NO_TORQUE = np.zeros(3)


def derivative(function, initial, h=1e-3):
    """At 0 from the right, to second order."""
    return (4.0 * function(h) - function(2.0 * h) - 3.0 * initial) / (2.0 * h)


@pytest.fixture
def body():
    return Spacecraft(INERTIA)


def flown(spacecraft, state, torque, duration, steps):
    """States of a flight under a constant torque asked for."""
    states = [state]
    for _ in range(steps):
        states.append(spacecraft.step(states[-1], torque, duration / steps))
    return states


def orders(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def test_total_momentum_is_constant_at_any_step(body):
    for steps in (20, 500):
        states = flown(body, TUMBLING, [0.3, -0.2, 0.1], 20.0, steps)
        totals = np.array([body.total_momentum(state) for state in states])
        assert np.ptp([state.wheel_momentum[0] for state in states]) > 5.0
        assert np.max(np.abs(totals - totals[0])) < 2e-15 * steps * np.linalg.norm(totals[0])


def test_energy_is_conserved_while_the_wheels_are_not_driven_to_fourth_order(body):
    drifts = []
    for steps in (300, 600, 1200):
        energies = [body.kinetic_energy(s) for s in flown(body, TUMBLING, NO_TORQUE, 20.0, steps)]
        drifts.append(np.max(np.abs(np.array(energies) / energies[0] - 1.0)))
    assert drifts[-1] < 1e-9
    assert np.all(np.abs(orders(drifts) - 4.0) < 0.25)


def test_energy_grows_by_the_work_of_the_wheels(body):
    torque = np.array([0.3, -0.2, 0.1])
    states = flown(body, TUMBLING, torque, 10.0, 1000)
    power = np.array([state.rate @ torque for state in states])
    simpson = (
        10.0 / 3000 * (power[0] + power[-1] + 4 * power[1:-1:2].sum() + 2 * power[2:-1:2].sum())
    )
    gained = body.kinetic_energy(states[-1]) - body.kinetic_energy(states[0])
    assert abs(gained) > 0.1
    assert gained == pytest.approx(simpson, abs=1e-8)


def test_a_spinning_top_precesses_by_the_closed_form_to_fourth_order():
    # J = diag(j, j, k): R(t) = exp(t L / j) R0 exp(-t (k/j - 1) w e3), L the total momentum.
    j, k = 2.0, 3.0
    top = Spacecraft(np.diag([j, j, k]))
    start = BodyState([0.1, -0.7, 0.1, 0.7], [0.3, 0.2, 1.1])
    spin = (k / j - 1.0) * start.rate[2]
    exact = so3.quaternion_multiply(
        so3.quaternion_multiply(
            so3.quaternion_exp(10.0 * top.total_momentum(start) / j), start.quaternion
        ),
        so3.quaternion_exp([0.0, 0.0, -10.0 * spin]),
    )
    errors = []
    for steps in (100, 200, 400):
        end = flown(top, start, NO_TORQUE, 10.0, steps)[-1]
        errors.append(float(so3.quaternion_distance(end.quaternion, exact)))
    assert errors[-1] < 1e-6
    assert np.all(np.abs(orders(errors) - 4.0) < 0.2)


def test_tumbling_with_wheels_converges_to_fourth_order(body):
    torque = [0.3, -0.2, 0.1]
    ends = [flown(body, TUMBLING, torque, 8.0, n)[-1].quaternion for n in (80, 160, 320, 640)]
    gaps = [float(so3.quaternion_distance(a, b)) for a, b in pairwise(ends)]
    assert np.all(np.abs(orders(gaps) - 4.0) < 0.2)


def test_the_stated_acceleration_is_that_of_the_motion(body):
    torque = np.array([0.3, -0.2, 0.1])
    difference = derivative(lambda t: body.step(TUMBLING, torque, t).rate, TUMBLING.rate)
    assert difference == pytest.approx(body.acceleration(TUMBLING, torque), abs=1e-5)


def test_a_wheel_turns_a_body_at_rest_by_the_closed_form():
    spacecraft = Spacecraft(np.diag([2.0, 3.0, 4.0]))
    end = flown(spacecraft, BodyState([0, 0, 0, 1]), [0.0, 0.0, 0.5], 2.0, 7)[-1]
    assert so3.quaternion_log(end.quaternion) == pytest.approx([0.0, 0.0, 0.25], abs=1e-14)
    assert end.wheel_momentum == pytest.approx([0.0, 0.0, -1.0])


def test_wheels_saturate_in_torque_and_in_momentum():
    spacecraft = Spacecraft(
        np.diag([2.0, 3.0, 4.0]), torque_limit=[0.1, 0.2, 0.3], momentum_limit=0.5
    )
    rest = BodyState([0, 0, 0, 1])
    assert spacecraft.applied_torque(rest, [1.0, -1.0, 0.25], 0.1).tolist() == [0.1, -0.2, 0.25]
    states = flown(spacecraft, rest, [1.0, -1.0, 1.0], 20.0, 77)
    momenta = np.array([state.wheel_momentum for state in states])
    assert np.max(np.abs(momenta)) <= 0.5 + 1e-15
    assert np.abs(momenta[-1]) == pytest.approx([0.5, 0.5, 0.5])
    assert spacecraft.applied_torque(states[-1], [1.0, 0.0, 0.0], 0.1)[0] == pytest.approx(0.0)
    assert spacecraft.applied_torque(states[-1], [-1.0, 0.0, 0.0], 0.1)[0] == -0.1  # desaturates


def test_noise_has_its_deviation_and_follows_its_seed():
    noise = SensorNoise(attitude=1e-3, rate=2e-4)

    def drawn(seed):
        random = np.random.default_rng(seed)
        return [noise.measured(TUMBLING, random) for _ in range(1500)]

    told = drawn(1)
    assert np.array_equal(told[-1].rate, drawn(1)[-1].rate)
    assert not np.array_equal(told[-1].rate, drawn(2)[-1].rate)
    rates = np.array([state.rate for state in told]) - TUMBLING.rate
    back = so3.quaternion_conjugate(TUMBLING.quaternion)
    turns = so3.quaternion_log(
        so3.quaternion_multiply(back, np.array([state.quaternion for state in told]))
    )
    assert np.std(rates, axis=0) == pytest.approx([2e-4] * 3, rel=0.08)
    assert np.std(turns, axis=0) == pytest.approx([1e-3] * 3, rel=0.08)
    assert told[0].wheel_momentum == pytest.approx(TUMBLING.wheel_momentum)


def test_a_target_extrapolates_a_constant_acceleration_to_fourth_order():
    target = Target(TUMBLING.quaternion, np.array([0.9, -0.4, 0.6]), np.array([-0.5, 0.8, 0.3]))
    errors = []
    for time in (0.4, 0.2, 0.1):
        fine = target
        for _ in range(2000):
            fine = fine.after(time / 2000)
        errors.append(
            float(so3.quaternion_distance(target.after(time).quaternion, fine.quaternion))
        )
        assert target.after(time).rate == pytest.approx(fine.rate, abs=1e-12)
    assert errors[-1] < 1e-5
    assert np.all(orders(errors) > 3.8)


@pytest.mark.parametrize("part", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("angle", [0.1, 3.0])
def test_the_controller_comes_to_a_target_at_rest_from_any_attitude(angle, part):
    plant = Spacecraft(part * INERTIA)
    controller = Controller(INERTIA)
    turn = angle * np.array([0.6, -0.64, 0.48])
    state = BodyState(so3.quaternion_exp(turn), [0.1, 0.05, -0.1])
    target = Target(np.array([0.0, 0.0, 0.0, 1.0]))
    for _ in range(500):
        state = plant.step(state, controller.torque(state, target), 0.05)
    assert float(so3.quaternion_distance(state.quaternion, target.quaternion)) < 1e-6
    assert np.linalg.norm(state.rate) < 1e-6


def test_the_closed_loop_is_the_stated_oscillator_where_the_inertia_is_known():
    # About one axis: e'' = -omega^2 e - 2 zeta omega e', e = (1 + omega t) exp(-omega t) e_0.
    plant, controller = Spacecraft(INERTIA), Controller(INERTIA, natural_frequency=0.5)
    state = BodyState(so3.quaternion_exp([0.0, 0.2, 0.0]))
    step = 0.004
    for _ in range(1000):
        torque = controller.torque(state, Target(np.array([0.0, 0.0, 0.0, 1.0])))
        state = plant.step(state, torque, step)
    expected = (1.0 + 2.0) * np.exp(-2.0) * 0.2
    assert so3.quaternion_log(state.quaternion) == pytest.approx([0.0, expected, 0.0], abs=4e-4)


def test_the_feed_forward_alone_holds_a_moving_target():
    # A target that turns and accelerates about a skew axis, as the torque would make it.
    plant, controller = Spacecraft(INERTIA), Controller(INERTIA)
    target = Target(TUMBLING.quaternion, TUMBLING.rate, np.array([0.1, -0.2, 0.05]))
    state = TUMBLING
    torque = controller.torque(state, target)
    assert plant.acceleration(state, torque) == pytest.approx(target.acceleration, abs=1e-12)


def test_the_feed_forward_is_turned_into_the_bodys_frame():
    # The body is at an error, and its acceleration relative to the target is the feedback's:
    # what is left of d/dt (v - Q v_d) by differences must be -omega^2 e - 2 zeta omega w.
    plant, controller = Spacecraft(INERTIA), Controller(INERTIA, 0.7, 0.9)
    target = Target(
        np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.3, 0.1, -0.2]), np.array([0.1, -0.2, 0.05])
    )
    torque = controller.torque(TUMBLING, target)

    def rate_error(time):
        state, moved = plant.step(TUMBLING, torque, time), target.after(time)
        error = so3.quaternion_multiply(
            so3.quaternion_conjugate(moved.quaternion), state.quaternion
        )
        return state.rate - so3.quaternion_to_matrix(error).T @ moved.rate, error

    w, error = rate_error(1e-12)
    feedback = -(0.7**2) * so3.quaternion_log(error) - 2.0 * 0.9 * 0.7 * w
    change = derivative(lambda t: rate_error(t)[0], w)
    assert change == pytest.approx(feedback, abs=1e-5)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Spacecraft(np.diag([1.0, -1.0, 1.0])), "inertia"),
        (lambda: Spacecraft(INERTIA, torque_limit=0.0), "torque_limit"),
        (lambda: Spacecraft(INERTIA, momentum_limit=[1.0, 2.0]), "momentum_limit"),
        (lambda: Spacecraft(INERTIA, torque_limit=np.nan), "torque_limit"),
        (lambda: Spacecraft(INERTIA).step(TUMBLING, NO_TORQUE, 0.0), "step"),
        (lambda: BodyState([0.0, 0.0, 0.0, 0.0]), "quaternion"),
        (lambda: BodyState([0.0, 0.0, 0.0, 1.0], [np.nan, 0.0, 0.0]), "rate"),
        (lambda: Controller(INERTIA, natural_frequency=0.0), "natural_frequency"),
        (lambda: SensorNoise(attitude=-1.0), "attitude"),
    ],
)
def test_wrong_values_are_refused_by_name(make, key):
    with pytest.raises(InvalidProblemError, match=key):
        make()
