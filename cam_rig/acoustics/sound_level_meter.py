"""Sound-level meter of IEC 61672-1, class 1, with weightings A, C, Z, F and S.

The meter stores its state between blocks of samples, so the division of a signal into blocks does
not affect the filters. Class 1 extends to 20 kHz and needs a sample rate of more than 40 kHz. At a
lower rate `class_1_up_to_hz` returns the frequency up to which the meter is class 1.
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

#: Frequency weightings of IEC 61672-1.
FREQUENCY_WEIGHTINGS = ("A", "C", "Z")
#: Time constants (s) of the time weightings F (fast) and S (slow) of IEC 61672-1.
TIME_WEIGHTINGS = {"F": 0.125, "S": 1.0}
#: Measuring range in dB of the JTS-1357, the sound-level meter of the published noise measurements.
RANGE_DB = (30.0, 130.0)
#: Level that the meter reads for silence, dB, because the exact level would be −∞.
SILENCE_DB = -200.0


@dataclass(frozen=True)
class Reading:
    """Reading of the sound-level meter for one block of samples, in dB re 20 µPa."""

    #: Time-weighted sound level, averaged as power over the block. If the sound is steady and the
    #: block covers whole turns, it is the equivalent level, whatever the cam angle at its end.
    level: float
    at_end: float  #: time-weighted level at the end of the block
    highest: float  #: maximum of the time-weighted level in the block
    equivalent: float  #: equivalent level over the block
    #: True if the unweighted pressure exceeds the peak of a sine with the highest level of the
    #: measuring range.
    overload: bool
    under_range: bool  #: True if ``level`` is below the lowest level of the range


@dataclass(frozen=True, eq=False)
class MeterState:
    """Complete state of a sound-level meter between two blocks."""

    frequency_weighting: str  #: A, C or Z
    time_weighting: str  #: F or S
    filter: FloatArray  #: state of the filter of the frequency weighting, ``(n, 2)``
    power: float  #: state of the time weighting, a mean square in Pa²
    energy: float  #: sum of the squared weighted samples since the start of the meter, Pa²
    samples: int  #: number of samples since the start of the meter
    highest: float  #: highest time-weighted level since the start of the meter, dB
    overload: bool  #: True if a block since the start of the meter was an overload


@dataclass
class SoundLevelMeter:
    """Meter that converts blocks of sound pressure to readings.

    Raises
    ------
    ConfigError
        If the weighting is unknown.
    """

    rate: int  #: sample rate of the sound pressure, Hz
    frequency_weighting: str = "Z"  #: A, C or Z
    time_weighting: str = "F"  #: F (125 ms) or S (1 s)
    #: Measuring range in dB. A reading outside of it has the flag ``overload`` or ``under_range``.
    span: tuple[float, float] = RANGE_DB

    def __post_init__(self) -> None:
        _require_weighting("frequency_weighting", self.frequency_weighting, FREQUENCY_WEIGHTINGS)
        _require_weighting("time_weighting", self.time_weighting, TIME_WEIGHTINGS)
        self._sections = weighting_filter(self.frequency_weighting, self.rate)
        self._keep = math.exp(-1.0 / (self.rate * TIME_WEIGHTINGS[self.time_weighting]))
        at_rest = np.zeros((len(self._sections), 2))
        self.state = MeterState(
            self.frequency_weighting, self.time_weighting, at_rest, 0.0, 0.0, 0, SILENCE_DB, False
        )

    @property
    def quantity(self) -> str:
        """Symbol of the quantity in IEC 61672-1, such as LZF or LAS."""
        return f"L{self.frequency_weighting}{self.time_weighting}"

    def read(self, pressure: FloatArray) -> Reading:
        """Return the reading for the next samples, ``(n,)`` in Pa.

        Raises
        ------
        ValueError
            If the block is empty.
        RefusedError
            If a sample is not finite. The state of the meter is unchanged.
        """
        if pressure.size == 0:
            raise ValueError("a block must contain at least one sample")
        _require_finite(pressure)
        weighted, filter_ = self._apply_weighting(pressure)
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
        """Equivalent level over all samples (LAeq, LCeq, LZeq), dB."""
        return _level(self.state.energy / max(self.state.samples, 1))

    @property
    def highest(self) -> float:
        """Highest time-weighted level of all samples, such as LAFmax, dB."""
        return self.state.highest

    @property
    def overloaded(self) -> bool:
        """True if a block since the start of the meter was an overload.

        The flag is never reset (latched), as IEC 61672-1 requires.
        """
        return self.state.overload

    def _apply_weighting(self, pressure: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the frequency-weighted samples, and the state of the filter after them.

        ``pressure`` are samples in Pa, ``(n,)``. The state of the meter is not changed.
        """
        if self._sections.size == 0:
            return pressure, self.state.filter
        from scipy.signal import sosfilt  # imported here, because it takes a second

        weighted, filter_ = sosfilt(self._sections, pressure, zi=self.state.filter)
        return np.asarray(weighted), np.asarray(filter_)


