"""How often messages may be sent again: what a successor needs stays in the topic's history."""

from __future__ import annotations

from collections import deque

from cam_rig.live.flow_control import HISTORY_DEPTH, TICKS_IN_HISTORY


class RepeatBudget:
    """Counts what one latched topic has published, of ticks for the first time and repeated.

    A repeated message takes a place in the topic's history. A node that is started again goes
    back as far as the first messages of the last ticks, in their order; repeats that would push
    one of them out are not allowed. New ticks make room for others.

    Parameters
    ----------
    ticks : the last ticks whose first messages must stay
    depth : messages in the history
    """

    def __init__(self, ticks: int = TICKS_IN_HISTORY, depth: int = HISTORY_DEPTH) -> None:
        self._ticks, self._depth = ticks, depth
        self._first: deque[int] = deque(maxlen=ticks)
        self._published = 0

    def publish(self) -> None:
        """Note the first message of the next tick."""
        self._first.append(self._published)
        self._published += 1

    def repeat(self) -> bool:
        """Whether a message may be published again; if so, it is noted."""
        oldest = self._first[0] if self._first else self._published
        to_come = self._ticks - len(self._first)
        allowed = self._published - oldest + to_come < self._depth
        self._published += allowed
        return allowed
