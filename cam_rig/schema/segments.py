"""Segments given by numbers of their own, by circular arcs, or by the name of a rise."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.segment_base import Length, Ratios, SegmentBase, Span, Table, WholeTurn
from cam_rig.units import TURN

#: Degree 100 is far beyond any cam, and still stable.
MAX_ORDINATES = 101
#: A polynomial through more conditions than this oscillates between them.
MAX_CONDITIONS = 21
MAX_HARMONICS = 50
MAX_B_SPLINE_DEGREE = 15
MAX_B_SPLINE_ORDINATES = 500
Angles = Annotated[Quantity, must_be("angle", is_list=True, ge=0.0, le=TURN + 1e-12)]
Order = Annotated[int, Field(ge=0, lt=MAX_CONDITIONS, strict=True)]


class Bezier(SegmentBase):
    """A Bézier curve by its ordinates, in fractions of the lift; they set both end levels."""

    law: Literal["bezier"]
    ordinates: Ratios

    @model_validator(mode="after")
    def _degree(self) -> Bezier:
        count = len(self.ordinates.numbers)
        if not 2 <= count <= MAX_ORDINATES:
            raise ValueError(f"ordinates: are {count}; allowed: 2 to {MAX_ORDINATES}")
        return self


class BSpline(SegmentBase):
    """A B-spline of one degree over knots, which are stretched to the span.

    The first and the last knot stand ``degree`` times, so that the curve begins and ends on its
    first and last ordinate: for L pieces of degree n there are L + n ordinates and
    L + 2n − 1 knots (profile thesis §2.1.2).
    """

    law: Literal["b_spline"]
    degree: int = Field(ge=1, le=MAX_B_SPLINE_DEGREE, strict=True)
    knots: Annotated[Quantity, must_be("ratio", is_list=True)]
    ordinates: Ratios

    @model_validator(mode="after")
    def _fit_each_other(self) -> BSpline:
        knots, count = self.knots.numbers, len(self.ordinates.numbers)
        if not self.degree + 1 <= count <= MAX_B_SPLINE_ORDINATES:
            raise ValueError(
                f"ordinates: are {count}; allowed for degree {self.degree}: "
                f"{self.degree + 1} to {MAX_B_SPLINE_ORDINATES}"
            )
        if len(knots) != count + self.degree - 1:
            raise ValueError(
                f"knots: are {len(knots)}; allowed for {count} ordinates of degree "
                f"{self.degree}: {count + self.degree - 1}, the ends counted {self.degree} times"
            )
        for i, (one, other) in enumerate(pairwise(knots)):
            if other < one:
                raise ValueError(f"knots: knot {i + 2} is {other:g} after {one:g}; allowed: rising")
        for knot, times in Counter(knots).items():
            at_end = knot in (knots[0], knots[-1])
            if (at_end and times != self.degree) or times > self.degree:
                limit = f"{self.degree} times" if at_end else f"at most {self.degree} times"
                raise ValueError(f"knots: {knot:g} stands {times} times; allowed: {limit}")
        return self


class Trigonometric(WholeTurn):
    """c₀ + Σ cᵢ cos iθ + sᵢ sin iθ over the whole turn, in fractions of the lift (eq. 2.2)."""

    law: Literal["trigonometric"]
    mean: Annotated[Quantity, must_be("ratio", ge=-100.0, le=100.0)]
    cosine: Ratios | None = None
    sine: Ratios | None = None

    @model_validator(mode="after")
    def _harmonics(self) -> Trigonometric:
        for key, sizes in (("cosine", self.cosine), ("sine", self.sine)):
            if sizes is not None and len(sizes.numbers) > MAX_HARMONICS:
                count = len(sizes.numbers)
                raise ValueError(f"{key}: are {count}; allowed: at most {MAX_HARMONICS}")
        return self


class Polynomial(SegmentBase):
    """The polynomial of lowest degree through conditions: one ``value`` at one angle each.

    ``at`` counts from the segment's start. ``order`` 0 is a level in fractions of the lift,
    ``order`` r the r-th derivative in lift per span to the r.
    """

    law: Literal["polynomial"]
    at: Angles
    order: list[Order]
    value: Annotated[Quantity, must_be("ratio", is_list=True, ge=-1e6, le=1e6)]

    @model_validator(mode="after")
    def _conditions(self) -> Polynomial:
        counts = {len(self.at.numbers), len(self.order), len(self.value.numbers)}
        if len(counts) != 1:
            raise ValueError(
                f"at, order, value: are {len(self.at.numbers)}, {len(self.order)} and "
                f"{len(self.value.numbers)} numbers; allowed: one of each for a condition"
            )
        count = len(self.order)
        if not 1 <= count <= MAX_CONDITIONS:
            raise ValueError(f"at: {count} conditions; allowed: 1 to {MAX_CONDITIONS}")
        for angle, order in zip(self.at.si_list, self.order, strict=True):
            if angle > self.span.si * (1.0 + 1e-12):
                raise ValueError(
                    f"at: is {math.degrees(angle):g}°; allowed: within the span, "
                    f"{math.degrees(self.span.si):g}°"
                )
            if order >= count:
                raise ValueError(
                    f"order: is {order}; allowed: at most {count - 1}, the degree that "
                    f"{count} conditions give"
                )
        for (at, order), times in Counter(zip(self.at.numbers, self.order, strict=True)).items():
            if times > 1:
                raise ValueError(
                    f"at: has {at:g} {self.at.unit} of order {order} twice; allowed: once"
                )
        return self


MAX_ARCS = 100
SignedLength = Annotated[Quantity, must_be("length", ge=-100.0, le=100.0)]


class TangentArcs(SegmentBase):
    """The whole event of a concave-flank arc cam, from base circle over the nose and back.

    Given by its event angles: ``span``, and ``nose_span`` of the nose's arc on the pitch curve.
    """

    law: Literal["tangent_arcs"]
    nose_span: Span


class ArcsByRadii(WholeTurn):
    """The follower's base circle, two equal flanks and a nose, by their radii on the contour.

    The nose's top stands one lift above it at 180°; the event's angles follow from the radii.
    """

    law: Literal["arcs_by_radii"]
    flank: Literal["convex", "straight", "concave"]
    flank_radius: Length | None = None
    nose_radius: Length

    @model_validator(mode="after")
    def _flank(self) -> ArcsByRadii:
        if (self.flank == "straight") != (self.flank_radius is None):
            need = "has no" if self.flank == "straight" else "needs"
            raise ValueError(f"flank: {self.flank} {need} flank_radius")
        return self


class ArcSpec(Strict):
    """One part of a contour: with ``x`` and ``y`` an arc about that centre, below 0 if concave.

    With a ``radius`` alone the arc that joins its neighbours; with nothing the line between them.
    """

    radius: SignedLength | None = None
    x: SignedLength | None = None
    y: SignedLength | None = None

    @model_validator(mode="after")
    def _complete(self) -> ArcSpec:
        given = [key for key in ("x", "y") if getattr(self, key) is not None]
        if len(given) == 1 or (given and self.radius is None):
            has = ", ".join([*given, *([] if self.radius is None else ["radius"])])
            raise ValueError(f"has {has}; allowed: radius, x and y, or radius alone, or nothing")
        if self.radius is not None and self.radius.si == 0.0:
            raise ValueError("radius: is 0; allowed: positive (convex) or negative (concave)")
        return self


class ArcsByCentres(WholeTurn):
    """A contour of arcs by centres and radii, in the order of the cam angle, from +y towards +x.

    Centres are in the cam's frame: the follower stands above the cam on +y at cam angle 0.
    """

    law: Literal["arcs_by_centres"]
    arcs: list[ArcSpec] = Field(min_length=2, max_length=MAX_ARCS)


_Classical = Literal[
    "constant_velocity", "simple_harmonic", "cycloidal", "modified_sine", "modified_trapezoid"
]
_Polynomial = Literal["poly345", "poly4567", "bezier5", "bezier7", "bezier9"]
_HalfRise = Literal[
    "bezier4_start", "bezier6_start", "bezier8_start", "bezier4_end", "bezier6_end", "bezier8_end"
]
RiseName = Literal[_Classical, _Polynomial, _HalfRise]


class Dwell(SegmentBase):
    """The follower rests at the level where the segment before it ended."""

    law: Literal["dwell"]


class Rise(SegmentBase):
    """A rise or a fall from the level reached so far to ``to`` (fraction of the lift).

    The half-rises ``…_start`` and ``…_end`` go from rest to constant velocity and back to rest;
    a ``constant_velocity`` segment of the same slope fits between them.
    """

    law: RiseName
    to: float = Field(ge=-1.0, le=1.0, allow_inf_nan=False, strict=True)


# What may stand in a cam's ``segments``: one model a law, told apart by the key ``law``.

Segment = Annotated[
    Dwell
    | Rise
    | Bezier
    | BSpline
    | Polynomial
    | Trigonometric
    | TangentArcs
    | ArcsByRadii
    | ArcsByCentres
    | Table,
    Field(discriminator="law"),
]
