"""Numbers with unit and origin: the form of every number in the files of the rig.

In YAML::

    mass: {given: 1.3, unit: kg, source: paper Table 1}
    span: {identified: 117.5, unit: deg, source: fit to Table 2, residual: 0.37 % RMS}

Exactly one of these keys contains the number:

- ``given``: a source prints the number.
- ``assumed``: no source prints it. ``source`` gives the reason for the value.
- ``identified``: it was fitted. ``source`` gives the data.

In Python the constructors of a cam and a rig also accept a plain number in SI, or a text with a
unit such as ``"3.2 N/mm"``. Its origin is then assumed. Files must not contain either of them.
"""

from __future__ import annotations

import math
import operator
import re
import sys
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

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

#: Origin of a number, which is the key that contains it in a file.
Origin = Literal["given", "assumed", "identified"]
#: All origins, in the order of messages.
ORIGINS: tuple[Origin, ...] = ("given", "assumed", "identified")


def per_angle(order: int) -> dict[str, float]:
    """Return the units of a derivative of the lift by the cam angle, with their factors to SI."""
    power = f"^{order}" if order > 1 else ""
    lengths, angles = {"m": 1.0, "mm": 1e-3, "in": 0.0254}, {"rad": 1.0, "deg": math.pi / 180.0}
    return {
        f"{length}/{angle}{power}": factor / radians**order
        for angle, radians in angles.items()
        for length, factor in lengths.items()
    }


#: Dimension -> unit -> factor to SI.
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
    "velocity over angle": per_angle(1),
    "acceleration over angle": per_angle(2),
    "jerk over angle": per_angle(3),
}
#: Unit -> factor to SI. Each unit has one dimension.
FACTORS = {unit: factor for units in UNITS.values() for unit, factor in units.items()}
#: Largest number of items of a list without a limit. Only the size of its file limits the list.
MANY = sys.maxsize
#: Largest number of items that the ``repr`` of a list of numbers contains.
MAX_SHOWN_NUMBERS = 6
#: Type of a number in a YAML file. Texts and booleans are errors.
Number = Annotated[float, Field(strict=True)]
#: Character translation of other spellings of a unit, such as mm² for mm^2.
UNIT_SPELLINGS = str.maketrans({"·": "*", "²": "^2", "µ": "u", "μ": "u", "°": "deg"})
#: Pattern of a text with a number and its unit.
NUMBER_WITH_UNIT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")
#: Context of a validation that accepts plain numbers: of a model made in Python, not in a file.
PYTHON_CONTEXT: dict[str, Any] = {"in_python": True}


class Strict(BaseModel):
    """Base class of the config models: unknown keys are errors, values are constant."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    #: Earlier name of a key -> present name. Files and bags of version 0 contain the earlier names.
    earlier_keys: ClassVar[dict[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _rename_earlier_keys(cls, data: Any) -> Any:
        """Return the data with earlier keys renamed to their present names.

        An earlier key is not renamed if the data also contain its present name. Validation then
        rejects it as unknown.
        """
        if not isinstance(data, dict) or data.keys().isdisjoint(cls.earlier_keys):
            return data
        present = {k: n for k, n in cls.earlier_keys.items() if n not in data}
        return {present.get(key, key): value for key, value in data.items()}

    def __init__(self, /, **data: Any) -> None:
        self.__pydantic_validator__.validate_python(
            data, self_instance=self, context=PYTHON_CONTEXT
        )

    # Without this, pydantic would call __init__ for files as well, and accept plain numbers.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def __str__(self) -> str:
        return repr(self)


class Quantity(Strict):
    """Number or list of numbers with unit, origin and source.

    Parameters
    ----------
    given, assumed, identified : float or list of float or None
        The number in `unit`. Exactly one of the three is not None.
    unit : str
        A unit of `UNITS`.
    source : str
        Source of a given number, reason of an assumed one, data of an identified one.
    residual : str
        Residual of the fit of an identified number, as text.

    Examples
    --------
    >>> from cam_rig.schema.quantity import Quantity
    >>> mass = Quantity(given=1300.0, unit="g", source="paper Table 1")
    >>> mass, mass.si, mass.origin
    (1300 g (given), 1.3, 'given')
    """

    given: Number | list[Number] | None = None
    assumed: Number | list[Number] | None = None
    identified: Number | list[Number] | None = None
    unit: str
    source: str = ""
    residual: str = ""

    @model_validator(mode="after")
    def _one_origin(self) -> Quantity:
        origins = [origin for origin in ORIGINS if getattr(self, origin) is not None]
        if len(origins) != 1:
            names = " and ".join(origins) or "none"
            raise ValueError(f"has {names}; allowed: exactly one of given, assumed, identified")
        if not all(math.isfinite(v) for v in self.numbers):
            raise ValueError(f"is {self.raw}; allowed: finite numbers")
        return self

    def __repr__(self) -> str:
        """Return the numbers with unit and origin, without source."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        count = len(self.numbers)
        numbers = ", ".join(f"{value:g}" for value in self.numbers[:MAX_SHOWN_NUMBERS])
        more = f", … {count}" if count > MAX_SHOWN_NUMBERS else ""
        return f"{numbers}{more}{unit} ({self.origin})"

    @property
    def origin(self) -> Origin:
        """Origin of the number: given, assumed or identified."""
        if self.given is not None:
            return "given"
        return "identified" if self.assumed is None else "assumed"

    @property
    def raw(self) -> float | list[float]:
        """Number or list of numbers as written, in `unit`."""
        value: float | list[float] = getattr(self, self.origin)
        return value

    @property
    def numbers(self) -> list[float]:
        """Numbers as written, in `unit`, always as a list."""
        raw = self.raw
        return raw if isinstance(raw, list) else [raw]

    @property
    def factor(self) -> float:
        """Factor from `unit` to SI."""
        return FACTORS[self.unit]

    @property
    def si(self) -> float:
        """Number in SI units. For a list, the first number."""
        return self.numbers[0] * self.factor

    @property
    def si_list(self) -> list[float]:
        """Numbers in SI units, always as a list."""
        return [value * self.factor for value in self.numbers]

    def with_si(self, value: float) -> Quantity:
        """Return a quantity of the same origin, unit and source with another number (SI)."""
        return self.model_copy(update={self.origin: value / self.factor})


