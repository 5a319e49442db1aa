"""Sound pressure of a rig, computed from the contact force and acoustic constants.

The pressure follows the rate of the contact force through a structure that is a low-pass filter:

    p = gain · ω_c (F − q),    q̇ = ω_c (F − q)        (p ≈ gain · Ḟ below the corner frequency)

F is the contact force, q (N) the state of the structure, and ω_c the angular corner frequency. A
landing is a force pulse of impulse J. Its shape is half a sine, and its duration T_c is half a
period of the follower's mass on its stem. Its frequencies are far above the corner. It radiates
∫p² dt = (gain ω_c J)² π²/(8 T_c) and increases q by ω_c J, so landings need no additional constant.
The energy of the background noise of motor and bearings is added. It rises with the speed. This is
the energy accountancy of machinery noise (Richards).
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
    """Return the sound level in dB re 20 µPa of an r.m.s. sound pressure in Pa."""
    return np.asarray(20.0 * np.log10(np.asarray(pressure) / REFERENCE_PRESSURE))


def pressure_pa(level: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the r.m.s. sound pressure in Pa of a sound level in dB re 20 µPa."""
    return np.asarray(REFERENCE_PRESSURE * 10.0 ** (np.asarray(level) / 20.0))


@dataclass(frozen=True)
class RadiationParameters:
    """Acoustic constants of a rig, from the contact force to the sound pressure.

    They describe the sound of the structure, of landings, and of the background.
    """

    gain: float  #: sound pressure per rate of the contact force, Pa·s/N
    corner_frequency: float  #: corner frequency of the structure's low-pass filter, Hz
    background: float  #: sound level of the background at ``background_reference_speed``, dB
    background_reference_speed: float  #: cam speed to which ``background`` refers, rad/s
    background_slope: float  #: increase of the background level per octave of cam speed, dB
    contact_time: float  #: duration of the force pulse of a landing, s, or 0 without landings
    #: Frequency above which the spectrum of the background falls by 6 dB per octave, Hz.
    background_corner_frequency: float

    @classmethod
    def from_rig(cls, rig: RigConfig, *, lands: bool = True) -> RadiationParameters:
        """Return the acoustic constants of a rig.

        Parameters
        ----------
        rig : RigConfig
            Rig with the section ``radiation``.
        lands : bool, optional
            False for a follower that never leaves the cam and needs no stem stiffness (default:
            True).

        Raises
        ------
        ConfigError
            If the rig has no radiation, or no stem stiffness although the follower may land.
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
        """Angular corner frequency ω_c (rad/s) of the structure that radiates sound."""
        return 2.0 * math.pi * self.corner_frequency

    def background_power(self, speed: float) -> float:
        """Return the mean square sound pressure (Pa²) of the background at a cam speed.

        ``speed`` is in rad/s.
        """
        level = self.background + self.background_slope * math.log2(
            speed / self.background_reference_speed
        )
        return float(pressure_pa(level)) ** 2

    def landing_energy(self, impulse: FloatArray) -> FloatArray:
        """Return the radiated energy ∫p² dt (Pa²·s) of landings with impulses in N·s."""
        if not impulse.any():
            return np.zeros_like(impulse)
        peak = self.gain * self.corner_rate * impulse
        return np.asarray(peak**2 * math.pi**2 / (8.0 * self.contact_time))


#: Number of samples that `first_order` computes as one block, a power of two.
BLOCK_SIZE = 64


def structure_response(
    corner_rate: float,
    sample_rate: float,
    start: float,
    previous: float,
    force: FloatArray,
    impulse: FloatArray,
) -> FloatArray:
    """Return the state q (N) of the structure that radiates sound, at n samples.

    The structure is a low-pass filter of the contact force F. The equation q̇ = ω_c (F − q) is
    solved exactly between samples. The shape is ``(n,)``.

    Parameters
    ----------
    corner_rate : float
        Angular corner frequency ω_c, rad/s.
    sample_rate : float
        Sample rate, Hz.
    start, previous : float
        State q and force F at the sample before the first one, N.
    force : ndarray, shape (n,)
        Contact force F, N, linear between samples.
    impulse : ndarray, shape (n,)
        Impulses J of landings at the samples, N·s. Each increases q by ω_c J.
    """
    x = corner_rate / sample_rate
    keep = math.exp(-x)
    ramp = -math.expm1(-x) / x
    previous_gain, gain = ramp - keep, 1.0 - ramp
    earlier = np.concatenate(([previous], force[:-1]))
    drive = previous_gain * earlier + gain * force + corner_rate * impulse
    return first_order(keep, drive, start)


def first_order(keep: float, drive: FloatArray, start: float) -> FloatArray:
    """Return the n values of the recursion yᵢ = keep · yᵢ₋₁ + driveᵢ, ``(n,)``.

    ``start`` is the value before the first one, and ``drive`` has the shape ``(n,)``. The samples
    are divided into blocks. All blocks are computed together as if they started from 0, and the
    contribution of the previous block is then added to each. This is as fast as a filter of
    scipy.signal, whose import takes half a second.
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
    """Generator of the background noise: Gaussian, with unit variance.

    Above the corner frequency its spectrum falls by 6 dB per octave. It is the first-order
    recursion x ← a x + √(1 − a²) n with a = e^(−2π corner/rate) and white noise n. The variance is
    1 from the first sample on, at any rate.
    """

    corner_frequency: float  #: corner frequency of the spectrum, Hz
    rate: float  #: sample rate, Hz
    seed: int  #: seed of the random numbers
    _last: float = field(init=False)

    def __post_init__(self) -> None:
        self._generator = np.random.default_rng(self.seed)
        self._last = float(self._generator.standard_normal())

    def samples(self, count: int) -> FloatArray:
        """Return the next samples of the background noise, ``(count,)``."""
        keep = math.exp(-2.0 * math.pi * self.corner_frequency / self.rate)
        fresh = self._generator.standard_normal(count)
        gain = math.sqrt(-math.expm1(2.0 * math.log(keep)))
        noise = first_order(keep, gain * fresh, self._last)
        self._last = float(noise[-1]) if count else self._last
        return noise


