"""Contours of tangent arcs: lifts of followers, and the least-squares search.

A contour is a base circle, two equal flanks and a nose, each tangent to the next. This is the law
``arcs_by_radii``. The centre of a roller follows the pitch curve: a contour with the radii
R_b + R_r, R_f + R_r and R_n + R_r. Lifts under a roller therefore determine only these sums. The
lift of a flat face is the contour's support function less R_b. It determines only the differences
R_f − R_b and R_n − R_b.

An interpretation of the columns is the kind of follower (flat or not) and the turning sense of
each column.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal

import numpy as np

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws.arc_law import ArcFollower, arc_lift
from cam_rig.laws.arcs import Blend, Circle, close_chain
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import FloatArray, rms

FollowerKind = Literal["roller", "flat", "point"]
#: Radii that are known in addition to the readings. None: neither is known.
Known = Literal["base", "roller", "both"] | None
#: Index of each parameter of a contour, in every sequence with one value per parameter.
PRIME, LIFT, FLANK, NOSE, ANGLE = COORDINATES = range(5)


@dataclass(frozen=True)
class Arcs:
    """Contour of tangent arcs: radii and lift in m, angle of the nose in rad.

    The radius of a flank is positive if convex, negative if concave, None if straight.
    """

    base_radius: float
    lift: float
    flank_radius: float | None
    nose_radius: float
    nose_angle: float

    @property
    def flank(self) -> str:
        """Kind of the flanks, as in a cam file: straight, convex or concave."""
        if self.flank_radius is None:
            return "straight"
        return "convex" if self.flank_radius > 0.0 else "concave"

    def grown(self, by: float) -> Arcs:
        """Return the parallel contour at the distance `by` (m), inside if negative."""
        flank = None if self.flank_radius is None else self.flank_radius + by
        radii = self.base_radius + by, self.lift, flank, self.nose_radius + by
        return Arcs(*radii, self.nose_angle)

    def lifts(self, follower: ArcFollower, angles: FloatArray) -> FloatArray:
        """Return the lift (m) of a follower at cam angles (rad).

        A flat face bridges a flank that is not convex.
        """
        flank = Blend(self.flank_radius)
        top = Circle(
            complex(-(self.base_radius + self.lift - self.nose_radius), 0.0), self.nose_radius
        )
        chain = close_chain([Circle(0j, self.base_radius), flank, top, flank])
        turned = angles - self.nose_angle + math.pi  # the nose's top is at 180° of the contour
        if follower.flat and self.flank != "convex":
            above = top.centre.real * np.cos(turned) + self.nose_radius - self.base_radius
            return np.maximum(above, 0.0)
        return arc_lift(chain, self.base_radius, follower, turned)


@dataclass(frozen=True, eq=False)
class ArcColumn:
    """Readings of one follower, with their interpretation and their residuals.

    ``reverse`` is True if the cam was turned in the other sense. ``away`` is the residuals, the
    lift of the contour less the reading, in m, shape ``(n,)``.
    """

    readings: Readings
    follower: ArcFollower
    reverse: bool
    away: FloatArray

    @property
    def kind(self) -> FollowerKind:
        """Kind of the follower: flat, roller or point."""
        if self.follower.flat:
            return "flat"
        return "roller" if self.follower.roller_radius else "point"

    def lifts(self, arcs: Arcs, angles: FloatArray) -> FloatArray:
        """Return the lift (m) of a contour at angles (rad) in the sense of the readings."""
        return arcs.lifts(self.follower, -angles if self.reverse else angles)

    @property
    def rms(self) -> float:
        """Residual of the readings, r.m.s. in m."""
        return rms(self.away)

    @property
    def worst(self) -> int:
        """Index of the reading that is farthest from the contour."""
        return int(np.abs(self.away).argmax())


@dataclass(frozen=True)
class Form:
    """Combinations of radii that lifts determine, and the coordinates of a contour.

    ``sums`` is True for flank and nose radius plus the roller radius, False for the radii less the
    base radius. ``rolling`` is True if a roller has a radius.

    In the coordinates every confidence interval is a connected range. They are, in 1/m, m and rad:

    - the curvature 1/(R_b + R_r),
    - the lift,
    - the curvature 1/(R_f + R_r) or 1/(R_f − R_b), 0 if the radius is infinite,
    - the nose radius R_n + R_r or R_n − R_b,
    - the angle of the nose.
    """

    rolling: bool
    sums: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the coordinates."""
        rolling = " + roller radius" if self.rolling else ""
        shift = rolling if self.sums else " - base radius"
        radii = f"flank radius{shift}", f"nose radius{shift}"
        return (f"base radius{rolling}", "lift", *radii, "nose angle")

    def shift(self, prime: float) -> float:
        """Return the length (m) to add to flank and nose radius of the pitch curve."""
        return 0.0 if self.sums else -prime

    def coordinates(self, pitch: Arcs) -> FloatArray:
        """Return the coordinates of a pitch curve, ``(5,)``, in 1/m, m and rad."""
        prime = pitch.base_radius
        shift = self.shift(prime)
        flank = 0.0 if pitch.flank_radius is None else 1.0 / (pitch.flank_radius + shift)
        return np.array(
            [1.0 / prime, pitch.lift, flank, pitch.nose_radius + shift, pitch.nose_angle]
        )


