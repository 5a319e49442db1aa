"""The last whole turn at each speed: what is laid over others, and what the results say."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.samples import NamedRows
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, to_rpm


@dataclass(frozen=True, eq=False)
class Turn(NamedRows):
    """One turn of a cam: unwrapped ``angle`` (rad) and ``(6, n)`` rows of its samples, named."""

    cam: str
    speed: float
    angle: FloatArray
    rows: FloatArray

    @property
    def rpm(self) -> float:
        """The cam's speed."""
        return to_rpm(self.speed)


class TurnCollector:
    """Keeps the newest turn, tick by tick."""

    def __init__(self, ticks_per_turn: int) -> None:
        self._ticks: deque[tuple[CamState, FloatArray, FloatArray]] = deque(maxlen=ticks_per_turn)

    def add(self, start: CamState, angle: FloatArray, rows: FloatArray) -> None:
        """Take the samples of the next tick."""
        last = self._ticks[-1][0] if self._ticks else start
        if (start.cam, start.speed) != (last.cam, last.speed):
            self._ticks.clear()
        self._ticks.append((start, angle, rows))

    def turn(self) -> Turn | None:
        """The newest turn, when a whole one has been seen since the speed changed."""
        if len(self._ticks) < (self._ticks.maxlen or 1):
            return None
        start, angles, rows = zip(*self._ticks, strict=True)
        state = start[0]
        return Turn(state.cam, state.speed, np.concatenate(angles), np.concatenate(rows, axis=1))


def sample_angles(start: CamState, end: CamState, time: FloatArray) -> FloatArray:
    """``(n,)`` unwrapped cam angles (rad) at ``time`` (s) in the tick from ``start`` to ``end``."""
    interval, since = start.until(end), time - start.time_ns / NS
    return start.unwrapped + since * (interval.speed + 0.5 * interval.acceleration * since)


def lift_offs(force: FloatArray, was_off: bool) -> FloatArray:
    """``(n,)`` True at the first sample of each loss of contact, where the force becomes zero."""
    off = force == 0.0
    return np.asarray(off & ~np.append(was_off, off[:-1]))
