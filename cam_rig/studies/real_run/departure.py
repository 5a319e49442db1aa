"""How far a measured quantity is from the model's, and how much of that is its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.studies.real_run.pairs import PairedSignal
from cam_rig.units import TURN

#: Parts of a turn in which noise is estimated, and over which differences are averaged.
BINS = 180
#: Readings in a part of a turn from which its noise is estimated, at least: of fewer, the square
#: of the median is too large.
LEAST = 40
#: Median of the absolute value of normal noise, in standard deviations.
MEDIAN = 0.6744897501960817
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
    """Measured less model over the settled turns of one speed.

    Parameters
    ----------
    rms : root mean square of the difference, SI
    noise : r.m.s. scatter of the readings from turn to turn, SI; 0 where it was driven exactly
    largest : the difference of the largest size, with its sign; of the mean over the turns, in
        parts of 2°, where there is noise
    degrees : cam angle in its turn at which that is
    scale : largest less least value of the model
    unrest : SI, by so much the model's own turns differ from each other in 5 % of the turn
    exact : whether the model was driven with the very states of the cam
    readings : how many
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
    """How far the measured is from the model, beside no jump.

    Examples
    --------
    >>> angle = np.linspace(0.0, 10.0 * TURN, 20000)
    >>> rng = np.random.default_rng(1)
    >>> pair = PairedSignal(angle, angle, np.cos(angle) + rng.normal(0, 0.01, 20000), np.cos(angle))
    >>> found = departure(pair, exact=False)
    >>> bool(abs(found.noise - 0.01) < 3e-4), found.within
    (True, True)
    """
    pair = pair.calm()
    difference = pair.difference
    rms = math.sqrt(float(np.mean(difference**2)))
    scale = float(np.ptp(pair.model))
    if exact:
        at = int(np.argmax(np.abs(difference)))
        degrees = float(np.degrees(np.remainder(pair.angle[at], TURN)))
        return Departure(
            rms, 0.0, float(difference[at]), degrees, scale, 0.0, exact, difference.size
        )
    noise = scatter(pair.angle, difference)
    places, means = mean_over_turns(pair.angle, difference)
    at = int(np.argmax(np.abs(means)))
    unrest = float(np.percentile(np.abs(_off_neighbours(pair.angle, pair.model)), 95.0))
    largest, degrees = float(means[at]), float(places[at])
    return Departure(rms, noise, largest, degrees, scale, unrest, exact, difference.size)


def mean_over_turns(angle: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cam angles in the turn (°) and means of a value near them, where there are any."""
    part = np.floor(np.remainder(angle, TURN) * (BINS / TURN)).astype(np.intp) % BINS
    count = np.bincount(part, minlength=BINS)
    there = np.flatnonzero(count)
    total = np.bincount(part, weights=value, minlength=BINS)
    places: FloatArray = (there.astype(np.float64) + 0.5) * (360.0 / BINS)
    return places, total[there] / count[there]


def scatter(angle: FloatArray, value: FloatArray) -> float:
    """r.m.s. of what differs from turn to turn, of readings at any angles.

    Readings that are neighbours by their angle in the turn are of different turns mostly: each is
    taken less what its two neighbours have there on a straight line. The median of each part of a
    turn counts, so that a departure that moves quickly there (a landing) is no more than its part.
    """
    off = np.abs(_off_neighbours(angle, value))
    if not off.size:
        return 0.0
    bins = max(1, min(BINS, off.size // LEAST))
    medians = [float(np.median(part)) for part in np.array_split(off, bins)]
    return math.sqrt(float(np.mean(np.square(medians)))) / MEDIAN


def _off_neighbours(angle: FloatArray, value: FloatArray) -> FloatArray:
    """Each value less that of its neighbours by the angle in the turn, with a value's scatter."""
    inside = np.remainder(angle, TURN)
    order = np.argsort(inside, kind="stable")
    places, values = inside[order], value[order]
    if values.size < 3:
        return np.empty(0)
    span = places[2:] - places[:-2]
    ahead = np.divide(places[2:] - places[1:-1], span, out=np.full_like(span, 0.5), where=span > 0)
    off = values[1:-1] - ahead * values[:-2] - (1.0 - ahead) * values[2:]
    off /= np.sqrt(1.0 + ahead**2 + (1.0 - ahead) ** 2)
    return np.asarray(off)
