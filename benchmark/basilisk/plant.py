# SPDX-License-Identifier: Apache-2.0
"""The spacecraft of Basilisk: rigid hub, reaction wheels, its navigation, tracking and control.

The chain is that of Basilisk's scenarioAttitudeConstrainedManeuver: simpleNav, attTrackingError,
mrpFeedback, rwMotorTorque, reactionWheelStateEffector, all at one step, with its gains
`P = 3 max(I) / 10 s` and `K = P^2 / max(I)`. There is no orbit and no disturbance: the zones'
directions are fixed, and Basilisk's boreAngCalc measures the angle to them beside us.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.fswAlgorithms import attTrackingError, mrpFeedback, rwMotorTorque
from Basilisk.simulation import (
    boreAngCalc,
    reactionWheelStateEffector,
    simpleNav,
    spacecraft,
)
from Basilisk.utilities import SimulationBaseClass, macros, simIncludeRW
from numpy.typing import NDArray

from benchmark.basilisk.reference import Reference, quaternion_of_mrp
from riem_planner import Problem, Zone

Array = NDArray[np.float64]

STEP = 0.01  # s, of simulation and control, as in the scenario
_DECAY_TIME = 10.0  # s, of the scenario's gains
_FAR = 1.5e11  # m, where the bodies of the zones stand
_MASS = 4.0  # kg; without forces it changes nothing
_WHEEL_SPEED = 6000.0  # rpm at the momentum limit, as in the scenario


@dataclass(frozen=True, eq=False)
class Craft:
    """What flies.

    Parameters
    ----------
    inertia : (3, 3)
        In body axes [kg m^2].
    wheel_axes : (m, 3)
        Spin axes in the body's frame.
    torque_limit, momentum_limit
        Of each wheel [N m], [N m s].
    """

    inertia: Array
    wheel_axes: Array
    torque_limit: float
    momentum_limit: float


@dataclass(frozen=True, eq=False)
class Flown:
    """What was recorded, at every step.

    Parameters
    ----------
    times : (n,)
        [s].
    quaternions : (n, 4)
        True attitudes, x, y, z, w, body to reference frame.
    rates : (n, 3)
        True body rates [rad/s].
    wheel_torques : (n, m)
        Of the wheels' motors in the step before [N m].
    torques : (n, 3)
        On the body, from the wheels [N m].
    zone_angles
        Per zone the angle between boresight and direction, by Basilisk's boreAngCalc (n,) [rad].
    """

    times: Array
    quaternions: Array
    rates: Array
    wheel_torques: Array
    torques: Array
    zone_angles: dict[str, Array]


class _Guidance(sysModel.SysModel):
    """Writes one sample of a reference at each step."""

    def __init__(self, reference: Reference) -> None:
        super().__init__()
        self.ModelTag = "guidance"
        self.attRefOutMsg = messaging.AttRefMsg()
        self._columns = [
            column.tolist() for column in (reference.mrp, reference.rates, reference.accelerations)
        ]

    def UpdateState(self, CurrentSimNanos: int) -> None:  # Basilisk's name
        """Write the sample of this time."""
        k = round(CurrentSimNanos * macros.NANO2SEC / STEP)
        payload = messaging.AttRefMsgPayload()
        payload.sigma_RN, payload.omega_RN_N, payload.domega_RN_N = (
            column[k] for column in self._columns
        )
        self.attRefOutMsg.write(payload, CurrentSimNanos, self.moduleID)


def body_message(direction: Array) -> messaging.SpicePlanetStateMsg:
    """A celestial body that stands far away in a direction (3,)."""
    payload = messaging.SpicePlanetStateMsgPayload()
    payload.PositionVector = (_FAR * np.asarray(direction)).tolist()
    return messaging.SpicePlanetStateMsg().write(payload)


def inertia_message(inertia: Array) -> messaging.VehicleConfigMsg:
    """What the flight software knows of the spacecraft's inertia (3, 3) [kg m^2]."""
    payload = messaging.VehicleConfigMsgPayload(ISCPntB_B=inertia.ravel().tolist())
    return messaging.VehicleConfigMsg().write(payload)


