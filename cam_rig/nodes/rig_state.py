"""State of the rig on one latched topic, for supervisors and dashboards."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from cam_rig.messages import topics
from cam_rig.nodes.base.diagnostics import ERROR, OK
from cam_rig.units import to_rpm

if TYPE_CHECKING:
    from cam_rig.nodes.clock_source import ClockSource

#: Time (s, wall clock) after which the state is published although only speed or progress change.
#: With the period of the calls of `update`, 0.1 s, the gap between two messages is at most 1 s.
STATE_PERIOD_S = 0.9


class RigState:
    """Publisher of /rig/state.

    A message is published when the activity or the mounted cam changes, and otherwise once per
    second of wall-clock time. The level is ERROR after an emergency stop or a failure. The node
    calls `update` at least ten times per second.
    """

    def __init__(self, node: ClockSource) -> None:
        self._node = node
        self._publisher = node.advertise(topics.RIG_STATE)
        self._last: tuple[str, str, str] | None = None  # state, text, cam
        self._published_at = 0.0

    def update(self) -> None:
        """Publish the state of the running rig on /rig/state if a message is due."""
        activity, now = self._node.activity(), time.monotonic()
        current = activity.state, activity.text, self._cam
        if current == self._last and now - self._published_at < STATE_PERIOD_S:
            return
        self._last, self._published_at = current, now
        level = ERROR if activity.state == "emergency" else OK
        self._send(level, activity.state, activity.text, ", ".join(activity.waits_for))

    def publish_end(self, level: bytes, text: str) -> None:
        """Publish the outcome of the run, with the level and the text of /rig/finished."""
        self._send(level, "finished", text, "")

    @property
    def _cam(self) -> str:
        state = self._node.newest
        return "" if state is None else state.cam

    def _send(self, level: bytes, state: str, text: str, waits_for: str) -> None:
        node = self._node
        turns = node.newest is not None and state in ("turning", "waiting")
        values = {
            "state": state,
            "waits_for": waits_for,
            "cam": self._cam,
            "rpm": f"{to_rpm(node.newest.speed) if turns and node.newest else 0.0:.6g}",
            "tick": str(max(0, node.ticks - node.in_flight)),
            "ticks": str(node.total_ticks),
            "stamp_ns": str(max(0, node.newest_ns)),
        }
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        self._publisher.publish(
            DiagnosticStatus(level=level, name="rig", message=text, hardware_id="rig", values=pairs)
        )
