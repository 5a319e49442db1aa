"""Quantities: one origin, a unit of the right dimension, SI afterwards."""

import math
import re
from typing import Annotated

import pytest
from pydantic import TypeAdapter, ValidationError

from cam_rig.schema.quantity import ORIGINS, UNITS, Quantity, must_be

ALL_UNITS = [(d, unit) for d, units in UNITS.items() for unit in units]


@pytest.mark.parametrize("origin", ORIGINS)
def test_origin_is_kept(origin):
    """Given, assumed and identified stay apart."""
    quantity = Quantity.model_validate({origin: 2.5, "unit": "kg"})
    assert quantity.origin == origin
    assert quantity.raw == 2.5


@pytest.mark.parametrize(
    ("number", "unit", "si"),
    [
        (50, "mm", 0.05),
        (1, "in", 0.0254),
        (180, "deg", math.pi),
        (0.5, "turn", math.pi),
        (60, "rpm", 2 * math.pi),
        (4.03, "N/mm", 4030.0),
        (48, "kHz", 48_000.0),
        (1300, "g", 1.3),
    ],
)
def test_si(number, unit, si):
    """Units are converted by their definition."""
    assert Quantity(given=number, unit=unit).si == pytest.approx(si, rel=1e-15)
    assert Quantity(given=[number, 0], unit=unit).si_list == pytest.approx([si, 0.0], rel=1e-15)


@pytest.mark.parametrize(("dimension", "unit"), ALL_UNITS)
def test_every_unit_fits_its_dimension_alone(dimension, unit):
    """A unit is accepted by its dimension and refused, with the allowed ones, by all others."""
    for other, units in UNITS.items():
        check = TypeAdapter(Annotated[Quantity, must_be(other)])
        if other == dimension:
            check.validate_python({"given": 1.0, "unit": unit})
        else:
            with pytest.raises(ValidationError, match=re.escape(f"allowed: {next(iter(units))}")):
                check.validate_python({"given": 1.0, "unit": unit})


def test_units_are_unambiguous():
    """No unit belongs to two dimensions: the factor to SI can be looked up by unit alone."""
    names = [unit for _, unit in ALL_UNITS]
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("limits", "inside", "outside", "words"),
    [
        ({"above": 0.0}, 1e-9, 0.0, "greater than 0 mm"),
        ({"least": 0.001}, 1.0, 0.999, "at least 1 mm"),
        ({"most": 0.001}, 1.0, 1.001, "at most 1 mm"),
    ],
)
def test_limits(limits, inside, outside, words):
    """Limits are in SI and shown in the unit the number is written in."""
    check = TypeAdapter(Annotated[Quantity, must_be("length", **limits)])
    check.validate_python({"given": inside, "unit": "mm"})
    with pytest.raises(ValidationError, match=words):
        check.validate_python({"given": outside, "unit": "mm"})


def test_each_number_of_a_list_is_checked():
    """One bad number in a list is found."""
    check = TypeAdapter(Annotated[Quantity, must_be("speed", many=True, above=0.0)])
    with pytest.raises(ValidationError, match="is -3 rpm; allowed: greater than 0 rpm"):
        check.validate_python({"given": [1, 2, -3], "unit": "rpm"})


def test_immutable():
    """A checked number does not change."""
    with pytest.raises(ValidationError, match="frozen"):
        Quantity(given=1.0, unit="kg").given = 2.0
