"""95 % intervals of the parameters of a contour, by profile likelihood.

Lifts depend strongly nonlinearly on the parameters. Readings may determine only that a prime radius
(base plus roller radius) is above 30 mm, or that a flank is flatter than some radius, convex or
concave. A standard error at the best contour does not show this. Each parameter is therefore fixed
at values farther and farther from the best, and all others are fitted again. The interval ends
where the sum of squares S has increased so that (S − S_min)/s² is the square of Student's t, with
s² = S_min/(n − p) for n readings and p parameters (Bates and Watts, *Nonlinear Regression Analysis
and Its Applications*, 1988, section 6.1).

The gauge's zero of each column is computed from its readings in dwells. Its error is common to all
lifts of the column. If a parameter increases by a when all lifts of a column increase by 1, the
zero adds the variance a² e², with the standard error e of the zero. The limit is increased
accordingly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cam_rig.studies.fit_cam.arcs.contour import Parameter, parameter_value
from cam_rig.studies.fit_cam.arcs.search import NO_CONTOUR_RESIDUAL, ArcSearch
from cam_rig.units import FloatArray

#: Probability of a value below the lower, or above the upper, end of a 95 % interval.
TAIL_PROBABILITY = 0.025
#: Tolerance of an end of a 95 % interval, relative to its distance from the best value. Two digits
#: of the end are displayed.
END_RTOL = 0.01
#: Relative tolerance of the sum of squares in a search with one fixed parameter of the contour. It
#: is far below the change of the sum at the end of an interval.
PROFILE_RTOL = 1e-6
#: Step of the search variables for a central difference. The variables are of the order of 1. The
#: step is of the order of the cube root of the rounding error, 6e-6.
DERIVATIVE_STEP = 1e-6
#: Standard error that is assumed for a coordinate of the contour if the lifts do not depend on it
#: to first order, relative to the largest search variable (at least 1). Case: a concave flank under
#: a flat follower. It sets only the first step, which is then doubled.
UNKNOWN_ERROR = 1e-3
#: Largest number of doublings of the first step in the search for an end of a 95 % interval. An end
#: beyond a factor of 10⁹ is taken as infinite.
MAX_DOUBLINGS = 30
#: Largest end of the interval of the prime radius (base plus roller radius), as a multiple of the
#: lift. A larger end is taken as infinite.
MAX_PRIME_LIFTS = 100.0


class LinearEstimate(NamedTuple):
    """Linear estimate of the uncertainty of one coordinate of the contour.

    ``error`` is its standard error, without that of the gauge's zero. ``limit`` is the distance at
    which the interval ends, see `Profile.distance`. ``gradient`` ``(p,)`` is the change of the p
    search variables per change of the coordinate, if all others are fitted again.
    """

    error: float
    limit: float
    gradient: FloatArray


@dataclass(frozen=True, eq=False)
class Profile:
    """Best contour of a search, and the profile likelihood of its parameters.

    ``x`` is the search variables of the best contour.
    """

    search: ArcSearch
    x: FloatArray

    @cached_property
    def sse(self) -> float:
        """Sum of squared residuals (m²) of the best contour, the smallest possible."""
        return self.search.sse(self.x)

    @cached_property
    def rms(self) -> float:
        """R.m.s. residual of all readings from the best contour, m."""
        return self.search.rms(self.x)

    @property
    def degrees_of_freedom(self) -> int:
        """Number of readings minus the numbers of free parameters and zeros, at least 1.

        Each column has one zero of the gauge.
        """
        return max(1, self.search.count - self.x.size - len(self.search.columns))

    @cached_property
    def variance(self) -> float:
        """Variance (m²) of a reading, from the residuals.

        It is at least the variance of the rounding.
        """
        rounding = min(column.rounding for column in self.search.columns)
        return max(self.sse / self.degrees_of_freedom, rounding**2)

    @cached_property
    def limit(self) -> float:
        """Distance from the best contour at the ends of an interval, by Student's t.

        The distance is that of `Profile.distance`, without errors of the gauge's zero.
        """
        from scipy.special import stdtrit

        return float(stdtrit(self.degrees_of_freedom, 1.0 - TAIL_PROBABILITY))

    def distance(self, sse: float) -> float:
        """Return the distance of a contour from the best, in standard errors of a reading.

        It is √((S − S_min)/s²). ``sse`` is the sum S of squared residuals (m²) of that contour, s²
        the variance of a reading.
        """
        return math.sqrt(max(0.0, sse - self.sse) / self.variance)

    def excludes(self, parameter: Parameter, sse: float) -> bool:
        """Return True if a contour is outside the 95 % interval of a parameter.

        ``sse`` is the sum of squared residuals (m²) of that contour.
        """
        return self.distance(sse) > self.linear_estimate(parameter).limit

    def linear_estimate(self, parameter: Parameter) -> LinearEstimate:
        """Return the linear estimate of the uncertainty of a coordinate.

        Lifts are taken as linear in all parameters. With the Jacobian J of the residuals and the
        gradient g of the coordinate, the variance of the coordinate is s² gᵀ(JᵀJ)⁻¹g. The sum of
        the weights gᵀ(JᵀJ)⁻¹Jᵀ of a column is the change of the coordinate if all lifts of the
        column change by 1.
        """
        x, search = self.x, self.search
        steps = DERIVATIVE_STEP * np.eye(x.size)

        def derivatives(function: Callable[[FloatArray], Any]) -> FloatArray:
            changes = [function(x + step) - function(x - step) for step in steps]
            return np.array(changes) / (2.0 * DERIVATIVE_STEP)

        gradient = derivatives(lambda y: search.coordinates.of(search.pitch(y))[parameter])
        jacobian = derivatives(search.residuals)  # transposed: p parameters, n readings
        direction = np.linalg.pinv(jacobian @ jacobian.T) @ gradient
        variance = float(gradient @ direction)
        if not variance > 0.0:  # lifts of a flat follower do not depend on a concave flank
            error = UNKNOWN_ERROR * max(1.0, float(np.abs(x).max()))
            return LinearEstimate(error, self.limit, 0.0 * x)
        ends = np.cumsum([column.angles.size for column in search.columns])
        weights = np.split(direction @ jacobian, ends[:-1])
        zero_variance = sum(
            (float(np.sum(column_weights)) * column.zero_error) ** 2
            for column_weights, column in zip(weights, search.columns, strict=True)
        )
        error = math.sqrt(self.variance * variance)
        limit = self.limit * math.hypot(1.0, math.sqrt(zero_variance) / error)
        return LinearEstimate(error, limit, direction / variance)

    def interval(self, parameter: Parameter) -> tuple[float, float]:
        """Return the two ends of the 95 % interval of a parameter (m or rad).

        They are ``low`` and ``high`` of `ParameterInterval`.
        """
        low, high = (
            parameter_value(parameter, self._interval_end(parameter, sign)) for sign in (-1.0, 1.0)
        )
        return (high, low) if parameter in (Parameter.PRIME, Parameter.FLANK) else (low, high)

    def _interval_end(self, parameter: Parameter, sign: float) -> float:
        """Return the coordinate at one end of a parameter's 95 % interval.

        `sign` selects the direction from the best contour: 1 or -1. If the limit is not reached,
        the result is 0 for a curvature that has a lower limit, else infinite.
        """
        from scipy.optimize import brentq

        lowest = -math.inf
        if parameter == Parameter.PRIME:
            lowest = 1.0 / (MAX_PRIME_LIFTS * self.search.pitch(self.x).lift)
        elif parameter == Parameter.FLANK and all(self.search.flats):
            lowest = 0.0  # a flat follower does not touch a concave flank
        path = _ProfilePath(self, parameter, lowest)
        inside, step = path.start, sign * path.estimate.limit * path.estimate.error
        for _ in range(MAX_DOUBLINGS):
            outside = max(path.start + step, lowest)
            if path.excess(outside) > 0.0:
                xtol = END_RTOL * abs(outside - path.start)
                return float(brentq(path.excess, inside, outside, xtol=xtol, rtol=1e-12))
            if outside == lowest:
                return 0.0
            inside, step = outside, 2.0 * step
        return sign * math.inf


class _ProfilePath:
    """Best contours over the values of one coordinate that is fixed in the search.

    The first is the best of all contours. Each computed contour is stored as a starting point for
    other values of the coordinate. ``lowest`` is the smallest allowed value.
    """

    def __init__(self, profile: Profile, parameter: Parameter, lowest: float) -> None:
        search = profile.search
        self._profile, self._parameter = profile, parameter
        self.estimate = profile.linear_estimate(parameter)
        coordinates = search.coordinates.of(search.pitch(profile.x))
        self.start = max(float(coordinates[parameter]), lowest)
        index = search.free.index(parameter)
        self._gradient = np.delete(self.estimate.gradient, index)
        self._solutions = {self.start: (np.delete(profile.x, index), -self.estimate.limit)}

    def excess(self, coordinate: float) -> float:
        """Return the distance of the best contour with this coordinate beyond the limit.

        The distance is `Profile.distance` of that contour minus the limit of the 95 % interval. It
        is negative inside the interval.
        """
        if coordinate in self._solutions:
            return self._solutions[coordinate][1]
        search = self._profile.search.fix(self._parameter, coordinate)
        start = self._extrapolate(coordinate)
        has_contour = search.rms(start) < NO_CONTOUR_RESIDUAL
        x = search.minimize(start, PROFILE_RTOL) if has_contour else search.solve()
        excess = self._profile.distance(search.sse(x)) - self.estimate.limit
        self._solutions[coordinate] = x, excess
        return excess

    def _extrapolate(self, coordinate: float) -> FloatArray:
        """Return start values for the search of the contour with this coordinate.

        They are a linear extrapolation from the two nearest computed contours within twice the
        limit. With noisy readings, a search from the nearest contour alone does not find the best
        contour.
        """
        limit = self.estimate.limit
        usable = [c for c, (_, excess) in self._solutions.items() if excess < limit]
        nearest, *others = sorted(usable, key=lambda other: abs(other - coordinate))[:2]
        x, gradient = self._solutions[nearest][0], self._gradient
        if others:
            gradient = (self._solutions[others[0]][0] - x) / (others[0] - nearest)
        return x + (coordinate - nearest) * gradient
