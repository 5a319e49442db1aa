"""The follower's samples of a tick, joined with the cam that turned under them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import Interval
from cam_rig.dynamics.samples import NamedRows
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, to_rpm

#: Speeds nearer than this part of each other are one.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class TickSamples(NamedRows):
    """Samples ``(6, n)`` of one tick, rows as in `COLUMNS`, and θ, rpm and cam beside them.

    Parameters
    ----------
    start : the cam where the tick begins
    interval : how it turns from there; it may go on beyond the samples, never end before them
    """

    start: CamState
    interval: Interval
    rows: FloatArray

    @property
    def cam(self) -> str:
        """The mounted cam."""
        return self.start.cam

    @property
    def steady(self) -> bool:
        """Whether the speed is held, and not ramped."""
        return self.interval.acceleration == 0.0

    def is_of(self, cam: str | None, rpm: float | None) -> bool:
        """Whether it is of a cam (None: of any) at a speed that is held (None: or ramped)."""
        if cam is not None and cam != self.cam:
            return False
        return rpm is None or (self.steady and abs(to_rpm(self.start.speed) - rpm) <= SAME * rpm)

    @cached_property
    def _since(self) -> FloatArray:
        """Times since the tick began, s."""
        return self.time - self.interval.start_ns / NS

    @property
    def angle(self) -> FloatArray:
        """``(n,)`` cam angle with all its turns, rad."""
        return self.interval.unwrapped(self._since)

    @cached_property
    def angle_in_turn(self) -> FloatArray:
        """``(n,)`` cam angle in [0, 2π), rad: it has all its digits however long the cam turned."""
        i = self.interval
        angle = i.angle + self._since * (i.speed + 0.5 * i.acceleration * self._since)
        inside = angle - np.floor(angle / TURN) * TURN
        return np.where(inside < TURN, inside, 0.0)  # TURN itself by rounding

    def turned(self, rate: int) -> float:
        """Angle (rad) that the cam turned under the samples, which are at ``rate`` Hz.

        All of the interval's, unless that goes on beyond the samples.
        """
        part = self.time.size / self.interval.grid(rate).count
        return part * self.interval.mean_speed * self.interval.duration

    @property
    def rpm(self) -> FloatArray:
        """``(n,)`` cam speed, rpm."""
        return to_rpm(self.interval.speed + self.interval.acceleration * self._since)
