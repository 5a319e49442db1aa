"""Flow control of the drive: a bounded number of ticks in flight, and pacing in wall-clock time.

The bound makes every queue of the protocol bounded: a topic has one message per tick, so that a
history of `HISTORY_DEPTH` messages never overflows.
"""

from __future__ import annotations

import math
import re
from collections import Counter, deque
from dataclasses import dataclass, field
from decimal import Decimal

from cam_rig.errors import ConfigError
from cam_rig.units import NS

#: Maximum number of ticks published by the drive and not yet acknowledged by every consumer.
MAX_TICKS_IN_FLIGHT = 4
#: Maximum number of states that the recorder writes between two flushes; a kill can lose them.
MAX_STATES_UNFLUSHED = 8
#: Messages in the history of a topic. A node that is discovered late still receives the first
#: ticks, which are at most `MAX_TICKS_IN_FLIGHT`; the rest is margin for cam and speed changes.
HISTORY_DEPTH = 64
#: Maximum number of blocks and states that wait for their counterpart: two histories.
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


#: Duration (s, wall clock) over which the pace of a run is compared with the requested one.
PACE_WINDOW_S = 10.0
#: Shortest duration (s, wall clock) for this comparison at the end of a run.
MIN_PACE_WINDOW_S = 2.0
#: Fraction of the requested real-time factor that a run may lose without a warning.
MAX_LOST = 0.1


class LostTime:
    """Wall-clock time that a paced run has given up in a window, and the nodes it waited for.

    `start` is the wall-clock time (s) at which the first window starts.
    """

    def __init__(self, start: float) -> None:
        self._start, self._lost = start, 0.0
        self._waits = Counter[str]()

    def add(self, late: float) -> None:
        """Add the time (s) given up at a state, `Pacing.late`."""
        self._lost += late

    def count_wait(self, node: str) -> None:
        """Count a sample of the time in which a due state waits for a node."""
        self._waits[node] += 1

    def text(self, factor: float, now: float, window: float) -> str:
        """Return a warning at the end of a window (s) in which much time was lost, else ""."""
        duration = now - self._start
        if duration < window:
            return ""
        achieved = factor * max(0.0, 1.0 - self._lost / duration)
        names = [name for name, _ in self._waits.most_common()]
        is_slow = achieved < (1.0 - MAX_LOST) * factor
        self._start, self._lost = now, 0.0
        self._waits.clear()
        if not is_slow:
            return ""
        waited_for = f"waiting for {', '.join(names)}" if names else "the drive itself is too slow"
        return (
            f"real-time factor {achieved:.3g} instead of {factor:g} in the last {duration:.0f} s: "
            f"{waited_for}; set a lower pacing, or reduce the load of this machine"
        )
