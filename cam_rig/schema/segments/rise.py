"""Dwells, and the rises and falls that are known by a name."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from cam_rig.schema.segments.base import SegmentBase

RiseName = Literal[
    "constant_velocity",
    "simple_harmonic",
    "cycloidal",
    "modified_sine",
    "modified_trapezoid",
    "poly345",
    "poly4567",
    "bezier5",
    "bezier7",
    "bezier9",
    "bezier4_start",
    "bezier6_start",
    "bezier8_start",
    "bezier4_end",
    "bezier6_end",
    "bezier8_end",
]


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