def _require_finite(pressure: FloatArray) -> None:
    """Raise `RefusedError` if a sample of the sound pressure is not finite.

    Such a sample would remain in the state of the filters and falsify all later readings.
    """
    finite = np.isfinite(pressure)
    if not finite.all():
        first = int(np.argmin(finite))
        raise RefusedError(
            f"sound pressure: sample {first} of {pressure.size} is {pressure[first]} Pa; allowed: "
            "finite numbers, so check the contact force and the radiation of the rig"
        )


def _require_weighting(name: str, value: str, allowed: Iterable[str]) -> None:
    """Raise `ConfigError` if a weighting is not one of ``allowed``.

    ``name`` is the name of the setting in the message.
    """
    if value not in allowed:
        raise ConfigError(f"{name} is {value!r}; allowed: {', '.join(allowed)}")


def _level(power: float) -> float:
    """Return the level (dB re 20 µPa) of a mean square pressure (Pa²).

    It is at least `SILENCE_DB`.
    """
    ratio = power / REFERENCE_PRESSURE**2
    return max(10.0 * math.log10(ratio), SILENCE_DB) if ratio > 0.0 else SILENCE_DB


# Digital filters of the weightings A and C. The analog poles and the zeros at 0 Hz are mapped by
# the matched z-transform. A few more zeros are fitted, so that the magnitude is that of the analog
# filter up to half the sample rate. At a rate of 12 kHz the error at 4 kHz is 0.03 dB. With the
# bilinear transform it is 1.2 dB.

#: Corner frequency f1 of the weightings in annex E of IEC 61672-1, Hz.
CORNER_1_HZ = 20.598997
#: Corner frequency f2 of the weightings in annex E of IEC 61672-1, Hz.
CORNER_2_HZ = 107.65265
#: Corner frequency f3 of the weightings in annex E of IEC 61672-1, Hz.
CORNER_3_HZ = 737.86223
#: Corner frequency f4 of the weightings in annex E of IEC 61672-1, Hz.
CORNER_4_HZ = 12194.217
#: Corner frequencies (Hz) of the poles of the weightings A and C.
POLES = {
    "A": (CORNER_1_HZ, CORNER_1_HZ, CORNER_2_HZ, CORNER_3_HZ, CORNER_4_HZ, CORNER_4_HZ),
    "C": (CORNER_1_HZ, CORNER_1_HZ, CORNER_4_HZ, CORNER_4_HZ),
}
#: Number of zeros at 0 Hz of the weightings A and C.
ZEROS = {"A": 4, "C": 2}
#: Number of zeros of a digital weighting filter that are fitted to the magnitude of the analog
#: filter.
FITTED_ZEROS = 6
#: Frequency at which every weighting is 0 dB, Hz (IEC 61672-1).
REFERENCE_FREQUENCY = 1000.0
#: Table 3 of IEC 61672-1 for class 1: nominal frequency (Hz), design goals of A and C (dB), upper
#: and lower acceptance limit of the error (dB).
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


def exact_frequency(nominal: float) -> float:
    """Return the exact third-octave frequency 10^(n/10) Hz of a nominal frequency (Hz)."""
    return float(10.0 ** (round(10.0 * math.log10(nominal)) / 10.0))


def weighting_power(curve: str, frequency: FloatArray) -> FloatArray:
    """Return the squared magnitude |W|² of a frequency weighting at frequencies in Hz.

    ``curve`` is A, C or Z. The result is 1 at 1 kHz.

    References
    ----------
    Annex E of IEC 61672-1.
    """
    if curve == "Z":
        return np.ones_like(frequency)
    return np.asarray(_analog(curve, frequency) / _analog(curve, np.array(REFERENCE_FREQUENCY)))


