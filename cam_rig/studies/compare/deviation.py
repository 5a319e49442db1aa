"""Deviation of a measured quantity from the model, in comparison with its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws import Law
from cam_rig.simulation.by_speed import MIN_GAP_RATIO
from cam_rig.simulation.scatter import BINS, off_neighbours, scatter
from cam_rig.units import RPM, TURN, FloatArray, rms

# Pairs of measured and modelled values at the same instants.


@dataclass(frozen=True, eq=False)
class PairedSignal:
    """Measured and modelled values of one quantity at the same instants.

    All arrays have the shape ``(n,)``. `time` is in s and `angle` (cam angle) in rad. `near_jump`
    marks readings near a jump of the model's force, None if no reading is marked.
    """

    time: FloatArray
    angle: FloatArray
    measured: FloatArray
    model: FloatArray
    near_jump: NDArray[np.bool_] | None = None

    @property
    def away_from_jumps(self) -> NDArray[np.bool_]:
        """Mask of the readings that are not near a jump of the model's force, ``(n,)``."""
        return np.ones(self.time.size, dtype=bool) if self.near_jump is None else ~self.near_jump

    @property
    def degrees(self) -> FloatArray:
        """Cam angles of the readings within the turn in degrees, ``(n,)``."""
        return np.degrees(np.remainder(self.angle, TURN))

    def select(self, which: slice | NDArray[np.bool_ | np.intp]) -> PairedSignal:
        """Return the pairs of measured and modelled values with selected indices.

        ``which`` is a slice, a boolean mask or an index array.
        """
        time, angle, measured, model = (
            array[which] for array in (self.time, self.angle, self.measured, self.model)
        )
        return PairedSignal(time, angle, measured, model, ~self.away_from_jumps[which])

    @property
    def difference(self) -> FloatArray:
        """Measured minus modelled values of a quantity in SI, ``(n,)``."""
        return self.measured - self.model


@dataclass(frozen=True, eq=False)
class PairedStep:
    """Settled turns of one cam at one speed, as pairs of measured and modelled values.

    Settled turns follow after the transient at the start of a speed. `lift` and `force` are None if
    not measured. `levels` are the measured and the modelled sound level (dB). `exact` is True if
    the model was driven with exact recorded cam states, so that it can be compared sample by
    sample.
    """

    cam: str
    rpm: float
    turns: float
    lift: PairedSignal | None
    force: PairedSignal | None
    levels: tuple[float | None, float | None] = (None, None)
    exact: bool = False


#: Largest systematic deviation from the model that is still accepted as agreement, as a fraction of
#: the noise. It is not 0, because the noise is only estimated.
SYSTEMATIC_NOISE_FRACTION = 0.5
#: Factor f of the tolerance of the squared systematic deviation: two standard errors are f/√n,
#: relative to the squared noise, for n readings.
NOISE_ERROR_FACTOR = 5.4
#: Deviation from the model that counts as agreement even without noise in a run on a test bench, as
#: a fraction of the model's range.
RANGE_RTOL = 2e-4
#: Largest difference between successive turns of the model that count as equal, as a fraction of
#: the model's range.
TURN_RTOL = 0.02
#: Largest deviation that counts as rounding if the model was driven with exact recorded cam states,
#: as a fraction of the model's range.
ROUNDING_RTOL = 1e-9


@dataclass(frozen=True, eq=False)
class Departure:
    """Deviation of one quantity (measured minus model) at one speed.

    `rms` is the r.m.s. deviation. `noise` is the r.m.s. scatter from turn to turn, or 0 if the
    model was driven exactly. `largest` is the largest deviation with its sign. With noise it is
    that of the mean over the turns, in intervals of 2° of the turn. `degrees` is its cam angle in
    the turn. `scale` is the range of the model. `turn_variation` is the difference between the
    model's turns that 5 % of the readings exceed. `exact` is that of `PairedStep`. `readings` is
    the number of readings. `max_noise` is the largest noise that an instrument can have, as a
    fraction of `scale`.
    """

    rms: float
    noise: float
    largest: float
    degrees: float
    scale: float
    turn_variation: float
    exact: bool
    readings: int
    max_noise: float = math.inf

    @property
    def turns_differ(self) -> bool:
        """True if turns of the run differ by more than an instrument's noise.

        The measured cam angle is wrong then, or the number of counts per turn of the encoder.
        """
        return not self.varies_by_turn and self.noise > self.max_noise * self.scale

    @property
    def systematic(self) -> float:
        """R.m.s. deviation from the model without the noise.

        The noise is subtracted in quadrature: √(rms² − noise²).
        """
        return math.sqrt(max(self.rms**2 - self.noise**2, 0.0))

    @property
    def within(self) -> bool:
        """True if the noise explains the deviation of the run from the model.

        If the model was driven with exact recorded cam states, rounding must explain it.
        """
        if self.exact:
            return abs(self.largest) <= ROUNDING_RTOL * self.scale
        if self.turns_differ:
            return False
        error = NOISE_ERROR_FACTOR / math.sqrt(self.readings)
        allowed = math.sqrt(SYSTEMATIC_NOISE_FRACTION**2 + error) * self.noise
        return self.systematic <= max(allowed, RANGE_RTOL * self.scale)

    @property
    def varies_by_turn(self) -> bool:
        """True if the model's turns differ from each other, because the follower bounces.

        The curves of single turns are then not comparable.
        """
        return not self.exact and self.turn_variation > max(self.noise, TURN_RTOL * self.scale)

    @property
    def relative(self) -> float:
        """Largest deviation from the model as a fraction of the model's range."""
        return abs(self.largest) / self.scale if self.scale > 0.0 else math.inf


