"""Telling /diagnostics how a node is: once when it changes, not once a tick."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.publisher import Publisher

from cam_rig.nodes.convert import to_header

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


class Diagnostics:
    """The state of one node, published when it changes."""

    def __init__(self, publisher: Publisher, node: str) -> None:
        self._publisher, self._node = publisher, node
        self._last: tuple[bytes, str] | None = None

    def report(self, time_ns: int, level: bytes, words: str, values: dict[str, str]) -> None:
        """Say how the node is at a rig time; said again only when level or words change."""
        if (level, words) == self._last:
            return
        self._last = (level, words)
        status = DiagnosticStatus(level=level, name=self._node, message=words, hardware_id="rig")
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        self._publisher.publish(DiagnosticArray(header=to_header(time_ns, ""), status=[status]))
