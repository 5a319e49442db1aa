"""What each node takes and gives: parameters and their values, topics, services; without rclpy."""

from __future__ import annotations

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
from cam_rig.schema.load import named_path
from cam_rig.schema.scene import MAX_POINTS_PER_TURN

#: What a value of each type is called.
KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text",
         list: "a list of texts"}  # fmt: skip


@dataclass(frozen=True)
class Spec:
    """One parameter: its default gives its type; the description names the unit.

    ``least`` and ``most`` bound a number; ``choices`` what a text, or each of a list, may be;
    ``check`` raises what else is wrong; ``read`` takes other ways to write a value, a scene's name
    for its path. A parameter that is not ``live`` is read-only.
    """

    name: str
    default: Any
    description: str
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False
    check: Callable[[Any], object] | None = None
    read: Callable[[Any], Any] | None = None

    def convert(self, value: Any) -> Any:
        """A value as a parameter of this type: whole numbers are numbers as well."""
        kind = type(self.default)
        if self.read is not None:
            value = self.read(value)
        if kind is float and type(value) is int:
            return float(value)
        if kind is list and isinstance(value, (list, tuple)):
            return list(value)
        if type(value) is not kind:
            quote = f"; in quotes: '\"{value}\"'" if kind is str and self.check is None else ""
            some = "a list, [], of " if kind is list and self.choices else ""
            allowed = some + ", ".join(self.choices) or KINDS[kind] + quote
            raise ConfigError(f"{self.name}: is {value!r}; allowed: {allowed}")
        return value

    def require(self, value: Any) -> None:
        """Refuse a value that is out of range, or none of the choices."""
        given = value if isinstance(value, (list, tuple)) else [value]
        unknown = [str(item) for item in given if self.choices and item not in self.choices]
        if unknown:
            raise ConfigError(
                f"{self.name}: has {', '.join(unknown)}; allowed: {', '.join(self.choices)}"
            )
        if self.most is not None and not (self.least or 0.0) <= value <= self.most:
            raise ConfigError(
                f"{self.name}: is {value:g}; allowed: {self.least:g} to {self.most:g}"
            )
        if self.check is not None:
            self.check(value)


SCENE = Spec(
    "scene",
    "tm21_sweep",
    "scene file (YAML), or a name in config/scenes, that every node takes its numbers from",
    read=lambda scene: str(named_path("scenes", scene)) if isinstance(scene, str) else scene,
)
#: What a node does when the drive or the player says that the run is over.
AT_END = Spec(
    "at_end",
    END,
    "at the run's end: end; stay, for another run, as if started anew; wait for a signal to stop",
    choices=(END, STAY, WAIT),
)
_PROGRESS = Spec(
    "progress_fd", -1, "open file descriptor that gets a line of JSON for each state; -1: none"
)
_PATIENCE = Spec("patience", 20.0, "wall time without progress before giving up, s", 0.1, 86400.0)
_POINTS = Spec(
    "points_per_turn",
    0,
    "instants a turn at which /joint_states and the like show the motion; 0: as the scene says",
    0,
    MAX_POINTS_PER_TURN,
)
#: What every node publishes.
COMMON = (topics.DIAGNOSTICS, topics.READY)
#: The consumers that are waited for by default: a run need not be seen.
ESSENTIAL = tuple(name for name in CONSUMERS if name not in OPTIONAL)
#: Parameters of the microphone, in the order of their letters in a quantity such as LAF.
WEIGHTING_PARAMETERS = ("frequency_weighting", "time_weighting")
_ACKNOWLEDGEMENTS = (topics.FOLLOWER_STATE, topics.PRESSURE, topics.RECORDED)


@dataclass(frozen=True)
class About:
    """One node: its parameters, the topics it takes and ``gives`` beside `COMMON`, its services."""

    does: str
    parameters: tuple[Spec, ...]
    takes: tuple[Topic, ...]
    example: str
    gives: tuple[Topic, ...] = ()
    services: tuple[str, ...] = ()


