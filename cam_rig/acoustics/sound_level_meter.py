"""A sound-level meter to IEC 61672-1, class 1: weightings A, C, Z and F, S, and its range.

It carries its state, so a signal reads the same however it is cut into blocks. A sample rate of
more than 40 kHz is needed for all of class 1, which ends at 20 kHz; a lower one says how far it
reaches (`weighting.class_1_up_to_hz`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.acoustics.radiation import REFERENCE_PRESSURE, first_order, pressure_pa
from cam_rig.acoustics.weighting import Spectrum, class_1_up_to_hz, third_octaves, weighting_filter
from cam_rig.errors import ConfigError, RefusedError, RunError
from cam_rig.units import FloatArray

#: Frequency weightings of the standard.
FREQUENCY_WEIGHTINGS = ("A", "C", "Z")
#: Time weightings and their time constants, s.
TIME_WEIGHTINGS = {"F": 0.125, "S": 1.0}
#: Range in dB of the paper's meter, a JTS-1357.
RANGE = (30.0, 130.0)
#: Silence reads as this level, dB.
SILENCE = -200.0


@dataclass(frozen=True)
class Reading:
    """What the meter shows for one block, in dB re 20 µPa."""

    #: The time-weighted sound level, energy-averaged over the block: in a steady sound of whole
    #: turns that is its equivalent level, whichever cam angle a block ends at.
    level: float
    at_end: float  #: the time-weighted level at the block's end
    highest: float  #: its maximum
    equivalent: float  #: Leq over the block
    overload: bool  #: the unweighted pressure went beyond a sine at the top of the range
    under_range: bool  #: the level is below its bottom


@dataclass(frozen=True, eq=False)
class MeterState:
    """The whole state of a meter."""

    frequency_weighting: str
    time_weighting: str
    filter: FloatArray  #: of the frequency weighting, ``(n, 2)``
    power: float  #: of the time weighting, Pa²
    energy: float  #: since it began, as all below, Pa²
    samples: int
    highest: float  #: dB
    overload: bool


@dataclass
class SoundLevelMeter:
    """Blocks of sound pressure in, readings out; a `ConfigError` for an unknown weighting."""

    rate: int  #: Hz, of the pressure samples
    frequency_weighting: str = "Z"  #: A, C or Z
    time_weighting: str = "F"  #: F (125 ms) or S (1 s)
    span: tuple[float, float] = RANGE  #: range in dB; a level outside it is shown with a flag

    def __post_init__(self) -> None:
        _require("frequency_weighting", self.frequency_weighting, FREQUENCY_WEIGHTINGS)
        _require("time_weighting", self.time_weighting, TIME_WEIGHTINGS)
        self._sections = weighting_filter(self.frequency_weighting, self.rate)
        self._keep = math.exp(-1.0 / (self.rate * TIME_WEIGHTINGS[self.time_weighting]))
        at_rest = np.zeros((len(self._sections), 2))
        self.state = MeterState(
            self.frequency_weighting, self.time_weighting, at_rest, 0.0, 0.0, 0, SILENCE, False
        )

    @classmethod
    def from_state(cls, rate: int, state: MeterState) -> SoundLevelMeter:
        """The meter in this state; a `RunError` if its filter is of another kind."""
        meter = cls(rate, state.frequency_weighting, state.time_weighting)
        if state.filter.shape != meter.state.filter.shape:
            raise RunError(
                f"the state of a meter has a filter of {state.filter.shape}; "
                f"allowed: {meter.state.filter.shape}"
            )
        meter.state = state
        return meter

    @property
    def quantity(self) -> str:
        """What is read, as IEC 61672-1 writes it: LZF, LAS."""
        return f"L{self.frequency_weighting}{self.time_weighting}"

    def read(self, pressure: FloatArray) -> Reading:
        """The reading for the next samples, ``(n,)`` in Pa; refused ones leave it as it was."""
        if pressure.size == 0:
            raise ValueError("a block must hold at least one sample")
        _require_finite(pressure)
        weighted, filter_ = self._weighted(pressure)
        fresh = (1.0 - self._keep) * np.square(weighted)
        power = first_order(self._keep, fresh, self.state.power)  # y ← keep y + (1 − keep) x
        energy = float(weighted @ weighted)
        highest = _level(float(power.max()))
        overload = float(np.abs(pressure).max()) > math.sqrt(2.0) * float(pressure_pa(self.span[1]))
        level = _level(float(power.mean()))
        before = self.state
        self.state = replace(
            before,
            filter=filter_,
            power=float(power[-1]),
            energy=before.energy + energy,
            samples=before.samples + pressure.size,
            highest=max(before.highest, highest),
            overload=before.overload or overload,
        )
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
        return _level(self.state.energy / max(self.state.samples, 1))

    @property
    def highest(self) -> float:
        """Highest time-weighted level so far (LAFmax and its like), dB."""
        return self.state.highest

    @property
    def overloaded(self) -> bool:
        """Whether any block so far was an overload: it stays shown, as the standard asks."""
        return self.state.overload

    def _weighted(self, pressure: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The samples through the frequency weighting, and the filter's state then."""
        if self._sections.size == 0:
            return pressure, self.state.filter
        from scipy.signal import sosfilt  # a second of imports, which only who weighs should pay

        weighted, filter_ = sosfilt(self._sections, pressure, zi=self.state.filter)
        return np.asarray(weighted), np.asarray(filter_)


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
    """Refuse a weighting that the standard does not have."""
    if value not in allowed:
        raise ConfigError(f"{name} is {value!r}; allowed: {', '.join(allowed)}")


