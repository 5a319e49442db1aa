"""What a node published for its last ticks, to be sent again to a node that did not get it."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from rclpy.publisher import Publisher

from cam_rig.live.flow_control import MAX_TICKS_IN_FLIGHT
from cam_rig.live.repeats import RepeatBudget

Published = tuple[Publisher, Any]


class ResendBuffer:
    """The messages of the ticks that may be in flight, each on topics of its own.

    The history of a subscription is bounded, so a flood from elsewhere may overflow it. The drive
    then sends its states again, and nodes that have answered them already answer again. A
    subscriber that did get the first answer knows the second by its stamp. What may be sent again
    is bounded, as the topics' histories are (`RepeatBudget`).
    """

    def __init__(self) -> None:
        self._ticks: deque[tuple[int, Sequence[Published]]] = deque(maxlen=MAX_TICKS_IN_FLIGHT + 1)
        self._budget = RepeatBudget()

    def publish(self, stamp_ns: int, messages: Sequence[Published]) -> None:
        """Publish all messages of a tick in their order, and remember them."""
        self._ticks.append((stamp_ns, messages))
        self._budget.publish()
        self._send(messages)

    def resend(self, stamp_ns: int) -> None:
        """Publish once more what was published for the tick that ends at a stamp."""
        for stamp, messages in self._ticks:
            if stamp == stamp_ns and self._budget.repeat():
                self._send(messages)

    def _send(self, messages: Sequence[Published]) -> None:
        for publisher, message in messages:
            publisher.publish(message)