ABOUT = {
    "law_server": About(
        "holds the motion law of the mounted cam and publishes it, latched",
        (
            SCENE, AT_END,
            Spec("cam", "", "a file of config/cams, mounted until the drive asks for another; "
                 "empty: the scene's first", live=True),
        ),
        (topics.CAM_STATE, topics.FINISHED),
        "-p scene:=quick -p cam:=cycloidal",
        gives=(topics.ROBOT_DESCRIPTION,),
    ),
    "cam_drive": About(
        "turns the cam through the scene's speeds, no faster than its slowest consumer",
        (
            SCENE, AT_END,
            Spec("rpm", 0.0, "set-point of the speed from the next tick on, rpm; 0: the scene's "
                 "speeds (the actual speed is on /cam/state)", 0.0, 1e5, live=True),
            Spec("pacing", "free", "rig time beside wall time: free, real_time, or a factor: 20, "
                 "20x", live=True, check=factor_of, read=pacing_of),
            Spec("autostart", True, "turn as soon as every node is ready; false: wait for ~/start"),
            Spec("consumers", list(ESSENTIAL), "nodes that are waited for", choices=CONSUMERS),
            _PATIENCE, _PROGRESS,
        ),
        (
            topics.LAW_COEFFICIENTS, *_ACKNOWLEDGEMENTS, topics.FOLLOWED, topics.CLOSED,
            topics.READY, topics.CAM_RPM, topics.PARAMETER_EVENTS,
        ),
        "-p scene:=quick -p pacing:=20 -p autostart:=false",
        services=("start", "stop", "reset", "emergency_stop"),
    ),
    "follower": About(
        "computes the follower's motion and contact force between the states of the cam",
        (
            SCENE, AT_END, _POINTS,
            Spec("motion_rate", 100.0, "how often /joint_states and the like show the motion of a "
                 "run at real time or a factor, Hz of wall time", 1.0, 1000.0),
        ),
        (topics.LAW_COEFFICIENTS, topics.CAM_STATE, topics.REAL_TIME_FACTOR, topics.FINISHED),
        "-p scene:=quick -p points_per_turn:=360",
        gives=(topics.JOINT_STATES,),
    ),
    "microphone": About(
        "computes sound pressure and level from the contact force of each tick",
        (
            SCENE, AT_END,
            Spec("frequency_weighting", "Z",
                 "frequency weighting of the level, class 1 up to 20 kHz: A, C or Z",
                 choices=FREQUENCY_WEIGHTINGS, live=True),
            Spec("time_weighting", "F", "time weighting of the level: F (125 ms) or S (1 s)",
                 choices=tuple(TIME_WEIGHTINGS), live=True),
        ),
        (topics.FOLLOWER_SAMPLES, topics.CAM_STATE, topics.FINISHED),
        "-p scene:=quick -p frequency_weighting:=A",
    ),
    "recorder": About(
        "records every message of the rig into a rosbag2 bag (MCAP)",
        (
            SCENE, AT_END,
            Spec("bag", "", "folder to record into, must not exist; empty: bags/<scene>_<date>"),
            _POINTS,
            Spec("max_bagfile_size", 0, "bytes after which the bag goes on in another file; 0: no "
                 "limit", check=check_parameter_size),
            Spec("max_bagfile_duration", 0.0, "rig time after which the bag goes on in another "
                 "file, s; 0: no limit", check=check_parameter_duration),
        ),
        (*topics.RECEIVED, topics.FINISHED),
        "-p scene:=quick -p bag:=bags/mine",
    ),
    "viewer": About(
        "draws the run in Rerun while it runs",
        (
            SCENE, replace(AT_END, default=WAIT),
            Spec("address", "", "Rerun's address that the picture goes to, or the folder that a "
                 "page of cam-rig reads it from; empty opens a window"),
        ),
        (
            topics.PROFILE, topics.CAM_STATE, topics.FOLLOWER_SAMPLES, topics.LEVEL,
            topics.PRESSURE, topics.REAL_TIME_FACTOR, topics.FINISHED,
        ),
        "-p scene:=quick",
        gives=(topics.SHOWN,),
    ),
    "panel": About(
        "passes commands of a page in a browser on to the other nodes, and shows it what they say",
        (
            SCENE, replace(AT_END, default=WAIT),
            Spec("socket", "", "socket of cam-rig panel, which starts this node"),
        ),
        (
            topics.CAM_STATE, topics.LEVEL, topics.PRESSURE, topics.FOLLOWER_SAMPLES,
            topics.DIAGNOSTICS, topics.PARAMETER_EVENTS, topics.FINISHED,
        ),
        "-p scene:=quick -p socket:=/run/user/1000/panel.socket",
    ),
    "player": About(
        "publishes the cam states and laws of a bag, in place of cam_drive and law_server",
        (
            replace(AT_END, choices=(END, WAIT)),
            Spec("bag", "", "bag whose cam states and laws are played"),
            _PATIENCE, _PROGRESS,
        ),
        (*_ACKNOWLEDGEMENTS, topics.CLOSED, topics.READY),
        "-p bag:=bags/golden",
        gives=(
            topics.CLOCK, topics.CAM_STATE, topics.LAW_COEFFICIENTS, topics.PROFILE, topics.LAW,
            topics.REAL_TIME_FACTOR, topics.FINISHED,
        ),
    ),
}  # fmt: skip
PARAMETERS = {node: about.parameters for node, about in ABOUT.items()}


def published(node: str) -> tuple[Topic, ...]:
    """The topics that a node publishes, in the table's order."""
    about = ABOUT[node]
    given = {topic.name for topic in (*about.gives, *COMMON)}
    return tuple(topic for topic in TOPICS if topic.owner == node or topic.name in given)


def usage(node: str) -> str:
    """What a node does and takes, for people: parameters, topics, services, an example."""
    about = ABOUT[node]
    lines = [
        f"{node}: {about.does}",
        "",
        f"usage: {node} [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r __ns:=/NAME]]",
        "",
        "parameters (default; * may be set while the node runs)",
    ]
    for spec in about.parameters:
        lines += _parameter(spec)
    for how, of in (("subscribes to", about.takes), ("publishes", published(node))):
        lines += ["", how, *(f"  {topic.name:34} {topic.type}" for topic in of)]
    if about.services:
        lines += ["", "services"]
        lines += [f"  ~/{name:32} std_srvs/srv/Trigger" for name in about.services]
    lines += ["", "example", f"  ros2 run cam_rig {node} --ros-args {about.example}"]
    return "\n".join(lines)


def _parameter(spec: Spec) -> list[str]:
    default = ", ".join(spec.default) if isinstance(spec.default, list) else spec.default
    shown = str(default).lower() if isinstance(default, bool) else default
    head = f"  {spec.name}{' *' if spec.live else ''}"
    lines = [f"{head:34} {shown if shown != '' else 'none'} ({KINDS[type(spec.default)]})"]
    lines.append(f"      {spec.description}")
    if spec.choices:
        lines.append(f"      allowed: {', '.join(spec.choices)}")
    if spec.most is not None:
        lines.append(f"      allowed: {spec.least:g} to {spec.most:g}")
    return lines


#: What may be set while the nodes run: the parameters of each node that are live.
LIVE = {
    node: live
    for node, specs in PARAMETERS.items()
    if (live := {spec.name: spec for spec in specs if spec.live})
}
