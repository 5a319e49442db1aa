"""What readings tell of each number of a contour: intervals of 95 % by profile likelihood.

Lifts bend strongly with the numbers: a prime radius may be told to be above 30 mm and no more, a
flank to be flatter than some radius, convex or concave. A standard error at the best contour knows
nothing of it. So each number is held at values farther and farther off, all others are fitted
again, and the interval ends where the sum of squares S has risen so far that (S − S_min)/s² is the
square of Student's t (Bates and Watts, *Nonlinear Regression Analysis and Its Applications*, 1988,
section 6.1), with s² = S_min/(n − p).

The gauge's zero of each column was found in its resting readings, and its error is one of all its
lifts: a number that rises by a when all lifts of a column rise by 1 has the variance a² e² more,
with the standard error e of the zero. The limit is widened by as much.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cam_rig.studies.fit_cam.arcs import FLANK, NO_CONTOUR, PRIME, ArcSearch, number_of
from cam_rig.units import FloatArray, rounded_to_error

#: What lies outside of an interval on either side.
OUTSIDE = 0.025
#: Standard errors from the middle of an interval to its ends, of a normal error.
ENDS = 1.96
#: Ends are found to this part of their distance from the best number.
ENDS_TO = 0.01
#: The sum of squares of a contour is found to this part of it.
NEAR = 1e-6
#: Step of the search's numbers, which are of the order of 1, for their slopes.
SLOPE_STEP = 1e-6
#: Standard error of a coordinate, in parts, where the slopes tell none.
FIRST_STEP = 1e-3
#: An end beyond so many doublings of the first step, or a radius of so many lifts, is none.
DOUBLINGS, MOST_LIFTS = 30, 100.0
#: A number is told poorly where its standard error is more than this part of it.
POORLY = 1.0 / 3.0


@dataclass(frozen=True)
class Told:
    """A number of a contour, m or rad, and its interval of 95 %.

    A flank's goes from the smallest convex radius, ``low``, over straight, which is infinite, to
    concave radii, which are negative.

    ``held``: why it has no interval: given, or assumed; ``unit``: in which it is shown, mm or deg.
    """

    name: str
    value: float
    low: float
    high: float
    held: str = ""
    unit: str = "mm"

    @property
    def over_straight(self) -> bool:
        """Whether the interval of a flank's radius goes through infinity."""
        return self.low > self.high

    @property
    def low_95(self) -> float | None:
        """Lower end of the interval, None if it is held or no interval of numbers."""
        return None if self.held or self.over_straight else self.low

    @property
    def high_95(self) -> float | None:
        """Upper end of the interval, None if it is held or no interval of numbers."""
        return None if self.held or self.over_straight else self.high

    @property
    def convex_from_95(self) -> float | None:
        """Least convex radius (m) of an interval that contains a straight flank, else None."""
        return self.low if self.over_straight else None

    @property
    def concave_from_95(self) -> float | None:
        """Least concave radius (m) of an interval that contains a straight flank, else None."""
        return -self.high if self.over_straight else None

    @property
    def error(self) -> float:
        """Standard error, a part of the interval; NaN where that is no stretch of numbers."""
        if self.held or self.over_straight or not math.isfinite(self.high - self.low):
            return math.nan
        return (self.high - self.low) / (2.0 * ENDS)

    @property
    def hardly(self) -> bool:
        """Whether the readings hardly tell it, or not at all; an angle may well be 0."""
        if self.held or not math.isfinite(self.error):
            return not self.held
        return self.unit == "mm" and self.error > POORLY * abs(self.value)

    @property
    def how_well(self) -> str:
        """A warning beside a number that the readings hardly tell."""
        if self.held:
            return self.held
        if self.over_straight or not math.isfinite(self.value):
            return "straight within the readings"
        if not math.isfinite(self.error):
            return "not told"
        return "poorly" if self.hardly else ""

    @property
    def _factor(self) -> float:
        return 1e3 if self.unit == "mm" else math.degrees(1.0)

    @property
    def shown(self) -> str:
        """To the digits of its error, four where it is hardly told."""
        if not math.isfinite(self.value):
            return "straight"
        value = self._factor * self.value
        if math.isfinite(self.error):
            return f"{rounded_to_error(value, self._factor * self.error)} {self.unit}"
        return f"{value:.{6 if self.held else 4}g} {self.unit}"

    @property
    def interval(self) -> str:
        """In words; empty of a number that is held."""
        if self.held:
            return ""
        low, high = self._end(self.low), self._end(self.high)
        if self.over_straight:
            convex = f"{low} {self.unit} convex" if 0.0 < self.low < math.inf else "any"
            concave = f"{high.lstrip('-')} {self.unit} concave" if self.high < 0.0 else "any"
            return f"{convex} over straight to {concave}"
        if not math.isfinite(self.high):
            return f"above {low} {self.unit}" if math.isfinite(self.low) else "any"
        words = f"{low} to" if math.isfinite(self.low) else "below"
        return f"{words} {high} {self.unit}"

    def _end(self, end: float) -> str:
        value, error = self._factor * end, self._factor * self.error
        if math.isfinite(error):
            return rounded_to_error(value, error)
        return f"{float(f'{value:.3g}'):g}"


class Line(NamedTuple):
    """A coordinate by the slopes at the best contour.

    ``error``: its standard error, without that of the gauge's zero; ``limit``: how far, in errors
    of a reading, the contours of its interval are from the best; ``ahead``: ``(p,)`` slopes of the
    search's numbers along the best contours.
    """

    error: float
    limit: float
    ahead: FloatArray