def must_be(
    dimension: str,
    *,
    counts: tuple[int, int] | None = None,
    gt: float | None = None,
    ge: float | None = None,
    le: float | None = None,
) -> WrapValidator:
    """Return the annotation of a config key that checks its quantity.

    Parameters
    ----------
    dimension : str
        A dimension of `UNITS`.
    counts : tuple of int or None
        Smallest and largest number of items of a list, each within the limits (default: the
        quantity is one number).
    gt, ge, le : float or None
        Limits in SI units: greater than, at least, at most.
    """
    units = UNITS[dimension]
    limits = (
        (gt, operator.gt, "greater than"),
        (ge, operator.ge, "at least"),
        (le, operator.le, "at most"),
    )

    def check(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Quantity:
        if (info.context or {}).get("in_python"):
            value = _to_file_form(value, units)
        quantity: Quantity = handler(value)
        if quantity.unit not in units:
            article = "an" if dimension[0] in "aeiou" else "a"
            allowed = ", ".join(units)
            raise ValueError(
                f"has unit {quantity.unit!r}, not {article} {dimension}; allowed: {allowed}"
            )
        if isinstance(quantity.raw, list) != (counts is not None):
            form = "one number" if counts is None else "a list of numbers"
            raise ValueError(f"is {quantity.raw}; allowed: {form}")
        if counts is not None and not counts[0] <= len(quantity.numbers) <= counts[1]:
            form = f"{counts[0]} to {counts[1]}" if counts[1] < MANY else f"at least {counts[0]}"
            raise ValueError(f"has {len(quantity.numbers)} numbers; allowed: {form}")
        factor, unit = quantity.factor, "" if quantity.unit == "1" else f" {quantity.unit}"
        for value in quantity.numbers:
            for limit, compare, text in limits:
                if limit is not None and not compare(value * factor, limit):
                    bound = f"{limit / factor:g}{unit}"
                    raise ValueError(f"is {value:g}{unit}; allowed: {text} {bound}")
        return quantity

    return WrapValidator(check)


def _to_file_form(value: Any, units: Mapping[str, float]) -> Any:
    """Convert a plain number in SI, or a text with its unit, to the mapping of a file.

    Quantities and mappings are returned unchanged.
    """
    value = value.tolist() if hasattr(value, "tolist") else value  # a scalar or array of NumPy
    if isinstance(value, Quantity | dict):
        return value
    unit = next(name for name, factor in units.items() if factor == 1.0)
    if isinstance(value, str):
        match = NUMBER_WITH_UNIT.fullmatch(value)
        if match is None or not (match[2] or unit == "1"):
            raise ValueError(
                f"is {value[:40]!r}; allowed: a number in {unit}, or a text with one and its "
                f"unit: {', '.join(units)}"
            )
        value, unit = float(match[1]), match[2].translate(UNIT_SPELLINGS) or "1"
    if isinstance(value, tuple):
        value = list(value)
    has_mappings = isinstance(value, list) and any(isinstance(item, dict) for item in value)
    if has_mappings or isinstance(value, bool) or not isinstance(value, int | float | list):
        raise ValueError(f"is a {type(value).__name__}; allowed: a number, or a text with its unit")
    return {"assumed": value, "unit": unit, "source": "in Python"}
