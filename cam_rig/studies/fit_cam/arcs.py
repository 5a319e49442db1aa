"""A contour of tangent arcs, the lifts of followers on it, and its least squares.

Base circle, two equal flanks and a nose, each tangent to the next: the law ``arcs_by_radii``.
Under a roller the centre follows a contour of the radii R_b + R_r, R_f + R_r, R_n + R_r, so the
lifts hold these sums. Under a flat face the lift is the contour's support function less R_b, so
the lifts hold the differences R_f − R_b and R_n − R_b.
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
from cam_rig.laws.arcs import Blend, Circle, close
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import FloatArray, rms

FollowerKind = Literal["roller", "flat", "point"]
#: Which radius is known beside the readings.
Known = Literal["base", "roller", "both"] | None
#: The numbers of a contour, in the order of everything here that has one of each.
PRIME, LIFT, FLANK, NOSE, ANGLE = COORDINATES = range(5)


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

    @property
    def flank(self) -> str:
        """Kind of the flanks, as a cam's file has it."""
        if self.flank_radius is None:
            return "straight"
        return "convex" if self.flank_radius > 0.0 else "concave"

    def grown(self, by: float) -> Arcs:
        """The parallel contour (m) outside of it, or inside."""
        flank = None if self.flank_radius is None else self.flank_radius + by
        radii = self.base_radius + by, self.lift, flank, self.nose_radius + by
        return Arcs(*radii, self.nose_angle)

    def lifts(self, follower: ArcFollower, angles: FloatArray) -> FloatArray:
        """The lift (m) at cam angles; a flat face bridges a flank that is not convex."""
        flank = Blend(self.flank_radius)
        top = Circle(
            complex(-(self.base_radius + self.lift - self.nose_radius), 0.0), self.nose_radius
        )
        chain = close([Circle(0j, self.base_radius), flank, top, flank])
        turned = angles - self.nose_angle + math.pi  # the nose's top is at 180° of the contour
        if follower.flat and self.flank != "convex":
            above = top.centre.real * np.cos(turned) + self.nose_radius - self.base_radius
            return np.maximum(above, 0.0)
        return arc_lift(chain, self.base_radius, follower, turned)


@dataclass(frozen=True, eq=False)
class ArcColumn:
    """Readings of one follower on the contour: its kind, the sense they were read in, the fit."""

    readings: Readings
    follower: ArcFollower
    reverse: bool
    away: FloatArray

    @property
    def kind(self) -> FollowerKind:
        """What follows the contour."""
        if self.follower.flat:
            return "flat"
        return "roller" if self.follower.roller_radius else "point"

    def lifts(self, arcs: Arcs, angles: FloatArray) -> FloatArray:
        """What its gauge would show (m) of a contour, at angles (rad) as the readings have them."""
        return arcs.lifts(self.follower, -angles if self.reverse else angles)

    @property
    def rms(self) -> float:
        """r.m.s. residual of the readings, m."""
        return rms(self.away)

    @property
    def worst(self) -> int:
        """Which reading is farthest from the contour."""
        return int(np.abs(self.away).argmax())


@dataclass(frozen=True)
class Form:
    """In which form lifts tell the radii: plus the roller's, if one rolls, or less the base's.

    The coordinates of a contour are those in which every interval is a stretch: the curvatures
    1/(R_b + R_r) and 1/(R_f + R_r), or 1/(R_f − R_b), which are 0 where the radius is infinite,
    the lift, the nose's radius in the same form, and the nose's angle; m and rad.
    """

    rolling: bool
    sums: bool

    @property
    def names(self) -> tuple[str, ...]:
        """What the numbers are called."""
        rolling = " + roller radius" if self.rolling else ""
        shift = rolling if self.sums else " - base radius"
        radii = f"flank radius{shift}", f"nose radius{shift}"
        return (f"base radius{rolling}", "lift", *radii, "nose angle")

    def shift(self, prime: float) -> float:
        """What is added to the pitch curve's radius of flank and nose, m."""
        return 0.0 if self.sums else -prime

    def coordinates(self, pitch: Arcs) -> FloatArray:
        """``(5,)`` of a pitch curve."""
        prime = pitch.base_radius
        shift = self.shift(prime)
        flank = 0.0 if pitch.flank_radius is None else 1.0 / (pitch.flank_radius + shift)
        return np.array(
            [1.0 / prime, pitch.lift, flank, pitch.nose_radius + shift, pitch.nose_angle]
        )


