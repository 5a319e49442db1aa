"""The one table of topics: name, type, quality of service, publisher, and how many per tick.

Nodes, recorder, runner and analysis take a topic's name from this table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from cam_rig.dynamics import COLUMNS
from cam_rig.live.flow_control import HISTORY_DEPTH
from cam_rig.live.state_validation import MAX_SAMPLES


@dataclass(frozen=True)
class Topic:
    """One topic. All are reliable.

    ``per`` says when it is published: for each ``state`` of the cam, each ``tick`` (the time
    between two states), each ``cam`` mounted, each ``speed``, or at ``any`` time.

    ``twin`` names the stamped topic that the same node publishes as often: the n-th message of the
    one belongs to the stamp of the n-th of the other.

    ``owner`` is the node that publishes it, and no other may; empty where several do. A message of
    more than ``most_bytes`` is refused before it is read.
    """

    name: str
    type: str
    per: Literal["state", "tick", "cam", "speed", "any"]
    latched: bool = True
    depth: int = HISTORY_DEPTH
    stamped: bool = True
    twin: str = ""
    owner: str = ""
    most_bytes: int = 1 << 20

    @property
    def package(self) -> str:
        """The interface package, std_msgs for one."""
        return self.type.split("/")[0]

    @property
    def message(self) -> str:
        """The message's name within its package."""
        return self.type.split("/")[2]


CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", "state", stamped=False, owner="cam_drive")
LAW = Topic("/cam/law", "trajectory_msgs/msg/JointTrajectory", "speed", owner="law_server")
LAW_COEFFICIENTS = Topic(
    "/cam/law_coefficients",
    "std_msgs/msg/Float64MultiArray",
    "cam",
    stamped=False,
    owner="law_server",
)
PROFILE = Topic("/cam/profile", "geometry_msgs/msg/PolygonStamped", "cam", owner="law_server")
CAM_STATE = Topic("/cam/state", "sensor_msgs/msg/JointState", "state", owner="cam_drive")
FOLLOWER_STATE = Topic("/follower/state", "sensor_msgs/msg/JointState", "tick", owner="follower")
FOLLOWER_CONTACT = Topic(
    "/follower/contact", "geometry_msgs/msg/WrenchStamped", "tick", owner="follower"
)
FOLLOWER_SAMPLES = Topic(
    "/follower/samples",
    "std_msgs/msg/Float64MultiArray",
    "tick",
    stamped=False,
    twin="/follower/state",
    owner="follower",
    most_bytes=MAX_SAMPLES * len(COLUMNS) * 8 + 1024,
)
LEVEL = Topic(
    "/microphone/level",
    "std_msgs/msg/Float64",
    "tick",
    stamped=False,
    twin="/microphone/pressure",
    owner="microphone",
)
PRESSURE = Topic(
    "/microphone/pressure", "sensor_msgs/msg/FluidPressure", "tick", owner="microphone"
)
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "any")
#: The nodes that report on /diagnostics, in the order of a bag.
DIAGNOSED_NODES = ("cam_drive", "law_server", "follower", "microphone", "recorder")
#: The name there of the drive's pacing. It depends on the wall clock, so bags do not hold it.
PACE = "cam_drive: pace"
#: The recorder's acknowledgement: the stamp of the newest tick whose messages are all written.
RECORDED = Topic("/recorder/written", "std_msgs/msg/Header", "tick", owner="recorder")
#: The law server's acknowledgement: the stamp of the newest state that it has processed.
FOLLOWED = Topic("/law_server/followed", "std_msgs/msg/Header", "state", owner="law_server")
#: The viewer's acknowledgement: the stamp of the newest tick that it has drawn.
SHOWN = Topic("/viewer/shown", "std_msgs/msg/Header", "tick")
#: A node, by the name in frame_id, takes messages; the recorder once its file is open.
READY = Topic("/rig/ready", "std_msgs/msg/Header", "any")

#: A command to the drive: the cam's speed in rpm from the next tick on, 0 as the scene says.
CAM_RPM = Topic("/cam/rpm", "std_msgs/msg/Float64", "any", latched=False, stamped=False)
#: Every node's, of its parameters; the law server's report which cam is mounted.
PARAMETER_EVENTS = Topic(
    "/parameter_events",
    "rcl_interfaces/msg/ParameterEvent",
    "any",
    latched=False,
    depth=1000,
)

#: What a bag holds.
RECORDING = (
    CLOCK,
    LAW,
    LAW_COEFFICIENTS,
    PROFILE,
    CAM_STATE,
    FOLLOWER_STATE,
    FOLLOWER_CONTACT,
    FOLLOWER_SAMPLES,
    LEVEL,
    PRESSURE,
    DIAGNOSTICS,
)
