"""Sound pressure of a rig, computed from the contact force and acoustic constants.

The pressure follows the rate of the contact force through a structure that is a low-pass filter:

    p = gain · ω_c (F − q),    q̇ = ω_c (F − q)        (p ≈ gain · Ḟ below the corner)

A landing is a force pulse of impulse J. Its shape is half a sine, and its duration T_c is that of
the follower's mass on its stem. The pulse is far above the corner. It radiates ∫p² dt = (gain ω_c
J)² π²/(8 T_c) and increases q by ω_c J, so the impact needs no constant of its own. The background
of motor and bearings adds in energy and rises with the speed. This is the energy accountancy of
machinery noise (Richards).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import force_ordinates
from cam_rig.dynamics.linear.propagator import periodic_state, piece
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

#: Reference sound pressure in air, Pa (IEC 61672).
REFERENCE_PRESSURE = 20e-6


def level_db(pressure: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the level in dB re 20 µPa of an r.m.s. pressure in Pa."""
    return np.asarray(20.0 * np.log10(np.asarray(pressure) / REFERENCE_PRESSURE))


def pressure_pa(level: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the r.m.s. pressure in Pa of a level in dB re 20 µPa."""
    return np.asarray(REFERENCE_PRESSURE * 10.0 ** (np.asarray(level) / 20.0))


@dataclass(frozen=True)
class RadiationParameters:
    """Acoustic constants of a rig."""

    gain: float  #: Pa·s/N, pressure per rate of contact force
    corner_frequency: float  #: Hz
    background: float  #: dB at the speed ``background_reference_speed`` (rad/s)
    background_reference_speed: float
    background_slope: float  #: dB per octave of speed
    contact_time: float  #: s, duration of a landing's force pulse, 0 without landings
    background_corner_frequency: float  #: Hz, above which the background falls by 6 dB per octave

    @classmethod
    def from_rig(cls, rig: RigConfig, *, lands: bool = True) -> RadiationParameters:
        """Return the constants of a rig file.

        Parameters
        ----------
        rig : RigConfig
            Rig file with radiation.
        lands : bool, optional
            False for a follower that never leaves the cam and needs no stem stiffness (default:
            True).

        Raises
        ------
        ConfigError
            If the rig file has no radiation, or no stem stiffness.
        """
        radiation = rig.need_radiation("the sound level")
        if lands:
            rig.need("stem_stiffness", "the sound of a landing")
        follower = FollowerParameters.from_rig(rig)
        return cls(
            gain=radiation.gain.si,
            corner_frequency=radiation.corner_frequency.si,
            background=radiation.background.si,
            background_reference_speed=radiation.background_reference_speed.si,
            background_slope=radiation.background_slope.si,
            contact_time=follower.contact_time if follower.stem_stiffness else 0.0,
            background_corner_frequency=radiation.background_corner_frequency.si,
        )

    @property
    def corner_rate(self) -> float:
        """Angular corner frequency ω_c in rad/s."""
        return 2.0 * math.pi * self.corner_frequency

    def background_power(self, speed: float) -> float:
        """Return the mean square background pressure (Pa²) at a cam speed in rad/s."""
        level = self.background + self.background_slope * math.log2(
            speed / self.background_reference_speed
        )
        return float(pressure_pa(level)) ** 2

    def landing_energy(self, impulse: FloatArray) -> FloatArray:
        """Return ∫p² dt in Pa²·s of landings with impulses in N·s."""
        if not impulse.any():
            return np.zeros_like(impulse)
        peak = self.gain * self.corner_rate * impulse
        return np.asarray(peak**2 * math.pi**2 / (8.0 * self.contact_time))


#: Number of samples per block of the recursion in `first_order`, a power of two.
BLOCK_SIZE = 64


def structure_response(
    corner_rate: float,
    sample_rate: float,
    start: float,
    previous: float,
    force: FloatArray,
    impulse: FloatArray,
) -> FloatArray:
    """Return the structure's state q (N) at the samples, ``(n,)``.

    The equation q̇ = ω_c (F − q) is solved exactly between samples.

    Parameters
    ----------
    corner_rate : float
        Corner rate ω_c, rad/s.
    sample_rate : float
        Sample rate, Hz.
    start, previous : float
        State q and force at the sample before the first one, N.
    force : ndarray, shape (n,)
        Force, N, linear between samples.
    impulse : ndarray, shape (n,)
        Impulses at the samples, N·s. Each increases q by ω_c J.
    """
    x = corner_rate / sample_rate
    keep = math.exp(-x)
    ramp = -math.expm1(-x) / x
    previous_gain, gain = ramp - keep, 1.0 - ramp
    earlier = np.concatenate(([previous], force[:-1]))
    drive = previous_gain * earlier + gain * force + corner_rate * impulse
    return first_order(keep, drive, start)


def first_order(keep: float, drive: FloatArray, start: float) -> FloatArray:
    """Return the values y ← keep · y + drive of a recursion from ``start``, ``(n,)``.

    All blocks are computed together from rest, by doubling. The contribution of the previous block
    is then added to each. This is as fast as scipy's filter, whose import takes half a second.
    """
    blocks = np.zeros((-(-drive.size // BLOCK_SIZE), BLOCK_SIZE))
    blocks.reshape(-1)[: drive.size] = drive
    steps = blocks.T.copy()
    shift, factor = 1, keep
    while shift < BLOCK_SIZE:
        steps[shift:] += factor * steps[:-shift]
        shift, factor = 2 * shift, factor * factor
    powers = np.array([keep**k for k in range(1, BLOCK_SIZE + 1)])
    starts, decay = [start], float(powers[-1])
    for end in steps[-1, :-1].tolist():
        starts.append(end + decay * starts[-1])
    if drive.size:
        steps += powers[:, None] * np.array(starts)
    return np.asarray(steps.T.reshape(-1)[: drive.size])


# Sound pressure as samples, block by block. The force is linear between the samples of a block, so
# the pressure can be computed at any higher rate. The samples of a landing's pulse have its exact
# area.


@dataclass
class Background:
    """Gaussian noise of unit variance that falls by 6 dB per octave above its corner.

    It is the first-order recursion x ← a x + √(1 − a²) n with a = e^(−2π corner/rate). The variance
    is 1 from the first sample on, at any rate.
    """

    corner_frequency: float  #: Hz
    rate: float  #: Hz
    seed: int  #: seed of the noise
    _last: float = field(init=False)

    def __post_init__(self) -> None:
        self._generator = np.random.default_rng(self.seed)
        self._last = float(self._generator.standard_normal())

    def samples(self, count: int) -> FloatArray:
        """Return the next samples, ``(count,)``."""
        keep = math.exp(-2.0 * math.pi * self.corner_frequency / self.rate)
        fresh = self._generator.standard_normal(count)
        gain = math.sqrt(-math.expm1(2.0 * math.log(keep)))
        noise = first_order(keep, gain * fresh, self._last)
        self._last = float(noise[-1]) if count else self._last
        return noise


#: Lowest sample rate, Hz. It is well above the rate that class 1 up to 20 kHz needs.
MIN_RATE = 96_000
#: Seed of the background noise, so that a run is repeatable sample by sample.
SEED = 1


@dataclass
class SoundSource:
    """Sound pressure of structure, landings and background, computed block by block."""

    parameters: RadiationParameters
    block_rate: int  #: Hz, of the force samples
    #: Hz. The rate of the pressure is the smallest multiple of ``block_rate`` that reaches it.
    least_rate: int = MIN_RATE
    seed: int = SEED  #: of the background noise
    _structure: float | None = field(default=None, init=False)
    _force: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self.factor = max(1, math.ceil(self.least_rate / self.block_rate))
        self._background = Background(
            self.parameters.background_corner_frequency, self.rate, self.seed
        )
        self._pulse = _pulse(self.parameters.contact_time or 1.0 / self.rate, self.rate)
        self._tail = np.zeros(self._pulse.size - 1)

    @property
    def rate(self) -> int:
        """Sample rate of the pressure, Hz."""
        return self.block_rate * self.factor

    def pressure(self, force: FloatArray, impulse: FloatArray, speed: float) -> FloatArray:
        """Return the sound pressure in Pa over one block, ``(n · factor,)``.

        Parameters
        ----------
        force : ndarray, shape (n,)
            Contact force at the samples, N.
        impulse : ndarray, shape (n,)
            Impulse of the landings since the sample before, N·s.
        speed : float
            Cam speed, rad/s, which determines the background.

        Raises
        ------
        ValueError
            If the block is empty.
        """
        if force.size == 0:
            raise ValueError("a block must contain at least one sample")
        p = self.parameters
        background = math.sqrt(p.background_power(speed))
        noise = background * self._background.samples(force.size * self.factor)
        return noise + p.gain * p.corner_rate * self._structure_force(force, impulse)

    def _structure_force(self, force: FloatArray, impulse: FloatArray) -> FloatArray:
        """Return the force F − q of the structure with the pulses of landings, N.

        It has ``factor`` samples per sample of the force.
        """
        if self._structure is None:  # at rest under the first force
            self._structure = self._force = float(force[0])
        earlier = np.concatenate(([self._force], force[:-1]))
        steps = np.arange(1, self.factor + 1) / self.factor
        fine = (earlier[:, None] + (force - earlier)[:, None] * steps).ravel()
        pulses = self._pulses(impulse)
        before, kicks = (self._structure, self._force), pulses / self.rate
        structure = structure_response(self.parameters.corner_rate, self.rate, *before, fine, kicks)
        self._structure, self._force = float(structure[-1]), float(force[-1])
        return fine - structure + pulses

    def _pulses(self, impulse: FloatArray) -> FloatArray:
        """Return the force pulses of the landings in this block, N.

        The rest of a pulse that extends beyond the block is stored for the next block.
        """
        count = impulse.size * self.factor
        out = np.zeros(count + self._tail.size)
        out[: self._tail.size] = self._tail
        for i in np.flatnonzero(impulse):
            start = (i + 1) * self.factor - 1
            out[start : start + self._pulse.size] += impulse[i] * self._pulse
        self._tail = out[count:]
        return out[:count]


def _pulse(duration: float, rate: float) -> FloatArray:
    """Return the half-sine pulse of a landing with unit area, as samples in 1/s.

    A sample is the mean of the pulse over its sampling interval, so the area is exact.
    """
    edges = np.arange(math.ceil(duration * rate) + 1) / rate
    integral = 0.5 * (1.0 - np.cos(math.pi * np.minimum(edges / duration, 1.0)))
    return np.asarray(rate * np.diff(integral))


# Contact force to r.m.s. sound pressure, by energy, as the microphone node publishes it.


@dataclass(frozen=True)
class MicrophoneState:
    """State of the structure between two blocks."""

    structure: float  #: q, N
    force: float  #: force at the last sample, N


def rms_pressure(
    parameters: RadiationParameters,
    state: MicrophoneState | None,
    force: FloatArray,
    impulse: FloatArray,
    sample_rate: float,
    speed: float,
) -> tuple[MicrophoneState, float]:
    """Return the state after one block and the r.m.s. sound pressure (Pa) over it.

    Parameters
    ----------
    parameters : RadiationParameters
        Acoustic constants.
    state : MicrophoneState or None
        State after the previous block (None: at rest under the first force).
    force : ndarray, shape (n,)
        Contact force, N, linear between samples.
    impulse : ndarray, shape (n,)
        Impulse of the landings since the sample before, N·s.
    sample_rate : float
        Sample rate, Hz.
    speed : float
        Cam speed, rad/s.

    Raises
    ------
    ValueError
        If the block is empty.
    """
    if force.size == 0:
        raise ValueError("a block must contain at least one sample")
    start = state or MicrophoneState(structure=float(force[0]), force=float(force[0]))
    structure = structure_response(
        parameters.corner_rate, sample_rate, start.structure, start.force, force, impulse
    )
    rate = parameters.corner_rate * (force - structure)
    contact = parameters.gain**2 * float(np.mean(rate**2))
    landings = float(np.sum(parameters.landing_energy(impulse))) * sample_rate / force.size
    power = parameters.background_power(speed) + contact + landings
    return MicrophoneState(float(structure[-1]), float(force[-1])), math.sqrt(power)


# Steady sound of a cam whose follower stays on it: exact, without samples or transients.

#: Number of Gauss-Legendre nodes per sub-interval. A sub-interval is at most one time constant of
#: the structure.
GAUSS_NODES = 12


def mean_square_rate(
    law: Law, follower: FollowerParameters, corner_rate: float, speed: float
) -> float:
    """Return the mean square of ω_c (F − q) in (N/s)² over a periodic turn.

    ``speed`` is the cam speed in rad/s. The result is exact to rounding for a follower that stays
    on the cam.
    """
    require_smooth(law)
    forces = force_ordinates(law, follower, speed)
    matrix = np.array([[-corner_rate]])
    durations = law.spans / speed
    pieces = [
        piece(matrix, corner_rate * forces[None, :, i], float(duration))
        for i, duration in enumerate(durations)
    ]
    nodes, node_weights = np.polynomial.legendre.leggauss(GAUSS_NODES)
    state, total = periodic_state(pieces), 0.0
    for i, solution in enumerate(pieces):
        count = max(4, int(np.ceil(corner_rate * solution.duration)))  # sub-intervals
        width = solution.duration / count
        times = ((np.arange(count)[:, None] + 0.5 * (nodes + 1.0)) * width).ravel()
        force = bernstein.evaluate(forces[:, i], times / solution.duration)
        rate = corner_rate * (force - solution.at(state, times)[0])
        total += float(np.tile(0.5 * width * node_weights, count) @ rate**2)
        state = solution.end(state)
    return total / float(durations.sum())


def steady_power(
    law: Law, follower: FollowerParameters, radiation: RadiationParameters, speed: float
) -> float:
    """Return the mean square sound pressure (Pa²) at ``speed`` (rad/s).

    It contains contact and background, and assumes a follower that stays on the cam.
    """
    rate = mean_square_rate(law, follower, radiation.corner_rate, speed)
    return radiation.background_power(speed) + radiation.gain**2 * rate
