"""A contour of tangent arcs, the lifts of followers on it, and which of its numbers lifts tell.

Base circle, two equal flanks and a nose, each tangent to the next: the law ``arcs_by_radii``.
Under a roller the centre follows a contour of the radii R_b + R_r, R_f + R_r, R_n + R_r, so the
lifts hold these sums. Under a flat face the lift is the contour's support function less R_b, so
the lifts hold the differences R_f − R_b and R_n − R_b.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
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
        """The lift (m) of a follower at cam angles in rad.

        A flat face bridges a flank that is not convex: it rests on the base circle or on the nose.
        """
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

    def flank_curvature(self, coordinate: float, base: float) -> float:
        """The flank's own curvature (1/m) of its coordinate."""
        below = 1.0 - coordinate * self.shift(base)
        if not below > 0.0:
            raise LawError("flank radius: is beyond zero; allowed: a radius")
        return coordinate / below


def number_of(index: int, coordinate: float) -> float:
    """The number (m, rad) of a coordinate: a radius of a curvature, infinite where that is 0."""
    if index not in (PRIME, FLANK):
        return coordinate
    return 1.0 / coordinate if coordinate else math.inf
