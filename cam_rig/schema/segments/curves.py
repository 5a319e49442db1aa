"""Segments given by numbers of their own: ordinates, knots, coefficients, conditions."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from cam_rig.schema.quantity import Quantity, must_be
from cam_rig.schema.segments.base import Ratios, SegmentBase, WholeTurn
from cam_rig.units import TURN

#: Degree 100 is far beyond any cam, and still stable.
MAX_ORDINATES = 101
#: A polynomial through more conditions than this oscillates between them.
MAX_CONDITIONS = 21
MAX_HARMONICS = 50
MAX_B_SPLINE_DEGREE = 15
MAX_B_SPLINE_ORDINATES = 500

Angles = Annotated[Quantity, must_be("angle", many=True, least=0.0, most=TURN + 1e-12)]
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
    knots: Annotated[Quantity, must_be("ratio", many=True)]
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
        for knot in dict.fromkeys(knots):
            self._multiplicity(knot, knots)
        return self

    def _multiplicity(self, knot: float, knots: list[float]) -> None:
        times, at_end = knots.count(knot), knot in (knots[0], knots[-1])
        if (at_end and times != self.degree) or times > self.degree:
            limit = f"{self.degree} times" if at_end else f"at most {self.degree} times"
            raise ValueError(f"knots: {knot:g} stands {times} times; allowed: {limit}")


class Trigonometric(WholeTurn):
    """c₀ + Σ cᵢ cos iθ + sᵢ sin iθ over the whole turn, in fractions of the lift (eq. 2.2)."""

    law: Literal["trigonometric"]
    mean: Annotated[Quantity, must_be("ratio", least=-100.0, most=100.0)]
    cosine: Ratios | None = None
    sine: Ratios | None = None

    @model_validator(mode="after")
    def _harmonics(self) -> Trigonometric:
        for key in ("cosine", "sine"):
            count = len(getattr(self, key).numbers) if getattr(self, key) is not None else 0
            if count > MAX_HARMONICS:
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
    value: Annotated[Quantity, must_be("ratio", many=True, least=-1e6, most=1e6)]

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
        conditions = list(zip(self.at.numbers, self.order, strict=True))
        for at, order in conditions:
            if conditions.count((at, order)) > 1:
                raise ValueError(
                    f"at: has {at:g} {self.at.unit} of order {order} twice; allowed: once"
                )
        return self
