"""The ticks of a paced run as people see them: each while the next one turns, evenly in wall time.

A tick's motion is known when the tick is over. So what is shown is a tick behind the drive, and a
margin: at each moment where the cam was a tick ago, by its samples and their own rig time.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, FloatArray

#: Of /joint_states and the like: drive, network and follower at work.
MARGIN_S = 0.03
#: Wall time (s) in which what is shown returns to its place: ticks never come quite evenly.
SETTLE_S = 0.5
#: Wall time (s), beside half a tick, that is caught up; of what is farther behind a part is left
#: out. A viewer that starts late receives several ticks at once.
CAUGHT_UP_S = 0.1


class Tick(NamedTuple):
    """A tick between two states of the cam, with its samples ``(6, n)``."""

    start: CamState
    end: CamState
    rows: FloatArray


class Shown(NamedTuple):
    """Samples of a tick ``(n,)``, counted from 0, and the wall times (s) at which to show them."""

    tick: Tick
    samples: NDArray[np.int64]
    walls: FloatArray


class Playback:
    """What to show of the finished ticks at a wall time.

    The position, a rig time, moves at the rate at which it comes to the newest tick's end when the
    next tick is due, and a margin later. The cam so seems to turn as fast as the drive turns it
    now, also where ticks become longer or shorter. It never goes back. ``margin`` is the wall time
    (s) that a tick may come late without a pause.
    """

    def __init__(self, sample_rate: int, margin: float = MARGIN_S) -> None:
        self._sample_rate, self._margin = sample_rate, margin
        self._ticks: deque[Tick] = deque()
        #: Position (ns) at a wall time (s), and its rate (ns of rig time a wall second).
        self._position, self._since, self._rate = 0.0, 0.0, 0.0
        #: Of the newest tick: its end (ns), and the wall time (s) at which that came.
        self._end_ns, self._came, self._factor = 0, 0.0, 1.0
        self._shown = -1
        #: Counts the ticks that were added: what was looked up ahead holds until the next.
        self.version = 0
        #: Rig time (ns) that was shown last, and how far it was behind the drive, at its pace, in
        #: wall time (s).
        self.shown_ns, self.lag = -1, 0.0

    def clear(self) -> None:
        """Forget all ticks: what follows is not shown evenly, or begins anew."""
        self._ticks.clear()
        self.version += 1

    def add(self, tick: Tick, factor: float, came: float, now: float) -> None:
        """Take the next finished tick, whose last state came at ``came`` (s of wall time)."""
        start, end = tick.start, tick.end
        interval = start.until(end)
        length = interval.duration
        if interval.acceleration == 0.0 and end.speed > 0.0:  # each tick turns by the same angle
            length *= start.speed / end.speed
        due = length / factor + self._margin
        natural = (end.time_ns - start.time_ns) / (length / factor)
        wanted = max(0.0, due - (now - came))
        position = self.position(now)
        follows = bool(self._ticks) and self._ticks[-1].end == start
        error = (end.time_ns - position) / natural - wanted
        if not follows or error > CAUGHT_UP_S + 0.5 * due:
            position, error = end.time_ns - wanted * natural, 0.0
        if not follows:
            self._ticks.clear()
        self._ticks.append(tick)
        self._position, self._since, self._end_ns = position, now, end.time_ns
        self._rate = natural * max(0.0, 1.0 + error / max(SETTLE_S, due))
        self._factor, self._came = factor, came
        self.version += 1
        self._drop_shown(int(position))

    def position(self, now: float) -> float:
        """Rig time (ns) that is shown at a wall time (s): the newest tick's end at most."""
        return min(self._position + self._rate * (now - self._since), self._end_ns)

    def ahead(self, walls: FloatArray) -> Shown | None:
        """What to show at rising wall times (s) of one tick, each sample once; None: nothing."""
        if not self._ticks:
            return None
        positions = self._position + self._rate * (walls - self._since)
        positions = np.minimum(positions, self._end_ns).astype(np.int64)
        self._drop_shown(int(positions[0]))
        tick = self._ticks[0]
        first = self._first_sample(tick)
        seconds, rest = np.divmod(positions, NS)
        numbers = seconds * self._sample_rate + rest * self._sample_rate // NS
        if len(self._ticks) == 1:
            numbers = np.minimum(numbers, first + tick.rows.shape[1] - 1)
        is_new = np.diff(numbers, prepend=-1) > 0
        is_new &= (numbers >= first) & (numbers > self._shown)
        is_new &= numbers < first + tick.rows.shape[1]
        if not is_new.any():
            return None
        return Shown(tick, numbers[is_new] - first, walls[is_new])

    def note_shown(self, shown: Shown, place: int) -> None:
        """Note that what stands at a place is shown now."""
        wall = float(shown.walls[place])
        self._shown = self._first_sample(shown.tick) + int(shown.samples[place])
        self.shown_ns = self._shown * NS // self._sample_rate
        behind = (self._end_ns - self.shown_ns) / NS / self._factor
        self.lag = behind + wall - self._came

    def _drop_shown(self, position: int) -> None:
        """Drop the ticks before the one that has the sample of a position (ns)."""
        sample = position * self._sample_rate // NS
        while len(self._ticks) > 1 and self._first_sample(self._ticks[1]) <= sample:
            self._ticks.popleft()

    def _first_sample(self, tick: Tick) -> int:
        """By its number in the run's one grid of samples."""
        return -(-tick.start.time_ns * self._sample_rate // NS)
