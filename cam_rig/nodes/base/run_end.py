"""End of a run: /rig/finished, the closed bag, and the end of the nodes.

The drive, or the player, publishes `FINISHED` and stays until the recorder has closed its bag. The
other nodes end when the drive has left, because late subscribers may request their latched messages
until then. A node with ``on_finish: stay`` is created again in the same process when all publishers
of the previous run have left.

A lost drive is detected by the matched event of the subscription to /rig/finished. This event does
not report which of two drives has left. At the end of a run the nodes therefore poll the endpoints
that DDS discovery reports.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node

from cam_rig.messages import topics
from cam_rig.runner.node_table import WAIT

if TYPE_CHECKING:
    from cam_rig.nodes.base.rig_node import RigNode

#: Longest time (s, wall clock) for which the recorder waits, after its last message, for the drive
#: to leave. The drive leaves when it has received that message.
DELIVERY_S = 2.0
#: Period (s, wall clock) at which a node checks which publishers are present.
POLL_S = 0.1
#: Time (s, wall clock) without the drive after which it counts as lost. A node that was suspended
#: sees the drive as lost until it receives the drive's next announcement.
DRIVE_LOST_S = 10.0
#: DDS identifiers of publishers by resolved topic name.
Endpoints = dict[str, set[bytes]]


def find_endpoints(node: Node, *names: str) -> Endpoints:
    """Return the identifiers of the present publishers of each topic (full name)."""
    return {
        name: {bytes(info.endpoint_gid) for info in node.get_publishers_info_by_topic(name)}
        for name in names
    }


def have_left(node: Node, endpoints: Endpoints) -> bool:
    """Return True if none of the given publishers is present any more.

    `endpoints` are the DDS identifiers of the publishers by topic name.
    """
    present = find_endpoints(node, *endpoints)
    return not any(endpoints[name] & present[name] for name in endpoints)


def wait_until_gone(node: Node, endpoints: Endpoints, is_stopped: Callable[[], bool]) -> None:
    """Block until all endpoints have left or `is_stopped` returns True."""
    while not (have_left(node, endpoints) or is_stopped()):
        time.sleep(POLL_S)


def create_staying_node(name: str) -> Node:
    """Create a hidden node that keeps this process's DDS participant between two runs.

    A participant that is created again in a process has the same identifier. A remote node that has
    not detected the end of the previous participant would ignore the announcements of the new one.
    """
    return rclpy.create_node(
        f"_{name}_between_runs",
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )


class FinishedRun(NamedTuple):
    """Content of a message on /rig/finished, which reports the end of a run."""

    level: bytes  #: level of diagnostic_msgs/DiagnosticStatus: OK, WARN (stopped), ERROR
    text: str
    ticks: int  #: number of ticks of the run
    stamp_ns: int  #: rig time of the last state, ns

    def to_message(self, node: str) -> DiagnosticStatus:
        """Return the message that `node` publishes on /rig/finished."""
        status = DiagnosticStatus(level=self.level, name=node, message=self.text)
        values = {"ticks": self.ticks, "stamp_ns": self.stamp_ns}
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        return status

    @classmethod
    def from_message(cls, message: DiagnosticStatus) -> FinishedRun:
        """Return the content of a message on /rig/finished.

        Invalid content raises ValueError or KeyError.
        """
        values = {pair.key: pair.value for pair in message.values}
        return cls(message.level, message.message, int(values["ticks"]), int(values["stamp_ns"]))


class LostDriveMonitor:
    """Ends a node if the drive has left without publishing /rig/finished.

    The drive is the node that turns the cam. The subscription to /rig/finished calls `on_drives`
    with the number of connected drives.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._timer = node.create_wall_timer(DRIVE_LOST_S, self._on_lost)
        self._timer.cancel()

    def on_drives(self, count: int) -> None:
        """Start the countdown when no drive is left, and stop it when a drive appears."""
        if count == 0:
            self._timer.reset()
        else:
            self._timer.cancel()

    def _on_lost(self) -> None:
        self._timer.cancel()
        if self._node.done.done():
            return
        self._node.get_logger().warning(
            f"the drive has left without publishing /rig/finished; ending after {DRIVE_LOST_S:g} s"
        )
        self._node.remember_endpoints()
        self._node.finish()


class RunEndMonitor:
    """Ends a node when the drive has published /rig/finished and has left."""

    def __init__(self, node: RigNode) -> None:
        self._node, self._drives = node, Endpoints()
        if node.settings["on_finish"] != WAIT:
            node.subscribe(topics.FINISHED, self._on_finished, LostDriveMonitor(node).on_drives)
            self._poll_timer = node.create_wall_timer(POLL_S, self._poll)
            self._poll_timer.cancel()

    def _on_finished(self, message: DiagnosticStatus) -> None:
        FinishedRun.from_message(message)  # rejects invalid content
        if not self._drives:
            self._node.remember_endpoints()
            name = self._node.resolve_topic_name(topics.FINISHED.relative)
            self._drives = find_endpoints(self._node, name)
            self._poll_timer.reset()

    def _poll(self) -> None:
        if have_left(self._node, self._drives):
            self._node.finish()
