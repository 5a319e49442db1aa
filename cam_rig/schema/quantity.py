"""A number with its unit and its origin: the only way a number enters the rig.

In YAML::

    mass: {given: 1.3, unit: kg, source: paper Table 1}
    span: {identified: 117.5, unit: deg, source: fit to Table 2, residual: 0.37 % RMS}

In Python a plain number in SI, or a text with a unit as ``"3.2 N/mm"``, stands for one as well
where a cam or a rig is made: it is assumed. In a file neither does.

Exactly one of ``given`` (a source prints it), ``assumed`` (nobody does, and it says why) or
``identified`` (fitted, and it says to what) carries the number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from operator import ge, gt, le
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

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


#: unit -> factor to SI
FACTORS = {unit: factor for units in UNITS.values() for unit, factor in units.items()}
#: Numbers of a list that are shown.
SHOWN = 6
#: A number as YAML means it: neither text nor true.
Number = Annotated[float, Field(strict=True)]


#: How other programs write a unit, as this one does.
WRITTEN = str.maketrans({"·": "*", "²": "^2", "µ": "u", "μ": "u", "°": "deg"})
#: A number and its unit in one text.
WITH_UNIT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")
#: Context of a validation that takes plain numbers: of a model made in Python, not of a file's.
IN_PYTHON: dict[str, Any] = {"in_python": True}


class Strict(BaseModel):
    """Base of every config model: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def __init__(self, /, **data: Any) -> None:
        self.__pydantic_validator__.validate_python(data, self_instance=self, context=IN_PYTHON)

    # else pydantic would build what a file has by __init__ too, and take plain numbers there
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]


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

    def __repr__(self) -> str:
        """With its unit and its origin, without its source."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        numbers = ", ".join(f"{value:g}" for value in self.numbers[:SHOWN])
        more = f", … {len(self.numbers)}" if len(self.numbers) > SHOWN else ""
        return f"{numbers}{more}{unit} ({self.origin})"

    __str__ = __repr__

    @property
    def origin(self) -> Origin:
        """given, assumed or identified."""
        if self.given is not None:
            return "given"
        return "identified" if self.assumed is None else "assumed"

    @property
    def raw(self) -> float | list[float]:
        """The number or numbers as written, in the written unit."""
        value: float | list[float] = getattr(self, self.origin)
        return value

    @property
    def numbers(self) -> list[float]:
        """The numbers as written, always as a list."""
        raw = self.raw
        return raw if isinstance(raw, list) else [raw]

    @property
    def factor(self) -> float:
        """Factor from the written unit to SI."""
        return FACTORS[self.unit]

    @property
    def si(self) -> float:
        """The number in SI units."""
        return self.numbers[0] * self.factor

    @property
    def si_list(self) -> list[float]:
        """The numbers in SI units."""
        return [value * self.factor for value in self.numbers]

    def with_si(self, value: float) -> Quantity:
        """Another number (SI) of the same origin and unit."""
        return self.model_copy(update={self.origin: value / self.factor})


def must_be(
    dimension: str,
    *,
    many: bool = False,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
) -> WrapValidator:
    """Annotation of a config key: its dimension, and limits in SI units."""
    units = UNITS[dimension]
    limits = ((above, gt, "greater than"), (least, ge, "at least"), (most, le, "at most"))

    def check(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Quantity:
        if (info.context or {}).get("in_python"):
            value = _in_python(value, units)
        quantity: Quantity = handler(value)
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

    return WrapValidator(check)


def _in_python(value: Any, units: Mapping[str, float]) -> Any:
    """A plain number in SI, or a text with its unit, as a file has it; all else as it is."""
    value = value.item() if hasattr(value, "item") and not getattr(value, "ndim", 0) else value
    value = value.tolist() if hasattr(value, "tolist") else value
    unit = next(name for name, factor in units.items() if factor == 1.0)
    if isinstance(value, str):
        found = WITH_UNIT.fullmatch(value)
        if found is None or not (found[2] or unit == "1"):
            known = ", ".join(units)
            raise ValueError(
                f"is {value[:40]!r}; allowed: a number in {unit}, or a text with one and its "
                f"unit: {known}"
            )
        value, unit = float(found[1]), found[2].translate(WRITTEN) or "1"
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    if plain or (isinstance(value, list | tuple) and not any(isinstance(x, dict) for x in value)):
        number = list(value) if isinstance(value, list | tuple) else value
        return {"assumed": number, "unit": unit, "source": "in Python"}
    if not isinstance(value, Quantity | dict):
        raise ValueError(f"is a {type(value).__name__}; allowed: a number, or a text with its unit")
    return value