def number_of(index: int, coordinate: float) -> float:
    """Return the parameter (m, rad) of a coordinate.

    The parameter of a curvature is its radius, infinite if the curvature is 0.
    """
    if index not in (PRIME, FLANK):
        return coordinate
    return 1.0 / coordinate if coordinate else math.inf


# Radii that lifts do not determine.

#: Smallest radius of nose or base that an assumed radius may leave, and the radius that its
#: replacement leaves. Both are fractions of the smaller of base and nose radius of the pitch curve.
#: Under a flat face they are fractions of the base radius.
LEAST_NOSE, GOOD_NOSE = 0.1, 0.5
#: Smallest radius of nose or base, as a fraction of the radius on the pitch curve.
SHARPEST = 1e-6


def with_radii(
    pitch: Arcs, flat: bool, known: Known, roller: float, base: float
) -> tuple[Arcs, float, float | None]:
    """Return the contour of a pitch curve, its roller radius, and a replaced radius.

    Parameters
    ----------
    pitch : pitch curve
    flat : True if all followers are flat, so that the lifts do not determine the base radius
    known : radii that are known
    roller : roller radius, m: known, or the usual assumption
    base : base radius, m: known, or the usual assumption

    Returns
    -------
    arcs : the contour
    roller : its roller radius, m
    replaced : the usual assumption in m, if it leaves too little radius for nose or base and
        another radius was assumed, else None
    """
    usual, least = None, min(pitch.nose_radius, pitch.base_radius)
    if flat:
        less = pitch.base_radius - pitch.nose_radius
        if known not in ("base", "both") and base - less < LEAST_NOSE * base:
            usual, base = base, float(f"{less / (1.0 - GOOD_NOSE):.2g}")
        return pitch.grown(base - pitch.base_radius), roller, usual
    if known == "base":
        # `require_roller` rejects a base radius without a roller or a nose after the fit
        roller = min(max(pitch.base_radius - base, 0.0), (1.0 - SHARPEST) * least)
    elif known is None and least - roller < LEAST_NOSE * least:
        usual, roller = roller, float(f"{GOOD_NOSE * least:.2g}")
    return pitch.grown(-roller), roller, usual


def require_roller(base: float, pitch: Arcs, told: str) -> None:
    """Raise ConfigError if a base radius (m) leaves no roller or no nose.

    ``told`` is the interval of the prime radius of the pitch curve, as text.
    """
    prime, nose = pitch.base_radius, pitch.nose_radius
    together = f"{prime * 1e3:.4g} mm ({told} with 95 %)"
    if base >= prime:
        raise ConfigError(
            f"--base-radius: is {base * 1e3:g} mm; allowed: below base and roller radius "
            f"together, {together}, or with --roller-radius"
        )
    if prime - base >= nose:
        raise ConfigError(
            f"--base-radius: is {base * 1e3:g} mm, which leaves a roller of "
            f"{(prime - base) * 1e3:.4g} mm of {together}; allowed: above "
            f"{(prime - nose) * 1e3:.4g} mm, for nose and roller radius are together "
            f"{nose * 1e3:.4g} mm, or with --roller-radius"
        )


