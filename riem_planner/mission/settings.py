# SPDX-License-Identifier: Apache-2.0
"""Every parameter of the node, as plain data: what it is, what it may be, what it means."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from riem_planner.checks import finite_array, unit_quaternion, unit_vector
from riem_planner.errors import InvalidProblemError
from riem_planner.limit_rows import QUANTITIES
from riem_planner.limits import Limits, Wheel
from riem_planner.problem import LEAST_ACCELERATION, LEAST_TIME, OBJECTIVES, S2, SO3, Space

Array = NDArray[np.float64]
Kind = Literal["number", "integer", "flag", "text", "texts", "numbers", "scalar_or_numbers"]
Change = Literal["any time", "unconfigured", "never"]

_FOREVER = 1e9
_CONVERSIONS: dict[str, Callable[[Any], Any]] = {
    "number": float,
    "integer": int,
    "flag": bool,
    "text": str,
}


_NUMBERS_A_WHEEL = 5


@dataclass(frozen=True)
class Specification:
    """One parameter: its name, kind, default, meaning, unit and range.

    Parameters
    ----------
    name
        As in `config/planner.yaml`; zones' parameters without `zones.<name>.`.
    kind
        `number` is a double, `numbers` a list of doubles (empty: unset),
        `scalar_or_numbers` either (unset by default).
    default
        Its value if nobody sets it; None is unset.
    description
        One sentence, with the unit at its end.
    least, most
        Range of each number, both included.
    lengths
        Allowed lengths of a list.
    choices
        Allowed texts.
    change
        When it may be set: at any time (what flies is checked anew), only while the node is
        unconfigured, or never after the start.
    """

    name: str
    kind: Kind
    default: Any
    description: str
    least: float = -_FOREVER
    most: float = _FOREVER
    lengths: tuple[int, ...] = ()
    choices: tuple[str, ...] = ()
    change: Change = "any time"


def _number(
    name: str, default: float, description: str, least: float, most: float
) -> Specification:
    return Specification(name, "number", default, description, least, most)


def _fixed(name: str, kind: Kind, default: Any, description: str, **more: Any) -> Specification:
    return Specification(name, kind, default, description, change="unconfigured", **more)


def _limit(name: str, description: str) -> Specification:
    return Specification(
        name, "scalar_or_numbers", None, description, least=1e-12, most=1e6, lengths=(0, 1, 3)
    )


SPECIFICATIONS: tuple[Specification, ...] = (
    _fixed(
        "space",
        "text",
        "so3",
        "so3: attitude; s2: pointing of the boresight, roll free",
        choices=("so3", "s2"),
    ),
    _fixed(
        "boresight",
        "numbers",
        [1.0, 0.0, 0.0],
        "body axis that points on s2, and of zones that name none [any length]",
        lengths=(3,),
    ),
    _fixed("reference_frame", "text", "inertial", "frame that messages must name"),
    _fixed("body_frame", "text", "base_link", "frame of the body, in ~/state and ~/imu"),
    Specification(
        "objective",
        "text",
        LEAST_ACCELERATION,
        "least_acceleration: the paper's; least_time: as quick as the limits allow (duration 0)",
        choices=OBJECTIVES,
    ),
    _number("duration", 60.0, "of a slew; 0: the least found within the limits [s]", 0.0, 1e6),
    _limit("limits.rate", "largest body rate, one number or one per axis; unset: none [rad/s]"),
    _limit("limits.acceleration", "largest body acceleration, one or three; unset: none [rad/s^2]"),
    _limit("limits.torque", "largest torque, one or three; needs inertia; unset: none [N m]"),
    _limit("limits.momentum", "largest momentum, one or three; needs inertia; unset: none [N m s]"),
    _limit("limits.jerk", "largest change of acceleration, one or three; unset: none [rad/s^3]"),
    _limit("limits.torque_rate", "largest change of torque; needs inertia; unset: none [N m/s]"),
    Specification(
        "limits.wheels",
        "numbers",
        [],
        "reaction wheels, at least three: of each its axis (three numbers), the torque it gives and"
        " the momentum it stores; needs inertia; unset: none [any length, N m, N m s]",
        -1e9,
        1e9,
    ),
    Specification(
        "inertia",
        "numbers",
        [],
        "inertia matrix by rows; unset: unknown [kg m^2]",
        -1e9,
        1e9,
        lengths=(0, 9),
    ),
    _number("normalized_tension", 0.0, "tension times duration^2 [1]", 0.0, 1e6),
    _number(
        "normalized_strength",
        0.01,
        "strength times duration^4 of ~/obstacles and of zones that set none [rad^4]",
        1e-9,
        1e3,
    ),
    _number(
        "obstacle_radius",
        0.0,
        "radius of the attitudes in ~/obstacles and ~/obstacle_states [rad]",
        0.0,
        3.1,
    ),
    _number(
        "obstacle_timeout",
        0.0,
        "age of ~/obstacles and ~/obstacle_states past which they grow; 0: never [s]",
        0.0,
        1e9,
    ),
    _number(
        "obstacle_max_speed",
        0.0,
        "at which obstacles grow once their data is too old [rad/s]",
        0.0,
        100.0,
    ),
    Specification(
        "start.orientation",
        "numbers",
        [0.0, 0.0, 0.0, 1.0],
        "x, y, z, w: where a plan starts as long as no state has come [unit]",
        lengths=(4,),
    ),
    Specification(
        "require_state", "flag", False, "refuse to plan before ~/state or ~/imu has come"
    ),
    Specification(
        "goal.orientation",
        "numbers",
        [],
        "x, y, z, w: a goal to plan to at start-up; unset: none [unit]",
        lengths=(0, 4),
    ),
    _number("setpoint_rate", 50.0, "of the stream of setpoints [Hz]", 0.1, 1000.0),
    Specification(
        "trajectory_poses", "integer", 121, "poses in ~/trajectory and ~/reference [1]", 2, 10000
    ),
    _number(
        "planning_budget", 0.1, "deadline of a solve; a plan starts that far ahead [s]", 0.005, 60.0
    ),
    _number(
        "replan_gain", 0.2, "relative gain in cost that justifies changing class [1]", 0.0, 1.0
    ),
    _number(
        "tracking_bound", 0.02, "distance to the reference past which to warn [rad]", 1e-6, math.pi
    ),
    _number(
        "tracking_timeout",
        5.0,
        "a goal that moves is followed so long after its arrival and its last message [s]",
        0.0,
        1e6,
    ),
    _number("input_timeout", 1.0, "a stamp older than it is stale [s]", 1e-3, 1e6),
    Specification("autostart", "flag", True, "configure and activate by itself", change="never"),
    Specification("auto_execute", "flag", True, "fly a plan without asking for ~/execute"),
    Specification(
        "stop_on_shutdown", "flag", True, "come to rest before SIGINT or SIGTERM ends the node"
    ),
    _number("shutdown_timeout", 4.0, "the longest that such a stop is waited for [s]", 0.0, 3600.0),
    Specification("zone_names", "texts", [], "names of the zones to watch", change="never"),
)

_PLACE: tuple[Specification, ...] = (
    Specification(
        "direction",
        "numbers",
        [],
        "of the body in the reference frame, until a message comes [any length]",
        lengths=(0, 3),
    ),
    Specification(
        "rate",
        "numbers",
        [],
        "angular velocity in the reference frame; unset: estimated from messages [rad/s]",
        -100.0,
        100.0,
        lengths=(0, 3),
    ),
    _number("timeout", 0.0, "age of data past which the zone grows; 0: never [s]", 0.0, 1e9),
    _number(
        "max_speed", 0.0, "at which the zone grows once its data is too old [rad/s]", 0.0, 100.0
    ),
)

ZONE_SPECIFICATIONS: tuple[Specification, ...] = (
    _fixed("kind", "text", "keep_out", "keep_out or keep_in", choices=("keep_out", "keep_in")),
    _fixed(
        "boresight",
        "numbers",
        [],
        "body axis that is kept out (in); unset: the planner's boresight [any length]",
        lengths=(0, 3),
    ),
    _number("half_angle", 0.35, "of the cone [rad]", 0.0, 3.1),
    _fixed("group", "text", "", "keep-in group: inside at least one of its members; unset: none"),
    _number(
        "normalized_strength",
        0.0,
        "strength times duration^4; 0: the planner's normalized_strength [rad^4]",
        0.0,
        1e3,
    ),
    Specification(
        "body",
        "text",
        "",
        "body whose ~/bodies/<body> and bodies.<body> parameters say where it is; unset: its own",
        change="never",
    ),
    *_PLACE,
)

BODY_SPECIFICATIONS: tuple[Specification, ...] = _PLACE
"""Of a body that zones name; a zone that names none has them itself."""


def specification_of(name: str) -> Specification | None:
    """Specification of a parameter by its full name, those of a zone or body included."""
    for prefix, items in (("zones.", ZONE_SPECIFICATIONS), ("bodies.", BODY_SPECIFICATIONS)):
        if name.startswith(prefix) and name.count(".") == 2:
            key = name.rsplit(".", 1)[1]
            return next((item for item in items if item.name == key), None)
    return next((item for item in SPECIFICATIONS if item.name == name), None)


def zone_parameter(zone: str, key: str) -> str:
    """Full name of a zone's parameter."""
    return f"zones.{zone}.{key}"


