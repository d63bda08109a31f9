# SPDX-License-Identifier: Apache-2.0
"""The simulated spacecraft as a ROS node: follows setpoints, tells its measured state."""

from __future__ import annotations

from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from trajectory_msgs.msg import MultiDOFJointTrajectory

from msg_adapters import MessageError
from msg_adapters.geometry import check_frame, odometry_from_attitude
from msg_adapters.trajectory import samples_from_reference
from riem_planner.checks import unit_quaternion
from riem_planner.errors import InvalidProblemError
from riem_planner.mission.settings import Kind, Specification, check_value
from riem_planner.node.hearing import overriding
from riem_planner.node.outputs import output_qos
from riem_planner.node.parameters import descriptor
from riem_planner.simulation.dynamics import BodyState, Controller, SensorNoise, Spacecraft, Target

LONGEST_STEP = 0.05
"""Longest step of the integration; longer periods are divided [s]."""
LONGEST_GAP = 2.0
"""A clock that goes on by more, or back, has been set: no motion follows from that [s]."""


def _fixed(
    name: str,
    kind: Kind,
    default: Any,
    description: str,
    least: float = -1e9,
    most: float = 1e9,
    lengths: tuple[int, ...] = (),
) -> Specification:
    return Specification(name, kind, default, description, least, most, lengths, change="never")


SPECIFICATIONS = (
    _fixed(
        "inertia",
        "numbers",
        [0.0066666667, 0.0, 0.0, 0.0, 0.0418666667, 0.0, 0.0, 0.0, 0.0418666667],
        "inertia matrix by rows, as the controller knows it [kg m^2]",
        lengths=(9,),
    ),
    _fixed(
        "inertia_error",
        "number",
        0.0,
        "true inertia over the one that the controller knows, less 1 [1]",
        -0.9,
        10.0,
    ),
    _fixed(
        "wheel_torque",
        "numbers",
        [0.001, 0.001, 0.001],
        "largest torque of each wheel [N m]",
        1e-12,
        1e9,
        (3,),
    ),
    _fixed(
        "wheel_momentum",
        "numbers",
        [0.01, 0.01, 0.01],
        "largest momentum of each wheel [N m s]",
        1e-12,
        1e9,
        (3,),
    ),
    _fixed("natural_frequency", "number", 1.0, "of the attitude controller [rad/s]", 1e-4, 1e3),
    _fixed("damping_ratio", "number", 1.0, "of the attitude controller [1]", 0.01, 100.0),
    _fixed(
        "attitude_noise",
        "number",
        0.0,
        "standard deviation of the measured attitude about each axis [rad]",
        0.0,
        1.0,
    ),
    _fixed(
        "rate_noise",
        "number",
        0.0,
        "standard deviation of each measured body rate [rad/s]",
        0.0,
        1.0,
    ),
    _fixed("seed", "integer", 0, "of the noise [1]", 0, 2**31 - 1),
    _fixed(
        "step_rate", "number", 50.0, "of control, simulation and state messages [Hz]", 1.0, 1000.0
    ),
    _fixed(
        "setpoint_timeout",
        "number",
        0.5,
        "a setpoint is extrapolated for so long, and the attitude then held [s]",
        0.0,
        1e6,
    ),
    _fixed(
        "start.orientation",
        "numbers",
        [0.0, 0.0, 0.0, 1.0],
        "x, y, z, w at the start, held until a setpoint comes [unit]",
        lengths=(4,),
    ),
    _fixed(
        "start.rate",
        "numbers",
        [0.0, 0.0, 0.0],
        "body rate at the start [rad/s]",
        -100.0,
        100.0,
        (3,),
    ),
    _fixed("planner", "text", "riem_planner", "name of the planner, relative to the namespace"),
    _fixed("reference_frame", "text", "inertial", "frame that setpoints must name"),
    _fixed("body_frame", "text", "base_link", "frame of the body, in state messages"),
)


