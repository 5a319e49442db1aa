"""Bringing blocks of samples and cam states together: they come on two topics, in any order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from cam_rig.dynamics import NS, FloatArray
from cam_rig.experiment.program import CamState


class TickPairing:
    """Gives each block with the states that its tick begins and ends with."""

    def __init__(self) -> None:
        self._states: deque[CamState] = deque()
        self._blocks: deque[FloatArray] = deque()

    def add_state(self, state: CamState) -> None:
        """Take the next state of the cam."""
        self._states.append(state)

    def add_block(self, rows: FloatArray) -> None:
        """Take the next block, ``(6, n)`` with rig time in s in its first row."""
        self._blocks.append(rows)

    def complete(self) -> Iterator[tuple[CamState, CamState, FloatArray]]:
        """Start, end and rows of every tick that is complete, in order; each is given once."""
        while self._blocks and len(self._states) > 1:
            times = self._blocks[0][0]
            middle = 0.5 * (times[0] + times[-1]) * NS
            if middle >= self._states[1].time_ns:
                self._states.popleft()
                continue
            rows = self._blocks.popleft()
            if middle >= self._states[0].time_ns:  # else from before we listened
                yield self._states[0], self._states[1], rows
