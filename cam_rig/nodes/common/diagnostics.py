"""The state of a node on /diagnostics: when it changes, and once a second of rig time."""

from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.publisher import Publisher

from cam_rig.messages.topics import HEARTBEAT
from cam_rig.nodes.common.convert import to_header
from cam_rig.units import NS

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
#: Wall time (s) after the last diagnosis before there is a heartbeat.
SILENT_S = 0.9

#: The last report: level, words, second, and the rig time (ns) up to which all is reported.
Reported = tuple[int, str, int, int]


class Diagnostics:
    """The state of one node.

    What is published depends on rig time alone, so it is the same in every run; ``reported`` is
    part of a checkpoint, so that a successor continues instead of starting over.
    """

    def __init__(self, publisher: Publisher, node: str) -> None:
        self._publisher, self.node = publisher, node
        #: Wall time (s) of the last message.
        self.published_at = -SILENT_S
        self.reported: Reported = (-1, "", -1, -1)

    def report(
        self, time_ns: int, level: bytes, words: str, values: dict[str, str] | None = None
    ) -> DiagnosticArray | None:
        """Report the node's state at a rig time; the message, if one was published."""
        *before, until = self.reported
        if time_ns <= until:
            return None
        now = (level[0], words, time_ns // NS)
        self.reported = (*now, time_ns)
        if now == tuple(before):
            return None
        status = DiagnosticStatus(level=level, name=self.node, message=words, hardware_id="rig")
        status.values = [KeyValue(key=k, value=v) for k, v in (values or {}).items()]
        message = DiagnosticArray(header=to_header(time_ns), status=[status])
        self._publisher.publish(message)
        self.published_at = time.monotonic()
        return message


class Heartbeat:
    """What a node does, once a second of wall time while rig time stands; no bag holds it.

    Parameters
    ----------
    publisher : of its own, so that the history of the rig's diagnostics holds no heartbeat
    health : silent as long as rig time stands
    """

    def __init__(self, publisher: Publisher, health: Diagnostics) -> None:
        self._publisher, self._health = publisher, health

    def beat(self, words: str) -> None:
        """Publish what the node does, unless its diagnostics have just said so."""
        if time.monotonic() - self._health.published_at < SILENT_S:
            return
        name = self._health.node + HEARTBEAT
        status = DiagnosticStatus(level=OK, name=name, message=words, hardware_id="rig")
        header = to_header(time.time_ns(), "")
        self._publisher.publish(DiagnosticArray(header=header, status=[status]))