def weighting_filter(curve: str, rate: int) -> FloatArray:
    """Return the digital filter of a frequency weighting as second-order sections.

    ``curve`` is A, C or Z, and ``rate`` is the sample rate in Hz. The shape is ``(n, 6)``, as for
    `scipy.signal.sosfilt`. Z has no section, ``(0, 6)``.
    """
    if curve == "Z":
        return np.zeros((0, 6))
    from scipy.signal import zpk2sos  # imported here, because it takes a second

    zeros, poles = ZEROS[curve], np.exp(-2.0 * math.pi * np.array(POLES[curve]) / rate)

    def zeros_power(x: FloatArray) -> FloatArray:
        """Return the squared magnitude that the fitted zeros must have at x = cos ω.

        ω is the digital frequency, 2π times the frequency divided by the sample rate.
        """
        below = np.prod([1.0 + p * p - 2.0 * p * x for p in poles], axis=0)
        above = (2.0 - 2.0 * x) ** zeros
        frequency = np.arccos(x) * rate / (2.0 * math.pi)
        return np.asarray(weighting_power(curve, frequency) * below / above)

    polynomial = Chebyshev.interpolate(zeros_power, FITTED_ZEROS)
    x = polynomial.roots().astype(complex)
    z = x + np.sqrt(x * x - 1.0)  # x = (z + 1/z)/2. Of z and 1/z one is inside the unit circle
    fitted = np.where(np.abs(z) > 1.0, 1.0 / z, z)
    gain = math.sqrt(float(polynomial(0.0)) / float(np.prod(np.abs(1j - fitted) ** 2)))
    return np.asarray(zpk2sos(np.append(fitted, np.ones(zeros)), poles, gain))


def class_1_up_to_hz(rate: int) -> float:
    """Return the nominal frequency (Hz) up to which the weightings are class 1.

    ``rate`` is the sample rate in Hz. Every third-octave frequency up to the result is below half
    the rate, and the response of the filters A and C there is within the limits of `CLASS_1`. The
    result is at most 20 kHz, where the standard ends, and 0 if the lowest frequency is outside its
    limits.
    """
    from scipy.signal import sosfreqz

    rows = [row for row in CLASS_1 if 2.0 * exact_frequency(row[0]) < rate]
    frequencies = np.array([exact_frequency(row[0]) for row in rows])
    limit = 0.0
    errors = [
        20.0 * np.log10(np.abs(sosfreqz(weighting_filter(curve, rate), frequencies, fs=rate)[1]))
        - 10.0 * np.log10(weighting_power(curve, frequencies))
        for curve in POLES
    ]
    for (nominal, _, _, above, below), *row_errors in zip(rows, *errors, strict=True):
        if not all(below <= error <= above for error in row_errors):
            break
        limit = nominal
    return limit


def _analog(curve: str, frequency: FloatArray) -> FloatArray:
    """Return the squared magnitude |H|² of the analog A or C filter, without its gain.

    ``frequency`` is in Hz.
    """
    square = np.square(frequency)
    gain = np.square(square) / np.square((square + CORNER_1_HZ**2) * (square + CORNER_4_HZ**2))
    if curve == "A":
        gain = gain * np.square(square) / ((square + CORNER_2_HZ**2) * (square + CORNER_3_HZ**2))
    return np.asarray(gain)


# Third-octave bands (IEC 61260-1): Butterworth filters of order 6, low bands at lower rates.

