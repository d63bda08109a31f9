# SPDX-License-Identifier: Apache-2.0
"""The published manoeuvres, flown in closed loop: tracked closely, and clear of every zone."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from riem_planner import InvalidProblemError, Zone, certify, plan
from riem_planner.files.problem_files import read_problem
from riem_planner.geometry import so3
from riem_planner.simulation.dynamics import Controller, Spacecraft
from riem_planner.simulation.flight import Conditions, fly

CASES = sorted((Path(__file__).resolve().parents[2] / "config/problems").glob("*.yaml"))
NAMES = [path.stem for path in CASES]
BOUND = np.radians(2.05)
BAR = np.radians(0.05)
# s: the same paths (strengths are normalised), flown faster, as far as the wheels allow.
QUICK = {name: 40.0 if name.startswith("bevo2") else 80.0 for name in NAMES}


@cache
def case(name, duration=None, enlarged=0.0):
    """A manoeuvre, its plan past zones that are larger by an angle [rad], and its spacecraft."""
    problem = read_problem(next(path for path in CASES if path.stem == name))
    problem = replace(problem, duration=duration or problem.duration)
    limits = problem.limits
    spacecraft = Spacecraft(limits.inertia_matrix, limits.torque, limits.momentum)
    zones = tuple(
        replace(
            zone, half_angle=zone.half_angle + (enlarged if zone.kind == "keep_out" else -enlarged)
        )
        for zone in problem.obstacles
    )
    return problem, plan(replace(problem, obstacles=zones)), spacecraft


def flown_nominally(name, duration):
    problem, trajectory, spacecraft = case(name, duration)
    flight = fly(trajectory, problem, spacecraft)
    assert flight.tracking_error < BAR
    assert flight.clearance
    assert min(flight.clearance.values()) > 0.0, flight.clearance


def flown_in_trouble(name, duration, part, way=1.0):
    problem, trajectory, spacecraft = case(name, duration, BOUND)
    assert min(certify(trajectory, problem).clearance.values()) >= BOUND
    true = replace(spacecraft, inertia=part * spacecraft.inertia)
    conditions = Conditions(
        initial_error=way * np.radians(2.0) * np.array([0.6, -0.64, 0.48]),
        dropped=0.1,
        without_torque=(0.4 * trajectory.duration, 0.4 * trajectory.duration + 2.0),
        seed=1,
    )
    flight = fly(trajectory, problem, true, Controller(spacecraft.inertia), conditions)
    assert flight.tracking_error < BOUND
    # What is left is the feed-forward's error, a fifth of the acceleration over omega^2.
    assert flight.errors[-1] < np.radians(0.2)
    assert min(flight.clearance.values()) > 0.0, flight.clearance


@pytest.mark.parametrize("name", NAMES)
def test_tracked_within_a_twentieth_of_a_degree_and_clear_of_every_zone(name):
    flown_nominally(name, QUICK[name])


@pytest.mark.parametrize(("name", "part"), [*zip(NAMES, [0.8, 1.2] * 3, strict=True)])
def test_planned_with_the_tracking_bound_no_zone_is_entered_whatever_goes_wrong(name, part):
    flown_in_trouble(name, QUICK[name], part)


@pytest.mark.soak
@pytest.mark.parametrize("name", NAMES)
def test_at_the_published_durations(name):
    flown_nominally(name, None)
    for part in (0.8, 1.2):
        for way in (1.0, -1.0):
            flown_in_trouble(name, None, part, way)


def test_extrapolating_setpoints_loses_little_beside_hearing_one_at_every_step():
    problem, trajectory, spacecraft = case("bevo2_case2", QUICK["bevo2_case2"])
    few, many = (
        fly(trajectory, problem, spacecraft, conditions=Conditions(rate, steps)).tracking_error
        for rate, steps in ((10.0, 4), (40.0, 1))
    )
    assert many < few < 0.05 * BAR


def test_the_clearance_is_below_the_samples_and_close_to_them():
    problem, trajectory, spacecraft = case("bevo2_case1", QUICK["bevo2_case1"])
    flight = fly(trajectory, problem, spacecraft, conditions=Conditions(steps_per_setpoint=4))
    attitudes = so3.quaternion_to_matrix(flight.quaternions)
    sampled = [problem.margins(R, t) for R, t in zip(attitudes, flight.times, strict=True)]
    assert {*flight.clearance} == {*sampled[0]}
    assert any(isinstance(zone, Zone) and zone.group for zone in problem.obstacles)
    for name, bound in flight.clearance.items():
        least = min(margins[name] for margins in sampled)
        slack = 0.5 * flight.times[1] * np.max(np.linalg.norm(flight.rates, axis=1))
        assert least - 1.2 * slack < bound <= least - slack


def test_wheels_too_weak_for_the_slew_saturate_and_miss_it():
    problem, trajectory, spacecraft = case("bevo2_case2", QUICK["bevo2_case2"])
    weak = replace(spacecraft, torque_limit=2e-5)
    flight = fly(trajectory, problem, weak)
    assert np.max(np.abs(flight.torques)) == pytest.approx(2e-5)
    assert flight.tracking_error > BAR


def test_what_goes_wrong_follows_the_seed():
    problem, trajectory, spacecraft = case("bevo2_case2", QUICK["bevo2_case2"])
    errors = [
        fly(trajectory, problem, spacecraft, conditions=Conditions(dropped=0.5, seed=seed)).errors
        for seed in (1, 1, 2)
    ]
    assert np.array_equal(errors[0], errors[1])
    assert not np.array_equal(errors[0], errors[2])


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"setpoint_rate": 0.0}, "setpoint_rate"),
        ({"steps_per_setpoint": 0}, "steps_per_setpoint"),
        ({"dropped": 1.0}, "dropped"),
        ({"initial_error": [1.0, 2.0]}, "initial_error"),
    ],
)
def test_wrong_conditions_are_refused_by_name(values, key):
    with pytest.raises(InvalidProblemError, match=key):
        Conditions(**values)
