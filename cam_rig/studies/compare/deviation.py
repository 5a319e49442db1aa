"""How far a measured quantity is from the model's, and how much of that is its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws import Law
from cam_rig.simulation.by_speed import OFF_THE_CAM
from cam_rig.simulation.scatter import BINS, off_neighbours, scatter
from cam_rig.units import RPM, TURN, FloatArray, rms

# What was measured and what the model has, at the same instants.


@dataclass(frozen=True, eq=False)
class PairedSignal:
    """One quantity, measured and of the model; ``beside_jump`` where the model jumps near."""

    time: FloatArray
    angle: FloatArray
    measured: FloatArray
    model: FloatArray
    beside_jump: NDArray[np.bool_] | None = None

    @property
    def calm(self) -> NDArray[np.bool_]:
        """Which readings are not beside a jump."""
        return (
            np.ones(self.time.size, dtype=bool) if self.beside_jump is None else ~self.beside_jump
        )

    @property
    def degrees(self) -> FloatArray:
        """Cam angle in its turn, °."""
        return np.degrees(np.remainder(self.angle, TURN))

    def some(self, which: slice | NDArray[np.bool_ | np.intp]) -> PairedSignal:
        """Some of the readings."""
        time, angle, measured, model = (
            array[which] for array in (self.time, self.angle, self.measured, self.model)
        )
        return PairedSignal(time, angle, measured, model, ~self.calm[which])

    @property
    def difference(self) -> FloatArray:
        """Measured less model."""
        return self.measured - self.model


@dataclass(frozen=True, eq=False)
class PairedStep:
    """The settled turns of one cam at one speed; ``exact`` where driven sample by sample."""

    cam: str
    rpm: float
    turns: float
    lift: PairedSignal | None
    force: PairedSignal | None
    levels: tuple[float | None, float | None] = (None, None)
    exact: bool = False


#: What the noise does not explain is within it up to this part of it: an estimate has its error.
WITHIN = 0.5
#: Twice the standard error of what is left of the mean square, for one reading.
NOISE_ERROR = 5.4
#: Parts of the model's range: no bench shows finer differences; turns alike differ by less.
FINEST, LEAST_UNREST = 2e-4, 0.02
#: Exactly driven, two numbers that differ by this part of the largest value are one.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Departure:
    """Measured less model over the settled turns of one speed, SI.

    ``noise``: r.m.s. scatter from turn to turn, 0 where it was driven exactly; ``largest``: with
    its sign, of the mean over the turns in parts of 2° where there is noise; ``degrees``: cam angle
    in its turn at which that is; ``scale``: the model's range; ``unrest``: by so much the model's
    own turns differ in 5 % of the turn; ``exact``: as in `PairedStep`.
    """

    rms: float
    noise: float
    largest: float
    degrees: float
    scale: float
    unrest: float
    exact: bool
    readings: int

    @property
    def systematic(self) -> float:
        """What is left of the r.m.s. without the noise."""
        return math.sqrt(max(self.rms**2 - self.noise**2, 0.0))

    @property
    def within(self) -> bool:
        """Whether the noise explains the difference; exactly driven, whether rounding does."""
        if self.exact:
            return abs(self.largest) <= ROUNDING * self.scale
        error = NOISE_ERROR / math.sqrt(self.readings)
        allowed = math.sqrt(WITHIN**2 + error) * self.noise
        return self.systematic <= max(allowed, FINEST * self.scale)

    @property
    def restless(self) -> bool:
        """Whether the model's turns differ from each other, as it bounces: curves say little."""
        return not self.exact and self.unrest > max(self.noise, LEAST_UNREST * self.scale)

    @property
    def relative(self) -> float:
        """The largest difference as a part of the range of the model."""
        return abs(self.largest) / self.scale if self.scale > 0.0 else math.inf


def departure(pair: PairedSignal, exact: bool) -> Departure:
    """How far the measured is from the model, beside no jump."""
    pair = pair.some(pair.calm)
    difference = pair.difference
    size, scale = rms(difference), float(np.ptp(pair.model))
    places, means, noise, unrest = pair.degrees, difference, 0.0, 0.0
    if not exact:
        noise = scatter(pair.angle, difference)
        places, means = mean_over_turns(pair.angle, difference)
        unrest = float(np.percentile(np.abs(off_neighbours(pair.angle, pair.model)), 95.0))
    at = int(np.argmax(np.abs(means)))
    largest, degrees = float(means[at]), float(places[at])
    return Departure(size, noise, largest, degrees, scale, unrest, exact, difference.size)