#: Numbers n of the lowest and the highest third-octave band, with the mid-band frequencies
#: 10^(n/10) Hz: nominally 12.5 Hz and 16 kHz.
BAND_NUMBERS = (11, 42)
#: Order of the Butterworth filters of the third-octave bands.
BAND_ORDER = 6
#: Smallest ratio of half the sample rate to the mid-band frequency of a third-octave band. A band
#: with a smaller ratio is omitted.
MIN_RATE_RATIO = 0.5 / 0.44
#: Smallest ratio of half the decimated sample rate to the upper edge frequency of a third-octave
#: band. The band is then below the transition of the decimation filter.
HEADROOM = 1.25
#: Largest factor by which the sample rate is decimated for a low third-octave band.
MAX_DECIMATION = 500
#: r.m.s. pressure (Pa) that replaces silence, so that the level is finite.
MIN_PRESSURE = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Sound levels of n third-octave bands."""

    frequency: FloatArray  #: exact mid-band frequencies, Hz, ``(n,)``
    names: tuple[str, ...]  #: nominal mid-band frequencies as text, such as 31.5 or 16k (Hz)
    level_db: FloatArray  #: equivalent level in each band, dB re 20 µPa, ``(n,)``


def third_octaves(pressure: FloatArray, rate: int) -> Spectrum:
    """Return the equivalent level in each third-octave band over the samples.

    The filters start at rest. The signal should therefore last some periods of the bandwidth of the
    lowest band, which is two seconds for 12.5 Hz. Bands beyond half the sample rate are omitted.

    Parameters
    ----------
    pressure : ndarray, shape (n,)
        Sound pressure, Pa.
    rate : int
        Sample rate, Hz.
    """
    numbers = np.arange(BAND_NUMBERS[0], BAND_NUMBERS[1] + 1)
    numbers = numbers[10.0 ** (numbers / 10.0) * MIN_RATE_RATIO * 2.0 <= rate]
    middle = 10.0 ** (numbers / 10.0)
    nominal = [CLASS_1[number - 10][0] for number in numbers]
    names = tuple(f"{hz / 1e3:g}k" if hz >= 1e3 else f"{hz:g}" for hz in nominal)
    pressures = np.array([_band_rms(pressure, rate, float(frequency)) for frequency in middle])
    return Spectrum(middle, names, level_db(np.maximum(pressures, MIN_PRESSURE)))


def _band_rms(pressure: FloatArray, rate: int, middle: float) -> float:
    """Return the r.m.s. sound pressure (Pa) in a third-octave band.

    ``middle`` is the mid-band frequency, and ``rate`` the sample rate, both in Hz.
    """
    from scipy.signal import butter, resample_poly, sosfilt

    edges = middle * 10.0 ** np.array([-0.05, 0.05])
    factor = min(max(int(rate / 2.0 / (HEADROOM * edges[1])), 1), MAX_DECIMATION)
    slower = resample_poly(pressure, 1, factor) if factor > 1 else pressure
    sections = butter(BAND_ORDER, edges, "bandpass", fs=rate / factor, output="sos")
    band = sosfilt(sections, slower)
    return float(np.linalg.norm(band)) / math.sqrt(band.size)


# Levels of a recorded sound, and its conversion to the samples of a file.

#: Largest value of a 16-bit sample in a sound file.
MAX_SAMPLE = 32767


@dataclass(frozen=True)
class Measurement:
    """Levels and flags of a recorded sound, the result of `measure`."""

    levels: dict[str, float]  #: dB re 20 µPa, by the standard's names such as LAeq and LAFmax
    bands: Spectrum  #: levels of the third-octave bands
    peak_pa: float  #: largest absolute sound pressure, Pa
    overload: bool  #: True if the sound pressure exceeds the range of the meter
    under_range: bool  #: True if a level is below the range of the meter
    class_1_up_to_hz: float  #: nominal frequency up to which the levels are class 1


def measure(pressure: FloatArray, rate: int) -> Measurement:
    """Return the levels of a recorded sound with all frequency and time weightings.

    ``pressure`` are samples of the sound pressure in Pa, ``(n,)``, and ``rate`` is the sample rate
    in Hz.

    Raises
    ------
    RefusedError
        If a sample is not finite.
    """
    levels: dict[str, float] = {}
    overload, margin = False, np.inf
    for weighting in FREQUENCY_WEIGHTINGS:
        for ballistics in TIME_WEIGHTINGS:
            meter = SoundLevelMeter(rate, weighting, ballistics)
            reading = meter.read(pressure)
            levels[f"L{weighting}eq"] = meter.equivalent
            levels[f"L{weighting}{ballistics}max"] = meter.highest
            overload, margin = meter.overloaded, min(margin, reading.level - meter.span[0])
    peak = float(np.abs(pressure).max())
    spectrum, class_1 = third_octaves(pressure, rate), class_1_up_to_hz(rate)
    return Measurement(levels, spectrum, peak, overload, margin < 0.0, class_1)


def full_scale(peak: float) -> float:
    """Return the sound pressure (Pa) for the largest sample value of a sound file.

    It is the smallest of the numbers 1, 2 and 5 times 10ⁿ that is not below ``peak``, the largest
    sound pressure in the file (Pa). It is 1 if ``peak`` is not positive.
    """
    if peak <= 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(peak))
    return float(next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if peak <= step * decade))


def pcm(pressure: FloatArray, scale: float) -> bytes:
    """Return sound pressures (Pa) as 16-bit little-endian samples of a sound file.

    ``scale`` is the sound pressure (Pa) that corresponds to the largest sample value.
    """
    return np.round(pressure * (MAX_SAMPLE / scale)).astype("<i2").tobytes()
