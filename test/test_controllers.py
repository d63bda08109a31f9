# SPDX-License-Identifier: Apache-2.0
"""Setpoints for controllers of others: there and back, and against their own definitions."""

import numpy as np
import pytest

from msg_adapters import controllers
from riem_planner.geometry import so3

# Asymmetric in every component: a wrong order or frame that cancels itself out would show.
Q = np.array([0.1, -0.2, 0.35, 0.9]) / np.linalg.norm([0.1, -0.2, 0.35, 0.9])
V = np.array([0.01, -0.02, 0.03])
A = np.array([0.004, 0.005, -0.006])
R = so3.quaternion_to_matrix(Q)
RANDOM = [so3.quaternion_exp(row) for row in np.random.default_rng(0).normal(size=(20, 3)) * 2.0]


def _alike(p, q):
    return abs(float(np.asarray(p) @ np.asarray(q))) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("q", [Q, *RANDOM])
def test_there_and_back(q):
    back, rate = controllers.attitude_from_px4(*controllers.px4_from_attitude(q, V))
    assert _alike(back, q)
    assert rate == pytest.approx(V, abs=1e-15)
    back, rate = controllers.attitude_from_mavros(controllers.mavros_from_attitude(q, V, 0.5))
    assert _alike(back, q)
    assert rate == pytest.approx(V)
    back, v, a = controllers.setpoint_from_basilisk(controllers.basilisk_from_setpoint(q, V, A))
    assert _alike(back, q)
    assert np.concatenate([v, a]) == pytest.approx(np.concatenate([V, A]), abs=1e-15)
    chained = controllers.references_from_setpoint(q, V, A, "attitude/")
    back, v, a = controllers.setpoint_from_references(chained, "attitude/")
    assert _alike(back, q)
    assert np.concatenate([v, a]) == pytest.approx(np.concatenate([V, A]))


def test_px4_has_w_first_and_axes_front_right_down_in_north_east_down():
    q_d, rates = controllers.px4_from_attitude(Q, V)
    ned_from_frd = so3.quaternion_to_matrix([*q_d[1:], q_d[0]])
    for front_left_up in np.eye(3):
        east, north, up = R @ front_left_up
        front, left, above = front_left_up
        assert ned_from_frd @ [front, -left, -above] == pytest.approx([north, east, -up])
    assert rates.tolist() == [V[0], -V[1], -V[2]]


def test_level_and_north_is_no_turn_for_px4():
    facing_north = so3.quaternion_exp(np.array([0.0, 0.0, np.pi / 2]))
    q_d, _ = controllers.px4_from_attitude(facing_north, np.zeros(3))
    assert np.abs(q_d) == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-15)


def test_basilisk_has_rates_in_inertial_components_and_parameters_of_the_short_way():
    reference = controllers.basilisk_from_setpoint(-Q, V, A)
    sigma = reference.sigma_RN
    assert np.linalg.norm(sigma) <= 1.0
    s = sigma @ sigma
    tilde = np.array([[0, -sigma[2], sigma[1]], [sigma[2], 0, -sigma[0]], [-sigma[1], sigma[0], 0]])
    # [RN] of Schaub and Junkins, equation 3.147: it maps components of N to those of R.
    RN = np.eye(3) + (8 * tilde @ tilde - 4 * (1 - s) * tilde) / (1 + s) ** 2
    assert pytest.approx(RN, abs=1e-14) == R.T
    assert reference.omega_RN_N == pytest.approx(R @ V)
    assert reference.domega_RN_N == pytest.approx(R @ A)


def test_mavros_is_told_what_to_ignore():
    assert controllers.mavros_from_attitude(Q).type_mask == 1 + 2 + 4 + 64
    assert controllers.mavros_from_attitude(Q, V, 0.3).type_mask == 0
    assert controllers.attitude_from_mavros(controllers.mavros_from_attitude(Q))[1] is None
    with pytest.raises(ValueError, match="thrust"):
        controllers.mavros_from_attitude(Q, V, 1.5)


@pytest.mark.parametrize("bad", [np.zeros(4), [np.nan, 0, 0, 1], [1.0, 0.0, 0.0], 2 * Q])
def test_what_is_no_attitude_is_refused(bad):
    for adapter in (
        lambda: controllers.px4_from_attitude(bad, V),
        lambda: controllers.mavros_from_attitude(bad),
        lambda: controllers.basilisk_from_setpoint(bad, V, A),
        lambda: controllers.references_from_setpoint(bad, V, A),
    ):
        with pytest.raises(ValueError, match="expected"):
            adapter()
    with pytest.raises(ValueError, match="finite"):
        controllers.px4_from_attitude(Q, [np.inf, 0.0, 0.0])
    with pytest.raises(ValueError, match="interface"):
        controllers.setpoint_from_references({"orientation.x": 0.0})


def test_inputs_are_not_changed():
    given = [Q.copy(), V.copy(), A.copy()]
    controllers.px4_from_attitude(*given[:2])
    controllers.basilisk_from_setpoint(*given)
    controllers.references_from_setpoint(*given)
    assert np.array_equal(np.concatenate(given), np.concatenate([Q, V, A]))