class SpacecraftNode(Node):
    """The node `/spacecraft_sim`.

    Every period of the node's clock it measures its state, publishes it, and turns for that
    period under the torque that the controller asks of the wheels.

    Raises
    ------
    InvalidProblemError
        A parameter's override is wrong; names the parameter.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("spacecraft_sim", **options)
        try:
            self._set_up({item.name: self._declared(item) for item in SPECIFICATIONS})
        except Exception:
            self.destroy_node()
            raise

    def _set_up(self, values: dict[str, Any]) -> None:
        inertia = np.reshape(values["inertia"], (3, 3))
        self._spacecraft = Spacecraft(
            inertia * (1.0 + values["inertia_error"]),
            torque_limit=values["wheel_torque"],
            momentum_limit=values["wheel_momentum"],
        )
        self._controller = Controller(inertia, values["natural_frequency"], values["damping_ratio"])
        self._noise = SensorNoise(values["attitude_noise"], values["rate_noise"])
        self._random = np.random.default_rng(values["seed"])
        self._frames = values["reference_frame"], values["body_frame"]
        self._timeout = values["setpoint_timeout"]
        orientation = unit_quaternion("start.orientation", values["start.orientation"])
        self.state = BodyState(orientation, values["start.rate"])
        self._target = Target(self.state.quaternion)
        self._target_ns: int | None = None
        self.setpoints = 0
        self._time_ns: int | None = None
        planner = values["planner"]
        qos = output_qos(latched=False)
        self._publisher = self.create_publisher(
            Odometry, f"{planner}/state", qos, qos_overriding_options=overriding()
        )
        self._setpoint_topic = self.resolve_topic_name(f"{planner}/setpoint")
        self.create_subscription(
            MultiDOFJointTrajectory,
            f"{planner}/setpoint",
            self._hear,
            output_qos(latched=False),
            qos_overriding_options=overriding(),
        )
        self.create_timer(1.0 / values["step_rate"], self._step)
        self.get_logger().info(
            f"flying; setpoints from {self._setpoint_topic}, state at {values['step_rate']:g} Hz"
        )

    def _declared(self, specification: Specification) -> Any:
        name = specification.name
        try:
            value = self.declare_parameter(
                name, specification.default, descriptor(name, specification)
            ).value
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise InvalidProblemError(name, str(error)) from error
        value = list(value) if specification.kind == "numbers" else value
        check_value(name, specification, value)
        return value

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _hear(self, message: MultiDOFJointTrajectory) -> None:
        self.setpoints += 1
        try:
            check_frame("header.frame_id", message.header.frame_id, self._frames[0])
            samples, stamp_ns = samples_from_reference(message)
        except MessageError as error:
            self.get_logger().warning(
                f"{self._setpoint_topic} rejected: {error}", throttle_duration_sec=1.0
            )
            return
        self._target = Target(samples.quaternions[0], samples.rates[0], samples.accelerations[0])
        self._target_ns = stamp_ns or self._now_ns()

    def _target_at(self, now_ns: int) -> Target:
        if self._target_ns is None:
            return self._target
        age = (now_ns - self._target_ns) * 1e-9
        moved = self._target.after(min(max(age, -self._timeout), self._timeout))
        return moved.at_rest() if age > self._timeout else moved

    def _step(self) -> None:
        now_ns = self._now_ns()
        gap = 0.0 if self._time_ns is None else (now_ns - self._time_ns) * 1e-9
        if not 0.0 <= gap <= LONGEST_GAP:
            self.get_logger().warning(f"the clock was set by {gap:.3g} s; the body waits there")
            gap = 0.0
        steps = int(np.ceil(gap / LONGEST_STEP))
        for left in range(steps, 0, -1):
            self._turn(gap / steps, now_ns - round(left * gap / steps * 1e9))
        self._time_ns = now_ns
        told = self._noise.measured(self.state, self._random)
        self._publisher.publish(
            odometry_from_attitude(told.quaternion, told.rate, now_ns, self._frames)
        )

    def _turn(self, step: float, time_ns: int) -> None:
        """Control and motion over a step [s] that begins at a time [ns]."""
        told = self._noise.measured(self.state, self._random)
        torque = self._controller.torque(told, self._target_at(time_ns))
        self.state = self._spacecraft.step(self.state, torque, step)
