"""One contour of tangent arcs through the readings of one or several followers at once.

Base circle, two equal flanks and a nose, each tangent to the next: the law ``arcs_by_radii``. Its
numbers are those that lifts can tell. Under a roller the centre follows a contour of the radii
R_b + R_r, R_f + R_r, R_n + R_r, so the lifts hold these sums. Under a flat face the lift is the
contour's support function less R_b, so the lifts hold the differences R_f − R_b and R_n − R_b.
The least squares are over R_b + R_r, the lift, the curvature of the flank, the nose's radius, and
the angle of the nose.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from cam_rig.arrays import FloatArray, rms
from cam_rig.errors import LawError
from cam_rig.laws.arcs.chain import Blend, Circle, close
from cam_rig.laws.arcs.law import ArcFollower, arc_lift
from cam_rig.studies.cam_fit.readings import Readings

#: What lifts tell of such a contour, m and rad.
NUMBERS = (
    "base radius + roller radius",
    "lift",
    "flank radius - base radius",
    "nose radius - base radius",
    "nose angle",
)
#: Starts of the search: prime radius in lifts, nose radius in parts of it, flank curvature in parts
#: of the greatest.
STARTS = tuple(product((3.0,), (0.3,), (0.3, 0.7, -0.3)))
#: Lifts (m) for numbers of which no contour can be made: far from any reading.
NO_CONTOUR = 1.0
#: A contour whose lifts are off the readings by this part of the lift, r.m.s., is another one.
FAR = 0.05
#: A flank flatter than this (in parts of the prime radius's curvature) is a straight line.
STRAIGHT = 1e-6
#: A column's own kind and sense.
Role = tuple[bool, bool]


@dataclass(frozen=True)
class Arcs:
    """Radii and lift (m) on the contour, the flank's None where straight, and the nose's angle.

    Positive where convex.
    """

    base_radius: float
    lift: float
    flank_radius: float | None
    nose_radius: float
    nose_angle: float

    def lifts(self, follower: ArcFollower, angles: FloatArray) -> FloatArray:
        """The lift (m) of a follower at cam angles in rad.

        Raises
        ------
        LawError : there is no such contour, or the follower cannot stay on it
        """
        flank = Blend(self.flank_radius)
        top = Circle(
            complex(-(self.base_radius + self.lift - self.nose_radius), 0.0), self.nose_radius
        )
        chain = close([Circle(0j, self.base_radius), flank, top, flank])
        turned = angles - self.nose_angle + math.pi  # the nose's top is at 180° of the contour
        return arc_lift(chain, self.base_radius, follower, turned)


@dataclass(frozen=True, eq=False)
class ArcColumn:
    """Readings of one follower on the contour: its kind, the sense they were read in, the fit."""

    readings: Readings
    follower: ArcFollower
    reverse: bool
    away: FloatArray

    @property
    def kind(self) -> str:
        """What follows the contour."""
        roller = "roller" if self.follower.roller_radius else "point"
        return "flat" if self.follower.flat else roller

    @property
    def rms(self) -> float:
        """r.m.s. distance of the readings from the contour's lifts, m."""
        return rms(self.away)


@dataclass(frozen=True, eq=False)
class ArcsFit:
    """A contour of tangent arcs, its columns, and what else was tried.

    Parameters
    ----------
    roller_radius : assumed (m); base, flank and nose radius go with it
    errors : standard errors of `NUMBERS`, NaN for one that is not told
    others : r.m.s. distance (m) of every other reading of the columns, likeliest first
    """

    arcs: Arcs
    columns: tuple[ArcColumn, ...]
    roller_radius: float
    errors: tuple[float, ...]
    others: tuple[tuple[str, float], ...]

    @property
    def rms(self) -> float:
        """r.m.s. distance of all readings from the contour's lifts, m."""
        return rms(np.concatenate([column.away for column in self.columns]))

    @property
    def numbers(self) -> tuple[float, ...]:
        """`NUMBERS` of the contour; the flank's is infinite where straight."""
        return _numbers(self.arcs, self.roller_radius)

    @property
    def cannot_tell(self) -> tuple[str, ...]:
        """What no readings of these followers can tell, a sentence each."""
        kinds = {column.kind for column in self.columns}
        if kinds == {"flat"}:
            return (
                "A flat follower tells flank and nose radius only less the base radius: that is "
                "assumed.",
            )
        if "point" in kinds:
            return ()
        return (
            "Base and roller radius are told only as a sum: the roller radius is assumed.",
            "Flank and nose radius go with the base radius: their differences from it are told.",
        )


def _numbers(arcs: Arcs, roller_radius: float) -> tuple[float, ...]:
    base = arcs.base_radius
    flank = math.inf if arcs.flank_radius is None else arcs.flank_radius - base
    return (base + roller_radius, arcs.lift, flank, arcs.nose_radius - base, arcs.nose_angle)


