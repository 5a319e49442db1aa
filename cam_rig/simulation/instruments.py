"""A simulated run as instruments would record it: counts, noise, clocks of their own.

What a fit or a comparison makes of a real machine is proven on these, where the truth is known.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import bilinear, lfilter

from cam_rig.dynamics import MODELS, Interval, Samples
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import NS, RPM, TURN, FloatArray

#: Readings of which the usual step is taken, at once; a slower speed has another.
WINDOW = 64
#: A step that is so many times the usual one is a gap; of readings at a steady rate, and others.
GAP_STEADY, GAP = 1.8, 4.0
#: Steps of which nine of ten differ by less than this part of themselves are of a steady rate.
STEADY = 0.05


@dataclass(frozen=True, eq=False)
class Signal:
    """One measured quantity."""

    time: FloatArray  #: s, rising, ``(n,)``
    value: FloatArray  #: SI, ``(n,)``
    source: str = ""  #: the topic and field it was read from

    def gaps(self) -> FloatArray:
        """``(k, 2)`` times (s) around steps far longer than the median nearby: readings missing."""
        steps = np.diff(self.time)
        if steps.size < 3:
            return np.empty((0, 2))
        count = -(-steps.size // WINDOW)
        padded = np.append(steps, np.full(count * WINDOW - steps.size, np.nan))
        blocks = padded.reshape(count, WINDOW)
        usual = np.nanmedian(blocks, axis=1)
        spread = np.nanpercentile(np.abs(blocks - usual[:, None]), 90.0, axis=1)
        factor = np.where(spread <= STEADY * usual, GAP_STEADY, GAP)
        limit = np.pad(factor * usual, 1, mode="edge")
        nearby = np.maximum(np.maximum(limit[:-2], limit[1:-1]), limit[2:])
        places = np.flatnonzero(steps > np.repeat(nearby, WINDOW)[: steps.size])
        return np.column_stack([self.time[places], self.time[places + 1]])


def pulls(force: FloatArray) -> bool:
    """Whether a measured contact force (N), ``(n,)``, has the sign of a pull."""
    return bool(np.median(force) < 0.0 and -force.min() > 2.0 * force.max())


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """What was recorded of one cam on a machine; what is None was not."""

    source: Path  #: the bag
    cam: str  #: name of the cam, as in the scene; empty where the bag does not say
    angle: Signal  #: cam angle with all its turns, rad; of an encoder, so perhaps in steps
    lift: Signal | None = None  #: follower displacement, m
    force: Signal | None = None  #: contact force, N
    level: Signal | None = None  #: sound level, dB re 20 µPa
    notes: tuple[str, ...] = ()  #: what was found odd in the bag, each a sentence for people
    begin_ns: int = 0  #: the stamp (ns) from which all times count


#: Samples of the model for one of a force sensor that vibrates.
FINER = 16


@dataclass(frozen=True)
class InstrumentErrors:
    """What the instruments of a machine do to what they measure."""

    rate: int = 2000  #: Hz, samples of lift and force
    encoder_rate: int = 1000  #: Hz
    counts: int = 1024  #: of the encoder in a turn; 0 for one without steps
    offset: float = math.radians(3.0)  #: rad, what the encoder shows where the cam is at θ = 0
    clock: float = 200e-6  #: part by which the clock of lift and force is fast beside the encoder's
    force_noise: float = 0.01  #: part of the largest force, or with ``in_proportion`` of each force
    in_proportion: bool = False
    lift_noise: float = 10e-6  #: m
    #: m, by how much the gauge of the lift reads less in a rise than in a fall
    backlash: float = 0.0
    sensor_frequency: float = 0.0  #: Hz, resonance of the force sensor; 0 for one without
    sensor_damping: float = 0.02  #: its damping ratio


def measured_run(
    law: Law,
    rig: RigConfig,
    model: str,
    rpms: Iterable[float],
    errors: InstrumentErrors = InstrumentErrors(),
    seed: int = 0,
    turns: float = 4.0,
    settled_for: int = 20,
    ramp: float = 0.3,
) -> MeasuredRun:
    """A run at some speeds (rpm), one after another, as it would be recorded.

    Recorded are ``turns`` at each speed, after ``settled_for`` others; in the ``ramp`` (s) from one
    speed to the next only the encoder is.
    """
    random = np.random.default_rng(seed)
    time, angle, before = 0.0, float(random.uniform(0.0, TURN)), 0.0
    encoder, sensors = list[FloatArray](), list[FloatArray]()
    for speed in (rpm * RPM for rpm in rpms):
        since = np.arange(int(ramp * errors.encoder_rate)) / errors.encoder_rate
        turned = before * since + 0.5 * (speed - before) / ramp * since**2
        encoder.append(np.stack([time + since, angle + turned]))
        time, angle, before = time + ramp, angle + 0.5 * (before + speed) * ramp, speed
        length = turns * TURN / speed
        since = np.arange(int(length * errors.encoder_rate)) / errors.encoder_rate
        encoder.append(np.stack([time + since, angle + speed * since]))
        rows = _settled(law, rig, model, (angle, speed, length), settled_for, errors)
        rows[0] += time
        sensors.append(rows)
        time, angle = time + length, angle + speed * length
    times, lift, force = np.hstack(sensors)
    times = times * (1.0 + errors.clock)
    noise = np.abs(force) if errors.in_proportion else float(force.max())
    force = force + errors.force_noise * noise * random.standard_normal(force.size)
    lift = lift + errors.lift_noise * random.standard_normal(lift.size)
    read, turned = np.hstack(encoder)
    turned = turned + errors.offset
    if errors.counts:
        count = TURN / errors.counts
        turned = np.floor(turned / count) * count
    signals = Signal(read, turned, "encoder"), Signal(times, lift, "lift")
    return MeasuredRun(Path("simulated"), law.name, *signals, Signal(times, force, "force"))


def _settled(
    law: Law,
    rig: RigConfig,
    model: str,
    hold: tuple[float, float, float],
    settled_for: int,
    errors: InstrumentErrors,
) -> FloatArray:
    """Time since the hold's start (s), lift (m) and force (N), ``(3, n)``; angle, speed, length."""
    angle, speed, length = hold
    rate = errors.rate * (FINER if errors.sensor_frequency else 1)
    parameters, advance = MODELS[model].parameters(rig), MODELS[model].advance
    begin = round(settled_for * TURN / speed * NS)
    back = speed * begin / NS - settled_for * TURN  # begin is a whole number of ns
    first = Interval(0, begin, math.fmod(angle, TURN) - back, speed)
    state, before = advance(law, parameters, None, first, rate)
    at = first.angle_at(first.duration)
    last = Interval(begin, begin + round(length * NS), at, speed)
    _, block = advance(law, parameters, state, last, rate)
    rows, count = np.hstack([before.rows, block.rows]), block.time.size
    force = _sensed(rows, rate, errors)[-count:]
    since, lift = block.time - begin / NS, block.lift
    if errors.backlash:
        lift = lift - 0.5 * errors.backlash * _side(Samples(rows).velocity)[-count:]
    every = slice(None, None, rate // errors.rate)
    return np.stack([since[every], lift[every], force[every]])


def _sensed(rows: FloatArray, rate: int, errors: InstrumentErrors) -> FloatArray:
    """The force as the sensor shows it: itself, or through a resonance with the landings' blows."""
    samples = Samples(rows)
    if not errors.sensor_frequency:
        return samples.force.copy()
    own, ratio = TURN * errors.sensor_frequency, errors.sensor_damping
    top, bottom = bilinear([own**2], [1.0, 2.0 * ratio * own, own**2], rate)
    return np.asarray(lfilter(top, bottom, samples.force + samples.impulse * rate))


def _side(velocity: FloatArray) -> FloatArray:
    """1 after a rise, -1 after a fall: where a backlash is taken up."""
    moving = np.abs(velocity) > 1e-9 * np.abs(velocity).max()
    last = np.maximum.accumulate(np.where(moving, np.arange(velocity.size), 0))
    return np.sign(velocity[last])


#: Angles that rise by whole steps so nearly, in parts of one, were read through an encoder; over a
#: step of n of them √n times that, as the count is not known better, and at most.
WHOLE, MOST = 1e-3, 0.05
#: Angles (rad) that differ by less are equal; a count is no finer than this.
EQUAL, FINEST = 1e-12, 1e-8


def encoder_count(angle: FloatArray) -> float:
    """The step (rad) in which angles ``(n,)`` with all their turns come; 0 where they show none.

    Not each count need have been read, but steps of two sizes, standing still among them: equal
    steps are those of a cam that turns steadily.
    """
    every = np.abs(np.diff(angle))
    steps = every[every > EQUAL]
    if not steps.size:
        return 0.0
    apart = np.diff(np.unique(np.round(steps, 9)))
    least = [float(steps.min()), *apart[:1].tolist(), float(apart.min(initial=np.inf))]
    for count in sorted(set(least), reverse=True):  # the least step seen may be several counts
        if not FINEST < count < np.inf:
            continue
        off = steps / count
        whole = np.rint(off)
        if not whole.all():
            continue
        if np.abs(off - whole).max() < min(MOST, WHOLE * max(1.0, float(np.sqrt(off.max())))):
            sizes = np.unique(whole).size + (steps.size < every.size)
            return float(np.median(steps / whole)) if sizes > 1 else 0.0
    return 0.0
