"""What each node takes and gives, as its ``--help`` prints it; nothing here needs rclpy."""

from __future__ import annotations

from dataclasses import dataclass

from cam_rig.messages import topics
from cam_rig.messages.topics import Topic
from cam_rig.nodes.parameters import KINDS, PARAMETERS, Spec

#: Topics of the table in its order.
TOPICS = tuple(value for value in vars(topics).values() if isinstance(value, Topic))

#: What every node publishes.
COMMON = (topics.DIAGNOSTICS, topics.READY)


@dataclass(frozen=True)
class About:
    """One node: what it does, the topics it takes, its services, an example of its parameters.

    It publishes the topics that it owns, ``gives``, and `COMMON`.
    """

    does: str
    takes: tuple[Topic, ...]
    example: str
    gives: tuple[Topic, ...] = ()
    services: tuple[str, ...] = ()


_ACKNOWLEDGEMENTS = (topics.FOLLOWER_STATE, topics.PRESSURE, topics.RECORDED)

_PLAYED = (topics.CLOCK, topics.CAM_STATE, topics.LAW_COEFFICIENTS, topics.PROFILE, topics.LAW)

ABOUT = {
    "law_server": About(
        "holds the motion law of the mounted cam and publishes it, latched",
        (topics.CAM_STATE, topics.FINISHED),
        "-p scene:=quick -p cam:=cycloidal",
        gives=(topics.ROBOT_DESCRIPTION,),
    ),
    "cam_drive": About(
        "turns the cam through the scene's speeds, no faster than its slowest consumer",
        (
            topics.LAW_COEFFICIENTS,
            *_ACKNOWLEDGEMENTS,
            topics.FOLLOWED,
            topics.CLOSED,
            topics.READY,
            topics.CAM_RPM,
            topics.PARAMETER_EVENTS,
        ),
        "-p scene:=quick -p pacing:=20 -p autostart:=false",
        services=("start", "stop", "reset", "emergency_stop"),
    ),
    "follower": About(
        "computes the follower's motion and contact force between the states of the cam",
        (topics.LAW_COEFFICIENTS, topics.CAM_STATE, topics.REAL_TIME_FACTOR, topics.FINISHED),
        "-p scene:=quick -p points_per_turn:=360",
        gives=(topics.JOINT_STATES,),
    ),
    "microphone": About(
        "computes sound pressure and level from the contact force of each tick",
        (topics.FOLLOWER_SAMPLES, topics.CAM_STATE, topics.FINISHED),
        "-p scene:=quick -p frequency_weighting:=A",
    ),
    "recorder": About(
        "records every message of the rig into a rosbag2 bag (MCAP)",
        (*topics.RECEIVED, topics.FINISHED),
        "-p scene:=quick -p bag:=bags/mine",
    ),
    "viewer": About(
        "draws the run in Rerun while it runs",
        (
            topics.PROFILE,
            topics.CAM_STATE,
            topics.FOLLOWER_SAMPLES,
            topics.LEVEL,
            topics.PRESSURE,
            topics.REAL_TIME_FACTOR,
            topics.FINISHED,
        ),
        "-p scene:=quick",
        gives=(topics.SHOWN,),
    ),
    "panel": About(
        "passes commands of a page in a browser on to the other nodes, and shows it what they say",
        (
            topics.CAM_STATE,
            topics.LEVEL,
            topics.PRESSURE,
            topics.FOLLOWER_SAMPLES,
            topics.DIAGNOSTICS,
            topics.PARAMETER_EVENTS,
            topics.FINISHED,
        ),
        "-p scene:=quick -p socket:=/run/user/1000/panel.socket",
    ),
    "player": About(
        "publishes the cam states and laws of a bag, in place of cam_drive and law_server",
        (*_ACKNOWLEDGEMENTS, topics.CLOSED, topics.READY),
        "-p bag:=bags/golden",
        gives=(*_PLAYED, topics.REAL_TIME_FACTOR, topics.FINISHED),
    ),
}


def published(node: str) -> tuple[Topic, ...]:
    """The topics that a node publishes, in the table's order."""
    about = ABOUT[node]
    given = {topic.name for topic in (*about.gives, *COMMON)}
    return tuple(topic for topic in TOPICS if topic.owner == node or topic.name in given)


def usage(node: str) -> str:
    """What a node does and takes, for people: parameters, topics, services, an example.

    >>> print(usage("follower").splitlines()[0])
    follower: computes the follower's motion and contact force between the states of the cam
    """
    about = ABOUT[node]
    lines = [
        f"{node}: {about.does}",
        "",
        f"usage: {node} [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r __ns:=/NAME]]",
        "",
        "parameters (default; * may be set while the node runs)",
    ]
    for spec in PARAMETERS[node]:
        lines += _parameter(spec)
    lines += ["", "subscribes to", *map(_topic, about.takes)]
    lines += ["", "publishes", *map(_topic, published(node))]
    if about.services:
        lines += ["", "services"]
        lines += [f"  ~/{name:32} std_srvs/srv/Trigger" for name in about.services]
    lines += ["", "example", f"  ros2 run cam_rig {node} --ros-args {about.example}"]
    return "\n".join(lines)


def _parameter(spec: Spec) -> list[str]:
    """A parameter with default, type, what it is, and what is allowed."""
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


def _topic(topic: Topic) -> str:
    return f"  {topic.name:34} {topic.type}"
