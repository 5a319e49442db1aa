"""How far the drive may run ahead: a bounded number of ticks in flight, none ever dropped."""

from __future__ import annotations

from collections import deque


class FlowControl:
    """Keeps account of the ticks sent and of what each consumer has dealt with.

    A consumer acknowledges with the stamp of the state that closed the tick.

    Parameters
    ----------
    consumers : names of those to wait for
    limit : most ticks in flight
    """

    def __init__(self, consumers: list[str], limit: int) -> None:
        self._limit = limit
        self._done = dict.fromkeys(consumers, -1)
        self._sent: deque[int] = deque()

    @property
    def in_flight(self) -> int:
        """Ticks that somebody has not dealt with yet."""
        return max(0, len(self._sent) - 1)

    def is_in_flight(self, stamp_ns: int) -> bool:
        """Whether a state begins or ends a tick that somebody has not dealt with."""
        return self.in_flight > 0 and stamp_ns in self._sent

    def may_send(self) -> bool:
        """Whether the next state may go out."""
        return self.in_flight < self._limit

    def sent(self, stamp_ns: int) -> None:
        """Note a state that went out."""
        self._sent.append(stamp_ns)

    def acknowledge(self, consumer: str, stamp_ns: int) -> bool:
        """Note that a consumer has dealt with the tick that ended at a stamp, and all before.

        A stamp that is not in flight, or was told before, is old news or no answer to this drive:
        it counts nothing, and False tells so.
        """
        if stamp_ns not in self._sent or stamp_ns <= self._done[consumer]:
            return False
        self._done[consumer] = stamp_ns
        slowest = min(self._done.values())
        while len(self._sent) > 1 and self._sent[1] <= slowest:
            self._sent.popleft()
        return True

    def behind(self) -> list[str]:
        """The consumers that have not dealt with every tick sent."""
        if self.in_flight == 0:
            return []
        return [name for name, done in self._done.items() if done < self._sent[-1]]
