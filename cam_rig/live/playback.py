"""Playback buffer of a paced run: samples at a constant wall-clock rate.

The motion of a tick is known when the tick has ended. The playback is therefore one tick and a
margin behind the drive. It shows the samples at which the cam was one tick ago.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, FloatArray

#: Default time (s, wall clock) that the samples of a tick (time between two cam states) may arrive
#: late without a pause of the playback. It covers the time that drive, network and follower need
#: for a tick.
MARGIN_S = 0.03
#: Time (s, wall clock) over which the playback corrects a deviation from its intended delay behind
#: the drive. Ticks never arrive at an exactly constant rate.
SETTLE_S = 0.5
#: Largest delay (s, wall clock), in addition to half a tick (time between two cam states), that is
#: corrected gradually. After a larger delay samples are skipped: a viewer that starts late receives
#: several ticks at once.
MAX_GRADUAL_DELAY_S = 0.1


class Tick(NamedTuple):
    """Time between two cam states, with the samples `rows`, shape (6, n)."""

    start: CamState
    end: CamState
    rows: FloatArray


class PlaybackSamples(NamedTuple):
    """Samples of a tick to display: their indices, and display times (s, wall clock).

    A tick is the time between two cam states. Both arrays have shape (n,).
    """

    tick: Tick
    indices: NDArray[np.int64]
    wall_times: FloatArray


class Playback:
    """Buffer of finished ticks, which selects the samples to display at a time.

    A tick is the time between two cam states. The playback position is a rig time. Its rate is such
    that it reaches the end of the newest tick shortly (one margin) after the next tick is due. The
    displayed cam therefore turns as fast as the drive turns it at present, also if ticks become
    longer or shorter. The position never moves backwards.

    Parameters
    ----------
    sample_rate : int
        Sample rate in Hz.
    margin : float
        Time (s, wall clock) that a tick may be late without a pause of the playback.
    """

    def __init__(self, sample_rate: int, margin: float = MARGIN_S) -> None:
        self._sample_rate, self._margin = sample_rate, margin
        self._ticks: deque[Tick] = deque()
        #: Position (ns) at the wall-clock time `_since` (s), and its rate (ns per wall-clock s).
        self._position, self._since, self._rate = 0.0, 0.0, 0.0
        #: End of the newest tick (time between two cam states) in ns, wall-clock time (s) of its
        #: arrival, and real-time factor.
        self._end_ns, self._received_at, self._factor = 0, 0.0, 1.0
        self._last_sample = -1  # number in the run
        #: Number of changes of the stored ticks (times between two cam states). A result of
        #: `samples_at` is valid until the next change.
        self.version = 0
        #: Rig time (ns) of the follower sample that was displayed last, -1 before the first.
        self.shown_ns = -1
        #: Delay (s, wall clock) of the sample that was shown last behind the drive.
        self.lag = 0.0

    def clear(self) -> None:
        """Remove all ticks, at the start of a free run or of another run.

        A tick is the time between two cam states.
        """
        self._ticks.clear()
        self.version += 1

    def add(self, tick: Tick, factor: float, received_at: float, now: float) -> None:
        """Add the next finished tick.

        A tick is the time between two cam states.

        Parameters
        ----------
        tick : Tick
            Next finished tick.
        factor : float
            Real-time factor of the run.
        received_at, now : float
            Wall-clock times (s): arrival of the last state of the tick, and present time.
        """
        start, end = tick.start, tick.end
        interval = start.until(end)
        length = interval.duration
        if interval.acceleration == 0.0 and end.speed > 0.0:  # each tick turns by the same angle
            length *= start.speed / end.speed
        due = length / factor + self._margin
        natural = (end.time_ns - start.time_ns) / (length / factor)
        delay = max(0.0, due - (now - received_at))
        position = self.position(now)
        is_next = bool(self._ticks) and self._ticks[-1].end == start
        error = (end.time_ns - position) / natural - delay
        if not is_next or error > MAX_GRADUAL_DELAY_S + 0.5 * due:
            position, error = end.time_ns - delay * natural, 0.0
        if not is_next:
            self._ticks.clear()
        self._ticks.append(tick)
        self._position, self._since, self._end_ns = position, now, end.time_ns
        self._rate = natural * max(0.0, 1.0 + error / max(SETTLE_S, due))
        self._factor, self._received_at = factor, received_at
        self.version += 1
        self._drop_before(int(position))

    def position(self, now: float) -> float:
        """Return the playback position (ns) at wall-clock time `now` (s).

        It is at most the end of the newest tick. A tick is the time between two cam states.
        """
        return min(self._position + self._rate * (now - self._since), self._end_ns)

    def samples_at(self, wall_times: FloatArray) -> PlaybackSamples | None:
        """Return the samples to display at rising times (s, wall clock).

        All samples are of one tick. Samples that were displayed before are left out. Returns None
        if no sample remains. A tick is the time between two cam states.
        """
        if not self._ticks:
            return None
        positions = self._position + self._rate * (wall_times - self._since)
        positions = np.minimum(positions, self._end_ns).astype(np.int64)
        self._drop_before(int(positions[0]))
        tick = self._ticks[0]
        first = self._first_sample(tick)
        seconds, remainder = np.divmod(positions, NS)
        numbers = seconds * self._sample_rate + remainder * self._sample_rate // NS
        if len(self._ticks) == 1:
            numbers = np.minimum(numbers, first + tick.rows.shape[1] - 1)
        is_new = np.diff(numbers, prepend=-1) > 0
        is_new &= (numbers >= first) & (numbers > self._last_sample)
        is_new &= numbers < first + tick.rows.shape[1]
        if not is_new.any():
            return None
        return PlaybackSamples(tick, numbers[is_new] - first, wall_times[is_new])

    def record_shown(self, samples: PlaybackSamples, index: int) -> None:
        """Record that the sample at an index of `samples` is shown now."""
        self._last_sample = self._first_sample(samples.tick) + int(samples.indices[index])
        self.shown_ns = self._last_sample * NS // self._sample_rate
        remainder = (self._end_ns - self.shown_ns) / NS / self._factor
        self.lag = remainder + float(samples.wall_times[index]) - self._received_at

    def _drop_before(self, position: int) -> None:
        """Remove the ticks before that of the sample at a position (ns).

        A tick is the time between two cam states.
        """
        sample = position * self._sample_rate // NS
        while len(self._ticks) > 1 and self._first_sample(self._ticks[1]) <= sample:
            self._ticks.popleft()

    def _first_sample(self, tick: Tick) -> int:
        """Return the number of the first sample of a tick, counted over the whole run.

        A tick is the time between two cam states.
        """
        return -(-tick.start.time_ns * self._sample_rate // NS)
