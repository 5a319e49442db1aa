"""Least-squares search for a contour of tangent arcs, any parameter of which can be fixed."""

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

# Short names of the parameters of a pitch curve, see `Parameter`.
PRIME = Parameter.PRIME
LIFT = Parameter.LIFT
FLANK = Parameter.FLANK
NOSE = Parameter.NOSE
ANGLE = Parameter.ANGLE

#: Start value of the prime radius (base radius plus roller radius) in the search, as a multiple of
#: the lift: a usual proportion of cams.
START_PRIME_LIFTS = 3.0
#: Start value of the nose radius in the search, as a fraction of its largest possible value.
START_NOSE = 0.3
#: Start values of the flanks' curvature in the search, as fractions of the largest possible
#: curvature: slightly convex, strongly convex, and concave. Without the first value the search does
#: not find some contours under a large roller, without the second some with a sharp nose, and
#: without the third some whose nose is as large as the base circle.
START_FLANKS = (0.3, 0.7, -0.3)
#: Relative tolerance of a rough search, which only ranks start points and interpretations.
ROUGH_RTOL = 1e-8
#: Largest number of evaluations of the residuals in one rough search.
MAX_ROUGH_EVALUATIONS = 30
#: Relative tolerance of the final search, close to floating-point rounding.
FINAL_RTOL = 1e-12
#: Error message if no contour is close to the readings, or if no contour with the fitted parameters
#: exists.
NO_CLOSE_CONTOUR = (
    "no base circle, two equal flanks and a nose come near the readings; allowed: a symmetric cam, "
    "else --shape spline"
)
#: Residual (m) of every reading in a search if no contour exists with the parameters. It is far
#: above any other residual, so the search avoids such parameters.
NO_CONTOUR_RESIDUAL = 1.0
#: Curvature below which a flank counts as straight, relative to the curvature of the prime circle
#: (radius: base plus roller radius). Over the length of a flank, such a curvature changes the lift
#: by less than 1e-6 of the radius.
STRAIGHT_CURVATURE = 1e-6


@dataclass(frozen=True)
class Role:
    """Interpretation of one column of readings in the search for a contour.

    ``is_flat`` is True for a flat follower. ``is_reversed`` is True if the cam was turned in the
    opposite sense.
    """

    is_flat: bool
    is_reversed: bool


@dataclass(frozen=True, eq=False)
class ArcSearch:
    """Least-squares search for a pitch curve, for one interpretation of the columns.

    The pitch curve is the contour enlarged by the roller radius. Lifts determine only this curve:
    those of a roller are the polar radii of its centre, and those of a flat face are equal on all
    parallel contours.

    Attributes
    ----------
    columns : tuple of Readings
        Readings of each column.
    roles : tuple of Role
        Interpretation of each column: follower type and turning sense.
    coordinates : Coordinates
        Coordinates of a pitch curve.
    fixed : mapping of Parameter to float
        Value of each fixed coordinate.
    min_radius : float
        Lower limit in m of the radii of base and nose of the pitch curve: the radius of a given
        roller, else 0.
    """

    columns: tuple[Readings, ...]
    roles: tuple[Role, ...]
    coordinates: Coordinates
    fixed: Mapping[Parameter, float] = field(default_factory=dict)
    min_radius: float = 0.0

    @property
    def free(self) -> tuple[Parameter, ...]:
        """Parameters of the pitch curve that are not fixed."""
        return tuple(parameter for parameter in Parameter if parameter not in self.fixed)

    @property
    def flats(self) -> tuple[bool, ...]:
        """Flags per column of readings, True if the follower of the column is flat."""
        return tuple(role.is_flat for role in self.roles)

    @property
    def count(self) -> int:
        """Number of readings of all columns of the search."""
        return sum(column.angles.size for column in self.columns)

    @property
    def name(self) -> str:
        """Interpretation of the columns as text: follower types and turning senses."""
        kinds = ("roller" if self.coordinates.rolling else "point", "flat")
        return ", ".join(
            f"{column.name.rpartition(', ')[2]} {kinds[role.is_flat]}"
            f"{' reversed' if role.is_reversed else ''}"
            for column, role in zip(self.columns, self.roles, strict=True)
        )

    def fix(self, parameter: Parameter, coordinate: float) -> ArcSearch:
        """Return a copy of the search with one more fixed coordinate.

        ``coordinate`` is its value, as in `Coordinates`.
        """
        return replace(self, fixed={**self.fixed, parameter: coordinate})

    # Residuals of the readings from a contour.

    def pitch(self, x: FloatArray) -> Arcs:
        """Return the pitch curve for search variables, one per free parameter.

        The search variables are not bounded. Those of prime radius and lift are their logarithms.
        The variable x of the flank gives the curvature 1 − e^x, as a fraction of the largest
        curvature with which the flank still joins base and nose, so that x = 0 is a straight flank.
        The variable of the nose is the logit of its radius within its limits. The variable of the
        angle is the angle in rad.

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
        """Return the readings of column `i` of the table, with their residuals (m).

        The residuals are the lifts of the cam with the search variables `x` minus the readings.
        They are computed with the pitch curve, on which a roller is a point and a flat stays flat.

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

    # Search for the smallest residuals.

    def solve(self) -> FloatArray:
        """Return the search variables of the best contour, by a rough and a final search."""
        return self.minimize(self.rough_minimum(), FINAL_RTOL)

    def rough_minimum(self) -> FloatArray:
        """Return the search variables of the best rough search from all start points."""
        starts = np.unique(list(self._starts()), axis=0)  # equal starts occur if the flank is fixed
        minima = (self.minimize(start, ROUGH_RTOL, MAX_ROUGH_EVALUATIONS) for start in starts)
        return min(minima, key=self.rms)

    def minimize(
        self, start: FloatArray, rtol: float, max_evaluations: int | None = None
    ) -> FloatArray:
        """Return the search variables of the local minimum near `start`.

        ``rtol`` is the relative tolerance of the sum of squares and of the variables.
        ``max_evaluations`` is the largest number of function evaluations (default: the limit of
        scipy).
        """
        from scipy.optimize import least_squares

        levenberg_marquardt = partial(least_squares, method="lm", x_scale="jac")
        solution = levenberg_marquardt(
            self.residuals, start, ftol=rtol, xtol=rtol, max_nfev=max_evaluations
        )
        return np.asarray(solution.x)

    def _starts(self) -> Iterator[FloatArray]:
        """Yield the points (search variables) from which searches are run.

        There is one per value of `START_FLANKS`. The nose is at the mean angle of the first column,
        weighted with the squares of its lifts.
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
            # If all followers are flat, the base circle is fixed and large. The start is therefore
            # the parallel contour on this circle, which has equal lifts. From a smaller contour the
            # search would end with a different flank.
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
    """Return the smallest radius (m) of a convex flank.

    It is also the upper limit of the nose radius. It is the mean of the base radius and the radius
    of the nose's top, which is base radius plus lift. ``prime`` is the radius of the base circle,
    m.
    """
    return prime + 0.5 * lift
