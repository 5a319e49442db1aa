"""Contact force to sound pressure: the constants of a rig, and what arrives at the microphone.

The pressure follows the rate of the contact force through a structure that cannot follow
beyond its corner:

    p = gain · ω_c (F − q),    q̇ = ω_c (F − q)        (p ≈ gain · Ḟ below the corner)

A landing is a force pulse of impulse J, half a sine of the time the follower's mass takes on
its stem. It is far above the corner, so it radiates ∫p² dt = (gain ω_c J)² π²/(8 T_c) and leaves
q higher by ω_c J: the impact needs no constant of its own. Background (motor, bearings) adds in
energy, rising with speed. This is the energy accountancy of machinery noise (Richards).
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
    """Level in dB re 20 µPa of an r.m.s. pressure in Pa."""
    return np.asarray(20.0 * np.log10(np.asarray(pressure) / REFERENCE_PRESSURE))


def pressure_pa(level: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """r.m.s. pressure in Pa of a level in dB re 20 µPa."""
    return np.asarray(REFERENCE_PRESSURE * 10.0 ** (np.asarray(level) / 20.0))


@dataclass(frozen=True)
class RadiationParameters:
    """The acoustic constants of a rig."""

    gain: float  #: Pa·s/N, pressure per rate of contact force
    corner: float  #: Hz
    background: float  #: dB at the speed ``background_at`` (rad/s)
    background_at: float
    background_slope: float  #: dB per octave of speed
    contact_time: float  #: s, duration of a landing's force pulse; 0 where nothing can land
    background_corner: float  #: Hz, above which the background falls by 6 dB an octave

    @classmethod
    def from_rig(cls, rig: RigConfig, *, lands: bool = True) -> RadiationParameters:
        """Take the numbers of a rig file; a follower that never ``lands`` needs no stem."""
        r = rig.need_radiation("the sound level")
        if lands:
            rig.need("stem_stiffness", "the sound of a landing")
        follower = FollowerParameters.from_rig(rig)
        return cls(
            gain=r.gain.si,
            corner=r.corner.si,
            background=r.background.si,
            background_at=r.background_at.si,
            background_slope=r.background_slope.si,
            contact_time=follower.contact_time if follower.stem_stiffness else 0.0,
            background_corner=r.background_corner.si,
        )

    @property
    def corner_rate(self) -> float:
        """ω_c in rad/s."""
        return 2.0 * math.pi * self.corner

    def background_power(self, speed: float) -> float:
        """Mean square background pressure, Pa², at a cam speed in rad/s."""
        level = self.background + self.background_slope * math.log2(speed / self.background_at)
        return float(pressure_pa(level)) ** 2

    def landing_energy(self, impulse: FloatArray) -> FloatArray:
        """∫p² dt in Pa²·s radiated by landings of these impulses (N·s)."""
        if not impulse.any():
            return np.zeros_like(impulse)
        peak = self.gain * self.corner_rate * impulse
        return np.asarray(peak**2 * math.pi**2 / (8.0 * self.contact_time))


#: Samples that `first_order` takes together, a power of two.
BLOCK = 64


def structure_response(
    corner_rate: float,
    sample_rate: float,
    start: float,
    previous: float,
    force: FloatArray,
    impulse: FloatArray,
) -> FloatArray:
    """Structure q (N) at the samples, ``(n,)``: q̇ = ω_c (F − q), solved exactly between them.

    ``start`` and ``previous`` are q and force (N) at the sample before the first. ``force`` (N) is
    straight between samples; ``impulse`` (N·s) falls at a sample and lifts q by ω_c J.
    """
    x = corner_rate / sample_rate
    keep = math.exp(-x)
    ramp = -math.expm1(-x) / x
    before, now = ramp - keep, 1.0 - ramp
    earlier = np.concatenate(([previous], force[:-1]))
    drive = before * earlier + now * force + corner_rate * impulse
    return first_order(keep, drive, start)


def first_order(keep: float, drive: FloatArray, start: float) -> FloatArray:
    """The recursion y ← keep · y + drive from y = ``start`` on, ``(n,)``.

    In blocks, all of which go forward together from rest, by doubling; each then gets what the one
    before has left. As quick as scipy's filter, whose import takes half a second.
    """
    blocks = np.zeros((-(-drive.size // BLOCK), BLOCK))
    blocks.reshape(-1)[: drive.size] = drive
    steps = blocks.T.copy()
    shift, kept = 1, keep
    while shift < BLOCK:
        steps[shift:] += kept * steps[:-shift]
        shift, kept = 2 * shift, kept * kept
    powers = np.array([keep**k for k in range(1, BLOCK + 1)])
    left, whole = [start], float(powers[-1])
    for own in steps[-1, :-1].tolist():
        left.append(own + whole * left[-1])
    if drive.size:
        steps += powers[:, None] * np.array(left)
    return np.asarray(steps.T.reshape(-1)[: drive.size])


# As samples, block by block. The force is straight between the samples of a block, so the pressure
# can be had at any higher rate; a landing's pulse has its area kept exactly on the grid of samples.


@dataclass
class Background:
    """Gaussian noise of unit variance that falls by 6 dB an octave above its corner.

    A first-order recursion, x ← a x + √(1 − a²) n with a = e^(−2π corner/rate): its variance is 1
    from the first sample on, at any rate.
    """

    corner: float  #: Hz
    rate: float  #: Hz
    seed: int  #: the same seed, the same noise
    _last: float = field(init=False)

    def __post_init__(self) -> None:
        self._generator = np.random.default_rng(self.seed)
        self._last = float(self._generator.standard_normal())

    def samples(self, count: int) -> FloatArray:
        """The next samples, ``(count,)``."""
        keep = math.exp(-2.0 * math.pi * self.corner / self.rate)
        fresh = self._generator.standard_normal(count)
        gain = math.sqrt(-math.expm1(2.0 * math.log(keep)))
        noise = first_order(keep, gain * fresh, self._last)
        self._last = float(noise[-1]) if count else self._last
        return noise


#: Hz, well above what a meter needs for class 1 up to 20 kHz.
MIN_RATE = 96_000
#: Seed of the background noise: a run repeats sample by sample.
SEED = 1


@dataclass
class SoundSource:
    """The structure, the landings and the background with their state."""

    parameters: RadiationParameters
    block_rate: int  #: Hz, of the force samples
    #: Hz; the pressure comes at the smallest whole multiple of ``block_rate`` that reaches it
    least_rate: int = MIN_RATE
    seed: int = SEED  #: of the background noise
    _structure: float | None = field(default=None, init=False)
    _force: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self.factor = max(1, math.ceil(self.least_rate / self.block_rate))
        self._background = Background(self.parameters.background_corner, self.rate, self.seed)
        self._pulse = _pulse(self.parameters.contact_time or 1.0 / self.rate, self.rate)
        self._tail = np.zeros(self._pulse.size - 1)

    @property
    def rate(self) -> int:
        """Hz, of the pressure samples."""
        return self.block_rate * self.factor

    def pressure(self, force: FloatArray, impulse: FloatArray, speed: float) -> FloatArray:
        """Sound pressure in Pa over one block, ``(n · factor,)``.

        ``force`` in N at the samples and ``impulse`` in N·s of the landings since the sample before
        are ``(n,)``; ``speed`` (rad/s) is of the cam, for the background.
        """
        if force.size == 0:
            raise ValueError("a block must hold at least one sample")
        p = self.parameters
        background = math.sqrt(p.background_power(speed))
        noise = background * self._background.samples(force.size * self.factor)
        return noise + p.gain * p.corner_rate * self._radiating(force, impulse)

    def _radiating(self, force: FloatArray, impulse: FloatArray) -> FloatArray:
        """F − q with the pulses of landings, N."""
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
        """Force pulses of the landings, N; what lasts longer than the block is kept."""
        count = impulse.size * self.factor
        out = np.zeros(count + self._tail.size)
        out[: self._tail.size] = self._tail
        for i in np.flatnonzero(impulse):
            begin = (i + 1) * self.factor - 1
            out[begin : begin + self._pulse.size] += impulse[i] * self._pulse
        self._tail = out[count:]
        return out[:count]


def _pulse(duration: float, rate: float) -> FloatArray:
    """Half a sine of unit area as its mean over each sample interval, 1/s."""
    edges = np.arange(math.ceil(duration * rate) + 1) / rate
    risen = 0.5 * (1.0 - np.cos(math.pi * np.minimum(edges / duration, 1.0)))
    return np.asarray(rate * np.diff(risen))


# Contact force to r.m.s. sound pressure, by energy: what the microphone node publishes.


@dataclass(frozen=True)
class MicrophoneState:
    """The state of the structure from one block to the next."""

    structure: float  #: q, N
    force: float  #: the last one, N


def rms_pressure(
    parameters: RadiationParameters,
    state: MicrophoneState | None,
    force: FloatArray,
    impulse: FloatArray,
    sample_rate: float,
    speed: float,
) -> tuple[MicrophoneState, float]:
    """State after, and r.m.s. sound pressure (Pa) over, one block at ``sample_rate`` (Hz).

    ``force`` (N, straight between the samples), ``impulse`` (N·s) and ``speed`` (rad/s) as of
    `SoundSource.pressure`; without a ``state`` the structure begins at rest under the force.
    """
    if force.size == 0:
        raise ValueError("a block must hold at least one sample")
    start = state or MicrophoneState(structure=float(force[0]), force=float(force[0]))
    structure = structure_response(
        parameters.corner_rate, sample_rate, start.structure, start.force, force, impulse
    )
    rate = parameters.corner_rate * (force - structure)
    contact = parameters.gain**2 * float(np.mean(rate**2))
    landings = float(np.sum(parameters.landing_energy(impulse))) * sample_rate / force.size
    power = parameters.background_power(speed) + contact + landings
    return MicrophoneState(float(structure[-1]), float(force[-1])), math.sqrt(power)


# The steady sound of a cam whose follower stays on it: exact, without samples or settling.

#: Gauss-Legendre nodes a sub-interval; each is short against the structure's time constant.
NODES = 12


def mean_square_rate(
    law: Law, follower: FollowerParameters, corner_rate: float, speed: float
) -> float:
    """⟨(ω_c (F − q))²⟩ of a periodic turn at ``speed`` (rad/s), to rounding, in (N/s)²."""
    require_smooth(law)
    forces = force_ordinates(law, follower, speed)
    matrix = np.array([[-corner_rate]])
    durations = law.spans / speed
    pieces = [
        piece(matrix, corner_rate * forces[None, :, i], float(duration))
        for i, duration in enumerate(durations)
    ]
    state = periodic_state(pieces)
    total = 0.0
    for i, part in enumerate(pieces):
        times, weights = _quadrature(part.duration, corner_rate)
        force = bernstein.evaluate(forces[:, i], times / part.duration)
        rate = corner_rate * (force - part.at(state, times)[0])
        total += float(weights @ rate**2)
        state = part.end(state)
    return total / float(durations.sum())


def _quadrature(duration: float, rate: float) -> tuple[FloatArray, FloatArray]:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    count = max(4, int(np.ceil(rate * duration)))
    width = duration / count
    times = (np.arange(count)[:, None] + 0.5 * (nodes + 1.0)) * width
    return times.ravel(), np.tile(0.5 * width * weights, count)


def steady_power(
    law: Law, follower: FollowerParameters, radiation: RadiationParameters, speed: float
) -> float:
    """Mean square sound pressure (Pa²) of contact and background at ``speed`` (rad/s)."""
    rate = mean_square_rate(law, follower, radiation.corner_rate, speed)
    return radiation.background_power(speed) + radiation.gain**2 * rate