def mean_over_turns(angle: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cam angles in the turn (°) and means of a value near them, where there are any."""
    part = np.floor(np.remainder(angle, TURN) * (BINS / TURN)).astype(np.intp) % BINS
    count = np.bincount(part, minlength=BINS)
    there = np.flatnonzero(count)
    total = np.bincount(part, weights=value, minlength=BINS)
    places: FloatArray = (there.astype(np.float64) + 0.5) * (360.0 / BINS)
    return places, total[there] / count[there]


# When the follower leaves its cam and lands, as readings show it: the same rule for both.

#: A force counts as lost below so many standard deviations of its noise,
SIGMAS = 4.0
#: and below this part of its mean: a load cell's zero is not exact.
PART_OF_MEAN = 0.02
#: Where no force was measured: m, the follower is off by more than this part of the lift.
PART_OF_LIFT = 2e-3
#: Neighbours whose mean tells a lost contact from noise.
NEIGHBOURS = 5
#: A measured and a modelled event this far apart (rad) are not the same one.
NEAR = TURN / 12.0


@dataclass(frozen=True)
class LostContact:
    """Lift-offs a turn of one speed, and how much later events are measured.

    ``shift``: s, median over the events that both have; None: no such; ``degrees``: the same as cam
    angle, °; ``rule``: in words, what counts as lost.
    """

    measured: float
    model: float
    shift: float | None
    degrees: float | None
    rule: str


def lost_contact(step: PairedStep, law: Law) -> LostContact | None:
    """The events of a step; None where neither force nor lift was measured."""
    clear = 0.0
    if step.force is not None and step.lift is not None and step.exact:
        pair, rule = step.force, "F = 0, gap > 0"
        lost = (
            _exactly(pair.measured, step.lift.measured, step.lift.angle, law),
            _exactly(pair.model, step.lift.model, step.lift.angle, law),
        )
    elif step.force is not None:
        pair = step.force
        limit, zero = _of_force(pair)
        clear, rule = limit - zero, f"F < {limit:.3g} N"
        lost = (pair.measured - limit, pair.model - limit)
    elif step.lift is not None:
        pair, rise = step.lift, law(np.remainder(step.lift.angle, TURN))
        noise = 0.0 if step.exact else scatter(pair.angle, pair.difference)
        limit = max(SIGMAS * noise, PART_OF_LIFT * law.lift)
        lost = (limit + rise - pair.measured, limit + rise - pair.model)
        rule = f"gap > {1e3 * limit:.3g} mm"
    else:
        return None
    here, there = (_events(pair.time, above, step.exact, clear) for above in lost)
    speed = step.rpm * RPM
    shift = _median_shift(here, there, NEAR / speed)
    counts = [found[0].size / step.turns for found in (here, there)]
    degrees = None if shift is None else float(np.degrees(shift * speed))
    return LostContact(counts[0], counts[1], shift, degrees, rule)


def _exactly(force: FloatArray, lift: FloatArray, angle: FloatArray, law: Law) -> FloatArray:
    """The force where it is above 0 or the follower off the cam; else it rests on a dwell."""
    off = lift - law(np.remainder(angle, TURN)) > OFF_THE_CAM * law.lift
    return np.where((force <= 0.0) & ~off, 1.0, force)


def _of_force(pair: PairedSignal) -> tuple[float, float]:
    """The force below which contact may be lost, and that below which the mean of some is none."""
    places, means = mean_over_turns(pair.angle, pair.measured)
    lowest = places[np.argsort(means)[: max(1, means.size // 20)]]
    part = np.remainder(np.degrees(pair.angle), 360.0)
    near = np.abs(part[:, None] - lowest).min(axis=1) <= 360.0 / means.size
    noise = scatter(pair.angle[near], pair.difference[near]) if near.sum() > 2 else 0.0
    error = PART_OF_MEAN * float(pair.measured.mean())
    return max(SIGMAS * noise, error), max(noise, 0.5 * error)


def _events(
    time: FloatArray, above: FloatArray, exact: bool, clear: float
) -> tuple[FloatArray, FloatArray]:
    """Times of lift-offs and of landings; where ``above`` is not positive, contact is lost.

    Of readings with noise, a loss counts if the mean of some neighbours is ``clear`` below that:
    on a dwell a small force may fall below the limit now and then.
    """
    lost = above <= 0.0
    if not exact:  # the majority of each reading and its neighbours: noise alone changes nothing
        padded = np.pad(lost.astype(np.intp), 1, mode="edge")
        lost = padded[:-2] + padded[1:-1] + padded[2:] >= 2
    edges = np.r_[0, np.flatnonzero(np.diff(lost)) + 1, lost.size]
    for begin, end in pairwise(edges.tolist()):
        if lost[begin]:
            count = min(NEIGHBOURS, end - begin)
            means = np.convolve(above[begin:end], np.full(count, 1.0 / count), mode="valid")
            lost[begin:end] = means.min() <= -clear
    changes = np.flatnonzero(np.diff(lost))
    if not changes.size:
        return np.empty(0), np.empty(0)
    before, after = above[changes], above[changes + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.clip(np.nan_to_num(before / (before - after), nan=0.5), 0.0, 1.0)
    at = time[changes] + part * (time[changes + 1] - time[changes])
    rises = lost[changes + 1]
    return at[rises], at[~rises]


def _median_shift(
    measured: tuple[FloatArray, FloatArray], model: tuple[FloatArray, FloatArray], near: float
) -> float | None:
    shifts: list[float] = []
    for here, there in zip(measured, model, strict=True):
        if not there.size:
            continue
        for time in here:
            shift = float(time - there[np.argmin(np.abs(there - time))])
            shifts += [shift] if abs(shift) <= near else []
    return float(np.median(shifts)) if shifts else None
