"""A factorial study: laws by continuity, event angles, and one cam whose event is compressed."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.scene import MAX_SPEED, Name
from cam_rig.schema.segments.rise import RiseName
from cam_rig.units import RPM, TURN

Events = Annotated[Quantity, must_be("angle", many=True, above=0.0, most=math.pi)]
#: Slowest speed of a measurement, rad/s.
SLOWEST = 1.0 * RPM
Speeds = Annotated[Quantity, must_be("speed", many=True, least=SLOWEST, most=MAX_SPEED)]


class FactorialConfig(Strict):
    """One file of ``config/factorials/``.

    Every rise of ``rises`` is built over every angle of ``events``, up and down alike; then over
    the angles at which it accelerates as ``reference`` does over those of ``gentle``. The cam
    ``proposed`` is pressed into each span of ``squeezed``, with a low dwell for the rest.
    """

    name: Name
    title: str
    rig: Name
    noise_rig: Name
    lift: Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
    rises: list[RiseName] = Field(min_length=2)
    events: Events
    reference: RiseName
    gentle: Events
    proposed: Name
    squeezed: Annotated[Quantity, must_be("angle", many=True, above=0.0, most=TURN)]
    run: Annotated[Quantity, must_be("time", above=0.0, most=3600.0)]
    accelerated: Speeds
    residual: Speeds
    noise: Speeds
    noise_in_contact: Annotated[Quantity, must_be("speed", least=SLOWEST, most=MAX_SPEED)]

    @model_validator(mode="after")
    def _levels(self) -> FactorialConfig:
        for key in ("events", "gentle"):
            angles = getattr(self, key).numbers
            if len(angles) < 2 or len(set(angles)) != len(angles):
                raise ValueError(f"{key}: are {angles}; allowed: at least two, each once")
        if len(set(self.rises)) != len(self.rises):
            raise ValueError(f"rises: {self.rises} names a law twice; allowed: each once")
        return self