def number_of(index: int, coordinate: float) -> float:
    """The number (m, rad) of a coordinate: a radius of a curvature, infinite where that is 0."""
    if index not in (PRIME, FLANK):
        return coordinate
    return 1.0 / coordinate if coordinate else math.inf


# Radii that no lift tells.

#: An assumed radius leaves the nose this part of the pitch curve's, or of the base; else another
#: is assumed, that leaves so much.
LEAST_NOSE, GOOD_NOSE = 0.1, 0.5
#: A nose that is no sharper has a radius at all, in parts of the pitch curve's.
SHARPEST = 1e-6


def with_radii(
    pitch: Arcs, flat: bool, known: Known, roller: float, base: float
) -> tuple[Arcs, float, float | None]:
    """The contour of a pitch curve, its roller's radius, and what was not assumed of them.

    ``flat``: whether lifts tell no base; ``roller``, ``base``: m, given as ``known`` has it, else
    to be assumed if that leaves a nose and a base.
    """
    usual, least = None, min(pitch.nose_radius, pitch.base_radius)
    if flat:
        less = pitch.base_radius - pitch.nose_radius
        if known not in ("base", "both") and base - less < LEAST_NOSE * base:
            usual, base = base, float(f"{less / (1.0 - GOOD_NOSE):.2g}")
        return pitch.grown(base - pitch.base_radius), roller, usual
    if known == "base":
        # one that leaves none is refused when the fit is done: `require_roller`
        roller = min(max(pitch.base_radius - base, 0.0), (1.0 - SHARPEST) * least)
    elif known is None and least - roller < LEAST_NOSE * least:
        usual, roller = roller, float(f"{GOOD_NOSE * least:.2g}")
    return pitch.grown(-roller), roller, usual


