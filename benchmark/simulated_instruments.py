"""Simulated measurements of a run: encoder counts, noise, and unequal clocks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import bilinear, lfilter

from cam_rig.dynamics import MODELS, Samples
from cam_rig.dynamics.interval import Interval
from cam_rig.laws.law import Law
from cam_rig.schema.rig import RigConfig
from cam_rig.simulation.instruments import MeasuredRun, Signal
from cam_rig.units import NS, RPM, TURN, FloatArray

#: Number of samples of the model per sample of a force sensor with a resonance.
FINER = 16


@dataclass(frozen=True)
class InstrumentErrors:
    """Errors of the instruments of a machine."""

    rate: int = 2000  #: Hz, sample rate of lift and force
    encoder_rate: int = 1000  #: Hz
    counts: int = 1024  #: counts of the encoder per turn, 0 for an encoder without steps
    offset: float = math.radians(3.0)  #: rad, angle that the encoder shows at θ = 0
    clock: float = 200e-6  #: relative error of the clock of lift and force against the encoder's
    force_noise: float = 0.01  #: relative to the largest or, with ``in_proportion``, each force
    in_proportion: bool = False
    lift_noise: float = 10e-6  #: m
    #: m, difference of the lift's reading in a fall and in a rise
    backlash: float = 0.0
    sensor_frequency: float = 0.0  #: Hz, resonance of the force sensor, 0 for a rigid sensor
    sensor_damping: float = 0.02  #: damping ratio of this resonance


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
    """Return the simulated measurement of a run at several speeds (rpm) in sequence.

    At each speed ``turns`` are recorded, after ``settled_for`` turns without a record. During the
    ``ramp`` (s) between speeds only the encoder is recorded.
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
    """Return time (s), lift (m) and force (N) at a constant speed, ``(3, n)``.

    The time starts at zero. ``hold`` is the first angle, the speed and the duration.
    """
    angle, speed, length = hold
    rate = errors.rate * (FINER if errors.sensor_frequency else 1)
    parameters, advance = MODELS[model].parameters(rig), MODELS[model].advance
    begin = round(settled_for * TURN / speed * NS)
    back = speed * begin / NS - settled_for * TURN  # begin is a whole number of ns
    first = Interval(0, begin, math.fmod(angle, TURN) - back, speed)
    state, before = advance(law, parameters, None, first, rate)
    start_angle = first.angle_at(first.duration)
    last = Interval(begin, begin + round(length * NS), start_angle, speed)
    _, block = advance(law, parameters, state, last, rate)
    rows, count = np.hstack([before.rows, block.rows]), block.time.size
    force = _sensed(rows, rate, errors)[-count:]
    since, lift = block.time - begin / NS, block.lift
    if errors.backlash:
        lift = lift - 0.5 * errors.backlash * _side(Samples(rows).velocity)[-count:]
    every = slice(None, None, rate // errors.rate)
    return np.stack([since[every], lift[every], force[every]])


def _sensed(rows: FloatArray, rate: int, errors: InstrumentErrors) -> FloatArray:
    """Return the force that the sensor indicates.

    Its resonance responds to the force and to the impulses of landings.
    """
    samples = Samples(rows)
    if not errors.sensor_frequency:
        return samples.force.copy()
    own, ratio = TURN * errors.sensor_frequency, errors.sensor_damping
    top, bottom = bilinear([own**2], [1.0, 2.0 * ratio * own, own**2], rate)
    return np.asarray(lfilter(top, bottom, samples.force + samples.impulse * rate))


def _side(velocity: FloatArray) -> FloatArray:
    """Return 1 after a rise and -1 after a fall, the side of the backlash."""
    moving = np.abs(velocity) > 1e-9 * np.abs(velocity).max()
    last = np.maximum.accumulate(np.where(moving, np.arange(velocity.size), 0))
    return np.sign(velocity[last])
