"""A sound-level meter to IEC 61672-1, class 1: weightings A, C, Z and F, S, and its range.

It carries its state, so a signal reads the same however it is cut into blocks. A sample rate of
more than 40 kHz is needed for all of class 1, which ends at 20 kHz; a lower one says how far it
reaches (`class_1_up_to_hz`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Chebyshev

from cam_rig.acoustics.pressure import REFERENCE_PRESSURE, first_order, level_db, pressure_pa
from cam_rig.errors import ConfigError, RefusedError
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


# Weightings A and C, digital. The analog poles are kept as they are (matched z), the zeros at 0 Hz
# too; a few more zeros bring the magnitude to the analog one up to half the sample rate, which the
# bilinear transform does not do: at 12 kHz it is 1.2 dB off at 4 kHz, this is 0.03 dB.

#: Corner frequencies f1 to f4 of annex E, Hz.
F1, F2, F3, F4 = 20.598997, 107.65265, 737.86223, 12194.217
#: Poles by their corners, and how many zeros there are at 0 Hz.
POLES = {"A": (F1, F1, F2, F3, F4, F4), "C": (F1, F1, F4, F4)}
ZEROS = {"A": 4, "C": 2}
#: Zeros that are fitted.
FITTED = 6
#: Where every weighting is 0 dB, Hz.
REFERENCE = 1000.0
#: Class 1 of table 3: nominal frequency (Hz), A and C (dB), acceptance limits above and below (dB).
CLASS_1 = (
    (10.0, -70.4, -14.3, 3.0, -math.inf),
    (12.5, -63.4, -11.2, 2.5, -math.inf),
    (16.0, -56.7, -8.5, 2.0, -4.0),
    (20.0, -50.5, -6.2, 2.0, -2.0),
    (25.0, -44.7, -4.4, 2.0, -1.5),
    (31.5, -39.4, -3.0, 1.5, -1.5),
    (40.0, -34.6, -2.0, 1.0, -1.0),
    (50.0, -30.2, -1.3, 1.0, -1.0),
    (63.0, -26.2, -0.8, 1.0, -1.0),
    (80.0, -22.5, -0.5, 1.0, -1.0),
    (100.0, -19.1, -0.3, 1.0, -1.0),
    (125.0, -16.1, -0.2, 1.0, -1.0),
    (160.0, -13.4, -0.1, 1.0, -1.0),
    (200.0, -10.9, 0.0, 1.0, -1.0),
    (250.0, -8.6, 0.0, 1.0, -1.0),
    (315.0, -6.6, 0.0, 1.0, -1.0),
    (400.0, -4.8, 0.0, 1.0, -1.0),
    (500.0, -3.2, 0.0, 1.0, -1.0),
    (630.0, -1.9, 0.0, 1.0, -1.0),
    (800.0, -0.8, 0.0, 1.0, -1.0),
    (1000.0, 0.0, 0.0, 0.7, -0.7),
    (1250.0, 0.6, 0.0, 1.0, -1.0),
    (1600.0, 1.0, -0.1, 1.0, -1.0),
    (2000.0, 1.2, -0.2, 1.0, -1.0),
    (2500.0, 1.3, -0.3, 1.0, -1.0),
    (3150.0, 1.2, -0.5, 1.0, -1.0),
    (4000.0, 1.0, -0.8, 1.0, -1.0),
    (5000.0, 0.5, -1.3, 1.5, -1.5),
    (6300.0, -0.1, -2.0, 1.5, -2.0),
    (8000.0, -1.1, -3.0, 1.5, -2.5),
    (10_000.0, -2.5, -4.4, 2.0, -3.0),
    (12_500.0, -4.3, -6.2, 2.0, -5.0),
    (16_000.0, -6.6, -8.5, 2.5, -16.0),
    (20_000.0, -9.3, -11.2, 3.0, -math.inf),
)


def exact(nominal: float) -> float:
    """The third-octave frequency, 10^(n/10) Hz, that has a nominal name."""
    return float(10.0 ** (round(10.0 * math.log10(nominal)) / 10.0))


def weighting_power(curve: str, frequency: FloatArray) -> FloatArray:
    """|W|² of A, C or Z at frequencies in Hz, as annex E gives it; 1 at 1 kHz."""
    if curve == "Z":
        return np.ones_like(frequency)
    return np.asarray(_analog(curve, frequency) / _analog(curve, np.array(REFERENCE)))


def weighting_filter(curve: str, rate: int) -> FloatArray:
    """Second-order sections ``(n, 6)`` of A, C or Z at ``rate`` Hz; none, ``(0, 6)``, for Z."""
    if curve == "Z":
        return np.zeros((0, 6))
    from scipy.signal import zpk2sos  # a second of imports, which only who listens should pay

    zeros, poles = ZEROS[curve], np.exp(-2.0 * math.pi * np.array(POLES[curve]) / rate)

    def left(x: FloatArray) -> FloatArray:
        """What the fitted zeros must give, |·|² over x = cos ω."""
        below = np.prod([1.0 + p * p - 2.0 * p * x for p in poles], axis=0)
        above = (2.0 - 2.0 * x) ** zeros
        frequency = np.arccos(x) * rate / (2.0 * math.pi)
        return np.asarray(weighting_power(curve, frequency) * below / above)

    wanted = Chebyshev.interpolate(left, FITTED)
    x = wanted.roots().astype(complex)
    pair = x + np.sqrt(x * x - 1.0)  # x = (z + 1/z) / 2: one of each pair is within the circle
    fitted = np.where(np.abs(pair) > 1.0, 1.0 / pair, pair)
    gain = math.sqrt(float(wanted(0.0)) / float(np.prod(np.abs(1j - fitted) ** 2)))
    return np.asarray(zpk2sos(np.append(fitted, np.ones(zeros)), poles, gain))


def class_1_up_to_hz(rate: int) -> float:
    """The nominal frequency (Hz) up to which A, C and Z are class 1 at a sample rate.

    Every third-octave frequency up to it is below half the rate, and the response of the filters
    there is within the acceptance limits of `CLASS_1`. 20 kHz is where the standard ends; 0 where
    not even the lowest is met.
    """
    from scipy.signal import sosfreqz

    rows = [row for row in CLASS_1 if 2.0 * exact(row[0]) < rate]
    at = np.array([exact(row[0]) for row in rows])
    last = 0.0
    errors = [
        20.0 * np.log10(np.abs(sosfreqz(weighting_filter(curve, rate), at, fs=rate)[1]))
        - 10.0 * np.log10(weighting_power(curve, at))
        for curve in POLES
    ]
    for (nominal, _, _, above, below), *found in zip(rows, *errors, strict=True):
        if not all(below <= error <= above for error in found):
            break
        last = nominal
    return last


def _analog(curve: str, frequency: FloatArray) -> FloatArray:
    """|H|² of the analog filter but for its gain."""
    square = np.square(frequency)
    gain = np.square(square) / np.square((square + F1**2) * (square + F4**2))
    if curve == "A":
        gain = gain * np.square(square) / ((square + F2**2) * (square + F3**2))
    return np.asarray(gain)


# Third-octave bands (IEC 61260-1): Butterworth filters of order 6, low bands at lower rates.

#: n of the lowest and highest band, 10^(n/10) Hz: nominally 12.5 Hz and 16 kHz.
BANDS = (11, 42)
ORDER = 6
#: Half the rate, over the highest band's mid frequency, at least.
ROOM = 0.5 / 0.44
#: A band is filtered at the lowest rate whose half is so many times its upper edge; a rate is not
#: lowered by more than the other.
HEADROOM, MAX_DECIMATION = 1.25, 500
#: r.m.s. pressure (Pa) that silence counts as.
LEAST = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Band levels."""

    frequency: FloatArray  #: exact mid-band frequency, Hz
    names: tuple[str, ...]  #: nominal
    level_db: FloatArray  #: re 20 µPa


