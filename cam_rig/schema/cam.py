"""A cam file: its law as segments around the turn, its follower, and where they come from."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from cam_rig.schema.contact_parts import ContactParts
from cam_rig.schema.follower import Follower
from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.segments import Segment, Table
from cam_rig.schema.segments.base import quantities

#: Frames of the rig's robot besides one for each cam, which bears the cam's name.
FRAMES = ("base_link", "guide", "motor", "microphone", "cam", "follower", "follower_arc")


class CamConfig(Strict):
    """One file of ``config/cams/``.

    ``cannot_be_made`` says why a cam is there to be looked at only: one that fails a check, and is
    meant to. ``contact`` is only for stresses: `parts` has its defaults where it is not given.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str
    identified_from: str | None = None
    cannot_be_made: str | None = Field(default=None, min_length=1)
    lift: Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
    follower: Follower
    contact: ContactParts | None = None
    segments: list[Segment] = Field(min_length=1)

    @model_validator(mode="after")
    def _own_frame(self) -> CamConfig:
        if self.name in FRAMES:
            raise ValueError(
                f"name: is {self.name!r}, another frame of the rig; allowed: any name but "
                f"{', '.join(FRAMES)}"
            )
        return self

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
        found: dict[str, Quantity] = {"lift": self.lift, **self.follower.numbers()}
        if self.contact is not None:
            found |= quantities(self.contact, "contact.")
        for i, segment in enumerate(self.segments):
            found |= {f"segments[{i}].{key}": n for key, n in segment.numbers().items()}
        return found

    @property
    def parts(self) -> ContactParts:
        """Width, material and permissible values of the contact, assumed where not given."""
        return self.contact or ContactParts()

    @property
    def files(self) -> list[str]:
        """Names of the files beside the cam's own that it is made of."""
        return [segment.file.file for segment in self.segments if isinstance(segment, Table)]
