"""A node's parameters as rclpy has them: declared from the table, converted, checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from cam_rig.errors import CamRigError, did_you_mean
from cam_rig.nodes.parameters import Spec


def descriptor(spec: Spec) -> ParameterDescriptor:
    """What `ros2 param describe` shows; rclpy refuses what is out of range by it."""
    out = ParameterDescriptor(description=spec.description, read_only=not spec.live)
    if spec.least is not None and spec.most is not None:
        if isinstance(spec.default, int):
            whole = IntegerRange(from_value=int(spec.least), to_value=int(spec.most), step=1)
            out.integer_range = [whole]
        else:
            span = FloatingPointRange(from_value=spec.least, to_value=spec.most, step=0.0)
            out.floating_point_range = [span]
    if spec.choices:
        out.additional_constraints = f"one of: {', '.join(spec.choices)}"
    return out


def declare(node: Node, table: tuple[Spec, ...]) -> dict[str, Any]:
    """Declare a node's parameters; their values by name."""
    values = {}
    for spec in table:
        value: Any = spec.convert(_given(node, spec))
        spec.require(value)
        node.declare_parameter(spec.name, value, descriptor(spec), ignore_override=True)
        values[spec.name] = value
    return values


def _given(node: Node, spec: Spec) -> Any:
    """What was given for a parameter at the start, of whatever type; else its default."""
    any_type = ParameterDescriptor(dynamic_typing=True)
    value: Any = node.declare_parameter(spec.name, spec.default, any_type).value
    node.undeclare_parameter(spec.name)
    return value


def unknown_names(node: Node, table: tuple[Spec, ...]) -> list[str]:
    """What was given for parameters that the node does not have, in words, one each.

    No error: a file of parameters may be meant for several nodes.
    """
    known = [spec.name for spec in table]
    given = (name for name in node._parameter_overrides if not node.has_parameter(name))
    found = []
    for name in sorted(given):
        if not name.startswith("qos_overrides."):
            hint = did_you_mean(name, known)
            found.append(f"parameter {name!r} is none of this node's{hint}; it is left aside")
    return found


def convert(table: tuple[Spec, ...], parameters: list[Parameter]) -> list[Parameter]:
    """Convert what is to be set: 250 to 250.0, a factor to its text."""
    specs = {spec.name: spec for spec in table}
    return [
        Parameter(one.name, value=specs[one.name].convert(one.value)) if one.name in specs else one
        for one in parameters
    ]


def refuse_wrong(table: tuple[Spec, ...]) -> Callable[[list[Parameter]], SetParametersResult]:
    """Answer a request to set parameters: refused with a reason, or fine; nothing is changed."""
    specs = {spec.name: spec for spec in table}

    def check(parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            try:
                if parameter.name in specs:
                    specs[parameter.name].require(parameter.value)
            except CamRigError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    return check


def weightings(quantity: str) -> list[Parameter]:
    """The parameters by which the microphone reads a quantity: LAF, LZS."""
    return [
        Parameter("frequency_weighting", value=quantity[1]),
        Parameter("time_weighting", value=quantity[2]),
    ]
