"""Parameters, topics and services of each node, without rclpy."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from cam_rig.acoustics.sound_level_meter import FREQUENCY_WEIGHTINGS, TIME_WEIGHTINGS
from cam_rig.bag.split import check_parameter_duration, check_parameter_size
from cam_rig.errors import ConfigError
from cam_rig.live.flow_control import factor_of, pacing_of
from cam_rig.messages import topics
from cam_rig.messages.topics import TOPICS, Topic
from cam_rig.runner.node_table import CONSUMERS, END, OPTIONAL, STAY, WAIT
from cam_rig.schema.load import resolve_path
from cam_rig.schema.scene import MAX_SAMPLES_PER_TURN

#: Type of a parameter -> description of its values, for messages and help texts.
KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text",
         list: "a list of texts"}  # fmt: skip


def require_frame_prefix(prefix: str) -> None:
    """Raise ConfigError if a text cannot start the name of a frame."""
    if not re.fullmatch(r"([A-Za-z_][\w/]*)?", prefix, re.ASCII):
        raise ConfigError(
            "frame_prefix must start with a letter, and contain letters, digits, _ and / only, got "
            f"{prefix!r}"
        )


@dataclass(frozen=True)
class Spec:
    """Parameter of a node.

    Parameters
    ----------
    name
        Name of the parameter.
    default
        Default value, which also determines the type.
    description
        Description with the unit, for help texts and `ros2 param describe`.
    min_value, max_value
        Limits of a number, None without limits.
    choices
        Allowed values of a text, or of each item of a list.
    live
        True if the parameter may be set while the node runs. Otherwise it is read-only.
    check
        Function that raises ConfigError if a value does not meet a further rule.
    read
        Function that converts other notations of a value, such as the name of a scene to its path.
    """

    name: str
    default: Any
    description: str
    min_value: float | None = None
    max_value: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False
    check: Callable[[Any], object] | None = None
    read: Callable[[Any], Any] | None = None

    def convert(self, value: Any) -> Any:
        """Return a value, converted to the type of this parameter, such as 250.0 for 250.

        Raises
        ------
        ConfigError
            If the value has another type.
        """
        kind = type(self.default)
        if self.read is not None:
            value = self.read(value)
        if kind is float and type(value) is int:
            return float(value)
        if kind is list and isinstance(value, (list, tuple)):
            return list(value)
        if type(value) is not kind:
            rule, remedy = KINDS[kind], ""
            if self.choices:
                rule = f"{'a list' if kind is list else 'one'} of {', '.join(self.choices)}"
            elif kind is str and self.check is None:
                remedy = f"; write it in quotes: '\"{value}\"'"
            raise ConfigError(f"{self.name} must be {rule}, got {value!r}{remedy}")
        return value

    def require(self, value: Any) -> None:
        """Raise ConfigError if a value is outside the limits or is not an allowed value."""
        items = value if isinstance(value, (list, tuple)) else [value]
        unknown = [str(item) for item in items if self.choices and item not in self.choices]
        if unknown:
            raise ConfigError(
                f"{self.name} must be one of {', '.join(self.choices)}, got {', '.join(unknown)}"
            )
        if self.max_value is not None and not (self.min_value or 0.0) <= value <= self.max_value:
            raise ConfigError(
                f"{self.name} must be between {self.min_value:g} and {self.max_value:g}, got "
                f"{value:g}"
            )
        if self.check is not None:
            self.check(value)


SCENE = Spec(
    "scene",
    "tm21_sweep",
    "scene file (YAML), or a name in config/scenes; the same for all nodes",
    read=lambda scene: str(resolve_path("scenes", scene)) if isinstance(scene, str) else scene,
)
#: Behaviour of a node when the drive or the player has published the end of the run.
ON_FINISH = Spec(
    "on_finish",
    END,
    "at the end of the run: end, stay for another run, or wait for a signal to stop",
    choices=(END, STAY, WAIT),
)
_PROGRESS = Spec(
    "progress_fd", -1, "open file descriptor for a line of JSON per state; -1: no report"
)
_PROGRESS_TIMEOUT = Spec(
    "progress_timeout", 20.0, "time without progress before an error, s, wall clock", 0.1, 86400.0
)
_SAMPLES_PER_TURN = Spec(
    "samples_per_turn",
    0,
    "instants per turn of the motion on /joint_states and similar topics; 0: as in the scene",
    0,
    MAX_SAMPLES_PER_TURN,
)
_FRAME_PREFIX = Spec(
    "frame_prefix",
    "",
    "text before the frames of /joint_states, /follower/contact and the markers, such as rig1/",
    check=require_frame_prefix,
)
#: Topics that every node publishes.
COMMON = (topics.DIAGNOSTICS, topics.READY)
#: Consumers of the cam states that the drive waits for by default. Displays are optional.
ESSENTIAL = tuple(name for name in CONSUMERS if name not in OPTIONAL)
#: Names of the microphone's weighting parameters, in the order of their letters in a quantity such
#: as LAF.
WEIGHTING_PARAMETERS = ("frequency_weighting", "time_weighting")
_ACKNOWLEDGEMENTS = (topics.FOLLOWER_STATE, topics.PRESSURE, topics.RECORDER_ACK)


@dataclass(frozen=True)
class NodeSpec:
    """Interface of a node.

    Parameters
    ----------
    description
        Function of the node, a verb phrase.
    parameters
        Parameters of the node.
    subscribed
        Topics to which the node subscribes.
    example
        Arguments of an example for the help text.
    published
        Topics without an owner that the node publishes, in addition to `COMMON`.
    services
        Names of its std_srvs/Trigger services, without "~/".
    """

    description: str
    parameters: tuple[Spec, ...]
    subscribed: tuple[Topic, ...]
    example: str
    published: tuple[Topic, ...] = ()
    services: tuple[str, ...] = ()


#: Interface of each node by name.
ABOUT = {
    "law_server": NodeSpec(
        "mounts the cams, and publishes law, contour and markers of the mounted cam, latched",
        (
            SCENE, ON_FINISH,
            Spec("cam", "", "cam, a name in config/cams, mounted until the drive requests another; "
                 "empty: the first of the scene", live=True),
            _FRAME_PREFIX,
        ),
        (topics.CAM_STATE, topics.FINISHED),
        "-p scene:=quick -p cam:=cycloidal",
        published=(topics.ROBOT_DESCRIPTION,),
    ),
    "cam_drive": NodeSpec(
        "turns the cam through the scene's speeds, at the pace of the slowest consumer",
        (
            SCENE, ON_FINISH,
            Spec("rpm", 0.0, "set-point of the speed from the next tick on, rpm; 0: the scene's "
                 "speeds (the actual speed is on /cam/state)", 0.0, 1e5, live=True),
            Spec("pacing", "free", "real-time factor: free, real_time, or a multiple such as 20x",
                 live=True, check=factor_of, read=pacing_of),
            Spec("autostart", True, "turn as soon as every node is ready; false: wait for ~/start"),
            Spec("consumers", list(ESSENTIAL), "nodes whose acknowledgements the drive waits for",
                 choices=CONSUMERS),
            _PROGRESS_TIMEOUT, _PROGRESS,
        ),
        (
            topics.LAW_COEFFICIENTS, *_ACKNOWLEDGEMENTS, topics.LAW_SERVER_ACK, topics.CLOSED,
            topics.READY, topics.CAM_RPM, topics.JOINT_COMMANDS, topics.PARAMETER_EVENTS,
        ),
        "-p scene:=quick -p pacing:=20 -p autostart:=false",
        services=("start", "stop", "reset", "emergency_stop"),
    ),
    "follower": NodeSpec(
        "computes the follower's motion and contact force in each tick",
        (
            SCENE, ON_FINISH, _SAMPLES_PER_TURN,
            Spec("visualization_rate", 100.0, "rate of /joint_states and similar topics in a "
                 "paced run, Hz, wall clock", 1.0, 1000.0),
            _FRAME_PREFIX,
        ),
        (topics.LAW_COEFFICIENTS, topics.CAM_STATE, topics.REAL_TIME_FACTOR, topics.FINISHED),
        "-p scene:=quick -p samples_per_turn:=360",
        published=(topics.JOINT_STATES,),
    ),
    "microphone": NodeSpec(
        "computes sound pressure and level from the contact force of each tick",
        (
            SCENE, ON_FINISH,
            Spec("frequency_weighting", "Z",
                 "frequency weighting of the level, class 1 up to 20 kHz: A, C or Z",
                 choices=FREQUENCY_WEIGHTINGS, live=True),
            Spec("time_weighting", "F", "time weighting of the level: F (125 ms) or S (1 s)",
                 choices=tuple(TIME_WEIGHTINGS), live=True),
        ),
        (topics.FOLLOWER_SAMPLES, topics.CAM_STATE, topics.FINISHED),
        "-p scene:=quick -p frequency_weighting:=A",
    ),
    "recorder": NodeSpec(
        "records every message of the rig into a rosbag2 bag (MCAP)",
        (
            SCENE, ON_FINISH,
            Spec("output_uri", "", "folder of the bag, must not exist; empty: bags/<scene>_<date>"),
            _SAMPLES_PER_TURN,
            Spec("max_bagfile_size", 0, "maximum size of a file of the bag, bytes; 0: no limit",
                 check=check_parameter_size),
            Spec("max_bagfile_duration", 0.0, "maximum duration of a file of the bag, s, rig time; "
                 "0: no limit", check=check_parameter_duration),
        ),
        (*topics.RECEIVED, topics.FINISHED),
        "-p scene:=quick -p output_uri:=bags/mine",
    ),
    "viewer": NodeSpec(
        "displays the run live in Rerun",
        (
            SCENE, replace(ON_FINISH, default=WAIT),
            Spec("address", "", "address of a Rerun viewer, or folder that a page of cam-rig "
                 "reads; empty: open a window"),
        ),
        (
            topics.PROFILE, topics.CAM_STATE, topics.FOLLOWER_SAMPLES, topics.LEVEL,
            topics.PRESSURE, topics.REAL_TIME_FACTOR, topics.FINISHED,
        ),
        "-p scene:=quick",
        published=(topics.VIEWER_ACK,),
    ),
    "panel": NodeSpec(
        "forwards commands of a page in a browser to the nodes, and their messages to the page",
        (
            SCENE, replace(ON_FINISH, default=WAIT),
            Spec("socket", "", "socket of cam-rig panel, which starts this node"),
        ),
        (
            topics.CAM_STATE, topics.LEVEL, topics.PRESSURE, topics.FOLLOWER_SAMPLES,
            topics.DIAGNOSTICS, topics.PARAMETER_EVENTS, topics.FINISHED,
        ),
        "-p scene:=quick -p socket:=/run/user/1000/panel.socket",
    ),
    "player": NodeSpec(
        "publishes the cam states and laws of a bag, in place of cam_drive and law_server",
        (
            replace(ON_FINISH, choices=(END, WAIT)),
            Spec("input_uri", "", "bag with the cam states and laws to publish"),
            _PROGRESS_TIMEOUT, _PROGRESS,
        ),
        (*_ACKNOWLEDGEMENTS, topics.CLOSED, topics.READY),
        "-p input_uri:=bags/golden",
        published=(
            topics.CLOCK, topics.CAM_STATE, topics.LAW_COEFFICIENTS, topics.PROFILE, topics.LAW,
            topics.REAL_TIME_FACTOR, topics.FINISHED, topics.RIG_STATE,
        ),
    ),
}  # fmt: skip
#: Parameters of each node by name.
PARAMETERS = {node: interface.parameters for node, interface in ABOUT.items()}


def published_topics(node: str) -> tuple[Topic, ...]:
    """Return the topics that a node publishes, in the order of the table of topics."""
    names = {topic.name for topic in (*ABOUT[node].published, *COMMON)}
    return tuple(topic for topic in TOPICS if topic.owner == node or topic.name in names)


def usage(node: str) -> str:
    """Return the help text of a node: parameters, topics, services and an example."""
    interface = ABOUT[node]
    lines = [
        f"{node}: {interface.description}",
        "",
        f"usage: {node} [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r __ns:=/NAME]]",
        "",
        "parameters (default; * may be set while the node runs)",
    ]
    for spec in interface.parameters:
        lines += _parameter(spec)
    listed = {"subscribes to": interface.subscribed, "publishes": published_topics(node)}
    for heading, topics_of_node in listed.items():
        lines += ["", heading, *(f"  {topic.name:34} {topic.type}" for topic in topics_of_node)]
    if interface.services:
        lines += ["", "services"]
        lines += [f"  ~/{name:32} std_srvs/srv/Trigger" for name in interface.services]
    lines += ["", "example", f"  ros2 run cam_rig {node} --ros-args {interface.example}"]
    return "\n".join(lines)


def _parameter(spec: Spec) -> list[str]:
    """Return the lines of the help text that describe a parameter."""
    default = ", ".join(spec.default) if isinstance(spec.default, list) else spec.default
    text = str(default).lower() if isinstance(default, bool) else default
    head = f"  {spec.name}{' *' if spec.live else ''}"
    lines = [f"{head:34} {text if text != '' else 'none'} ({KINDS[type(spec.default)]})"]
    lines.append(f"      {spec.description}")
    if spec.choices:
        lines.append(f"      allowed: {', '.join(spec.choices)}")
    if spec.max_value is not None:
        lines.append(f"      allowed: {spec.min_value:g} to {spec.max_value:g}")
    return lines


#: Live parameters of each node: those that may be set while the nodes run.
LIVE = {
    node: live
    for node, specs in PARAMETERS.items()
    if (live := {spec.name: spec for spec in specs if spec.live})
}
