# SPDX-License-Identifier: Apache-2.0
"""Plans of least time, flown by the simulator."""

import numpy as np

from riem_planner import Limits, Problem, State, Wheel, Zone, solve
from riem_planner.geometry import so3
from riem_planner.simulation.dynamics import Spacecraft
from riem_planner.simulation.flight import Conditions, fly

INERTIA = np.diag([2.0, 3.0, 2.5])
TORQUE, MOMENTUM = 6e-3, 0.3


def test_wheels_that_are_just_strong_enough_fly_a_plan_of_least_time():
    limits = Limits(
        wheels=[Wheel(axis, TORQUE, MOMENTUM) for axis in np.eye(3)], jerk=5e-4, inertia=INERTIA
    )
    sun = Zone([0.75, 0.0, -0.66], 0.4, [1.0, 0.0, 0.0], normalized_strength=0.01, name="sun")
    start, goal = State(np.eye(3)), State(so3.exp([0.3, 1.8, -0.4]))
    problem = Problem(start, goal, "auto", limits=limits, obstacles=(sun,), objective="least_time")
    trajectory = solve(problem).trajectory
    # The motors have 5 % in hand for the controller.
    spacecraft = Spacecraft(INERTIA, torque_limit=1.05 * TORQUE, momentum_limit=1.05 * MOMENTUM)
    flight = fly(trajectory, problem, spacecraft, conditions=Conditions(setpoint_rate=50.0))
    assert np.degrees(flight.tracking_error) < 0.1
    assert np.max(np.abs(flight.torques)) < 1.02 * TORQUE
    assert np.max(np.abs(flight.wheel_momenta)) < 1.02 * MOMENTUM
    assert flight.clearance["sun"] > np.radians(-0.1)