def departure(pair: PairedSignal, exact: bool, max_noise: float = math.inf) -> Departure:
    """Return the deviation of a measured signal from the model.

    Readings near a jump of the force are left out. `exact` is True if the model was driven with
    exact recorded cam states. `max_noise` is that of `Departure`.
    """
    pair = pair.select(pair.away_from_jumps)
    difference = pair.difference
    size, scale = rms(difference), float(np.ptp(pair.model))
    degrees_of_means, means, noise, turn_variation = pair.degrees, difference, 0.0, 0.0
    if not exact:
        noise = scatter(pair.angle, difference)
        degrees_of_means, means = mean_over_turns(pair.angle, difference)
        turn_variation = float(np.percentile(np.abs(off_neighbours(pair.angle, pair.model)), 95.0))
    index = int(np.argmax(np.abs(means)))
    largest, degrees = float(means[index]), float(degrees_of_means[index])
    return Departure(
        size, noise, largest, degrees, scale, turn_variation, exact, difference.size, max_noise
    )


def mean_over_turns(angle: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of a value over all turns, in equal intervals of the cam angle.

    The first result are the middles of the intervals (°), the second the means, both of shape (k,).
    `angle` is in rad. Intervals without a reading are left out.
    """
    bin_index = np.floor(np.remainder(angle, TURN) * (BINS / TURN)).astype(np.intp) % BINS
    count = np.bincount(bin_index, minlength=BINS)
    occupied = np.flatnonzero(count)
    total = np.bincount(bin_index, weights=value, minlength=BINS)
    degrees: FloatArray = (occupied.astype(np.float64) + 0.5) * (360.0 / BINS)
    return degrees, total[occupied] / count[occupied]


# Lift-offs and landings in the measured and the modelled values, by the same rule.
#: Force, or gap between follower and cam, beyond which contact counts as lost, in standard
#: deviations of the noise.
FORCE_SIGMAS = 4.0
#: Smallest force below which contact counts as lost, as a fraction of the mean force. It allows for
#: the zero offset of a load cell.
MEAN_FORCE_FRACTION = 0.02
#: Smallest gap between follower and cam that counts as a loss of contact, as a fraction of the
#: lift. It is used if no force was measured.
LIFT_FRACTION = 2e-3
#: Number of adjacent readings whose mean is used to distinguish a loss of contact from noise.
NEIGHBOURS = 5
#: Largest distance (rad) between a measured and a modelled lift-off or landing that are taken as
#: the same event.
MAX_EVENT_SHIFT = TURN / 12.0


@dataclass(frozen=True)
class LostContact:
    """Lift-offs per turn at one speed, and the delay of the measured events.

    `measured` and `model` are the numbers of lift-offs per turn. `shift` is the median delay in s
    of the measured lift-offs and landings relative to the model, over the events that both have. It
    is None without such events. `degrees` is the same as cam angle in °. `rule` is the criterion
    for lost contact as text.
    """

    measured: float
    model: float
    shift: float | None
    degrees: float | None
    rule: str


def lost_contact(step: PairedStep, law: Law) -> LostContact | None:
    """Return the measured and modelled lift-offs of a cam at one speed.

    The same criterion is used for both. Returns None if neither force nor lift was measured.
    """
    clear = 0.0
    if step.force is not None and step.lift is not None and step.exact:
        pair, rule = step.force, "F = 0, gap > 0"
        lost = (
            _exact_force(pair.measured, step.lift.measured, step.lift.angle, law),
            _exact_force(pair.model, step.lift.model, step.lift.angle, law),
        )
    elif step.force is not None:
        pair = step.force
        limit, zero = _force_limits(pair)
        clear, rule = limit - zero, f"F < {limit:.3g} N"
        lost = (pair.measured - limit, pair.model - limit)
    elif step.lift is not None:
        pair, rise = step.lift, law(np.remainder(step.lift.angle, TURN))
        noise = 0.0 if step.exact else scatter(pair.angle, pair.difference)
        limit = max(FORCE_SIGMAS * noise, LIFT_FRACTION * law.lift)
        lost = (limit + rise - pair.measured, limit + rise - pair.model)
        rule = f"gap > {1e3 * limit:.3g} mm"
    else:
        return None
    measured, modelled = (_contact_events(pair.time, margin, step.exact, clear) for margin in lost)
    speed = step.rpm * RPM
    shift = _median_shift(measured, modelled, MAX_EVENT_SHIFT / speed)
    counts = [events[0].size / step.turns for events in (measured, modelled)]
    degrees = None if shift is None else float(np.degrees(shift * speed))
    return LostContact(counts[0], counts[1], shift, degrees, rule)


def _exact_force(force: FloatArray, lift: FloatArray, angle: FloatArray, law: Law) -> FloatArray:
    """Return the contact force (N), with 0 replaced by 1 N where contact is kept.

    A force of 0 on a dwell is then not taken as a lost contact. The follower has left the cam only
    if the gap exceeds `MIN_GAP_RATIO` of the lift.
    """
    is_off = lift - law(np.remainder(angle, TURN)) > MIN_GAP_RATIO * law.lift
    return np.where((force <= 0.0) & ~is_off, 1.0, force)


def _force_limits(pair: PairedSignal) -> tuple[float, float]:
    """Return the two forces (N) below which contact counts as lost.

    The first is the limit for a single reading, the second the limit for the mean of adjacent
    readings.
    """
    degrees, means = mean_over_turns(pair.angle, pair.measured)
    lowest = degrees[np.argsort(means)[: max(1, means.size // 20)]]
    angle = np.remainder(np.degrees(pair.angle), 360.0)
    is_near = np.abs(angle[:, None] - lowest).min(axis=1) <= 360.0 / means.size
    noise = scatter(pair.angle[is_near], pair.difference[is_near]) if is_near.sum() > 2 else 0.0
    error = MEAN_FORCE_FRACTION * float(pair.measured.mean())
    return max(FORCE_SIGMAS * noise, error), max(noise, 0.5 * error)


def _contact_events(
    time: FloatArray, margin: FloatArray, exact: bool, clear: float
) -> tuple[FloatArray, FloatArray]:
    """Return the times (s) of lift-offs and of landings in a signal.

    Contact is lost while `margin` is not positive: the force (or the gap) relative to its limit. If
    the signal has noise (not `exact`), the mean of adjacent readings must also be `-clear` or less,
    because a small force on a dwell may fall below the limit at random.
    """
    lost = margin <= 0.0
    if not exact:  # a reading follows the majority of itself and its two neighbours
        padded = np.pad(lost.astype(np.intp), 1, mode="edge")
        lost = padded[:-2] + padded[1:-1] + padded[2:] >= 2
    edges = np.r_[0, np.flatnonzero(np.diff(lost)) + 1, lost.size]
    for start, end in pairwise(edges.tolist()):
        if lost[start]:
            count = min(NEIGHBOURS, end - start)
            means = np.convolve(margin[start:end], np.full(count, 1.0 / count), mode="valid")
            lost[start:end] = means.min() <= -clear
    changes = np.flatnonzero(np.diff(lost))
    if not changes.size:
        return np.empty(0), np.empty(0)
    before, after = margin[changes], margin[changes + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.clip(np.nan_to_num(before / (before - after), nan=0.5), 0.0, 1.0)
    times = time[changes] + fraction * (time[changes + 1] - time[changes])
    rises = lost[changes + 1]
    return times[rises], times[~rises]


def _median_shift(
    measured: tuple[FloatArray, FloatArray], model: tuple[FloatArray, FloatArray], max_shift: float
) -> float | None:
    """Return the median delay (s) of measured events relative to the model.

    Both are times of lift-offs and of landings. Events farther apart than `max_shift` (s) are not
    paired. The result is None without pairs.
    """
    shifts: list[float] = []
    for measured_times, model_times in zip(measured, model, strict=True):
        if not model_times.size:
            continue
        for time in measured_times:
            shift = float(time - model_times[np.argmin(np.abs(model_times - time))])
            shifts += [shift] if abs(shift) <= max_shift else []
    return float(np.median(shifts)) if shifts else None