# Least-squares search for a contour. Any of its parameters can be fixed.

#: Starts of the search: prime radius in lifts, nose radius as a fraction of its range, and flank
#: curvature as a fraction of its largest value.
STARTS = tuple(product((3.0,), (0.3,), (0.3, 0.7, -0.3)))
#: Relative tolerances of a rough and of the final search, and the largest number of function
#: evaluations of a rough search.
ROUGH, EXACT, FEW = 1e-8, 1e-12, 30
#: Two results whose r.m.s. residuals differ by less than this factor are the same minimum.
SAME = 1.0 + 1e-6
#: Message if no contour is close to the readings, or if no contour has the parameters.
NONE_NEAR = (
    "no base circle, two equal flanks and a nose come near the readings; allowed: a symmetric cam, "
    "else --shape spline"
)
#: Residual (m) of each reading if no contour has the parameters, far above any other residual.
NO_CONTOUR = 1.0
#: Curvature below which a flank is a straight line, as a fraction of the prime circle's curvature.
STRAIGHT = 1e-6


def _most(prime: float, lift: float) -> float:
    """Return the smallest radius (m) of a convex flank.

    It is the mean of the base radius and the top radius, which is base radius plus lift.
    """
    return prime + 0.5 * lift


@dataclass(frozen=True, eq=False)
class ArcSearch:
    """Least-squares search for the pitch curve, for one interpretation of the columns.

    The pitch curve is the contour enlarged by the roller radius. Lifts determine only this curve:
    those of a roller are the polar radii of its centre, and those of a flat face are equal on all
    parallel contours.

    Attributes
    ----------
    columns : readings of each column
    roles : two flags per column: True if its follower is flat, and True if its sense is reversed
    form : coordinates of a contour
    held : value of each fixed coordinate of `form`, by its index
    least : radius in m that base and nose of the pitch curve must exceed: that of a known roller,
        else 0
    """

    columns: tuple[Readings, ...]
    roles: tuple[tuple[bool, bool], ...]
    form: Form
    held: Mapping[int, float] = field(default_factory=dict)
    least: float = 0.0

    @property
    def free(self) -> tuple[int, ...]:
        """Index of each free parameter."""
        return tuple(i for i in COORDINATES if i not in self.held)

    @property
    def flats(self) -> tuple[bool, ...]:
        """Flag of each column, True if its follower is flat."""
        return tuple(flat for flat, _ in self.roles)

    @property
    def count(self) -> int:
        """Number of readings of all columns."""
        return sum(column.angles.size for column in self.columns)

    def holding(self, index: int, coordinate: float) -> ArcSearch:
        """Return this search with one more fixed coordinate."""
        return replace(self, held={**self.held, index: coordinate})

    def pitch(self, x: FloatArray) -> Arcs:
        """Return the pitch curve of unbounded search variables, one per free parameter.

        The variables of prime radius and lift are their logarithms. A variable x of the flank is
        the curvature 1 − e^x, as a fraction of the largest curvature that still joins base and
        nose, so that x = 0 is a straight flank. The variable of the nose is the logit of its radius
        within its limits. The angle (rad) is its variable.

        Raises
        ------
        LawError : no contour has these parameters
        """
        free, held = dict(zip(self.free, x, strict=True)), self.held
        prime = 1.0 / held[PRIME] if PRIME in held else math.exp(free[PRIME])
        lift = held[LIFT] if LIFT in held else math.exp(free[LIFT])
        shift, most = self.form.shift(prime), _most(prime, lift)
        if FLANK in held:
            below = 1.0 - held[FLANK] * shift
            if not below > 0.0:
                raise LawError(f"{self.columns[0].name}: {NONE_NEAR}")
            curvature = held[FLANK] / below
        else:
            curvature = -math.expm1(free[FLANK]) / most
        straight = abs(curvature) < STRAIGHT / prime
        if NOSE in held:
            nose = held[NOSE] - shift
        else:
            nose = self.least + (most - self.least) / (1.0 + math.exp(-free[NOSE]))
        if not self.least < nose < most or not prime > self.least:
            raise LawError(f"{self.columns[0].name}: {NONE_NEAR}")
        angle = held[ANGLE] if ANGLE in held else float(free[ANGLE])
        return Arcs(prime, lift, None if straight else 1.0 / curvature, nose, angle)

    def away(self, x: FloatArray) -> FloatArray:
        """Return the residuals (m) of all readings, ``(n,)``."""
        try:
            found = [self.column(x, i).away for i in range(len(self.columns))]
        except (LawError, OverflowError, ZeroDivisionError):
            return np.full(self.count, NO_CONTOUR)
        return np.concatenate(found)

    def column(self, x: FloatArray, i: int) -> ArcColumn:
        """Return column `i` with its residuals from the pitch curve.

        On the pitch curve the follower is a point or flat.

        Raises
        ------
        LawError : no contour has these parameters, or the follower does not reach it
        """
        readings, (flat, reverse) = self.columns[i], self.roles[i]
        angles = -readings.angles if reverse else readings.angles
        follower = ArcFollower(flat, 0.0)
        with np.errstate(all="ignore"):
            away = self.pitch(x).lifts(follower, angles) - readings.lifts
        if not np.isfinite(away).all():
            raise LawError("the follower does not reach the contour")
        return ArcColumn(readings, follower, reverse, away)

    @property
    def name(self) -> str:
        """Interpretation of the columns as text."""
        words = ("roller" if self.form.rolling else "point", "flat")
        return ", ".join(
            f"{column.name.rpartition(', ')[2]} {words[flat]}{' reversed' if reverse else ''}"
            for column, (flat, reverse) in zip(self.columns, self.roles, strict=True)
        )

    def best(self) -> FloatArray:
        """Return the search variables of the best contour from all starts."""
        return self.refined(self.rough())

    def rough(self) -> list[FloatArray]:
        """Return the result of a rough search from each start, the best first."""
        first = self.columns[0]
        height = max(float(column.lifts.max()) for column in self.columns)
        weights = np.maximum(first.lifts, 0.0) ** 2  # the lift is largest at the nose
        angle = float(np.angle(np.sum(weights * np.exp(1j * first.angles))))
        starts = []
        for lifts, part, bend in STARTS:
            prime = self.least + lifts * height
            most = _most(prime, height)
            nose, flank, room = part * (most - self.least), most / bend, most - self.least
            if all(self.flats):  # the parallel contour on the fixed base circle: equal lifts
                by = max(0.0, 1.0 / self.held[PRIME] - prime)
                nose, flank, room = nose + by, flank + (by if bend > 0.0 else 0.0), room + by
                most += by
            ends = [math.log1p(-most / flank), math.log(nose / (room - nose))]
            all_free = [math.log(prime), math.log(height), *ends, angle]
            starts.append(np.array(all_free)[list(self.free)])
        different = np.unique(starts, axis=0)  # with a fixed flank some starts are equal
        return sorted((self.nearest(start, ROUGH, FEW) for start in different), key=self.rms)

    def refined(self, rough: list[FloatArray]) -> FloatArray:
        """Return the search variables of the best contour, from rough results.

        The two best rough results are refined, unless they are the same minimum.
        """
        first, *more = rough
        others = [x for x in more[:1] if self.rms(x) > SAME * self.rms(first)]
        ends = [self.nearest(x, EXACT) for x in (first, *others)]
        return min(ends, key=self.rms)

    def rms(self, x: FloatArray) -> float:
        """Return the r.m.s. residual (m) of all readings."""
        return rms(self.away(x))

    def nearest(self, start: FloatArray, to: float, steps: int | None = None) -> FloatArray:
        """Return the search variables of the local minimum near `start`.

        ``to`` is the relative tolerance of the sum of squares and of the variables. ``steps`` is
        the largest number of function evaluations (default: no limit except that of scipy).
        """
        from scipy.optimize import least_squares

        found = least_squares(
            self.away, start, x_scale="jac", method="lm", ftol=to, xtol=to, max_nfev=steps
        )
        return np.asarray(found.x)
