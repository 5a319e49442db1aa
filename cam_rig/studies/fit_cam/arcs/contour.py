"""Contours of tangent arcs: lifts of followers, and the parameters that lifts determine.

A contour consists of a base circle, two equal flanks and a nose, each an arc tangent to the next.
This is the law ``arcs_by_radii``. R_b, R_f, R_n and R_r are the radii of base circle, flank, nose
and roller. The centre of a roller follows the pitch curve, a contour with the radii R_b + R_r, R_f
+ R_r and R_n + R_r. Lifts of a roller therefore determine only these sums. The lift of a flat
follower is the support function of the contour (distance of the tangent from the axis) less R_b. It
determines only the differences R_f − R_b and R_n − R_b.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

import numpy as np

from cam_rig.laws.arc_law import ArcFollower, arc_lift
from cam_rig.laws.arcs import Blend, Circle, close_chain
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import FloatArray, rms

FollowerKind = Literal["roller", "flat", "point"]


@dataclass(frozen=True)
class Arcs:
    """Contour of tangent arcs: base circle, two equal flanks, and a nose.

    Radii and lift are in m, the angle of the nose in rad. The flank radius is positive if convex,
    negative if concave, None if straight.
    """

    base_radius: float
    lift: float
    flank_radius: float | None
    nose_radius: float
    nose_angle: float

    @property
    def flank(self) -> str:
        """Kind of the flanks of a contour, as in a cam file: straight, convex or concave."""
        if self.flank_radius is None:
            return "straight"
        return "convex" if self.flank_radius > 0.0 else "concave"

    def offset(self, distance: float) -> Arcs:
        """Return the parallel contour at a distance (m).

        It is outside of this contour for a positive distance, and inside for a negative distance.
        """
        flank = None if self.flank_radius is None else self.flank_radius + distance
        base, nose = self.base_radius + distance, self.nose_radius + distance
        return replace(self, base_radius=base, flank_radius=flank, nose_radius=nose)

    def lifts(self, follower: ArcFollower, angles: FloatArray) -> FloatArray:
        """Return the lift (m) of a follower at cam angles (rad), same shape.

        A flat follower does not touch a straight or concave flank. It moves from the base circle
        directly to the nose.
        """
        flank = Blend(self.flank_radius)
        centre = -(self.base_radius + self.lift - self.nose_radius)
        top = Circle(complex(centre, 0.0), self.nose_radius)
        chain = close_chain([Circle(0j, self.base_radius), flank, top, flank])
        turned = angles - self.nose_angle + math.pi  # in the contour's frame, the nose is at 180°
        if follower.flat and self.flank != "convex":
            above = centre * np.cos(turned) + self.nose_radius - self.base_radius
            return np.maximum(above, 0.0)
        return arc_lift(chain, self.base_radius, follower, turned)


@dataclass(frozen=True, eq=False)
class ArcColumn:
    """Readings of one follower with their interpretation and residuals.

    The interpretation is the type of the follower, and ``is_reversed``, which is True if the cam
    was turned in the opposite sense. ``residuals`` are the lift of the fitted contour minus the
    reading, in m, shape ``(n,)``.
    """

    readings: Readings
    follower: ArcFollower
    is_reversed: bool
    residuals: FloatArray

    @property
    def kind(self) -> FollowerKind:
        """Type of the follower with which readings were taken: flat, roller or point."""
        if self.follower.flat:
            return "flat"
        return "roller" if self.follower.roller_radius else "point"

    def lifts(self, arcs: Arcs, angles: FloatArray) -> FloatArray:
        """Return the lift (m) of a contour at the cam angles (rad) of this column.

        If the cam was turned in the opposite sense, the contour is evaluated at the negative
        angles.
        """
        return arcs.lifts(self.follower, -angles if self.is_reversed else angles)

    @property
    def rms(self) -> float:
        """R.m.s. residual (m) of the readings of one follower from a contour."""
        return rms(self.residuals)

    @property
    def worst(self) -> int:
        """Index of the reading that is farthest from the contour."""
        return int(np.abs(self.residuals).argmax())


class Parameter(IntEnum):
    """Parameters of a pitch curve: the path of the centre of the roller.

    They are prime radius (base radius plus roller radius), lift, flank, nose, and angle of the
    nose. The value is the index in every sequence with one value per parameter.
    """

    PRIME = 0
    LIFT = 1
    FLANK = 2
    NOSE = 3
    ANGLE = 4


@dataclass(frozen=True)
class Coordinates:
    """Coordinates of a pitch curve, in which each confidence interval is connected.

    The coordinates are, in 1/m, m and rad:

    - the curvature 1/(R_b + R_r),
    - the lift,
    - the curvature 1/(R_f + R_r) or 1/(R_f − R_b), 0 if the radius is infinite,
    - the nose radius R_n + R_r or R_n − R_b,
    - the angle of the nose.

    R_b, R_f, R_n and R_r are the radii of base circle, flank, nose and roller. ``sums`` is True if
    flank and nose are expressed by the sums with R_r, False if by the differences from R_b.
    Readings determine only these combinations. ``rolling`` is True if the roller radius is not 0.
    """

    rolling: bool
    sums: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of a pitch curve for tables.

        They are in the order of the coordinates.
        """
        roller = " + roller radius" if self.rolling else ""
        shift = roller if self.sums else " - base radius"
        radii = f"flank radius{shift}", f"nose radius{shift}"
        return (f"base radius{roller}", "lift", *radii, "nose angle")

    def shift(self, prime: float) -> float:
        """Return the length (m) between a radius of the pitch curve and its coordinate.

        Added to the radius of flank or nose, it gives the radius in `Coordinates`. ``prime`` is the
        radius of the base circle of the pitch curve, m.
        """
        return 0.0 if self.sums else -prime

    def of(self, pitch: Arcs) -> FloatArray:
        """Return the coordinates of a pitch curve, ``(5,)``, in 1/m, m and rad."""
        prime = pitch.base_radius
        shift = self.shift(prime)
        flank = 0.0 if pitch.flank_radius is None else 1.0 / (pitch.flank_radius + shift)
        return np.array(
            [1.0 / prime, pitch.lift, flank, pitch.nose_radius + shift, pitch.nose_angle]
        )


def parameter_value(parameter: Parameter, coordinate: float) -> float:
    """Return the value (m or rad) of a parameter from its coordinate.

    For a curvature (1/m) it is the radius, infinite if the curvature is 0.
    """
    if parameter not in (Parameter.PRIME, Parameter.FLANK):
        return coordinate
    return 1.0 / coordinate if coordinate else math.inf