def third_octaves(pressure: FloatArray, rate: int) -> Spectrum:
    """Equivalent level in each third-octave band over the samples, ``(n,)`` in Pa.

    The filters begin at rest, so the signal should last some periods of the lowest band's
    width: two seconds for 12.5 Hz. Bands beyond the sample rate's half are left out.
    """
    numbers = np.arange(BANDS[0], BANDS[1] + 1)
    numbers = numbers[10.0 ** (numbers / 10.0) * ROOM * 2.0 <= rate]
    middle = 10.0 ** (numbers / 10.0)
    nominal = [CLASS_1[number - 10][0] for number in numbers]
    names = tuple(f"{hz / 1e3:g}k" if hz >= 1e3 else f"{hz:g}" for hz in nominal)
    passed = np.array([_passed(pressure, rate, float(frequency)) for frequency in middle])
    return Spectrum(middle, names, level_db(np.maximum(passed, LEAST)))


def _passed(pressure: FloatArray, rate: int, middle: float) -> float:
    """r.m.s. of the band about a frequency."""
    from scipy.signal import butter, resample_poly, sosfilt

    edges = middle * 10.0 ** np.array([-0.05, 0.05])
    factor = min(max(int(rate / 2.0 / (HEADROOM * edges[1])), 1), MAX_DECIMATION)
    slower = resample_poly(pressure, 1, factor) if factor > 1 else pressure
    sections = butter(ORDER, edges, "bandpass", fs=rate / factor, output="sos")
    band = sosfilt(sections, slower)
    return float(np.linalg.norm(band)) / math.sqrt(band.size)


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
