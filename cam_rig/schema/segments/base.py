"""What all segments have: a span, and their numbers by key."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

from pydantic import BaseModel, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.units import TURN

Span = Annotated[Quantity, must_be("angle", above=0.0, most=TURN * (1.0 + 1e-12))]
#: Ordinates, levels and coefficients in fractions of the lift.
Ratios = Annotated[Quantity, must_be("ratio", many=True, least=-100.0, most=100.0)]
#: A length of the cam's own shape.
Length = Annotated[Quantity, must_be("length", above=0.0, most=100.0)]


class SegmentBase(Strict):
    """A part of the turn."""

    span: Span

    def numbers(self) -> dict[str, Quantity]:
        """Every number of the segment by its key."""
        return dict(quantities(self, ""))


class WholeTurn(SegmentBase):
    """A law that goes once around: no other segment has a place beside it."""

    @model_validator(mode="after")
    def _whole(self) -> WholeTurn:
        degrees = math.degrees(self.span.si)
        if abs(degrees - 360.0) > 1e-9:
            raise ValueError(f"span: is {degrees:.9g}°; allowed: 360°, this law is a whole turn")
        return self


def quantities(node: BaseModel, prefix: str) -> Iterator[tuple[str, Quantity]]:
    """Every number of a config model by its key."""
    for key in type(node).model_fields:
        value = getattr(node, key)
        for at, item in _items(value):
            if isinstance(item, Quantity):
                yield f"{prefix}{key}{at}", item
            elif isinstance(item, BaseModel):
                yield from quantities(item, f"{prefix}{key}{at}.")


def _items(value: object) -> list[tuple[str, object]]:
    if isinstance(value, list):
        return [(f"[{i}]", item) for i, item in enumerate(value)]
    if isinstance(value, dict):
        return [(f".{key}", item) for key, item in value.items()]
    return [("", value)]
