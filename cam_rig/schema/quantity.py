"""A number with its unit and its origin: the only way a number enters the rig.

In YAML::

    mass: {given: 1.3, unit: kg, source: paper Table 1}
    span: {identified: 117.5, unit: deg, source: fit to Table 2, residual: 0.37 % RMS}

Exactly one of ``given`` (a source prints it), ``assumed`` (nobody does, and it says why) or
``identified`` (fitted, and it says to what) carries the number.
"""

from __future__ import annotations

import math
from operator import ge, gt, le
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from cam_rig.units import RPM, TURN

Origin = Literal["given", "assumed", "identified"]
ORIGINS: tuple[Origin, ...] = ("given", "assumed", "identified")
#: dimension -> unit -> factor to SI
UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "turn": TURN},
    "speed": {"rad/s": 1.0, "rpm": RPM},
    "mass": {"kg": 1.0, "g": 1e-3},
    "stiffness": {"N/m": 1.0, "N/mm": 1e3},
    "damping": {"N*s/m": 1.0},
    "force": {"N": 1.0},
    "inertia": {"kg*m^2": 1.0},
    "torsional stiffness": {"N*m/rad": 1.0},
    "torsional damping": {"N*m*s/rad": 1.0},
    "frequency": {"Hz": 1.0, "kHz": 1e3},
    "level": {"dB": 1.0},
    "level slope": {"dB/octave": 1.0},
    "radiation": {"Pa*s/N": 1.0},
    "ratio": {"1": 1.0},
    "turns": {"turns": 1.0},
    "time": {"s": 1.0, "ms": 1e-3},
    "temperature": {"degC": 1.0},
    "pressure": {"Pa": 1.0, "MPa": 1e6, "GPa": 1e9},
    "linear speed": {"m/s": 1.0},
}


#: A number as YAML means it: neither text nor true.
Number = Annotated[float, Field(strict=True)]


class Strict(BaseModel):
    """Base of every config model: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Quantity(Strict):
    """One number, or a list of them, with unit, origin and where it comes from."""

    given: Number | list[Number] | None = None
    assumed: Number | list[Number] | None = None
    identified: Number | list[Number] | None = None
    unit: str
    source: str = ""
    residual: str = ""

    @model_validator(mode="after")
    def _one_origin(self) -> Quantity:
        named = [origin for origin in ORIGINS if getattr(self, origin) is not None]
        if len(named) != 1:
            found = " and ".join(named) or "none"
            raise ValueError(f"has {found}; allowed: exactly one of given, assumed, identified")
        if not all(math.isfinite(v) for v in self.numbers):
            raise ValueError(f"is {self.raw}; allowed: finite numbers")
        return self

    @property
    def origin(self) -> Origin:
        """given, assumed or identified."""
        return next(o for o in ORIGINS if getattr(self, o) is not None)

    @property
    def raw(self) -> float | list[float]:
        """The number or numbers as written, in the written unit."""
        value: float | list[float] = getattr(self, self.origin)
        return value

    @property
    def numbers(self) -> list[float]:
        """The numbers as written, always as a list."""
        return self.raw if isinstance(self.raw, list) else [self.raw]

    @property
    def factor(self) -> float:
        """Factor from the written unit to SI."""
        return next(units[self.unit] for units in UNITS.values() if self.unit in units)

    @property
    def si(self) -> float:
        """The number in SI units."""
        return self.numbers[0] * self.factor

    @property
    def si_list(self) -> list[float]:
        """The numbers in SI units."""
        return [value * self.factor for value in self.numbers]


def must_be(
    dimension: str,
    *,
    many: bool = False,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
) -> AfterValidator:
    """Annotation of a config key: its dimension, and limits in SI units."""
    units = UNITS[dimension]
    limits = ((above, gt, "greater than"), (least, ge, "at least"), (most, le, "at most"))

    def check(quantity: Quantity) -> Quantity:
        if quantity.unit not in units:
            article = "an" if dimension[0] in "aeiou" else "a"
            allowed = ", ".join(units)
            raise ValueError(
                f"has unit {quantity.unit!r}, not {article} {dimension}; allowed: {allowed}"
            )
        if isinstance(quantity.raw, list) != many:
            wanted = "a list of numbers" if many else "one number"
            raise ValueError(f"is {quantity.raw}; allowed: {wanted}")
        if many and not quantity.numbers:
            raise ValueError("is an empty list; allowed: at least one number")
        factor, unit = quantity.factor, "" if quantity.unit == "1" else f" {quantity.unit}"
        for value in quantity.numbers:
            for limit, holds, words in limits:
                if limit is not None and not holds(value * factor, limit):
                    shown = limit / factor
                    raise ValueError(f"is {value:g}{unit}; allowed: {words} {shown:g}{unit}")
        return quantity

    return AfterValidator(check)
