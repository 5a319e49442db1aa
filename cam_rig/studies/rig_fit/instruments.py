"""The numbers of the instruments, which are found beside those of the follower."""

from __future__ import annotations

from dataclasses import dataclass

#: Errors of the instruments: of the sensors' clock (ppm), the lift's zero and backlash (m), a
#: resonance of the force sensor (logarithm of its frequency in Hz, and damping ratio).
CLOCK, ZERO, BACKLASH, RESONANCE, RATIO = SINGLE = (
    *("clock", "zero", "backlash"),
    *("sensor_frequency", "sensor_damping"),
)


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