def require_roller(base: float, pitch: Arcs, told: str) -> None:
    """Refuse a base radius (m) beside which a pitch curve has no roller, or no nose.

    ``told``: the interval of its prime radius.
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


# Least squares of a contour, any of whose numbers may be held.

#: Starts of the search: prime radius in lifts, nose radius in parts of it, flank curvature in parts
#: of the greatest.
STARTS = tuple(product((3.0,), (0.3,), (0.3, 0.7, -0.3)))
#: How near a rough search and the last one come, in parts, and the steps of the rough one.
ROUGH, EXACT, FEW = 1e-8, 1e-12, 30
#: Two ends of the search whose residuals differ by less than this factor are one.
SAME = 1.0 + 1e-6
#: Of readings to which no contour comes near, or of numbers that are none.
NONE_NEAR = (
    "no base circle, two equal flanks and a nose come near the readings; allowed: a symmetric cam, "
    "else --shape spline"
)
#: Lifts (m) for numbers of which no contour can be made: far from any reading.
NO_CONTOUR = 1.0
#: A flank flatter than this (in parts of the prime radius's curvature) is a straight line.
STRAIGHT = 1e-6


def _most(prime: float, lift: float) -> float:
    """The mean of the base's and the top's radius (m): the least of a convex flank."""
    return prime + 0.5 * lift


@dataclass(frozen=True, eq=False)
class ArcSearch:
    """The least squares of one reading of the columns.

    It is of the pitch curve, the contour grown by the roller's radius, which is all that lifts
    tell: those of a roller's centre are its polar radii, and a flat face's are the same on every
    parallel contour. ``roles``: of each column, whether its follower is flat, and whether it was
    read backwards; ``held``: coordinates of ``form`` that are not searched, by their index;
    ``least``: radius (m) above which base and nose of the pitch curve are, that of a roller which
    is known.
    """

    columns: tuple[Readings, ...]
    roles: tuple[tuple[bool, bool], ...]
    form: Form
    held: Mapping[int, float] = field(default_factory=dict)
    least: float = 0.0

    @property
    def free(self) -> tuple[int, ...]:
        """Index of each number that is searched."""
        return tuple(i for i in COORDINATES if i not in self.held)

    @property
    def flats(self) -> tuple[bool, ...]:
        """Of each column, whether its follower is flat."""
        return tuple(flat for flat, _ in self.roles)

    @property
    def count(self) -> int:
        """How many readings there are."""
        return sum(column.angles.size for column in self.columns)

    def holding(self, index: int, coordinate: float) -> ArcSearch:
        """The search that holds one number more."""
        return replace(self, held={**self.held, index: coordinate})

    def pitch(self, x: FloatArray) -> Arcs:
        """The pitch curve of unbounded numbers, one for each that is free.

        Logarithms of prime radius and lift, the flank's curvature over the greatest that still
        joins, as 1 − e^x, so that 0 is a straight flank, and the logit of the nose's radius within
        its limits.
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
        """Residuals (m) of all readings."""
        try:
            found = [self.column(x, i).away for i in range(len(self.columns))]
        except (LawError, OverflowError, ZeroDivisionError):
            return np.full(self.count, NO_CONTOUR)
        return np.concatenate(found)

    def column(self, x: FloatArray, i: int) -> ArcColumn:
        """A column beside the pitch curve, on which the follower is a point or flat."""
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
        """The roles in words."""
        words = ("roller" if self.form.rolling else "point", "flat")
        return ", ".join(
            f"{column.name.rpartition(', ')[2]} {words[flat]}{' reversed' if reverse else ''}"
            for column, (flat, reverse) in zip(self.columns, self.roles, strict=True)
        )

    def best(self) -> FloatArray:
        """The best numbers, from all starts."""
        return self.refined(self.rough())

    def rough(self) -> list[FloatArray]:
        """Where the search comes to from each start in few steps, the nearest first."""
        first = self.columns[0]
        height = max(float(column.lifts.max()) for column in self.columns)
        weights = np.maximum(first.lifts, 0.0) ** 2  # the nose is where the lift is greatest
        angle = float(np.angle(np.sum(weights * np.exp(1j * first.angles))))
        starts = []
        for lifts, part, bend in STARTS:
            prime = self.least + lifts * height
            most = _most(prime, height)
            nose, flank, room = part * (most - self.least), most / bend, most - self.least
            if all(self.flats):  # the same lifts on the base circle that is held
                by = max(0.0, 1.0 / self.held[PRIME] - prime)
                nose, flank, room = nose + by, flank + (by if bend > 0.0 else 0.0), room + by
                most += by
            ends = [math.log1p(-most / flank), math.log(nose / (room - nose))]
            all_free = [math.log(prime), math.log(height), *ends, angle]
            starts.append(np.array(all_free)[list(self.free)])
        different = np.unique(starts, axis=0)  # those of a flank that is held are one
        return sorted((self.nearest(start, ROUGH, FEW) for start in different), key=self.rms)

    def refined(self, rough: list[FloatArray]) -> FloatArray:
        """The best numbers from where a few steps came to: the two nearest, if they are two."""
        first, *more = rough
        others = [x for x in more[:1] if self.rms(x) > SAME * self.rms(first)]
        ends = [self.nearest(x, EXACT) for x in (first, *others)]
        return min(ends, key=self.rms)

    def rms(self, x: FloatArray) -> float:
        """r.m.s. residual (m) of all readings."""
        return rms(self.away(x))

    def nearest(self, start: FloatArray, to: float, steps: int | None = None) -> FloatArray:
        """The numbers of a minimum near others, to this part of sum and numbers."""
        from scipy.optimize import least_squares

        found = least_squares(
            self.away, start, x_scale="jac", method="lm", ftol=to, xtol=to, max_nfev=steps
        )
        return np.asarray(found.x)