def _level(power: float) -> float:
    """Level in dB of a mean square in Pa²; silence is `SILENCE`."""
    ratio = power / REFERENCE_PRESSURE**2
    return max(10.0 * math.log10(ratio), SILENCE) if ratio > 0.0 else SILENCE


# Measuring a recorded sound: every level a meter would have shown, and what a file needs.

#: The 16-bit samples of a sound file reach to this.
FULL_SCALE = 32767


@dataclass(frozen=True)
class Measurement:
    """What a recorded sound measures."""

    levels: dict[str, float]  #: dB re 20 µPa by the standard's names, as LAeq and LAFmax
    bands: Spectrum
    peak_pa: float
    overload: bool
    under_range: bool
    class_1_up_to_hz: float  #: nominal frequency up to which the levels are of class 1


def measure(pressure: FloatArray, rate: int) -> Measurement:
    """Measure samples ``(n,)`` in Pa."""
    levels: dict[str, float] = {}
    overload, lowest = False, np.inf
    for weighting in FREQUENCY_WEIGHTINGS:
        for ballistics in TIME_WEIGHTINGS:
            meter = SoundLevelMeter(rate, weighting, ballistics)
            reading = meter.read(pressure)
            levels[f"L{weighting}eq"] = meter.equivalent
            levels[f"L{weighting}{ballistics}max"] = meter.highest
            overload, lowest = meter.overloaded, min(lowest, reading.level - meter.span[0])
    peak = float(np.abs(pressure).max())
    spectrum, class_1 = third_octaves(pressure, rate), class_1_up_to_hz(rate)
    return Measurement(levels, spectrum, peak, overload, lowest < 0.0, class_1)


def full_scale(peak: float) -> float:
    """Pressure (Pa) of a sound file's largest number: the least 1, 2, 5 · 10ⁿ from ``peak`` on."""
    if peak <= 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(peak))
    return float(next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if peak <= step * decade))


def pcm(pressure: FloatArray, scale: float) -> bytes:
    """16-bit little-endian samples, where ``scale`` (Pa) is the largest number."""
    return np.round(pressure * (FULL_SCALE / scale)).astype("<i2").tobytes()
