"""Errors of the instruments as search variables, after those of the follower."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cam_rig.laws import Law
from cam_rig.units import TURN, FloatArray

#: Key of the relative error of the sensors' clock, ppm.
CLOCK = "clock"
#: Key of the zero offset of the lift gauge, m.
ZERO = "zero"
#: Key of the backlash of the lift gauge, m.
BACKLASH = "backlash"
#: Key of the zero offset of the force sensor, N.
FORCE_ZERO = "force_zero"
#: Key of the natural frequency of the force sensor. Its search variable is the logarithm of the
#: frequency in Hz.
RESONANCE = "sensor_frequency"
#: Key of the damping ratio of the force sensor.
RATIO = "sensor_damping"
#: Keys of the instrument errors that all segments share, in the order of the search variables.
SHARED = (CLOCK, ZERO, BACKLASH, FORCE_ZERO, RESONANCE, RATIO)


@dataclass(frozen=True)
class Instruments:
    """Positions of the instruments' errors among the search variables.

    They follow the ``first`` parameters of the follower. ``single`` are the names of the errors
    that all segments share.
    """

    first: int
    segments: int
    single: tuple[str, ...]

    @property
    def phases(self) -> slice:
        """Slice of the segments' phases (rad) among the search variables."""
        return slice(self.first, self.first + self.segments)

    @property
    def speeds(self) -> slice:
        """Slice of the segments' speed errors, in their standard errors."""
        return slice(self.first + self.segments, self.first + 2 * self.segments)

    @cached_property
    def index(self) -> dict[str, int]:
        """Index of each free error of `SHARED` among the search variables."""
        return {name: self.speeds.stop + i for i, name in enumerate(self.single)}

    @property
    def size(self) -> int:
        """Number of all search variables, including the follower's parameters."""
        return self.first + 2 * self.segments + len(self.single)


#: Cam angles (rad) at which the side of a backlash is computed.
SIDE_ANGLES = np.linspace(0.0, TURN, 4097)
#: Largest |s'| of a dwell, relative to the maximum of |s'|.
MIN_SLOPE_FRACTION = 1e-6


def backlash_side(law: Law, angle: FloatArray) -> FloatArray:
    """Return the side on which backlash of the gauge is taken up, at cam angles (rad).

    It is 1 after a rise and -1 after a fall.
    """
    slope = law.motion_at(SIDE_ANGLES)[1]
    moving = np.abs(slope) > MIN_SLOPE_FRACTION * np.abs(slope).max()
    last = np.maximum.accumulate(np.where(moving, np.arange(slope.size), -1))
    last = np.where(last < 0, np.flatnonzero(moving)[-1], last)
    return np.asarray(np.sign(slope[last])[np.searchsorted(SIDE_ANGLES, np.mod(angle, TURN)) - 1])
