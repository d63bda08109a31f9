# SPDX-License-Identifier: Apache-2.0
"""Declares the parameters with ROS, and turns changes of them into settings."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from copy import copy
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from riem_planner.errors import InvalidProblemError
from riem_planner.mission.settings import (
    BODY_SPECIFICATIONS,
    SPECIFICATIONS,
    ZONE_SPECIFICATIONS,
    Settings,
    Specification,
    bodies_of,
    body_parameter,
    settings_from_values,
    specification_of,
    zone_parameter,
)

_TYPES = {
    "number": Parameter.Type.DOUBLE,
    "integer": Parameter.Type.INTEGER,
    "flag": Parameter.Type.BOOL,
    "text": Parameter.Type.STRING,
    "texts": Parameter.Type.STRING_ARRAY,
    "numbers": Parameter.Type.DOUBLE_ARRAY,
    "scalar_or_numbers": Parameter.Type.DOUBLE_ARRAY,
}
_LISTS = ("texts", "numbers", "scalar_or_numbers")
_OTHERS = ("qos_overrides.", "use_sim_time", "start_type_description_service")


def descriptor(name: str, specification: Specification) -> ParameterDescriptor:
    """What `ros2 param describe` shows."""
    described = ParameterDescriptor(
        name=name,
        description=specification.description,
        read_only=specification.change == "never",
        dynamic_typing=specification.kind == "scalar_or_numbers",
        additional_constraints=_constraints(specification),
    )
    if specification.kind == "number":
        described.floating_point_range = [
            FloatingPointRange(from_value=specification.least, to_value=specification.most)
        ]
    elif specification.kind == "integer":
        described.integer_range = [
            IntegerRange(from_value=int(specification.least), to_value=int(specification.most))
        ]
    return described


def _constraints(specification: Specification) -> str:
    parts = []
    if specification.choices:
        parts.append("one of " + ", ".join(specification.choices))
    if specification.lengths:
        parts.append("length " + " or ".join(map(str, specification.lengths)))
    if specification.change == "unconfigured":
        parts.append("may be set only while the node is unconfigured")
    return "; ".join(parts)


class Parameters:
    """The node's parameters: declared, checked together when set, handed on as settings.

    Parameters
    ----------
    node
        Whose parameters they are.
    unconfigured
        Whether the node is in the state in which all of them may be set.
    changed
        Called after a change with the new settings.

    Raises
    ------
    InvalidProblemError
        An override from a file or the command line is wrong; names the parameter.
    """

    def __init__(
        self,
        node: Node,
        unconfigured: Callable[[], bool],
        changed: Callable[[Settings], None],
    ) -> None:
        self._node = node
        self._unconfigured = unconfigured
        self._changed = changed
        self._names: list[str] = []
        for specification in SPECIFICATIONS:
            self._declare(specification.name, specification)
        for zone in self.values()["zone_names"] or []:
            if zone:
                for specification in ZONE_SPECIFICATIONS:
                    self._declare(zone_parameter(zone, specification.name), specification)
        for body in bodies_of(self.values()):
            for specification in BODY_SPECIFICATIONS:
                self._declare(body_parameter(body, specification.name), specification)
        self.settings = settings_from_values(self.values())
        node.add_pre_set_parameters_callback(self._typed)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def _declare(self, name: str, specification: Specification) -> None:
        described = descriptor(name, specification)
        read_only, described.read_only = described.read_only, False
        try:
            self._node.declare_parameter(name, _typed_default(specification), described)
        except (InvalidParameterValueException, InvalidParameterTypeException) as error:
            raise InvalidProblemError(name, str(error)) from error
        self._names.append(name)
        if self._node.get_parameter_or(name, Parameter(name)).value is None:
            # A parameter without a value makes rclpy answer a request for all of them with none.
            self._node.set_parameters([_empty(name, specification)])
        if read_only:  # after its value, which could not be set otherwise
            final = copy(described)
            final.read_only = True
            self._node.set_descriptor(name, final)

    def values(self) -> dict[str, Any]:
        """All values by full name; lists as lists, unset as None."""
        values = {}
        for name in self._names:
            values[name] = _plain(self._node.get_parameter_or(name, Parameter(name)).value)
        return values

    def unknown(self, topics: Iterable[str]) -> list[str]:
        """Sentences about overrides that no parameter has, with the name that was likely meant."""
        known = [*self._names, *topics]
        overrides = getattr(self._node, "_parameter_overrides", {})
        sentences = []
        for name in sorted(overrides):
            if name in known or self._node.has_parameter(name) or name in _OTHERS[1:]:
                continue
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            if name.startswith("zones.") and specification_of(name) is not None:
                hint = f"; is {name.split('.')[1]!r} missing in zone_names?"
            if name.startswith("bodies.") and specification_of(name) is not None:
                hint = f"; does no zone name the body {name.split('.')[1]!r}?"
            sentences.append(f"unknown parameter {name}, ignored{hint}")
        return sentences

    def is_set_to(self, parameter: Parameter) -> bool:
        """Whether a parameter has the value that it is to be set to."""
        name = parameter.name
        if not self._node.has_parameter(name):
            return False
        given, present = _plain(parameter.value), _plain(self._node.get_parameter(name).value)
        if isinstance(present, bool) or isinstance(given, bool):
            return given is present
        return bool(given == present) and given is not None

    def _typed(self, parameters: list[Parameter]) -> list[Parameter]:
        """Unset a list that is given as `[]`, which as YAML has no type, or that is deleted."""
        typed = []
        for parameter in parameters:
            specification = specification_of(parameter.name)
            if (
                specification is not None
                and specification.kind in _LISTS
                and _plain(parameter.value) in ([], None)
            ):
                parameter = _empty(parameter.name, specification)
            typed.append(parameter)
        return typed

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        values = self.values()
        for parameter in parameters:
            specification = specification_of(parameter.name)
            if specification is None or parameter.name not in self._names:
                continue
            if specification.change == "unconfigured" and not self._unconfigured():
                reason = f"{parameter.name}: may be set only while the node is unconfigured"
                return SetParametersResult(successful=False, reason=reason)
            values[parameter.name] = _plain(parameter.value)
        try:
            settings_from_values(values)
        except InvalidProblemError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        if any(parameter.name in self._names for parameter in parameters):
            self.settings = settings_from_values(self.values())
            self._changed(self.settings)


def _plain(value: Any) -> Any:
    """A value with lists as lists, whatever array came."""
    return list(value) if isinstance(value, tuple) or hasattr(value, "tolist") else value


def _typed_default(specification: Specification) -> Any:
    """A default that rclpy infers the right type from; an empty list alone would be bytes."""
    if specification.default == []:
        return _TYPES[specification.kind]
    return specification.default


def _empty(name: str, specification: Specification) -> Parameter:
    """An empty list of the right type: unset."""
    return Parameter(name, _TYPES[specification.kind], [])
