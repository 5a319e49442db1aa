"""Diagnostics of a node: status changes and heartbeats, all stamped with rig time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.publisher import Publisher

from cam_rig.messages.topics import DIAGNOSTICS, HEARTBEAT
from cam_rig.nodes.convert import to_header
from cam_rig.units import NS

if TYPE_CHECKING:
    from cam_rig.nodes.base.rig_node import RigNode

# Levels of a diagnostic status, each a byte.
OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
#: Period (s, wall clock) at which a node publishes a heartbeat while its status is constant.
HEARTBEAT_PERIOD_S = 1.0
#: Time (s, wall clock) after a status message during which no heartbeat is needed. Slightly less
#: than the period, so that timer jitter does not suppress every second heartbeat.
STATUS_VALID_S = 0.9


class Activity(NamedTuple):
    """Current activity of a node, as its heartbeat reports it."""

    state: str  #: waiting, turning, stopped or emergency
    waits_for: Sequence[str]  #: names of the nodes that this node waits for
    text: str  #: description for the operator


def make_diagnostics(
    time_ns: int, name: str, level: bytes, text: str, values: dict[str, str]
) -> DiagnosticArray:
    """Return a message with the status of one node or of one of its components.

    `time_ns` is the rig time (ns) of its stamp, `level` is OK, WARN or ERROR, and `values` are
    further values of the status by name.
    """
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    status = DiagnosticStatus(level=level, name=name, message=text, hardware_id="rig", values=pairs)
    return DiagnosticArray(header=to_header(time_ns), status=[status])


class Diagnostics:
    """Status of one node on /diagnostics.

    A message is published when level or text changes, and otherwise once per second of rig time.
    The messages depend on rig time only, so they are the same in every run of a scene.
    """

    def __init__(self, publisher: Publisher, node: str) -> None:
        self._publisher, self.node = publisher, node
        self._last_status: tuple[int, str, int] | None = None  # level, text, second of rig time
        #: Rig time (ns) of the newest status that the node has reported.
        self.newest_ns = -1
        #: Time (s, monotonic clock) of the last message with the node's status.
        self.published_at = -STATUS_VALID_S

    def report(
        self, time_ns: int, level: bytes, text: str, values: dict[str, str] | None = None
    ) -> DiagnosticArray | None:
        """Publish the status at a rig time (ns) if it is due, and return its message.

        Returns None if no message is published, because level, text and second of rig time are
        unchanged. A report that is not later than the previous report is ignored.
        """
        if time_ns <= self.newest_ns:
            return None
        self.newest_ns = time_ns
        status = (level[0], text, time_ns // NS)
        if status == self._last_status:
            return None
        self._last_status = status
        message = make_diagnostics(time_ns, self.node, level, text, values or {})
        self._publisher.publish(message)
        self.published_at = time.monotonic()
        return message


class Heartbeat:
    """Publishes the activity of a node each second while its status is constant.

    Rig time stops with the cam, so a heartbeat has the stamp of the newest status or state of its
    node, 0 before the first. It shows that the node is alive, and for which nodes it waits. The
    suffix `HEARTBEAT` of the name distinguishes heartbeats from status messages, and the recorder
    ignores them. They have a publisher with a history of one message, so that they do not displace
    status messages from the history that late subscribers receive.
    """

    def __init__(self, node: RigNode, diagnostics: Diagnostics) -> None:
        self._node, self._diagnostics = node, diagnostics
        self._publisher = node.advertise(replace(DIAGNOSTICS, depth=1))
        node.create_wall_timer(HEARTBEAT_PERIOD_S, self._publish)

    def _publish(self) -> None:
        if time.monotonic() - self._diagnostics.published_at < STATUS_VALID_S:
            return
        activity = self._node.activity()
        values = {"state": activity.state, "waits_for": ", ".join(activity.waits_for)}
        name = self._diagnostics.node + HEARTBEAT
        stamp_ns = max(0, self._diagnostics.newest_ns)
        message = make_diagnostics(stamp_ns, name, OK, activity.text, values)
        self._publisher.publish(message)