@dataclass(frozen=True, eq=False)
class _Search:
    """The least squares of one reading of the columns."""

    columns: tuple[Readings, ...]
    roles: tuple[Role, ...]
    roller: float
    base: float | None

    def arcs(self, x: FloatArray) -> Arcs:
        """The contour of unbounded numbers ``(5,)``, or ``(4,)`` where the base is assumed.

        Logarithms of prime radius and lift, logit of the nose's radius within its limits, and the
        flank's curvature over the greatest that still joins, as 1 − e^x: 0 is a straight flank.
        """
        prime = math.exp(x[-1]) if self.base is None else self.base + self.roller
        lift, base = math.exp(x[0]), prime - self.roller
        nose = (base + 0.5 * lift) / (1.0 + math.exp(-x[2]))
        greatest = 2.0 / (2.0 * base + lift)  # 1 over the mean of the base's and the top's radius
        curvature = greatest * -math.expm1(x[1])
        straight = abs(curvature) < STRAIGHT / prime
        flank = None if straight else 1.0 / curvature
        return Arcs(base, lift, flank, nose, float(x[3]))

    def away(self, x: FloatArray) -> FloatArray:
        """Distances (m) of all readings."""
        try:
            found = [self.column(x, i).away for i in range(len(self.columns))]
        except (LawError, OverflowError, ZeroDivisionError):
            found = [np.full(column.angles.size, NO_CONTOUR) for column in self.columns]
        return np.concatenate(found)

    def column(self, x: FloatArray, i: int) -> ArcColumn:
        readings, (flat, reverse) = self.columns[i], self.roles[i]
        angles = -readings.angles if reverse else readings.angles
        follower = ArcFollower(flat, 0.0 if flat else self.roller)
        with np.errstate(all="ignore"):
            away = self.arcs(x).lifts(follower, angles) - readings.lifts
        if not np.isfinite(away).all():
            raise LawError("the follower does not reach the contour")
        return ArcColumn(readings, follower, reverse, away)

    def named(self) -> str:
        """The roles in words."""
        words = ("roller" if self.roller else "point", "flat")
        return ", ".join(
            f"{column.name.rpartition(', ')[2]} {words[flat]}{' reversed' if reverse else ''}"
            for column, (flat, reverse) in zip(self.columns, self.roles, strict=True)
        )


def fit_arcs(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller_radius: float,
    base_radius: float,
) -> ArcsFit:
    """Fit one contour to all columns, above their zero; of unnamed ones the kind is found too.

    Parameters
    ----------
    kinds : for each column whether its follower is flat; None tries both
    roller_radius : m, 0 for a point; assumed, for only its sum with the base radius is told
    base_radius : m, taken where all followers are flat, for nothing is told of it then

    Raises
    ------
    LawError : no contour of arcs comes near the readings
    """
    tried = sorted(_tried(columns, kinds, roller_radius, base_radius), key=_unlikely)
    if tried[0][0] >= FAR * max(float(column.lifts.max()) for column in columns):
        raise LawError(
            f"{columns[0].name}: no base circle, two equal flanks and a nose come near the "
            "readings; allowed: a symmetric cam, else --shape spline"
        )
    best, x, search = tried[0]
    others = tuple((other.named(), distance) for distance, _, other in tried[1:])
    found = tuple(search.column(x, i) for i in range(len(columns)))
    return ArcsFit(search.arcs(x), found, roller_radius, _errors(search, x, best), others)


def _tried(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller: float,
    base: float,
) -> Iterator[tuple[float, FloatArray, _Search]]:
    """r.m.s. distance, numbers and search of each possible reading of the columns.

    A contour and its mirror image differ in the nose's angle alone, so the first column is read
    as it is and the others also backwards.
    """
    flats = product(*((True, False) if kind is None else (kind,) for kind in kinds))
    senses = list(product(*([(False,)] + [(False, True)] * (len(columns) - 1))))
    for flat, sense in product(flats, senses):
        roles = tuple(zip(flat, sense, strict=True))
        search = _Search(columns, roles, roller, base if all(flat) else None)
        x = _best(search)
        yield rms(search.away(x)), x, search


def _unlikely(tried: tuple[float, FloatArray, _Search]) -> float:
    """Schwarz's criterion (BIC): of two that are as near the one with fewer numbers is likelier."""
    distance, x, search = tried
    count = sum(column.angles.size for column in search.columns)
    return 2.0 * count * math.log(max(distance, 1e-12)) + x.size * math.log(count)


def _best(search: _Search) -> FloatArray:
    """The best of least squares from all starts."""
    from scipy.optimize import least_squares

    first = search.columns[0]
    height = max(float(column.lifts.max()) for column in search.columns)
    weights = np.maximum(first.lifts, 0.0) ** 2  # the nose is where the lift is greatest
    angle = float(np.angle(np.sum(weights * np.exp(1j * first.angles))))
    starts = []
    for prime, nose, flank in STARTS:
        known = [math.log(height), math.log1p(-flank), math.log(nose / (1.0 - nose)), angle]
        free = [math.log(search.roller + prime * height)] if search.base is None else []
        starts.append(np.array(known + free))
    solve = partial(least_squares, search.away, x_scale="jac", method="lm")
    rough = sorted(
        (solve(start, max_nfev=60).x for start in starts), key=lambda x: rms(search.away(x))
    )
    found = min((solve(x, xtol=1e-12, ftol=1e-12) for x in rough[:2]), key=lambda f: float(f.cost))
    return np.asarray(found.x)


def _errors(search: _Search, x: FloatArray, distance: float) -> tuple[float, ...]:
    """Standard errors of `NUMBERS` from the Jacobian, for independent errors of the distance."""
    steps = 1e-6 * np.eye(x.size)
    slopes = np.stack([(search.away(x + h) - search.away(x - h)) / 2e-6 for h in steps], axis=1)

    def numbers(y: FloatArray) -> FloatArray:
        return np.array(_numbers(search.arcs(y), search.roller))

    count = slopes.shape[0]
    variance = distance**2 * count / (count - x.size) * np.linalg.pinv(slopes.T @ slopes)
    with np.errstate(invalid="ignore"):  # a straight flank has no radius
        turn = np.stack([(numbers(x + h) - numbers(x - h)) / 2e-6 for h in steps], axis=1)
        found = np.sqrt(np.diag(turn @ variance @ turn.T))
    if search.base is not None:
        found[0] = math.nan
    return tuple(float(error) for error in found)