class _Simulation:
    """One spacecraft and its flight software.

    Basilisk's modules point to each other's messages, so all that is made is kept here.
    """

    def __init__(self, craft: Craft, problem: Problem, reference: Reference) -> None:
        self.simulation = SimulationBaseClass.SimBaseClass()
        process = self.simulation.CreateNewProcess("process")
        process.addTask(self.simulation.CreateNewTask("task", macros.sec2nano(STEP)))
        self.hub = _hub(craft, reference)
        self.factory = _wheel_factory(craft)
        self.wheels = reactionWheelStateEffector.ReactionWheelStateEffector()
        self.factory.addToSpacecraft("wheels", self.wheels, self.hub)
        # A wheel's command is read before the hub moves; both move before the software runs.
        self._add(self.wheels, 2)
        self._add(self.hub, 1)
        self._flight_software(craft, reference)
        self.sensors = [self._sensor(zone) for zone in problem.obstacles]
        self.state_log = self._recorded(self.hub.scStateOutMsg)
        self.wheel_logs = [self._recorded(message) for message in self.wheels.rwOutMsgs]
        self.angle_logs = {
            str(zone.name): self._recorded(sensor.angOutMsg)
            for zone, (sensor, _) in zip(problem.obstacles, self.sensors, strict=True)
        }

    def _add(self, module: Any, priority: int = -1) -> Any:
        self.simulation.AddModelToTask("task", module, priority)
        return module

    def _recorded(self, message: Any) -> Any:
        return self._add(message.recorder())

    def _flight_software(self, craft: Craft, reference: Reference) -> None:
        self.inertia = inertia_message(craft.inertia)
        self.wheel_parameters = self.factory.getConfigMessage()
        navigation = self._add(simpleNav.SimpleNav())
        guidance = self._add(_Guidance(reference))
        error = self._add(attTrackingError.attTrackingError())
        control = self._add(mrpFeedback.mrpFeedback())
        motors = self._add(rwMotorTorque.rwMotorTorque())
        largest = float(np.max(craft.inertia))
        control.P = 3.0 * largest / _DECAY_TIME
        control.K = control.P**2 / largest
        control.Ki = -1.0  # no integral feedback
        motors.controlAxes_B = np.eye(3).ravel().tolist()
        navigation.scStateInMsg.subscribeTo(self.hub.scStateOutMsg)
        error.attNavInMsg.subscribeTo(navigation.attOutMsg)
        error.attRefInMsg.subscribeTo(guidance.attRefOutMsg)
        control.guidInMsg.subscribeTo(error.attGuidOutMsg)
        control.vehConfigInMsg.subscribeTo(self.inertia)
        control.rwParamsInMsg.subscribeTo(self.wheel_parameters)
        control.rwSpeedsInMsg.subscribeTo(self.wheels.rwSpeedOutMsg)
        motors.rwParamsInMsg.subscribeTo(self.wheel_parameters)
        motors.vehControlInMsg.subscribeTo(control.cmdTorqueOutMsg)
        self.wheels.rwMotorCmdInMsg.subscribeTo(motors.rwMotorTorqueOutMsg)
        self.software = (navigation, guidance, error, control, motors)

    def _sensor(self, zone: Zone) -> tuple[Any, Any]:
        """What measures the angle between a zone's boresight and its direction; the body there."""
        body = body_message(zone.direction)
        sensor = self._add(boreAngCalc.BoreAngCalc())
        sensor.boreVec_B = zone.boresight.tolist()
        sensor.scStateInMsg.subscribeTo(self.hub.scStateOutMsg)
        sensor.celBodyInMsg.subscribeTo(body)
        return sensor, body


def _hub(craft: Craft, reference: Reference) -> Any:
    """The rigid body, in the reference's first state."""
    hub = spacecraft.Spacecraft()
    hub.hub.mHub = _MASS
    hub.hub.IHubPntBc_B = craft.inertia.tolist()
    hub.hub.sigma_BNInit = reference.mrp[0].reshape(3, 1).tolist()
    hub.hub.omega_BN_BInit = reference.body()[0][0].reshape(3, 1).tolist()
    return hub


def _wheel_factory(craft: Craft) -> Any:
    """The wheels, at rest, without friction and imbalance."""
    factory = simIncludeRW.rwFactory()
    for axis in craft.wheel_axes:
        factory.create(
            "custom",
            axis.tolist(),
            Omega_max=_WHEEL_SPEED,
            maxMomentum=craft.momentum_limit,
            u_max=craft.torque_limit,
            RWModel=messaging.BalancedWheels,
        )
    return factory


def fly(craft: Craft, problem: Problem, reference: Reference) -> Flown:
    """Let Basilisk's spacecraft follow a reference, from its start and with wheels at rest.

    Parameters
    ----------
    problem
        Whose zones' angles are recorded; its start is not used.
    reference
        Sampled every `STEP`.
    """
    built = _Simulation(craft, problem, reference)
    built.simulation.InitializeSimulation()
    built.simulation.ConfigureStopTime(macros.sec2nano(float(reference.times[-1])))
    built.simulation.ExecuteSimulation()
    motor = np.column_stack([log.u_current for log in built.wheel_logs])
    axes = craft.wheel_axes / np.linalg.norm(craft.wheel_axes, axis=1, keepdims=True)
    return Flown(
        times=np.asarray(built.state_log.times()) * macros.NANO2SEC,
        quaternions=quaternion_of_mrp(built.state_log.sigma_BN),
        rates=np.asarray(built.state_log.omega_BN_B),
        wheel_torques=motor,
        torques=-motor @ axes,
        zone_angles={name: np.asarray(log.missAngle) for name, log in built.angle_logs.items()},
    )
