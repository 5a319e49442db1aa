"""How far the drive may run ahead: a bounded number of ticks in flight, none ever dropped.

Every buffer of the protocol follows from that bound; the chain of them stands here, in order:

    ticks in flight < what a killed recorder loses < what each successor repeats < topic history
"""

from __future__ import annotations

import math
import re
from collections import deque
from dataclasses import dataclass, field
from decimal import Decimal

from cam_rig.errors import ConfigError
from cam_rig.units import NS

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
    """Counts the ticks sent, and those acknowledged by each consumer with their closing stamps."""

    def __init__(self, consumers: list[str]) -> None:
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
        return self.in_flight < MAX_TICKS_IN_FLIGHT

    def sent(self, stamp_ns: int) -> None:
        """Note a state that went out."""
        self._sent.append(stamp_ns)

    def acknowledge(self, consumer: str, stamp_ns: int) -> bool:
        """Note a tick that a consumer has processed, and all before; False if it counts nothing."""
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


# Rig time against wall time: the real-time factor of a run.

#: Wall time (s) that a paced run may be late before it gives that time up and reports so.
MAX_LATENESS_S = 0.1
#: Least and greatest real-time factor.
FACTORS = (1e-3, 1e3)


def pacing_of(value: object) -> object:
    """The pacing that a bare number means, 20x for 20; anything else as it is."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"{Decimal(repr(value)):f}x" if math.isfinite(value) else str(value)
    is_number = isinstance(value, str) and re.fullmatch(r"\d+(?:\.\d+)?", value)
    return f"{value}x" if is_number else value


def factor_of(pacing: str) -> float | None:
    """Rig seconds a wall second: 1 for ``real_time``, N for ``Nx``, None for ``free``."""
    if pacing == "free":
        return None
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*[x×]", pacing)
    factor = 1.0 if pacing == "real_time" else float(found[1]) if found else 0.0
    if not FACTORS[0] <= factor <= FACTORS[1]:
        raise ConfigError(
            f"pacing: is {pacing!r}; allowed: free, real_time, or a factor of "
            f"{FACTORS[0]:g} to {FACTORS[1]:g} such as 20x"
        )
    return factor


@dataclass
class Pacing:
    """Delays each state until its rig time has come; what a late run has lost is not made up."""

    #: Rig seconds a wall second; None never waits.
    factor: float | None = None
    #: Wall time (s) given up at the last state; zero while the run is on time.
    late: float = 0.0
    _begin: tuple[int, float] | None = field(default=None, repr=False)
    _stands: bool = field(default=False, repr=False)

    def set(self, pacing: str) -> None:
        """Change the real-time factor from the next state on."""
        self.factor, self._begin, self.late = factor_of(pacing), None, 0.0

    def stand(self) -> None:
        """Hold the next state back no longer: its rig time comes when it is sent."""
        self._stands = True

    def wait(self, rig_ns: int, now: float) -> float:
        """Wall time (s) until the state at a rig time is due, seen from wall time ``now``."""
        if self.factor is None or self._begin is None or self._stands:
            return 0.0
        return max(0.0, self._due(rig_ns) - now)

    def reached(self, now: float) -> int | None:
        """Rig time (ns) come by wall time ``now``; None of a free run, or before a state."""
        if self.factor is None or self._begin is None:
            return None
        from_ns, wall = self._begin
        return from_ns + round((now - wall) * self.factor * NS)

    def sent(self, rig_ns: int, now: float) -> None:
        """Note that a state went out."""
        self.late = 0.0
        if self.factor is None:
            return
        if self._begin is None or self._stands:
            self._begin, self._stands = (rig_ns, now), False
        late = now - self._due(rig_ns)
        if late > MAX_LATENESS_S:
            self.late, self._begin = late, (rig_ns, now)

    def _due(self, rig_ns: int) -> float:
        assert self.factor is not None and self._begin is not None
        from_ns, wall = self._begin
        return wall + (rig_ns - from_ns) / NS / self.factor
