"""The state of a node on /diagnostics: when it changes, and once a second of rig time."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.publisher import Publisher

from cam_rig.nodes.common.convert import to_header
from cam_rig.units import NS

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


#: The last report: level, words, second, and the rig time (ns) up to which all is reported.
Reported = tuple[int, str, int, int]


class Diagnostics:
    """The state of one node.

    What is published depends on rig time alone, so it is the same in every run; ``reported`` is
    part of a checkpoint, so that a successor continues instead of starting over.
    """

    def __init__(self, publisher: Publisher, node: str) -> None:
        self._publisher, self._node = publisher, node
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
        status = DiagnosticStatus(level=level, name=self._node, message=words, hardware_id="rig")
        status.values = [KeyValue(key=k, value=v) for k, v in (values or {}).items()]
        message = DiagnosticArray(header=to_header(time_ns, ""), status=[status])
        self._publisher.publish(message)
        return message
