"""Telling /diagnostics how a node is: when it changes, and once a second of rig time."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.publisher import Publisher

from cam_rig.nodes.common.convert import to_header
from cam_rig.units import NS

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


#: What was said last: level, words, second, and the rig time (ns) up to which all is said.
Said = tuple[int, str, int, int]


class Diagnostics:
    """The state of one node.

    What is said depends on rig time alone, so it is the same in every run; ``said`` is handed over
    to a successor, which so goes on instead of beginning anew.
    """

    def __init__(self, publisher: Publisher, node: str) -> None:
        self._publisher, self._node = publisher, node
        self.said: Said = (-1, "", -1, -1)

    def report(
        self, time_ns: int, level: bytes, words: str, values: dict[str, str] | None = None
    ) -> DiagnosticArray | None:
        """Say how the node is at a rig time; what was said, if anything."""
        *before, until = self.said
        if time_ns <= until:
            return None
        now = (level[0], words, time_ns // NS)
        self.said = (*now, time_ns)
        if now == tuple(before):
            return None
        status = DiagnosticStatus(level=level, name=self._node, message=words, hardware_id="rig")
        status.values = [KeyValue(key=k, value=v) for k, v in (values or {}).items()]
        message = DiagnosticArray(header=to_header(time_ns, ""), status=[status])
        self._publisher.publish(message)
        return message
