"""A sound-level meter to IEC 61672-1, class 1: weightings A, C, Z and F, S, and its range.

The filters are PyOctaveBand's; they carry their state, so a signal reads the same however it is
cut into blocks. Class 1 holds up to 20 kHz from a sample rate of 96 kHz on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from cam_rig.acoustics.level import REFERENCE_PRESSURE, pressure_pa
from cam_rig.dynamics import FloatArray
from cam_rig.errors import ConfigError, RefusedError

#: Frequency weightings of the standard.
FREQUENCY_WEIGHTINGS = ("A", "C", "Z")
#: Time weightings, and what the library calls them: time constants of 125 ms and 1 s.
TIME_WEIGHTINGS = {"F": "fast", "S": "slow"}
#: Range in dB of the paper's meter, a JTS-1357.
RANGE = (30.0, 130.0)
#: Silence reads as this level, dB.
SILENCE = -200.0


@dataclass(frozen=True)
class Reading:
    """What the meter shows for one block, in dB re 20 µPa.

    ``level`` is the time-weighted sound level, energy-averaged over the block: in a steady sound
    of whole turns that is its equivalent level, whichever cam angle a block ends at. ``at_end``
    and ``highest`` are the time-weighted level at the block's end and its maximum,
    ``equivalent`` is Leq over the block. ``overload``: the unweighted pressure went beyond a sine
    at the top of the range; ``under_range``: the level is below its bottom.
    """

    level: float
    at_end: float
    highest: float
    equivalent: float
    overload: bool
    under_range: bool


@dataclass
class SoundLevelMeter:
    """Blocks of sound pressure in, readings out.

    Parameters
    ----------
    rate : Hz, of the pressure samples
    frequency_weighting : A, C or Z
    time_weighting : F (125 ms) or S (1 s)
    span : range in dB; a level outside it is shown with a flag

    Raises
    ------
    ConfigError : a weighting that the standard does not have
    """

    rate: int
    frequency_weighting: str = "Z"
    time_weighting: str = "F"
    span: tuple[float, float] = RANGE
    _energy: float = field(default=0.0, init=False)
    _samples: int = field(default=0, init=False)
    _highest: float = field(default=SILENCE, init=False)
    _overload: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        _require("frequency_weighting", self.frequency_weighting, FREQUENCY_WEIGHTINGS)
        _require("time_weighting", self.time_weighting, TIME_WEIGHTINGS)
        # scipy.signal comes with it: a second of imports, which only who listens should pay
        from pyoctaveband import TimeWeighting as Ballistics
        from pyoctaveband import WeightingFilter

        self._filter = WeightingFilter(self.rate, self.frequency_weighting, stateful=True)
        self._ballistics = Ballistics(self.rate, TIME_WEIGHTINGS[self.time_weighting])

    def read(self, pressure: FloatArray) -> Reading:
        """The reading for the next samples, ``(n,)`` in Pa.

        Raises
        ------
        RefusedError : a sample that is no number; the meter is as it was
        """
        if pressure.size == 0:
            raise ValueError("a block must hold at least one sample")
        _require_finite(pressure)
        weighted = self._filter.filter(pressure)
        power = self._ballistics.process(weighted)
        energy = float(weighted @ weighted)
        highest = _level(float(power.max()))
        overload = float(np.abs(pressure).max()) > math.sqrt(2.0) * float(pressure_pa(self.span[1]))
        level = _level(float(power.mean()))
        self._energy += energy
        self._samples += pressure.size
        self._highest = max(self._highest, highest)
        self._overload = self._overload or overload
        return Reading(
            level=level,
            at_end=_level(float(power[-1])),
            highest=highest,
            equivalent=_level(energy / pressure.size),
            overload=overload,
            under_range=level < self.span[0],
        )

    @property
    def equivalent(self) -> float:
        """Leq over all samples so far (LAeq, LCeq, LZeq), dB."""
        return _level(self._energy / max(self._samples, 1))

    @property
    def highest(self) -> float:
        """Highest time-weighted level so far (LAFmax and its like), dB."""
        return self._highest

    @property
    def overloaded(self) -> bool:
        """Whether any block so far was an overload: it stays shown, as the standard asks."""
        return self._overload


def _require_finite(pressure: FloatArray) -> None:
    """Refuse a broken signal: it would read as silence, for ever after."""
    good = np.isfinite(pressure)
    if not good.all():
        first = int(np.argmin(good))
        raise RefusedError(
            f"sound pressure: sample {first} of {pressure.size} is {pressure[first]} Pa; allowed: "
            "finite numbers, so look at what the follower or the rig's radiation gives"
        )


def _require(name: str, value: str, allowed: Iterable[str]) -> None:
    if value not in allowed:
        raise ConfigError(f"{name} is {value!r}; allowed: {', '.join(allowed)}")


def _level(power: float) -> float:
    """Level in dB of a mean square in Pa²; silence is `SILENCE`."""
    ratio = power / REFERENCE_PRESSURE**2
    return max(10.0 * math.log10(ratio), SILENCE) if ratio > 0.0 else SILENCE
