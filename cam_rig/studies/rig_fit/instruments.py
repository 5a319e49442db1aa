"""The numbers of the instruments, which are found beside those of the follower."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.units import TURN

#: Errors of the instruments: of the sensors' clock (ppm), the lift's zero and backlash (m), the
#: force's zero (N), a resonance of the force sensor (logarithm of its frequency in Hz, and damping
#: ratio).
CLOCK, ZERO, BACKLASH, TARE, RESONANCE, RATIO = SINGLE = (
    *("clock", "zero", "backlash", "force_zero"),
    *("sensor_frequency", "sensor_damping"),
)

#: Cam angles (rad) at which the side of a play is known; a cam slower than this part stands still.
SIDES, STILL = np.linspace(0.0, TURN, 4097), 1e-6


@dataclass(frozen=True)
class Instruments:
    """Where the numbers of the instruments stand behind those of the follower.

    ``first`` is how many those are, ``single`` the names of what there is once for all holds.
    """

    first: int
    holds: int
    single: tuple[str, ...]

    @property
    def phases(self) -> slice:
        """Of each hold, rad."""
        return slice(self.first, self.first + self.holds)

    @property
    def speeds(self) -> slice:
        """Of each hold: how far its speed is off, in standard errors of the encoder's."""
        return slice(self.first + self.holds, self.first + 2 * self.holds)

    def at(self, name: str) -> int | None:
        """Where one of `SINGLE` stands; None where it is not sought."""
        if name not in self.single:
            return None
        return self.first + 2 * self.holds + self.single.index(name)

    @property
    def size(self) -> int:
        """How many numbers there are, the follower's among them."""
        return self.first + 2 * self.holds + len(self.single)


def side_of(law: Law, angle: FloatArray) -> FloatArray:
    """1 after a rise and -1 after a fall at cam angles (rad): where play is taken up."""
    slope = law.motion_at(SIDES)[1]
    moving = np.abs(slope) > STILL * np.abs(slope).max()
    last = np.maximum.accumulate(np.where(moving, np.arange(slope.size), -1))
    last = np.where(last < 0, np.flatnonzero(moving)[-1], last)
    return np.asarray(np.sign(slope[last])[np.searchsorted(SIDES, np.mod(angle, TURN)) - 1])
