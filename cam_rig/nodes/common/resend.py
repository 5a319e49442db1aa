"""What a node published for its last ticks, to be said again to whoever did not get it."""

from __future__ import annotations

from collections import deque
from typing import Any

from rclpy.publisher import Publisher

from cam_rig.live.checkpoint import TICKS_IN_FLIGHT

Said = tuple[Publisher, Any]


class Repeats:
    """A reader's history is bounded, so a flood from elsewhere may sweep a message out of it.

    The drive then says its states again; who has answered them already, answers again. Whoever
    did get the first answer knows the second by its stamp.
    """

    def __init__(self) -> None:
        self._ticks: deque[tuple[int, list[Said]]] = deque(maxlen=TICKS_IN_FLIGHT + 1)

    def publish(self, stamp_ns: int, said: list[Said]) -> None:
        """Publish all messages of a tick in their order, and remember them."""
        self._ticks.append((stamp_ns, said))
        self._say(said)

    def again(self, stamp_ns: int) -> None:
        """Publish once more what was published for the tick that ends at a stamp."""
        for stamp, said in self._ticks:
            if stamp == stamp_ns:
                self._say(said)

    def _say(self, said: list[Said]) -> None:
        for publisher, message in said:
            publisher.publish(message)
