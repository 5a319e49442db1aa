"""Least-squares search for a contour of tangent arcs. Any of its parameters can be fixed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws.arc_law import ArcFollower
from cam_rig.studies.fit_cam.arcs.contour import ArcColumn, Arcs, Coordinates, Parameter
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import FloatArray, rms

# Short names of the parameters.
PRIME = Parameter.PRIME
LIFT = Parameter.LIFT
FLANK = Parameter.FLANK
NOSE = Parameter.NOSE
ANGLE = Parameter.ANGLE

#: Start value of the prime circle's radius in the search, in lifts: a usual proportion of cams.
START_PRIME_LIFTS = 3.0
#: Start value of the nose radius in the search, as a fraction of the range of the nose radius.
START_NOSE = 0.3
#: Start values of the flanks' curvature in the search, as fractions of the largest curvature:
#: slightly convex, strongly convex, and concave. The search misses a contour without the first
#: under a large roller, without the second at a sharp nose, and without the third at a nose as
#: large as the base.
START_FLANKS = (0.3, 0.7, -0.3)
#: Relative tolerance of a rough search, which only ranks starts and interpretations.
ROUGH_RTOL = 1e-8
#: Largest number of evaluations of the residuals in a rough search.
MAX_ROUGH_EVALUATIONS = 30
#: Relative tolerance of the final search, near the rounding of floating-point numbers.
FINAL_RTOL = 1e-12
#: Error message if no contour is close to the readings, or if no contour has the parameters.
NO_CLOSE_CONTOUR = (
    "no base circle, two equal flanks and a nose come near the readings; allowed: a symmetric cam, "
    "else --shape spline"
)
#: Residual (m) assigned to each reading if no contour has the parameters, far above any other
#: residual.
NO_CONTOUR_RESIDUAL = 1.0
#: Curvature below which a flank counts as straight, as a fraction of the prime circle's curvature.
#: Over the length of a flank, such a curvature changes the lift by less than 1e-6 of the radius.
STRAIGHT_CURVATURE = 1e-6


@dataclass(frozen=True)
class Role:
    """Interpretation of a column: the kind of its follower, and the turning sense."""

    is_flat: bool
    is_reversed: bool


@dataclass(frozen=True, eq=False)
class ArcSearch:
    """Least-squares search for the pitch curve, for one interpretation of the columns.

    The pitch curve is the contour enlarged by the roller radius. Lifts determine only this curve:
    those of a roller are the polar radii of its centre, and those of a flat face are equal on all
    parallel contours.

    Attributes
    ----------
    columns : tuple of Readings
        Readings of each column.
    roles : tuple of Role
        Interpretation of each column.
    coordinates : Coordinates
        Coordinates of a contour.
    fixed : mapping of Parameter to float
        Value of each fixed coordinate.
    min_radius : float
        Radius in m that base and nose of the pitch curve must exceed: that of a given roller, else
        0.
    """

    columns: tuple[Readings, ...]
    roles: tuple[Role, ...]
    coordinates: Coordinates
    fixed: Mapping[Parameter, float] = field(default_factory=dict)
    min_radius: float = 0.0

    @property
    def free(self) -> tuple[Parameter, ...]:
        """Free parameters of the contour."""
        return tuple(parameter for parameter in Parameter if parameter not in self.fixed)

    @property
    def flats(self) -> tuple[bool, ...]:
        """Flag of each column, True if its follower is flat."""
        return tuple(role.is_flat for role in self.roles)

    @property
    def count(self) -> int:
        """Number of readings of all columns."""
        return sum(column.angles.size for column in self.columns)

    @property
    def name(self) -> str:
        """Interpretation of the columns as text: followers and turning senses."""
        kinds = ("roller" if self.coordinates.rolling else "point", "flat")
        return ", ".join(
            f"{column.name.rpartition(', ')[2]} {kinds[role.is_flat]}"
            f"{' reversed' if role.is_reversed else ''}"
            for column, role in zip(self.columns, self.roles, strict=True)
        )

    def fix(self, parameter: Parameter, coordinate: float) -> ArcSearch:
        """Return the search with one more fixed coordinate of the contour."""
        return replace(self, fixed={**self.fixed, parameter: coordinate})

    # Residuals of a contour.

    def pitch(self, x: FloatArray) -> Arcs:
        """Return the pitch curve of search variables, one per free parameter.

        The search variables are not bounded. The variables of prime radius and lift are their
        logarithms. A variable x of the flank is the curvature 1 − e^x, as a fraction of the largest
        curvature that still joins base and nose, so that x = 0 is a straight flank. The variable of
        the nose is the logit of its radius within its limits. The angle (rad) is its variable.

        Raises
        ------
        LawError
            If no contour has these parameters.
        """
        free, fixed = dict(zip(self.free, x.tolist(), strict=True)), self.fixed
        no_contour = LawError(f"{self.columns[0].name}: {NO_CLOSE_CONTOUR}")
        prime = math.exp(free[PRIME]) if PRIME in free else 1.0 / fixed[PRIME]
        lift = math.exp(free[LIFT]) if LIFT in free else fixed[LIFT]
        shift, max_nose = self.coordinates.shift(prime), _min_convex_radius(prime, lift)
        if FLANK in free:
            curvature = -math.expm1(free[FLANK]) / max_nose
        else:
            divisor = 1.0 - fixed[FLANK] * shift
            if not divisor > 0.0:
                raise no_contour
            curvature = fixed[FLANK] / divisor
        is_straight = abs(curvature) < STRAIGHT_CURVATURE / prime
        if NOSE in free:
            room = max_nose - self.min_radius
            nose = self.min_radius + room / (1.0 + math.exp(-free[NOSE]))
        else:
            nose = fixed[NOSE] - shift
        if not self.min_radius < nose < max_nose or not prime > self.min_radius:
            raise no_contour
        angle = free[ANGLE] if ANGLE in free else fixed[ANGLE]
        return Arcs(prime, lift, None if is_straight else 1.0 / curvature, nose, angle)

    def column(self, x: FloatArray, i: int) -> ArcColumn:
        """Return column `i` with its residuals from the pitch curve.

        On the pitch curve the follower is a point or flat.

        Raises
        ------
        LawError
            If no contour has these parameters, or the follower does not reach it.
        """
        readings, role = self.columns[i], self.roles[i]
        angles = -readings.angles if role.is_reversed else readings.angles
        follower = ArcFollower(role.is_flat, 0.0)
        with np.errstate(all="ignore"):
            residuals = self.pitch(x).lifts(follower, angles) - readings.lifts
        if not np.isfinite(residuals).all():
            raise LawError("the follower does not reach the contour")
        return ArcColumn(readings, follower, role.is_reversed, residuals)

    def residuals(self, x: FloatArray) -> FloatArray:
        """Return the residuals (m) of all readings for the search variables `x`, ``(n,)``."""
        try:
            columns = [self.column(x, i) for i in range(len(self.columns))]
        except (LawError, OverflowError, ZeroDivisionError):
            return np.full(self.count, NO_CONTOUR_RESIDUAL)
        return np.concatenate([column.residuals for column in columns])

    def sse(self, x: FloatArray) -> float:
        """Return the sum of squared residuals (m²) for the search variables `x`."""
        return float(np.sum(self.residuals(x) ** 2))

    def rms(self, x: FloatArray) -> float:
        """Return the r.m.s. residual (m) of all readings for the search variables `x`."""
        return rms(self.residuals(x))

    # Minimum of the residuals.

    def solve(self) -> FloatArray:
        """Search for the best contour, and return its search variables."""
        return self.minimize(self.rough_minimum(), FINAL_RTOL)

    def rough_minimum(self) -> FloatArray:
        """Return the search variables of the best rough search from all starts."""
        starts = np.unique(list(self._starts()), axis=0)  # with a fixed flank some are equal
        minima = (self.minimize(start, ROUGH_RTOL, MAX_ROUGH_EVALUATIONS) for start in starts)
        return min(minima, key=self.rms)

    def minimize(
        self, start: FloatArray, rtol: float, max_evaluations: int | None = None
    ) -> FloatArray:
        """Return the search variables of the local minimum near `start`.

        ``rtol`` is the relative tolerance of the sum of squares and of the variables.
        ``max_evaluations`` is the largest number of function evaluations (default: no limit except
        that of scipy).
        """
        from scipy.optimize import least_squares

        levenberg_marquardt = partial(least_squares, method="lm", x_scale="jac")
        solution = levenberg_marquardt(
            self.residuals, start, ftol=rtol, xtol=rtol, max_nfev=max_evaluations
        )
        return np.asarray(solution.x)

    def _starts(self) -> Iterator[FloatArray]:
        """Yield the search variables from which searches start.

        The nose is at the mean angle of the first column, weighted with the squares of its lifts.
        """
        first = self.columns[0]
        lift = max(float(column.lifts.max()) for column in self.columns)
        weights = np.maximum(first.lifts, 0.0) ** 2
        angle = float(np.angle(np.sum(weights * np.exp(1j * first.angles))))
        for curvature in START_FLANKS:
            prime = self.min_radius + START_PRIME_LIFTS * lift
            max_nose = _min_convex_radius(prime, lift)
            room = max_nose - self.min_radius
            nose, flank = START_NOSE * room, max_nose / curvature
            # The fixed base circle of a flat face is large. The parallel contour on it has equal
            # lifts. Without it, the search ends at a contour with another flank.
            if all(self.flats):
                distance = max(0.0, 1.0 / self.fixed[PRIME] - prime)
                nose, room, max_nose = nose + distance, room + distance, max_nose + distance
                flank += distance if curvature > 0.0 else 0.0
            variables = {
                PRIME: math.log(prime),
                LIFT: math.log(lift),
                FLANK: math.log1p(-max_nose / flank),
                NOSE: math.log(nose / (room - nose)),
                ANGLE: angle,
            }
            yield np.array([variables[parameter] for parameter in self.free])


def _min_convex_radius(prime: float, lift: float) -> float:
    """Return the smallest radius (m) of a convex flank, which is the largest of a nose.

    It is the mean of the base radius and the top radius, which is base radius plus lift.
    """
    return prime + 0.5 * lift
