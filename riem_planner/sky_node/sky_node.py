# SPDX-License-Identifier: Apache-2.0
"""Publishes where bodies are, as the planner's own inputs."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Transform, Vector3, Vector3Stamped
from numpy.typing import NDArray
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from std_msgs.msg import Header
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from riem_planner.errors import InvalidProblemError
from riem_planner.sky import BODIES, Circular, Orbit, Sky, Tle
from riem_planner.sky.bodies import RADII
from riem_planner.sky.ephemeris import ephemeris
from riem_planner.sky.view import check_known

Array = NDArray[np.float64]

DIRECTION_PERIOD = 1.0
"""Between two messages of a direction [s]."""

_CIRCULAR = {
    "altitude_km": "height above 6378.137 km [km]; 0: no circular orbit",
    "inclination_deg": "to the equator of the GCRS [deg]",
    "raan_deg": "right ascension of the ascending node [deg]",
    "argument_of_latitude_deg": "from the node, at the start of this node [deg]",
}
_NUMBERS = {
    "horizon": (900.0, 1.0, 86400.0, "how far ahead a path tells [s]"),
    "step": (10.0, 0.1, 600.0, "between two points of a path [s]"),
    "period": (60.0, 1.0, 3600.0, "between two messages of a path [s]"),
}


class SkyNode(Node):
    """The node `sky_node`.

    Parameters
    ----------
    options
        Passed on to the node, such as `parameter_overrides`.

    Raises
    ------
    InvalidProblemError
        A parameter is wrong, or the libraries of the sky are not installed.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("sky_node", **options)
        self._declare()
        self._names = list(self._value("bodies"))
        for name in self._names:
            check_known(name, {})
        self._orbit = self._stated_orbit()
        self._sky: Sky | None = None
        self._numbers = {name: float(self._value(name)) for name in _NUMBERS}
        latched = QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        planner = self._value("planner")
        self._directions = {
            name: self.create_publisher(Vector3Stamped, f"{planner}/bodies/{name}", latched)
            for name in self._names
        }
        self._paths = {
            name: self.create_publisher(
                MultiDOFJointTrajectory, f"{planner}/bodies/{name}/path", latched
            )
            for name in self._names
        }
        ephemeris()  # so that libraries that are missing are told of before anything waits for us
        self.create_timer(DIRECTION_PERIOD, self.tell_directions)
        self.create_timer(self._numbers["period"], self.tell_paths)
        self.tell_paths()
        self.tell_directions()

    def _declare(self) -> None:
        def declare(name: str, default: Any, text: str) -> None:
            self.declare_parameter(name, default, ParameterDescriptor(description=text))

        declare("planner", "riem_planner", "name of the planner, whose inputs these are")
        declare("reference_frame", "inertial", "frame of the directions: the axes of the GCRS")
        declare("bodies", ["sun", "moon", "earth"], f"of {', '.join(BODIES)}")
        declare("orbit.tle", ["", ""], "two lines of elements")
        for name, text in _CIRCULAR.items():
            declare(f"orbit.circular.{name}", 0.0, text)
        for name, (default, least, most, text) in _NUMBERS.items():
            bounds = FloatingPointRange(from_value=least, to_value=most, step=0.0)
            described = ParameterDescriptor(description=text, floating_point_range=[bounds])
            self.declare_parameter(name, default, described)

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _stated_orbit(self) -> Orbit:
        """The orbit that the parameters state: one of both kinds."""
        lines = list(self._value("orbit.tle"))
        values = {name: self._value(f"orbit.circular.{name}") for name in _CIRCULAR}
        if any(lines) == (values["altitude_km"] != 0.0):
            raise InvalidProblemError(
                "orbit", "expected either orbit.tle or orbit.circular.altitude_km and its angles"
            )
        if any(lines):
            if len(lines) != 2:
                raise InvalidProblemError("orbit.tle", f"expected two lines, got {len(lines)}")
            return Tle(*lines)
        return Circular(**values)

    def _look(self) -> tuple[Time, Sky, Array] | None:
        """The clock's time, the sky and the time in it (1,) [s]; None before the clock has one."""
        stamp = self.get_clock().now()
        if stamp.nanoseconds == 0:
            return None
        now = float(stamp.nanoseconds) * 1e-9
        if self._sky is None:
            epoch = datetime(1970, 1, 1, tzinfo=timezone.utc) + timedelta(seconds=now)
            self._sky, self._begin = Sky(epoch, self._orbit), now
            for note in self._sky.notes():
                self.get_logger().warning(note)
        return stamp, self._sky, np.array([now - self._begin])

    def _told(self, tell: Callable[[Time, Sky, Array], None]) -> None:
        """Publish, or say why nothing can be: elements that give no place any more."""
        try:
            seen = self._look()
            if seen is not None:
                tell(*seen)
        except InvalidProblemError as error:
            self.get_logger().error(str(error), throttle_duration_sec=60.0)

    def tell_directions(self) -> None:
        """Publish where every body is now."""

        def tell(stamp: Time, sky: Sky, since: Array) -> None:
            for name, publisher in self._directions.items():
                vector = _vector(sky.directions(name, since)[0])
                publisher.publish(Vector3Stamped(header=self._header(stamp), vector=vector))

        self._told(tell)

    def tell_paths(self) -> None:
        """Publish where every body will be."""
        ahead = np.arange(0.0, self._numbers["horizon"] + 1e-9, self._numbers["step"])

        def tell(stamp: Time, sky: Sky, since: Array) -> None:
            for name, publisher in self._paths.items():
                places = sky.places(name, since + ahead) / RADII.get(name, 1.0)
                message = MultiDOFJointTrajectory(header=self._header(stamp), joint_names=[name])
                message.points = [_point(t, p) for t, p in zip(ahead, places, strict=True)]
                publisher.publish(message)

        self._told(tell)

    def _header(self, stamp: Time) -> Header:
        return Header(stamp=stamp.to_msg(), frame_id=self._value("reference_frame"))


def _vector(values: Array) -> Vector3:
    x, y, z = (float(value) for value in values)
    return Vector3(x=x, y=y, z=z)


def _point(time: float, place: Array) -> MultiDOFJointTrajectoryPoint:
    seconds, nanoseconds = divmod(round(time * 1e9), 1_000_000_000)
    point = MultiDOFJointTrajectoryPoint(transforms=[Transform(translation=_vector(place))])
    point.time_from_start = Duration(sec=int(seconds), nanosec=int(nanoseconds))
    return point
