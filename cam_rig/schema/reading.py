"""A reading of the paper's Table 2: the numbers that it does not print, each with its origin."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, FiniteFloat, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.rig import Damping, Force, Mass, RollerShare, Stiffness

#: Above, a run has more periods than can be looked at at each speed of the grid.
Stem = Annotated[Quantity, must_be("stiffness", least=1e4, most=1e9)]
Span = Annotated[Quantity, must_be("angle", above=0.0, most=3.0)]


class TableReading(Strict):
    """A two-mass follower and the angles of rise and high dwell, as one way to read the table."""

    title: str
    mass: Mass
    spring_stiffness: Stiffness
    stem_stiffness: Stem
    roller_share: RollerShare
    stem_damping: Damping
    damping: Damping
    preload: Force
    event: Span
    high_dwell: Span

    @model_validator(mode="after")
    def _fits(self) -> TableReading:
        if 2.0 * self.event.si + self.high_dwell.si > 6.28:
            raise ValueError(
                f"event, high_dwell: are {self.event.raw} and {self.high_dwell.raw} "
                f"{self.event.unit}; allowed: two events and the high dwell within 359.8 deg"
            )
        return self

    @property
    def fitted(self) -> tuple[str, ...]:
        """Which numbers were identified from the table."""
        numbers = ((key, value) for key, value in self if isinstance(value, Quantity))
        return tuple(key for key, value in numbers if value.origin == "identified")


class TableReadings(Strict):
    """``config/published/readings/table2.yaml``: ways to read Table 2, by name."""

    name: str
    source: str
    run_s: FiniteFloat = Field(ge=1.0, le=60.0)
    readings: dict[str, TableReading] = Field(min_length=1)
