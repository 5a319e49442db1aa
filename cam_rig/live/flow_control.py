"""Flow control of the drive: limit of ticks in flight, and wall-clock pacing.

A tick is in flight until every consumer has acknowledged it. The limit bounds every queue of the
protocol: a topic has one message per tick, so a history of `HISTORY_DEPTH` messages never
overflows.
"""

from __future__ import annotations

import math
import re
from collections import Counter, deque
from dataclasses import dataclass, field
from decimal import Decimal

from cam_rig.errors import ConfigError
from cam_rig.units import NS

#: Largest number of ticks (times between two cam states) that the drive has published and that not
#: every consumer has acknowledged.
MAX_TICKS_IN_FLIGHT = 4
#: Maximum number of states that the recorder writes between two flushes; a kill can lose them.
MAX_STATES_UNFLUSHED = 8
#: Number of messages in the history of a topic. A node that is discovered late still receives the
#: first ticks, of which there are at most `MAX_TICKS_IN_FLIGHT`. The remaining messages are a
#: margin for changes of cam and speed.
HISTORY_DEPTH = 64
#: Maximum number of cam states, or of blocks of samples, that a node stores until the message on
#: the other topic arrives: two histories.
MAX_WAITING = 2 * HISTORY_DEPTH


class FlowControl:
    """Stamps of the cam states in flight, and the last stamp of each consumer.

    A stamp is the rig time (ns) of a state. A state is in flight until every consumer has
    acknowledged it.
    """

    def __init__(self, consumers: list[str]) -> None:
        self._acknowledged = dict.fromkeys(consumers, -1)
        self._sent: deque[int] = deque()

    @property
    def in_flight(self) -> int:
        """Number of ticks that at least one consumer has not acknowledged.

        A tick is the time between two cam states.
        """
        return max(0, len(self._sent) - 1)

    def may_send(self) -> bool:
        """Return True if the next cam state may be sent.

        It must wait while too many ticks are not acknowledged. A tick is the time between two cam
        states.
        """
        return self.in_flight < MAX_TICKS_IN_FLIGHT

    def record_sent(self, stamp_ns: int) -> None:
        """Record that the cam state with a stamp (rig time, ns) was sent."""
        self._sent.append(stamp_ns)

    def acknowledge(self, consumer: str, stamp_ns: int) -> bool:
        """Record that a consumer has processed all ticks up to a stamp (ns).

        Returns False, without an effect, if the consumer is unknown, no state of this stamp is in
        flight, or the stamp is acknowledged already. A tick is the time between two cam states.
        """
        previous = self._acknowledged.get(consumer)
        if previous is None or stamp_ns not in self._sent or stamp_ns <= previous:
            return False
        self._acknowledged[consumer] = stamp_ns
        self._release()
        return True

    def drop(self, consumer: str) -> None:
        """Stop waiting for the acknowledgements of a consumer."""
        self._acknowledged.pop(consumer, None)
        self._release()

    def behind(self) -> list[str]:
        """Return the names of the consumers that have not acknowledged every tick.

        A tick is the time between two cam states.
        """
        if self.in_flight == 0:
            return []
        return [name for name, stamp in self._acknowledged.items() if stamp < self._sent[-1]]

    def _release(self) -> None:
        slowest = min(self._acknowledged.values(), default=self._sent[-1] if self._sent else -1)
        while len(self._sent) > 1 and self._sent[1] <= slowest:
            self._sent.popleft()


# Real-time factor of a run: rig seconds per wall-clock second.

#: Longest delay (s, wall clock) of a state that a paced run makes up by sending the next states
#: sooner. A longer delay is reported as lost time, and the run continues from there.
MAX_LATENESS_S = 0.1
#: Smallest real-time factor that can be requested. `MAX_FACTOR` is the largest.
MIN_FACTOR = 1e-3
MAX_FACTOR = 1e3