#: Lowest sample rate of the sound pressure, Hz. It is well above the rate that a class 1
#: sound-level meter (IEC 61672-1) up to 20 kHz needs.
MIN_RATE = 96_000
#: Seed of the background noise, so that a run is repeatable sample by sample.
SEED = 1


@dataclass
class SoundSource:
    """Generator of the sound pressure of a rig, block by block.

    A block is a series of samples of the contact force. The pressure is the sum of the sound of the
    structure, of the landings and of the background. The state between two blocks is stored.
    """

    parameters: RadiationParameters  #: acoustic constants of the rig
    block_rate: int  #: sample rate of the contact force, Hz
    #: Lowest sample rate of the computed sound pressure, Hz. The rate that is used is the smallest
    #: multiple of ``block_rate`` that is not below it.
    least_rate: int = MIN_RATE
    seed: int = SEED  #: seed of the background noise
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
        """Sample rate of the sound pressure, Hz: ``factor`` × ``block_rate``."""
        return self.block_rate * self.factor

    def pressure(self, force: FloatArray, impulse: FloatArray, speed: float) -> FloatArray:
        """Return the sound pressure (Pa) over the next block, ``(n · factor,)``.

        It has ``factor`` samples per sample of the contact force.

        Parameters
        ----------
        force : ndarray, shape (n,)
            Contact force at the samples, N.
        impulse : ndarray, shape (n,)
            Impulse of the landings since the previous sample, N·s.
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
        """Return the force F − q (N) that radiates sound, with the pulses of landings.

        F is the contact force and q the state of the structure. The result has ``factor`` samples
        per sample of the contact force.
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
        """Return the force pulses (N) of the landings over this block, as samples.

        There are ``factor`` samples per element of ``impulse`` (N·s). The rest of a pulse that
        extends beyond the block is stored and added to the next block.
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

    A sample is the mean of the pulse over its sampling interval, so the area is exact. ``duration``
    is that of the pulse in s, and ``rate`` the sample rate in Hz.
    """
    edges = np.arange(math.ceil(duration * rate) + 1) / rate
    integral = 0.5 * (1.0 - np.cos(math.pi * np.minimum(edges / duration, 1.0)))
    return np.asarray(rate * np.diff(integral))


# R.m.s. sound pressure from the contact force. The powers of structure, landings and background are
# added. The microphone node publishes this pressure.


@dataclass(frozen=True)
class MicrophoneState:
    """State of the structure that radiates sound, between two blocks of samples."""

    structure: float  #: state q of the structure at the last sample, N
    force: float  #: contact force at the last sample, N


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
        Impulse of the landings since the previous sample, N·s.
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


# Sound in steady state of a follower that stays on the cam: exact, without samples or transients.

#: Number of Gauss-Legendre nodes per sub-interval of the mean over a turn. A sub-interval lasts at
#: most one time constant 1/ω_c of the structure.
GAUSS_NODES = 12


def mean_square_rate(
    law: Law, follower: FollowerParameters, corner_rate: float, speed: float
) -> float:
    """Return the mean square of the filtered rate of the contact force, in (N/s)².

    The filtered rate is ω_c (F − q) with the contact force F, the state q of the structure and the
    angular corner frequency ω_c (``corner_rate``, rad/s). The mean is over a turn in steady state.
    ``speed`` is the cam speed in rad/s. The result is exact to rounding for a rigid follower that
    stays on the cam.
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
    """Return the mean square sound pressure (Pa²) in steady state at a cam speed.

    It is the sum of the sound of the contact force and of the background, for a rigid follower that
    stays on the cam. ``speed`` is in rad/s.
    """
    rate = mean_square_rate(law, follower, radiation.corner_rate, speed)
    return radiation.background_power(speed) + radiation.gain**2 * rate
