"""Errors of the measuring instruments as search variables of a fit.

They follow the follower's parameters in the vector of search variables: one phase and one speed
error per steady-speed segment, then the errors that all segments share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cam_rig.laws import Law
from cam_rig.units import TURN, FloatArray

#: Key of the relative error of the sensors' clock, in ppm.
CLOCK = "clock"
#: Key of the zero offset of the lift gauge, in m.
ZERO = "zero"
#: Key of the backlash of the lift gauge, in m.
BACKLASH = "backlash"
#: Key of the zero offset of the force sensor, in N.
FORCE_ZERO = "force_zero"
#: Key of the natural frequency of the force sensor. Its search variable is the natural logarithm of
#: the frequency in Hz.
RESONANCE = "sensor_frequency"
#: Key of the damping ratio of the force sensor's resonance, dimensionless.
RATIO = "sensor_damping"
#: Keys of the instrument errors that all steady-speed segments share, in the order of the search
#: variables.
SHARED = (CLOCK, ZERO, BACKLASH, FORCE_ZERO, RESONANCE, RATIO)


@dataclass(frozen=True)
class Instruments:
    """Positions of the instrument errors in the vector of search variables of a fit.

    ``first`` is the number of free parameters of the follower, which come first. ``segments`` is
    the number of steady-speed segments. ``single`` are the keys of the free errors that all
    segments share.
    """

    first: int
    segments: int
    single: tuple[str, ...]

    @property
    def phases(self) -> slice:
        """Slice of the phases: one per steady-speed segment, in rad.

        A phase is the difference between the cam angle and the encoder's angle.
        """
        return slice(self.first, self.first + self.segments)

    @property
    def speeds(self) -> slice:
        """Slice of the speed errors: one per steady-speed segment, in standard errors."""
        return slice(self.first + self.segments, self.first + 2 * self.segments)

    @cached_property
    def index(self) -> dict[str, int]:
        """Index among the search variables of each free error of `SHARED`, by its key."""
        return {name: self.speeds.stop + i for i, name in enumerate(self.single)}

    @property
    def size(self) -> int:
        """Number of search variables: the follower's parameters and instrument errors."""
        return self.first + 2 * self.segments + len(self.single)


#: Cam angles (rad) of the table of the last direction of the lift, which decides the side of the
#: gauge's backlash.
SIDE_ANGLES = np.linspace(0.0, TURN, 4097)
#: Largest |s'| that counts as a dwell, relative to the maximum of |s'| over the turn.
MIN_SLOPE_FRACTION = 1e-6


def backlash_side(law: Law, angle: FloatArray) -> FloatArray:
    """Return the direction of the gauge's backlash at cam angles (rad), ``(n,)``.

    It is 1 if the last motion of the lift was a rise, and -1 if it was a fall.
    """
    slope = law.motion_at(SIDE_ANGLES)[1]
    moving = np.abs(slope) > MIN_SLOPE_FRACTION * np.abs(slope).max()
    last = np.maximum.accumulate(np.where(moving, np.arange(slope.size), -1))
    last = np.where(last < 0, np.flatnonzero(moving)[-1], last)
    return np.asarray(np.sign(slope[last])[np.searchsorted(SIDE_ANGLES, np.mod(angle, TURN)) - 1])
