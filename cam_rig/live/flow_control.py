"""How far the drive may run ahead: a bounded number of ticks in flight, none ever dropped.

Every buffer of the protocol follows from that bound; the chain of them stands here, in order:

    ticks in flight < what a killed recorder loses < what each successor repeats < topic history
"""

from __future__ import annotations

from collections import deque

#: Ticks in flight, at most: published by the drive, not yet acknowledged by every consumer.
MAX_TICKS_IN_FLIGHT = 4
#: States that the recorder writes between two flushes, at most: what a kill can take from it.
MAX_STATES_UNFLUSHED = 8
_LOST = MAX_STATES_UNFLUSHED + MAX_TICKS_IN_FLIGHT + 1
_AHEAD = MAX_TICKS_IN_FLIGHT + 1
#: Ticks that a successor goes back, by node. It publishes again what a recorder that was killed as
#: well may have lost, and what the successor of whoever subscribes needs to go back as far.
TICKS_KEPT = {
    "microphone": _LOST,
    "law_server": _LOST,
    "follower": _LOST + _AHEAD,
    "cam_drive": _LOST + 2 * _AHEAD,
}
#: Ticks whose messages stay in the history of a topic: as far as the last node of that chain goes
#: back, and is ahead.
TICKS_IN_HISTORY = TICKS_KEPT["cam_drive"] + _AHEAD
#: Messages in the history of a topic: the rest of it is for those that are sent again. A node
#: discovered late still gets the first ticks.
HISTORY_DEPTH = 64
#: States that a node remembers, to know one that is sent again: two histories.
REMEMBERED_STATES = 2 * HISTORY_DEPTH
#: Blocks and states that wait for their counterpart: two histories as well.
MAX_WAITING = 2 * HISTORY_DEPTH


class FlowControl:
    """Counts the ticks sent and what each consumer has acknowledged.

    A consumer acknowledges with the stamp of the state that closed the tick.

    Parameters
    ----------
    consumers : names of those to wait for
    limit : most ticks in flight
    """

    def __init__(self, consumers: list[str], limit: int = MAX_TICKS_IN_FLIGHT) -> None:
        self._limit = limit
        self._acknowledged = dict.fromkeys(consumers, -1)
        self._sent: deque[int] = deque()

    @property
    def in_flight(self) -> int:
        """Ticks that a consumer has not acknowledged yet."""
        return max(0, len(self._sent) - 1)

    def is_in_flight(self, stamp_ns: int) -> bool:
        """Whether a state begins or ends a tick that a consumer has not acknowledged."""
        return self.in_flight > 0 and stamp_ns in self._sent

    def may_send(self) -> bool:
        """Whether the next state may go out."""
        return self.in_flight < self._limit

    def sent(self, stamp_ns: int) -> None:
        """Note a state that went out."""
        self._sent.append(stamp_ns)

    def acknowledge(self, consumer: str, stamp_ns: int) -> bool:
        """Note that a consumer has processed the tick that ended at a stamp, and all before.

        A stamp that is not in flight, or was acknowledged before, counts nothing: False. So does
        that of a consumer that is not waited for any longer.
        """
        known = self._acknowledged.get(consumer)
        if known is None or stamp_ns not in self._sent or stamp_ns <= known:
            return False
        self._acknowledged[consumer] = stamp_ns
        self._release()
        return True

    def drop(self, consumer: str) -> None:
        """Wait for a consumer no longer."""
        self._acknowledged.pop(consumer, None)
        self._release()

    def behind(self) -> list[str]:
        """The consumers that have not acknowledged every tick sent."""
        if self.in_flight == 0:
            return []
        return [name for name, stamp in self._acknowledged.items() if stamp < self._sent[-1]]

    def _release(self) -> None:
        slowest = min(self._acknowledged.values(), default=self._sent[-1] if self._sent else -1)
        while len(self._sent) > 1 and self._sent[1] <= slowest:
            self._sent.popleft()
