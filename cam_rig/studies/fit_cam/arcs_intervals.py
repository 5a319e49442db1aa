"""Intervals (95 %) of the parameters of a contour, by profile likelihood.

Lifts are strongly nonlinear in the parameters. Readings may determine only that a prime radius is
above 30 mm, or that a flank is flatter than some radius, convex or concave. A standard error at the
best contour does not show this. Each parameter is therefore fixed at values farther and farther
from the best, and all others are fitted again. The interval ends at the value at which the sum of
squares S has increased so that (S − S_min)/s² is the square of Student's t, with s² = S_min/(n − p)
for n readings and p parameters (Bates and Watts, *Nonlinear Regression Analysis and Its
Applications*, 1988, section 6.1).

The gauge's zero of each column is computed from its resting readings. Its error is common to all
lifts of the column. If a parameter increases by a when all lifts of a column increase by 1, the
zero adds the variance a² e², with the standard error e of the zero. The limit is increased
accordingly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cam_rig.studies.fit_cam.arcs import FLANK, NO_CONTOUR, PRIME, ArcSearch, number_of
from cam_rig.units import FloatArray, round_to_error

#: Probability of a value beyond each end of an interval.
OUTSIDE = 0.025
#: Distance from the middle of an interval to its ends, in standard errors of a normal error.
ENDS = 1.96
#: Tolerance of the end of an interval, relative to its distance from the best value.
ENDS_TO = 0.01
#: Relative tolerance of the sum of squares of a contour with a fixed parameter.
NEAR = 1e-6
#: Step of the search variables for numerical derivatives. The variables are of the order of 1.
SLOPE_STEP = 1e-6
#: Relative standard error of a coordinate that is assumed if the derivatives do not determine it.
FIRST_STEP = 1e-3
#: Largest number of doublings of the first step, and largest prime radius in lifts. An end beyond
#: these is infinite.
DOUBLINGS, MOST_LIFTS = 30, 100.0
#: Relative standard error above which a parameter is poorly determined.
POORLY = 1.0 / 3.0


@dataclass(frozen=True)
class Told:
    """Parameter of a contour, in m or rad, and its 95 % interval.

    The interval of a flank radius can extend from the smallest convex radius, ``low``, over a
    straight flank (infinite radius) to concave flanks (negative radius), ``high``.

    ``held`` is "given" or "assumed" for a fixed parameter, which has no interval, else empty.
    ``unit`` is the unit for display: mm or deg.
    """

    name: str
    value: float
    low: float
    high: float
    held: str = ""
    unit: str = "mm"

    @property
    def over_straight(self) -> bool:
        """True if the interval of a flank radius contains a straight flank."""
        return self.low > self.high

    @property
    def low_95(self) -> float | None:
        """Lower end of the interval, None if fixed or if the interval contains straight."""
        return None if self.held or self.over_straight else self.low

    @property
    def high_95(self) -> float | None:
        """Upper end of the interval, None if fixed or if the interval contains straight."""
        return None if self.held or self.over_straight else self.high

    @property
    def convex_from_95(self) -> float | None:
        """Smallest convex radius (m) if the interval contains straight, else None."""
        return self.low if self.over_straight else None

    @property
    def concave_from_95(self) -> float | None:
        """Smallest concave radius (m) if the interval contains straight, else None."""
        return -self.high if self.over_straight else None

    @property
    def error(self) -> float:
        """Standard error from the width of the interval, NaN if that is not finite.

        It is also NaN if the parameter is fixed or the interval contains a straight flank.
        """
        if self.held or self.over_straight or not math.isfinite(self.high - self.low):
            return math.nan
        return (self.high - self.low) / (2.0 * ENDS)

    @property
    def hardly(self) -> bool:
        """True if the readings determine the parameter poorly or not at all.

        The relative error of an angle is not checked, because an angle can be 0.
        """
        if self.held or not math.isfinite(self.error):
            return not self.held
        return self.unit == "mm" and self.error > POORLY * abs(self.value)

    @property
    def how_well(self) -> str:
        """Warning about a fixed or poorly determined parameter, else an empty string."""
        if self.held:
            return self.held
        if self.over_straight or not math.isfinite(self.value):
            return "straight within the readings"
        if not math.isfinite(self.error):
            return "undetermined"
        return "poorly" if self.hardly else ""

    @property
    def _factor(self) -> float:
        return 1e3 if self.unit == "mm" else math.degrees(1.0)

    @property
    def shown(self) -> str:
        """Value as text, rounded to its standard error.

        A value without a standard error has four digits, or six if it is fixed.
        """
        if not math.isfinite(self.value):
            return "straight"
        value = self._factor * self.value
        if math.isfinite(self.error):
            return f"{round_to_error(value, self._factor * self.error)} {self.unit}"
        return f"{value:.{6 if self.held else 4}g} {self.unit}"

    @property
    def interval(self) -> str:
        """Interval as text, empty for a fixed parameter."""
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
            return round_to_error(value, error)
        return f"{float(f'{value:.3g}'):g}"


class Line(NamedTuple):
    """Linear estimate of a coordinate near the best contour.

    ``error`` is its standard error, without that of the gauge's zero. ``limit`` is the distance of
    the interval's ends from the best contour, in errors of a reading. ``ahead`` is the derivatives
    of the search variables with respect to the coordinate along the best contours, ``(p,)``.
    """

    error: float
    limit: float
    ahead: FloatArray


@dataclass(frozen=True, eq=False)
class Profile:
    """Best contour of a search, and the profile likelihood of its parameters.

    ``x`` is the search variables of the best contour.
    """

    search: ArcSearch
    x: FloatArray

    @cached_property
    def squares(self) -> float:
        """Smallest sum of squares, m²."""
        return float(np.sum(self.search.away(self.x) ** 2))

    @cached_property
    def rms(self) -> float:
        """Residual of all readings, r.m.s. in m."""
        return self.search.rms(self.x)

    @property
    def spare(self) -> int:
        """Number of readings less that of free parameters and zeros, at least 1."""
        return max(1, self.search.count - self.x.size - len(self.search.columns))

    @cached_property
    def variance(self) -> float:
        """Variance (m²) of a reading, from the residuals, at least that of the rounding."""
        rounding = min(column.rounding for column in self.search.columns)
        return max(self.squares / self.spare, rounding**2)

    @cached_property
    def limit(self) -> float:
        """Student's t: largest distance from the best contour, in errors of a reading."""
        from scipy.special import stdtrit

        return float(stdtrit(self.spare, 1.0 - OUTSIDE))

    def away(self, squares: float) -> float:
        """Return the distance of a contour from the best, in errors of a reading.

        ``squares`` is the sum of squares (m²) of that contour.
        """
        return math.sqrt(max(0.0, squares - self.squares) / self.variance)

    def line(self, index: int) -> Line:
        """Return the estimate of a coordinate for lifts that are linear in all parameters."""
        x, search = self.x, self.search
        steps = SLOPE_STEP * np.eye(x.size)

        def slopes(function: Callable[[FloatArray], Any]) -> FloatArray:
            rises = [function(x + h) - function(x - h) for h in steps]
            return np.array(rises) / (2.0 * SLOPE_STEP)

        turn = slopes(lambda y: search.form.coordinates(search.pitch(y))[index])
        bent = slopes(search.away)
        spread = np.linalg.pinv(bent @ bent.T) @ turn
        variance = float(turn @ spread)
        if not variance > 0.0:  # lifts of a flat face do not depend on a concave flank
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
        """Return the two ends of the interval of a parameter (m, rad).

        They are ``low`` and ``high`` of `Told`.
        """
        below, above = (number_of(index, self._end(index, sign)) for sign in (-1.0, 1.0))
        return (above, below) if index in (PRIME, FLANK) else (below, above)

    def _end(self, index: int, sign: float) -> float:
        """Return the coordinate at which the limit is reached, in the direction `sign`.

        If it is not reached, return 0 for a bounded curvature, else an infinite value.
        """
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
    """Best contours with one fixed coordinate, as a function of this coordinate.

    The path starts at the best of all contours. Each result is kept as a starting point for the
    next coordinates.
    """

    def __init__(self, profile: Profile, index: int, least: float) -> None:
        self._profile, self._index = profile, index
        self._place = profile.search.free.index(index)
        form, pitch = profile.search.form, profile.search.pitch(profile.x)
        self.start = max(float(form.coordinates(pitch)[index]), least)
        self.error, self.limit, ahead = profile.line(index)
        self._ahead = np.delete(ahead, self._place)
        self._found = {self.start: (np.delete(profile.x, self._place), -self.limit)}

    def above(self, coordinate: float) -> float:
        """Return the distance beyond the limit of the best contour with this coordinate.

        The distance is in errors of a reading, negative within the limit.
        """
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
        """Yield two starting points for the contour with this coordinate.

        The first is a linear extrapolation from the two nearest contours within twice the limit.
        The second is the nearest contour.
        """
        good = [c for c, (_, above) in self._found.items() if above < self.limit]
        near, *more = sorted(good, key=lambda one: abs(one - coordinate))[:2]
        x = self._found[near][0]
        slope = (self._found[more[0]][0] - x) / (more[0] - near) if more else self._ahead
        yield x + (coordinate - near) * slope
        yield x
