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

from cam_rig.errors import LawError
from cam_rig.laws.arc_law import ArcFollower, arc_lift
from cam_rig.laws.arcs import Blend, Circle, close
from cam_rig.measured.cam_fit.gauge import Readings
from cam_rig.units import FloatArray, rms

FollowerKind = Literal["roller", "flat", "point"]
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
    """In which form lifts tell the radii: plus the roller's, or less the base's.

    The coordinates of a contour are those in which every interval is a stretch: the curvatures
    1/(R_b + R_r) and 1/(R_f + R_r), or 1/(R_f − R_b), which are 0 where the radius is infinite,
    the lift, the nose's radius in the same form, and the nose's angle; m and rad.
    """

    roller: float
    sums: bool

    @property
    def names(self) -> tuple[str, ...]:
        """What the numbers are called."""
        rolling = " + roller radius" if self.roller else ""
        shift = rolling if self.sums else " - base radius"
        radii = f"flank radius{shift}", f"nose radius{shift}"
        return (f"base radius{rolling}", "lift", *radii, "nose angle")

    def shift(self, base: float) -> float:
        """What is added to the radius of flank and nose, m."""
        return self.roller if self.sums else -base

    def coordinates(self, arcs: Arcs) -> FloatArray:
        """``(5,)`` of a contour."""
        shift = self.shift(arcs.base_radius)
        flank = 0.0 if arcs.flank_radius is None else 1.0 / (arcs.flank_radius + shift)
        prime = 1.0 / (arcs.base_radius + self.roller)
        return np.array([prime, arcs.lift, flank, arcs.nose_radius + shift, arcs.nose_angle])


def number_of(index: int, coordinate: float) -> float:
    """The number (m, rad) of a coordinate: a radius of a curvature, infinite where that is 0."""
    if index not in (PRIME, FLANK):
        return coordinate
    return 1.0 / coordinate if coordinate else math.inf


# Least squares of a contour, any of whose numbers may be held.

#: Starts of the search: prime radius in lifts, nose radius in parts of it, flank curvature in parts
#: of the greatest.
STARTS = tuple(product((3.0,), (0.3,), (0.3, 0.7, -0.3)))
#: How near a rough search and the last one come, in parts, and the steps of the rough one.
ROUGH, EXACT, FEW = 1e-8, 1e-12, 30
#: Two ends of the search whose residuals differ by less than this factor are one.
SAME = 1.0 + 1e-6
#: Lifts (m) for numbers of which no contour can be made: far from any reading.
NO_CONTOUR = 1.0
#: A flank flatter than this (in parts of the prime radius's curvature) is a straight line.
STRAIGHT = 1e-6
#: A column's own kind and sense.
Role = tuple[bool, bool]


@dataclass(frozen=True, eq=False)
class ArcSearch:
    """The least squares of one reading of the columns.

    ``roles``: of each column, whether its follower is flat, and whether it was read backwards;
    ``held``: coordinates of ``form`` that are not searched, by their index.
    """

    columns: tuple[Readings, ...]
    roles: tuple[Role, ...]
    form: Form
    held: Mapping[int, float] = field(default_factory=dict)

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

    def arcs(self, x: FloatArray) -> Arcs:
        """The contour of unbounded numbers, one for each that is free.

        Logarithms of prime radius and lift, the flank's curvature over the greatest that still
        joins, as 1 − e^x, so that 0 is a straight flank, and the logit of the nose's radius within
        its limits.
        """
        free, held = dict(zip(self.free, x, strict=True)), self.held
        prime = 1.0 / held[PRIME] if PRIME in held else math.exp(free[PRIME])
        lift = held[LIFT] if LIFT in held else math.exp(free[LIFT])
        base = prime - self.form.roller
        most = base + 0.5 * lift  # the mean of the base's and the top's radius
        if FLANK in held:
            below = 1.0 - held[FLANK] * self.form.shift(base)
            if not below > 0.0:
                raise LawError("flank radius: is beyond zero; allowed: a radius")
            curvature = held[FLANK] / below
        else:
            curvature = -math.expm1(free[FLANK]) / most
        straight = abs(curvature) < STRAIGHT / prime
        if NOSE in held:
            nose = held[NOSE] - self.form.shift(base)
        else:
            nose = most / (1.0 + math.exp(-free[NOSE]))
        if not 0.0 < nose < most or not base > 0.0:
            raise LawError("nose radius: is none; allowed: above 0, below that of base and top")
        angle = held[ANGLE] if ANGLE in held else float(free[ANGLE])
        return Arcs(base, lift, None if straight else 1.0 / curvature, nose, angle)

    def away(self, x: FloatArray) -> FloatArray:
        """Residuals (m) of all readings."""
        try:
            found = [self.column(x, i).away for i in range(len(self.columns))]
        except (LawError, OverflowError, ZeroDivisionError):
            return np.full(self.count, NO_CONTOUR)
        return np.concatenate(found)

    def column(self, x: FloatArray, i: int) -> ArcColumn:
        """A column beside the contour."""
        readings, (flat, reverse) = self.columns[i], self.roles[i]
        angles = -readings.angles if reverse else readings.angles
        follower = ArcFollower(flat, 0.0 if flat else self.form.roller)
        with np.errstate(all="ignore"):
            away = self.arcs(x).lifts(follower, angles) - readings.lifts
        if not np.isfinite(away).all():
            raise LawError("the follower does not reach the contour")
        return ArcColumn(readings, follower, reverse, away)

    @property
    def name(self) -> str:
        """The roles in words."""
        words = ("roller" if self.form.roller else "point", "flat")
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
        for prime, nose, flank in STARTS:
            radius = math.log(self.form.roller + prime * height)
            all_free = [radius, math.log(height), math.log1p(-flank), math.log(nose / (1.0 - nose))]
            starts.append(np.array([*all_free, angle])[list(self.free)])
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
