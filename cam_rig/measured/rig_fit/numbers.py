"""The numbers of a follower that a fit looks for: units, limits, and the follower of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.units import TURN, FloatArray

Follower = FollowerParameters | TwoMassParameters


@dataclass(frozen=True)
class Number:
    """A number of a rig file: its unit, its limits, and whether it is sought by its logarithm."""

    unit: str
    low: float
    high: float
    logarithm: bool = False


#: By their keys in a rig file.
NUMBERS = {
    "mass": Number("kg", 1e-6, 1e6, logarithm=True),
    "spring_stiffness": Number("N/m", 1e-6, 1e12, logarithm=True),
    "preload": Number("N", 0.0, 1e9),
    "damping": Number("N*s/m", 0.0, 1e9),
    "restitution": Number("1", 0.0, 0.95),
    "stem_stiffness": Number("N/m", 1.0, 1e15, logarithm=True),
    "roller_share": Number("1", 0.01, 0.99),
    "stem_damping": Number("N*s/m", 0.0, 1e9),
}

ONE_MASS = ("mass", "spring_stiffness", "preload", "damping", "restitution")

TWO_MASSES = (*ONE_MASS, "stem_stiffness", "roller_share", "stem_damping")

#: Those that one rigid mass has not.
OF_TWO = ("roller_share", "stem_damping")


def require_in_model(given: Mapping[str, float], model: str | None) -> None:
    """Refuse numbers that no follower has, or not one of the model that is asked for."""
    for name, value in given.items():
        limits = NUMBERS[name]
        if not limits.low <= value <= limits.high:
            raise ConfigError(
                f"{name}: {value:g} {limits.unit} is given; allowed: from {limits.low:g} to "
                f"{limits.high:g} {limits.unit}"
            )
    if model != "two_mass" and (odd := [name for name in given if name in OF_TWO]):
        raise ConfigError(
            f"{odd[0]}: is given, a number of two masses and a stem; allowed with --model two_mass"
        )


def follower_of(values: dict[str, float], stem_stiffness: float | None) -> Follower:
    """The follower of some numbers: two masses where they say how the mass splits.

    ``stem_stiffness`` (N/m) is that of one mass, which only a landing's pulse feels.
    """
    v = values
    if "roller_share" not in v:
        spring = v["spring_stiffness"], v["damping"], v["preload"]
        return FollowerParameters(v["mass"], *spring, stem_stiffness, v["restitution"])
    roller = v["roller_share"] * v["mass"]
    names = ("stem_stiffness", "spring_stiffness", "stem_damping", "damping", "preload")
    others = (v[name] for name in (*names, "restitution"))
    return TwoMassParameters(roller, v["mass"] - roller, *others)


def to_search(name: str, value: float) -> float:
    """The number as it is sought."""
    return float(np.log(value)) if NUMBERS[name].logarithm else value


def from_search(name: str, x: float) -> float:
    """What is sought as a number of the rig."""
    return float(np.exp(x)) if NUMBERS[name].logarithm else x


def slope(name: str, value: float) -> float:
    """The number's change with what is sought."""
    return value if NUMBERS[name].logarithm else 1.0


def search_limits(names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest of what is sought, ``(n,)`` each."""
    low = [to_search(name, NUMBERS[name].low) for name in names]
    return np.array(low), np.array([to_search(name, NUMBERS[name].high) for name in names])


# The numbers of the instruments, which are found beside those of the follower.

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
