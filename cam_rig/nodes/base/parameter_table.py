"""Parameters of a node: declaration, conversion and checks."""

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

from cam_rig.errors import CamRigError, ConfigError, did_you_mean
from cam_rig.nodes.parameters import Spec

#: Parameters that rclpy declares in every node. They are not reported as unknown.
RCLPY_PARAMETERS = ("use_sim_time", "start_type_description_service")
#: Prefix of the parameters by which rclpy overrides QoS settings.
QOS_PREFIX = "qos_overrides."


class ParameterTable:
    """Declared parameters of a node, with conversion and checks.

    rclpy sets parameters in four steps: pre-set callbacks convert the values, rclpy checks type,
    range and read-only, on-set callbacks accept or reject, and post-set callbacks apply the values.
    This class uses the first and the third step. A pre-set callback cannot reject: it passes a
    value that it cannot convert on to the third step. The parameters are declared with dynamic
    typing for this, because rclpy (Kilted) reports a wrong type in step two as "expected '3' got
    '4'".

    `node` must be created with ``automatically_declare_parameters_from_overrides=True``. This is
    the only public access of rclpy (Kilted) to the values of the command line and of parameter
    files before the parameters are declared with their types.

    Attributes
    ----------
    values : dict
        Parameter values at start-up by name. They do not follow later changes.
    unknown : list of str
        One warning per override that is not a parameter of this node. A parameter file may serve
        several nodes, so an unknown name is not an error.
    """

    def __init__(self, node: Node, specs: tuple[Spec, ...]) -> None:
        self._specs = {spec.name: spec for spec in specs}
        self._checks: list[tuple[str, Callable[[Any], object]]] = []
        self.values: dict[str, Any] = {}
        for spec in specs:
            value = spec.default
            if node.has_parameter(spec.name):
                value = node.get_parameter(spec.name).value
                node.undeclare_parameter(spec.name)
            value = spec.convert(value)
            spec.require(value)
            node.declare_parameter(spec.name, value, make_descriptor(spec), ignore_override=True)
            self.values[spec.name] = value
            self.add_check(spec.name, spec.require)
        self.unknown = self._remove_unknown(node)
        node.add_pre_set_parameters_callback(self._convert)
        node.add_on_set_parameters_callback(self._check)

    def add_check(self, name: str, check: Callable[[Any], object]) -> None:
        """Add a check of new values of a parameter.

        A value for which `check` raises a `CamRigError` is rejected with the text of the error.
        """
        self._checks.append((name, check))

    def _remove_unknown(self, node: Node) -> list[str]:
        warnings = []
        for name in sorted(node.list_parameters([], 0).names):
            if name in self._specs or name in RCLPY_PARAMETERS or name.startswith(QOS_PREFIX):
                continue
            node.undeclare_parameter(name)
            hint = did_you_mean(name, list(self._specs))
            warnings.append(f"ignoring unknown parameter {name!r}{hint}")
        return warnings

    def _convert(self, parameters: list[Parameter]) -> list[Parameter]:
        """Return new parameter values in the notation of the rig, such as "20x" for 20.

        A value that cannot be converted is returned unchanged, and `_check` rejects it.
        """
        converted = []
        for parameter in parameters:
            value = parameter.value
            try:
                if parameter.name in self._specs:
                    value = self._specs[parameter.name].convert(value)
            except ConfigError:
                pass  # _check rejects it
            is_new = value is not parameter.value
            converted.append(Parameter(parameter.name, value=value) if is_new else parameter)
        return converted

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            for parameter in parameters:
                if parameter.name in self._specs:
                    self._specs[parameter.name].convert(parameter.value)
                for name, check in self._checks:
                    if name == parameter.name:
                        check(parameter.value)
        except CamRigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)


def make_descriptor(spec: Spec) -> ParameterDescriptor:
    """Return the ROS descriptor of a parameter: description, limits, read-only flag."""
    descriptor = ParameterDescriptor(
        description=spec.description, read_only=not spec.live, dynamic_typing=True
    )
    low, high = spec.min_value, spec.max_value
    if low is not None and high is not None:
        if isinstance(spec.default, int):
            bounds = IntegerRange(from_value=int(low), to_value=int(high), step=1)
            descriptor.integer_range = [bounds]
        else:
            span = FloatingPointRange(from_value=low, to_value=high, step=0.0)
            descriptor.floating_point_range = [span]
    if spec.choices:
        descriptor.additional_constraints = f"one of: {', '.join(spec.choices)}"
    return descriptor
