"""A cam file: its law as segments around the turn, its follower, and where they come from."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be

Span = Annotated[Quantity, must_be("angle", above=0.0, most=2.0 * math.pi * (1.0 + 1e-12))]


#: Degree 100 is far beyond any cam, and still stable.
MOST_ORDINATES = 101


class _Segment(Strict):
    span: Span


class Dwell(_Segment):
    """The follower rests at the level where the segment before it ended."""

    law: Literal["dwell"]


class Rise(_Segment):
    """A rise or a fall from the level reached so far to ``to`` (fraction of the lift)."""

    law: Literal["poly345", "poly4567", "cycloidal"]
    to: float = Field(ge=-1.0, le=1.0, allow_inf_nan=False, strict=True)


class Bezier(_Segment):
    """A Bézier curve by its ordinates, in fractions of the lift; they set both end levels."""

    law: Literal["bezier"]
    ordinates: Annotated[Quantity, must_be("ratio", many=True, least=-100.0, most=100.0)]

    @model_validator(mode="after")
    def _degree(self) -> Bezier:
        count = len(self.ordinates.numbers)
        if not 2 <= count <= MOST_ORDINATES:
            raise ValueError(f"ordinates: are {count}; allowed: 2 to {MOST_ORDINATES}")
        return self


class TangentArcs(_Segment):
    """The whole event of a concave-flank arc cam, from base circle over the nose and back."""

    law: Literal["tangent_arcs"]
    nose_span: Span


Segment = Annotated[Dwell | Rise | Bezier | TangentArcs, Field(discriminator="law")]


class Follower(Strict):
    """The translating follower and the size of the cam under it."""

    type: Literal["roller", "point"]
    base_radius: Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
    roller_radius: Annotated[Quantity, must_be("length", above=0.0, most=100.0)] | None = None

    @model_validator(mode="after")
    def _roller(self) -> Follower:
        if (self.type == "roller") != (self.roller_radius is not None):
            need = "needs" if self.type == "roller" else "has no"
            raise ValueError(f"of type {self.type!r} {need} roller_radius")
        return self

    @property
    def roller(self) -> float:
        """Roller radius in m, 0 for a point follower."""
        return self.roller_radius.si if self.roller_radius is not None else 0.0


class CamConfig(Strict):
    """One file of ``config/cams/``."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str
    identified_from: str | None = None
    lift: Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
    follower: Follower
    segments: list[Segment] = Field(min_length=1)

    @model_validator(mode="after")
    def _turn(self) -> CamConfig:
        total = sum(math.degrees(segment.span.si) for segment in self.segments)
        if abs(total - 360.0) > 1e-9:
            raise ValueError(
                f"segments: spans sum to {total:.9g}°; allowed: 360° "
                f"({'missing' if total < 360.0 else 'too much by'} {abs(360.0 - total):.9g}°)"
            )
        return self

    def numbers(self) -> dict[str, Quantity]:
        """Every number of the file by its key, for tables of given / assumed / identified."""
        found: dict[str, Quantity] = {"lift": self.lift, "base_radius": self.follower.base_radius}
        if self.follower.roller_radius is not None:
            found["roller_radius"] = self.follower.roller_radius
        for i, segment in enumerate(self.segments):
            for key in ("span", "ordinates", "nose_span"):
                value = getattr(segment, key, None)
                if value is not None:
                    found[f"segments[{i}].{key}"] = value
        return found
