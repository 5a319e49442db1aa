"""One check of a cam: a value, its limit, and the angle where it is."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

#: How a value has to be to its limit.
RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "more than": operator.gt,
    "less than": operator.lt,
    "at most": operator.le,
}
#: Units that checks are shown in, and their factor from SI.
FACTORS = {"mm": 1e3, "mm/rad": 1e3, "°": 180.0 / np.pi, "1": 1.0, "crossings": 1.0}


@dataclass(frozen=True)
class Check:
    """One thing that is right with a cam, or wrong.

    Parameters
    ----------
    name : what is checked
    value, limit : SI units
    relation : one of `RELATIONS`
    unit : one of `FACTORS`, for showing
    angle : rad, the cam angle where the value is; None for the cam as a whole
    remedy : what to do when it fails
    vital : whether a cam that fails cannot exist; else it is bad, but can be made
    disc : which of conjugate cams; empty otherwise
    """

    name: str
    value: float
    relation: str
    limit: float
    unit: str
    angle: float | None
    remedy: str
    vital: bool = True
    disc: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value is as it has to be."""
        return RELATIONS[self.relation](self.value, self.limit)

    @property
    def title(self) -> str:
        """The name, with the disc's where there are two."""
        return f"{self.disc} cam, {self.name}" if self.disc else self.name

    @property
    def degrees(self) -> float | None:
        """The cam angle in degrees."""
        return None if self.angle is None else float(np.degrees(self.angle)) % 360.0

    def shown(self, value: float) -> str:
        """A value in the unit for showing."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{value * FACTORS[self.unit]:.5g}{unit}".replace(" °", "°")

    @property
    def allowed(self) -> str:
        """Relation and limit, in words."""
        return f"{self.relation} {self.shown(self.limit)}"

    def __str__(self) -> str:
        """What is wrong, in one line: angle, value, limit, remedy."""
        where = "" if self.degrees is None else f" at {self.degrees:.4g}°"
        return (
            f"{self.title} is {self.shown(self.value)}{where}; allowed: {self.allowed}; "
            f"{self.remedy}"
        )
