"""Cams made of circular arcs and straight lines, each tangent to the next."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.segments.base import Length, SegmentBase, Span, WholeTurn

MAX_ARCS = 100

Coordinate = Annotated[Quantity, must_be("length", least=-100.0, most=100.0)]
SignedLength = Annotated[Quantity, must_be("length", least=-100.0, most=100.0)]


class TangentArcs(SegmentBase):
    """The whole event of a concave-flank arc cam, from base circle over the nose and back.

    Given by its event angles: ``span``, and ``nose_span`` of the nose's arc on the pitch curve.
    """

    law: Literal["tangent_arcs"]
    nose_span: Span


class ArcsByRadii(WholeTurn):
    """Base circle, two equal flanks and a nose, by their radii on the contour.

    The base circle is the follower's ``base_radius``; the nose's top stands one lift above it,
    at cam angle 180°. The event's angles follow from the radii.
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
    """One part of a contour.

    With ``x`` and ``y`` a circular arc about that centre; with a ``radius`` alone the arc that
    joins its two neighbours; with nothing at all the straight line between them. A concave
    arc's radius is negative.
    """

    radius: SignedLength | None = None
    x: Coordinate | None = None
    y: Coordinate | None = None

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
    """A contour of arcs by centres and radii, in the order of the cam angle.

    Centres are in the cam's frame: the follower stands above the cam on +y at cam angle 0, and
    the cam angle runs from +y towards +x.
    """

    law: Literal["arcs_by_centres"]
    arcs: list[ArcSpec] = Field(min_length=2, max_length=MAX_ARCS)
