"""Where a follower should rest at its lowest: the stretch in which residual vibration is read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.units import TURN

#: A piece whose ordinates differ by no more than this fraction of the lift is flat, ...
FLAT = 1e-12
#: ... and low where it is no higher than this fraction above the lowest ordinate: a spline through
#: readings that leaves its dwell may dip below it by part of their scatter.
LOW = 1e-3
#: In place of the low dwell of a law without one: this much (rad) about its lowest lift, as wide
#: as the low dwell of the paper's other laws here.
GRID = 3600
STAND_IN = float(np.radians(62.5))


@dataclass(frozen=True)
class LowDwell:
    """A stretch of the turn from ``start`` (rad), ``span`` wide; ``dwell`` says that it rests."""

    start: float
    span: float
    dwell: bool

    @property
    def middle(self) -> float:
        """Cam angle (rad) of its middle, in the turn."""
        return (self.start + 0.5 * self.span) % TURN

    def holds(self, angle: FloatArray) -> NDArray[np.bool_]:
        """Which cam angles (rad) lie inside, the end not among them."""
        return np.asarray((angle - self.start) % TURN < self.span * (1.0 - 1e-9))


def low_dwell(law: Law) -> LowDwell:
    """The longest run of pieces at the lowest lift, around the turn; else the stand-in."""
    lowest = float(law.ordinates.min())
    low = law.ordinates.max(axis=0) - lowest <= LOW * law.lift
    flat = low & (np.ptp(law.ordinates, axis=0) <= FLAT * law.lift)
    best = LowDwell(0.0, 0.0, True)
    count = flat.size
    for i in np.flatnonzero(flat & ~np.roll(flat, 1)):
        run = 1
        while flat[(i + run) % count] and run < count:
            run += 1
        span = float(sum(law.spans[(i + k) % count] for k in range(run)))
        if span > best.span:
            best = LowDwell(float(law.breaks[i]), span, True)
    if best.span > 0.0:
        return best
    angles = np.concatenate([law.breaks[:-1], np.linspace(0.0, TURN, GRID, endpoint=False)])
    middle = float(angles[np.argmin(law(angles))])
    return LowDwell((middle - 0.5 * STAND_IN) % TURN, STAND_IN, False)