def pacing_of(value: object) -> object:
    """Convert a bare number to a pacing, such as 20 to "20x".

    Other values are returned unchanged.
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"{Decimal(repr(value)):f}x" if math.isfinite(value) else str(value)
    is_number = isinstance(value, str) and re.fullmatch(r"\d+(?:\.\d+)?", value)
    return f"{value}x" if is_number else value


def factor_of(pacing: str) -> float | None:
    """Return the real-time factor: 1 for "real_time", N for "Nx", None for "free".

    Raises
    ------
    ConfigError
        If the text is not a pacing, or the factor is not between `MIN_FACTOR` and `MAX_FACTOR`.
    """
    if pacing == "free":
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*[x×]", pacing)
    factor = 1.0 if pacing == "real_time" else float(match[1]) if match else 0.0
    if not MIN_FACTOR <= factor <= MAX_FACTOR:
        raise ConfigError(
            f"pacing must be free, real_time, or a factor between {MIN_FACTOR:g} and "
            f"{MAX_FACTOR:g} such as 20x, got {pacing!r}"
        )
    return factor


@dataclass
class Pacing:
    """Real-time pacing: computes the wall-clock time at which each state is due."""

    #: Real-time factor of the run, None for a free run, which never waits.
    factor: float | None = None
    #: Time (s, wall clock) that was lost at the last cam state because it was sent too late, 0
    #: while the run is on time.
    late: float = 0.0
    #: Rig time (ns) and wall-clock time (s) of the same moment, from which the times of all states
    #: are computed.
    _reference: tuple[int, float] | None = field(default=None, repr=False)
    _is_paused: bool = field(default=False, repr=False)

    def set(self, pacing: str) -> None:
        """Set the pacing (``free``, ``real_time`` or a factor such as ``20x``) of a run.

        It applies from the next cam state on.
        """
        self.factor, self._reference, self.late = factor_of(pacing), None, 0.0

    def pause(self) -> None:
        """Stop rig time until the next cam state is sent, which is then due at once."""
        self._is_paused = True

    def wait(self, rig_ns: int, now: float) -> float:
        """Return the time (s) from `now` (wall clock) until a cam state is due.

        `rig_ns` is the rig time of the state in ns. The result is 0 in a free run, before the first
        state and after a pause.
        """
        if self.factor is None or self._reference is None or self._is_paused:
            return 0.0
        return max(0.0, self._due(rig_ns) - now)

    def rig_time_ns(self, now: float) -> int | None:
        """Return the rig time (ns) at wall-clock time `now` (s).

        Returns None in a free run and before the first state.
        """
        if self.factor is None or self._reference is None:
            return None
        reference_ns, wall = self._reference
        return reference_ns + round((now - wall) * self.factor * NS)

    def record_sent(self, rig_ns: int, now: float) -> None:
        """Record that a cam state was sent at wall-clock time `now` (s).

        `rig_ns` is the rig time of the state in ns.
        """
        self.late = 0.0
        if self.factor is None:
            return
        if self._reference is None or self._is_paused:
            self._reference, self._is_paused = (rig_ns, now), False
        late = now - self._due(rig_ns)
        if late > MAX_LATENESS_S:
            self.late, self._reference = late, (rig_ns, now)

    def _due(self, rig_ns: int) -> float:
        """Return the wall-clock time (s) at which a cam state is due.

        `rig_ns` is the rig time of the state in ns.
        """
        assert self.factor is not None and self._reference is not None
        reference_ns, wall = self._reference
        return wall + (rig_ns - reference_ns) / NS / self.factor


#: Period (s, wall clock) over which the real-time factor of a run is compared with the requested.
PACE_WINDOW_S = 10.0
#: Shortest duration (s, wall clock) over which the real-time factor is compared once more at the
#: end of a run.
MIN_PACE_WINDOW_S = 2.0
#: Largest fraction of the requested real-time factor that a run may lose without a warning.
MAX_LOST = 0.1


class LostTime:
    """Wall-clock time that a paced run lost since the last report, and the slow nodes.

    A paced run has a requested real-time factor. `start` is the wall-clock time (s) from which lost
    time is counted.
    """

    def __init__(self, start: float) -> None:
        self._start, self._lost = start, 0.0
        self._waits = Counter[str]()

    def add(self, late: float) -> None:
        """Add the delay (s, wall clock) of a published cam state, `Pacing.late`.

        A run that is paced by the clock cannot make up this delay, so it counts as lost.
        """
        self._lost += late

    def count_wait(self, node: str) -> None:
        """Count a moment at which a due cam state cannot be sent because of a node."""
        self._waits[node] += 1

    def text(self, factor: float, now: float, window: float) -> str:
        """Return a warning if the run lost more than `MAX_LOST`, else an empty text.

        `factor` is the requested real-time factor and `now` the wall-clock time (s). The text is
        empty before `window` (s) since the last report. Then counting starts again.
        """
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
