# SPDX-License-Identifier: Apache-2.0
"""A planned slew, flown in closed loop without ROS: tracking error and achieved clearance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import finite_array, positive_number
from riem_planner.errors import InvalidProblemError
from riem_planner.geometry import so3
from riem_planner.problem import Problem
from riem_planner.simulation.dynamics import BodyState, Controller, SensorNoise, Spacecraft, Target
from riem_planner.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Conditions:
    """What a flight has to bear.

    Parameters
    ----------
    setpoint_rate
        Of the stream of setpoints [Hz].
    steps_per_setpoint
        Steps of control and simulation per setpoint; between setpoints the controller
        extrapolates.
    initial_error : (3,)
        Rotation vector in the body's frame from the planned start to the true one [rad].
    dropped
        Part of the setpoints that never arrives, the first one excepted.
    without_torque
        Times from and until which the wheels give nothing [s].
    noise
        Of the sensors.
    seed
        Of the noise and of what is dropped.
    """

    setpoint_rate: float = 10.0
    steps_per_setpoint: int = 2
    initial_error: Array = field(default_factory=lambda: np.zeros(3))
    dropped: float = 0.0
    without_torque: tuple[float, float] = (0.0, 0.0)
    noise: SensorNoise = field(default_factory=SensorNoise)
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate and freeze."""
        positive_number("setpoint_rate", self.setpoint_rate)
        if self.steps_per_setpoint < 1:
            raise InvalidProblemError(
                "steps_per_setpoint", f"expected at least 1, got {self.steps_per_setpoint}"
            )
        if not 0.0 <= self.dropped < 1.0:
            raise InvalidProblemError("dropped", f"expected from 0 to below 1, got {self.dropped}")
        error = finite_array("initial_error", self.initial_error, (3,))
        object.__setattr__(self, "initial_error", error)


@dataclass(frozen=True, eq=False)
class Flight:
    """How a slew was flown.

    Parameters
    ----------
    times : (n,)
        [s].
    quaternions : (n, 4)
        True attitudes, x, y, z, w, body to reference frame.
    rates : (n, 3)
        True body rates [rad/s].
    torques : (n, 3)
        What the wheels gave in the step before; 0 at the start [N m].
    wheel_momenta : (n, 3)
        [N m s].
    errors : (n,)
        Angle between the true and the planned attitude [rad].
    clearance
        Per obstacle or keep-in group, the least distance to the forbidden set [rad] over the
        whole time: a lower bound, as between two samples no attitude is farther from the nearer
        one than half a step at the largest rate.
    """

    times: Array
    quaternions: Array
    rates: Array
    torques: Array
    wheel_momenta: Array
    errors: Array
    clearance: dict[str, float]

    @property
    def tracking_error(self) -> float:
        """Largest angle between the true and the planned attitude [rad]."""
        return float(np.max(self.errors))


def fly(
    trajectory: Trajectory,
    problem: Problem,
    spacecraft: Spacecraft,
    controller: Controller | None = None,
    conditions: Conditions | None = None,
) -> Flight:
    """Let a spacecraft follow a trajectory, and measure how far it keeps from the zones.

    Parameters
    ----------
    trajectory
        The reference; setpoints are its attitude, rate and acceleration at their times.
    problem
        Whose obstacles the clearance is measured from.
    spacecraft
        What flies, from the planned start and with wheels at rest.
    controller
        What steers; by default one that knows the spacecraft's inertia.
    conditions
        What it has to bear; by default nothing but setpoints at 10 Hz.
    """
    controller = Controller(spacecraft.inertia) if controller is None else controller
    conditions = Conditions() if conditions is None else conditions
    random = np.random.default_rng(conditions.seed)
    setpoints = max(1, int(np.ceil(trajectory.duration * conditions.setpoint_rate)))
    per = conditions.steps_per_setpoint
    times = np.linspace(0.0, trajectory.duration, setpoints * per + 1)
    planned = trajectory.evaluate_quaternion(times)
    step = float(times[1])
    error = so3.quaternion_exp(conditions.initial_error)
    start = so3.quaternion_multiply(planned[0][0], error)
    states = [BodyState(start, so3.quaternion_to_matrix(error).T @ planned[1][0])]
    torques = [np.zeros(3)]
    first, last = conditions.without_torque
    heard = 0
    for k, time in enumerate(times[:-1]):
        if k % per == 0 and (k == 0 or random.random() >= conditions.dropped):
            heard = k
        target = Target(*(column[heard] for column in planned)).after(time - float(times[heard]))
        told = conditions.noise.measured(states[-1], random)
        wanted = controller.torque(told, target)
        if first <= time < last:
            wanted = np.zeros(3)
        torques.append(spacecraft.applied_torque(states[-1], wanted, step))
        states.append(spacecraft.step(states[-1], torques[-1], step))
    quaternions = np.array([state.quaternion for state in states])
    rates = np.array([state.rate for state in states])
    return Flight(
        times=times,
        quaternions=quaternions,
        rates=rates,
        torques=np.array(torques),
        wheel_momenta=np.array([state.wheel_momentum for state in states]),
        errors=so3.quaternion_distance(quaternions, planned[0]),
        clearance=_clearance(problem, times, quaternions, rates),
    )


def _clearance(
    problem: Problem, times: Array, quaternions: Array, rates: Array
) -> dict[str, float]:
    """Lower bounds of the distances to the forbidden sets, between the samples as well.

    The body may turn faster than at both ends of a step, but by no more than the rate changes
    within one.
    """
    if not problem.obstacles:
        return {}
    forbidden = problem.forbidden
    change = float(np.max(np.linalg.norm(np.diff(rates, axis=0), axis=1)))
    fastest = float(np.max(np.linalg.norm(rates, axis=1))) + change + forbidden.fastest
    slack = 0.5 * fastest * float(np.max(np.diff(times)))
    margins = forbidden.margins(so3.quaternion_to_matrix(quaternions), times)
    return {name: float(np.min(values)) - slack for name, values in margins.items()}
