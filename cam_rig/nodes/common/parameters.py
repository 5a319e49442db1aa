"""The one table of parameters: what every node declares, and which values are allowed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from cam_rig.acoustics.sound_level_meter import FREQUENCY_WEIGHTINGS, TIME_WEIGHTINGS
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.live.pacing import factor_of
from cam_rig.runner.node_table import CONSUMERS, OPTIONAL
from cam_rig.schema.load import config_root


@dataclass(frozen=True)
class Spec:
    """One parameter: its default gives its type; the description names the unit.

    ``least`` and ``most`` bound a number; ``choices`` what a text, or each of a list, may be;
    ``check`` raises what else is wrong. A parameter that is not ``live`` is read-only.
    """

    name: str
    default: Any
    description: str
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False
    check: Callable[[Any], object] | None = None

    def descriptor(self) -> ParameterDescriptor:
        """What `ros2 param describe` shows; rclpy refuses what is out of range by it."""
        out = ParameterDescriptor(description=self.description, read_only=not self.live)
        if self.least is not None and self.most is not None:
            span = FloatingPointRange(from_value=self.least, to_value=self.most, step=0.0)
            out.floating_point_range = [span]
        if self.choices:
            out.additional_constraints = f"one of: {', '.join(self.choices)}"
        return out

    def require(self, value: Any) -> None:
        """Refuse a value that the descriptor cannot.

        Raises
        ------
        ConfigError : names the parameter, the value and what is allowed
        """
        given = value if isinstance(value, (list, tuple)) else [value]
        unknown = [str(item) for item in given if self.choices and item not in self.choices]
        if unknown:
            raise ConfigError(
                f"{self.name}: has {', '.join(unknown)}; allowed: {', '.join(self.choices)}"
            )
        if self.check is not None:
            self.check(value)


SCENE = Spec(
    "scene",
    str(config_root() / "scenes" / "tm21_sweep.yaml"),
    "scene file (YAML) that every node takes its numbers from",
)
CHECKPOINT = Spec(
    "checkpoint",
    "",
    "folder of this run where a node saves its state for a successor; empty: none",
)
PROGRESS = Spec(
    "progress_fd",
    -1,
    "open file descriptor that gets a line of JSON for each state; -1: none",
)
#: The consumers that are waited for by default: a run need not be seen.
ESSENTIAL = tuple(name for name in CONSUMERS if name not in OPTIONAL)

PARAMETERS: dict[str, tuple[Spec, ...]] = {
    "law_server": (
        SCENE,
        CHECKPOINT,
        Spec("cam", "", "a file of config/cams, mounted until the drive asks for another; "
             "empty: the scene's first", live=True),
    ),
    "cam_drive": (
        SCENE,
        CHECKPOINT,
        Spec("rpm", 0.0, "speed from the next tick on, rpm; 0: as the scene says", 0.0, 1e5,
             live=True),
        Spec("pacing", "free", "rig time beside wall time: free, real_time, or Nx such as 20x",
             live=True, check=factor_of),
        Spec("autostart", True, "turn as soon as every node is ready; false: wait for ~/start"),
        Spec("consumers", list(ESSENTIAL), "nodes that are waited for", choices=CONSUMERS),
        Spec("patience", 20.0, "wall time without progress before giving up, s", 0.1, 86400.0),
        PROGRESS,
    ),
    "follower": (SCENE, CHECKPOINT),
    "microphone": (
        SCENE,
        CHECKPOINT,
        Spec("frequency_weighting", "Z",
             "frequency weighting of the level, class 1 up to 20 kHz: A, C or Z",
             choices=FREQUENCY_WEIGHTINGS, live=True),
        Spec("time_weighting", "F", "time weighting of the level: F (125 ms) or S (1 s)",
             choices=tuple(TIME_WEIGHTINGS), live=True),
    ),
    "recorder": (
        SCENE,
        CHECKPOINT,
        Spec("bag", "", "folder to record into, must not exist; empty: bags/<scene>_<date>"),
    ),
    "viewer": (
        SCENE,
        CHECKPOINT,
        Spec("address", "", "Rerun's address that the picture goes to; empty opens a window"),
    ),
    "player": (
        CHECKPOINT,
        Spec("bag", "", "bag whose cam states and laws are played"),
        Spec("patience", 20.0, "wall time without progress before giving up, s", 0.1, 86400.0),
        PROGRESS,
    ),
}  # fmt: skip


def declare(node: Node, table: tuple[Spec, ...]) -> dict[str, Any]:
    """Declare a node's parameters; their values by name.

    Raises
    ------
    ConfigError : a value is not allowed
    """
    values = {}
    for spec in table:
        value: Any = node.declare_parameter(spec.name, spec.default, spec.descriptor()).value
        spec.require(value)
        values[spec.name] = value
    return values


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