def body_parameter(body: str, key: str) -> str:
    """Full name of a body's parameter."""
    return f"bodies.{body}.{key}"


def bodies_of(values: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the bodies that zones name, each once."""
    named = (
        values.get(zone_parameter(zone, "body")) for zone in values["zone_names"] or [] if zone
    )
    return tuple(dict.fromkeys(name for name in named if name))


def check_value(name: str, specification: Specification, value: Any) -> None:
    """Refuse a value that does not fit its specification.

    Raises
    ------
    InvalidProblemError
        Names the parameter, its value, and what was expected.
    """
    if specification.kind == "text" and specification.choices:
        if value not in specification.choices:
            expected = " or ".join(specification.choices)
            raise InvalidProblemError(name, f"expected {expected}, got {value!r}")
        return
    if specification.kind == "text" and specification.name.endswith("frame") and not value:
        raise InvalidProblemError(name, "expected the name of a frame, got an empty one")
    if specification.kind in ("text", "texts", "flag") or value is None:
        return
    numbers = list(value) if isinstance(value, list | tuple | np.ndarray) else [value]
    is_list = isinstance(value, list | tuple | np.ndarray)
    if is_list and specification.lengths and len(numbers) not in specification.lengths:
        expected = " or ".join(str(length) for length in specification.lengths if length)
        raise InvalidProblemError(name, f"expected {expected} numbers, got {len(numbers)}")
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise InvalidProblemError(name, f"expected numbers, got {number!r}")
        if not specification.least <= number <= specification.most:  # refuses NaN as well
            raise InvalidProblemError(
                name,
                f"expected from {specification.least:g} to {specification.most:g}, got {number:g}",
            )


@dataclass(frozen=True)
class ZoneSettings:
    """One configured zone; units as in `ZONE_SPECIFICATIONS`, unset is None.

    What says where it is, is its body's if it names one.
    """

    name: str
    body: str | None
    kind: str
    boresight: Array | None
    half_angle: float
    group: str | None
    normalized_strength: float | None
    direction: Array | None
    rate: Array | None
    timeout: float
    max_speed: float

    @property
    def source(self) -> str:
        """The topic that says where it is: `zones/<name>` or `bodies/<body>`."""
        return f"zones/{self.name}" if self.body is None else f"bodies/{self.body}"

    @property
    def title(self) -> str:
        """Its name, and its body's."""
        return self.name if self.body is None else f"{self.name} (body {self.body})"


@dataclass(frozen=True)
class Settings:
    """All parameters, validated; units as in `SPECIFICATIONS`, unset is None.

    A number, flag or text is called as its parameter; the others are made of several.
    """

    space: Space
    boresight: Array
    reference_frame: str
    body_frame: str
    objective: str
    duration: float
    limits: Limits | None
    normalized_tension: float
    normalized_strength: float
    obstacle_radius: float
    obstacle_timeout: float
    obstacle_max_speed: float
    zones: tuple[ZoneSettings, ...]
    start_orientation: Array
    require_state: bool
    goal_orientation: Array | None
    setpoint_rate: float
    trajectory_poses: int
    planning_budget: float
    replan_gain: float
    tracking_bound: float
    tracking_timeout: float
    input_timeout: float
    autostart: bool
    auto_execute: bool
    stop_on_shutdown: bool
    shutdown_timeout: float

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that zones follow."""
        return tuple(dict.fromkeys(zone.body for zone in self.zones if zone.body is not None))

    @property
    def budget_ns(self) -> int:
        """The planning budget [ns]."""
        return round(self.planning_budget * 1e9)

    @property
    def period_ns(self) -> int:
        """Time between two setpoints [ns]."""
        return round(1e9 / self.setpoint_rate)


def _optional(value: Any) -> Any:
    return None if value is None or (isinstance(value, list) and not value) else value


def _axis(name: str, value: Any) -> Array | None:
    value = _optional(value)
    return None if value is None else unit_vector(name, value)


def _zone(name: str, values: Mapping[str, Any]) -> ZoneSettings:
    def key(which: str) -> str:
        return zone_parameter(name, which)

    body = values[key("body")] or None
    if body is not None:
        _check_place_unset(name, body, values)

    def place(which: str) -> str:
        return key(which) if body is None else body_parameter(body, which)

    rate = _optional(values[place("rate")])
    return ZoneSettings(
        name=name,
        body=body,
        kind=values[key("kind")],
        boresight=_axis(key("boresight"), values[key("boresight")]),
        half_angle=float(values[key("half_angle")]),
        group=values[key("group")] or None,
        normalized_strength=values[key("normalized_strength")] or None,
        direction=_axis(place("direction"), values[place("direction")]),
        rate=None if rate is None else finite_array(place("rate"), rate, (3,)),
        timeout=float(values[place("timeout")]),
        max_speed=float(values[place("max_speed")]),
    )


def _check_place_unset(zone: str, body: str, values: Mapping[str, Any]) -> None:
    """A zone that names a body says nothing itself of where that is."""
    if not re.fullmatch(r"[A-Za-z_]\w*", body):
        raise InvalidProblemError(
            zone_parameter(zone, "body"), f"expected letters, digits and _, got {body!r}"
        )
    for item in BODY_SPECIFICATIONS:
        value = values[zone_parameter(zone, item.name)]
        if _optional(value) is not None and value != item.default:
            raise InvalidProblemError(
                zone_parameter(zone, item.name),
                f"the zone follows {body!r}; set {body_parameter(body, item.name)} instead",
            )


def _limits(values: Mapping[str, Any]) -> Limits | None:
    limits: dict[str, Any] = {}
    for key in QUANTITIES:
        value = _optional(values[f"limits.{key}"])
        if value is not None:
            limits[key] = value[0] if isinstance(value, list) and len(value) == 1 else value
    limits["wheels"] = _wheels(_optional(values["limits.wheels"]) or [])
    if not any(limits.values()):
        return None
    inertia = _optional(values["inertia"])
    return Limits(**limits, inertia=None if inertia is None else np.reshape(inertia, (3, 3)))


def _wheels(numbers: list[float]) -> tuple[Wheel, ...]:
    if len(numbers) % _NUMBERS_A_WHEEL:
        raise InvalidProblemError(
            "limits.wheels",
            f"expected {_NUMBERS_A_WHEEL} numbers a wheel (axis x, y, z, torque, momentum), got"
            f" {len(numbers)}",
        )
    return tuple(
        Wheel(each[:3], float(each[3]), float(each[4]))
        for each in np.reshape(numbers, (-1, _NUMBERS_A_WHEEL))
    )


def _check_zones(zones: tuple[ZoneSettings, ...]) -> None:
    for zone in zones:
        key = zone_parameter(zone.name, "kind")
        if zone.group is not None and zone.kind != "keep_in":
            raise InvalidProblemError(
                key, f"only keep_in zones form groups, got {zone.kind} with a group; clear it"
            )
        if zone.kind == "keep_in" and zone.half_angle == 0.0:
            raise InvalidProblemError(
                zone_parameter(zone.name, "half_angle"), "expected above 0 for keep_in, got 0"
            )
    groups = {zone.group for zone in zones if zone.group is not None}
    for zone in zones:
        if zone.name in groups:
            raise InvalidProblemError(
                zone_parameter(zone.name, "group"), f"{zone.name!r} names a zone and a group"
            )


def settings_from_values(values: Mapping[str, Any]) -> Settings:
    """Settings of parameter values by full name, all of them given.

    Raises
    ------
    InvalidProblemError
        Names the parameter that is wrong, alone or together with another.
    """
    for name, value in values.items():
        specification = specification_of(name)
        if specification is not None:
            check_value(name, specification, value)
    names = [name for name in values["zone_names"] or [] if name]
    if len(set(names)) != len(names):
        raise InvalidProblemError("zone_names", f"a name is used twice in {names}")
    zones = tuple(_zone(name, values) for name in names)
    _check_zones(zones)
    limits = _limits(values)
    if values["duration"] == 0.0 and limits is None:
        raise InvalidProblemError("duration", "0 is the least within limits, but none is set")
    if values["objective"] == LEAST_TIME and values["duration"] != 0.0:
        raise InvalidProblemError(
            "duration", f"expected 0.0 with objective {LEAST_TIME}, got {values['duration']:g}"
        )
    goal = _optional(values["goal.orientation"])
    made: dict[str, Any] = {
        "space": S2 if values["space"] == "s2" else SO3,
        "boresight": unit_vector("boresight", values["boresight"]),
        "limits": limits,
        "zones": zones,
        "start_orientation": unit_quaternion("start.orientation", values["start.orientation"]),
        "goal_orientation": None if goal is None else unit_quaternion("goal.orientation", goal),
    }
    for item in SPECIFICATIONS:
        convert = _CONVERSIONS.get(item.kind)
        if convert is not None and item.name not in made:
            made[item.name] = convert(values[item.name])
    return Settings(**made)


def default_values(zones: tuple[str, ...] = (), bodies: tuple[str, ...] = ()) -> dict[str, Any]:
    """Values of all parameters that nobody set, with those of some zones and bodies."""
    values = {item.name: item.default for item in SPECIFICATIONS}
    values["zone_names"] = list(zones)
    for zone in zones:
        for item in ZONE_SPECIFICATIONS:
            values[zone_parameter(zone, item.name)] = item.default
    for body in bodies:
        for item in BODY_SPECIFICATIONS:
            values[body_parameter(body, item.name)] = item.default
    return values
