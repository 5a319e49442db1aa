"""Matching blocks of samples with cam states: they come on two topics, in any order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import Samples
from cam_rig.errors import RefusedError
from cam_rig.live.flow_control import MAX_WAITING
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS


class TickMatcher:
    """Yields each block with the states that its tick begins and ends with, each tick once.

    Parameters
    ----------
    sample_rate : Hz; a block without its tick's samples is refused, and no tick left out. None
        takes any block, and leaves ticks out that have none.
    since : rig time (ns); ticks that begin earlier were done by a predecessor
    """

    def __init__(self, sample_rate: int | None = None, since: int = 0) -> None:
        self._sample_rate, self._since = sample_rate, since
        self._began = since > 0
        self._states: deque[CamState] = deque(maxlen=MAX_WAITING)
        self._blocks: deque[FloatArray] = deque(maxlen=MAX_WAITING)

    def add_state(self, state: CamState) -> None:
        """Take the next state of the cam."""
        if state.time_ns >= self._since:
            self._states.append(state)
        if state.speed == 0.0:  # the next sequence may begin at any time
            self._since = 0

    def add_block(self, rows: FloatArray) -> None:
        """Take the next block, ``(6, n)`` with rig time in s in its first row."""
        self._blocks.append(rows)

    def complete(self) -> Iterator[tuple[CamState, CamState, FloatArray]]:
        """Start, end and rows of every tick that is complete, in order, each once.

        Raises
        ------
        RefusedError : a block is not of its tick; raised after the ticks that are complete
        """
        refused = None
        while self._blocks and len(self._states) > 1:
            start, end, rows = self._states[0], self._states[1], self._blocks[0]
            times = Samples(rows).time
            middle = 0.5 * (times[0] + times[-1]) * NS
            later = middle >= end.time_ns
            if not start.turns_until(end) or (later and self._may_skip):
                self._states.popleft()  # the cam stood, or this tick has no block
                continue
            if later:
                refused = refused or self._refusal(start, rows)
            self._blocks.popleft()
            if later or middle < start.time_ns:
                continue  # from before the subscription, or sent again
            if self._fits(start, end, rows):
                self._states.popleft()
                self._began = True
                yield start, end, rows
            else:
                refused = refused or self._refusal(start, rows)
        if refused is not None:
            raise refused

    @property
    def _may_skip(self) -> bool:
        """Whether a tick may lack its block: on joining late, or where blocks were lost."""
        return self._sample_rate is None or not self._began

    def _fits(self, start: CamState, end: CamState, rows: FloatArray) -> bool:
        if self._sample_rate is None:
            return True
        grid = start.until(end).grid(self._sample_rate)
        times = start.time_ns / NS + grid.since_start()
        return rows.shape[1] == grid.count and bool(np.abs(Samples(rows).time - times).max() < 1e-6)

    def _refusal(self, start: CamState, rows: FloatArray) -> RefusedError:
        times = Samples(rows).time
        return RefusedError(
            f"follower samples: {times.size} from {times[0]:.6f} s on; allowed: the samples "
            f"of the tick that begins at {start.time_ns / NS:.6f} s"
        )