@dataclass(frozen=True, eq=False)
class Profile:
    """The sum of squares about the best contour of a search, as numbers are held elsewhere."""

    search: ArcSearch
    x: FloatArray

    @cached_property
    def squares(self) -> float:
        """The least sum of squares, m²."""
        return float(np.sum(self.search.away(self.x) ** 2))

    @cached_property
    def rms(self) -> float:
        """r.m.s. residual of all readings, m."""
        return self.search.rms(self.x)

    @property
    def spare(self) -> int:
        """How many more readings there are than numbers and zeros, one at least."""
        return max(1, self.search.count - self.x.size - len(self.search.columns))

    @cached_property
    def variance(self) -> float:
        """Variance (m²) of a reading: what is left, and that of the rounding at least."""
        rounding = min(column.rounding for column in self.search.columns)
        return max(self.squares / self.spare, rounding**2)

    @cached_property
    def limit(self) -> float:
        """Student's t: how far, in errors of a reading, a contour may be from the best."""
        from scipy.special import stdtrit

        return float(stdtrit(self.spare, 1.0 - OUTSIDE))

    def away(self, squares: float) -> float:
        """How far a contour of other numbers is from the best, in errors of a reading."""
        return math.sqrt(max(0.0, squares - self.squares) / self.variance)

    def line(self, index: int) -> Line:
        """A coordinate of contours near the best, as if lifts were linear in all numbers."""
        x, search = self.x, self.search
        steps = SLOPE_STEP * np.eye(x.size)

        def slopes(function: Callable[[FloatArray], Any]) -> FloatArray:
            rises = [function(x + h) - function(x - h) for h in steps]
            return np.array(rises) / (2.0 * SLOPE_STEP)

        turn = slopes(lambda y: search.form.coordinates(search.pitch(y))[index])
        bent = slopes(search.away)
        spread = np.linalg.pinv(bent @ bent.T) @ turn
        variance = float(turn @ spread)
        if not variance > 0.0:  # a concave flank under a flat face, where nothing changes
            return Line(FIRST_STEP * max(1.0, float(np.abs(x).max())), self.limit, 0.0 * x)
        ends = np.cumsum([column.angles.size for column in search.columns])
        weights = np.split(spread @ bent, ends[:-1])
        zeros = sum(
            (float(np.sum(own)) * column.zero_error) ** 2
            for own, column in zip(weights, search.columns, strict=True)
        )
        error = math.sqrt(self.variance * variance)
        limit = self.limit * math.hypot(1.0, math.sqrt(zeros) / error)
        return Line(error, limit, spread / variance)

    def interval(self, index: int) -> tuple[float, float]:
        """Least and greatest of a number (m, rad) within the limit, as `Told` has them."""
        below, above = (number_of(index, self._end(index, sign)) for sign in (-1.0, 1.0))
        return (above, below) if index in (PRIME, FLANK) else (below, above)

    def _end(self, index: int, sign: float) -> float:
        """Where the limit is reached; 0 of a curvature, or infinite, if it is nowhere."""
        from scipy.optimize import brentq

        least = -math.inf
        if index == PRIME:
            least = 1.0 / (MOST_LIFTS * self.search.pitch(self.x).lift)
        elif index == FLANK and all(self.search.flats):
            least = 0.0  # a flat face does not reach a concave flank
        path = _Path(self, index, least)
        inside, step = path.start, sign * path.limit * path.error
        for _ in range(DOUBLINGS):
            outside = max(path.start + step, least)
            if path.above(outside) > 0.0:
                near = ENDS_TO * abs(outside - path.start)
                return float(brentq(path.above, inside, outside, xtol=near, rtol=1e-12))
            if outside == least:
                return 0.0
            inside, step = outside, 2.0 * step
        return sign * math.inf


class _Path:
    """The best contours with one number held, from the best of all on either side."""

    def __init__(self, profile: Profile, index: int, least: float) -> None:
        self._profile, self._index = profile, index
        self._place = profile.search.free.index(index)
        form, pitch = profile.search.form, profile.search.pitch(profile.x)
        self.start = max(float(form.coordinates(pitch)[index]), least)
        self.error, self.limit, ahead = profile.line(index)
        self._ahead = np.delete(ahead, self._place)
        self._found = {self.start: (np.delete(profile.x, self._place), -self.limit)}

    def above(self, coordinate: float) -> float:
        """How far beyond the limit the best contour is that has this coordinate."""
        if coordinate in self._found:
            return self._found[coordinate][1]
        profile = self._profile
        search = profile.search.holding(self._index, coordinate)
        starts = [x for x in self._guesses(coordinate) if search.rms(x) < NO_CONTOUR]
        ends = [search.nearest(x, NEAR) for x in starts[:1]] or [search.best()]
        squares = float(np.sum(search.away(ends[0]) ** 2))
        above = profile.away(squares) - self.limit
        self._found[coordinate] = ends[0], above
        return above

    def _guesses(self, coordinate: float) -> Iterator[FloatArray]:
        """On the line through the two nearest contours within twice the limit; the nearest."""
        good = [c for c, (_, above) in self._found.items() if above < self.limit]
        near, *more = sorted(good, key=lambda one: abs(one - coordinate))[:2]
        x = self._found[near][0]
        slope = (self._found[more[0]][0] - x) / (more[0] - near) if more else self._ahead
        yield x + (coordinate - near) * slope
        yield x
