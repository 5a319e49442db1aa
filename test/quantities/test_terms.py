"""Tests of the text form of goals and limits of a search, such as lift@90deg>=5mm."""

from __future__ import annotations

import math

import pytest

from cam_rig.errors import ConfigError
from cam_rig.quantities.catalogue import DESIGN_QUANTITIES, QUANTITIES, campaign_quantities
from cam_rig.quantities.terms import parse_limit, parse_term
from cam_rig.studies.design.request import DesignRequest, parse_goal
from cam_rig.units import RPM


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("lift@90deg>=30mm", 0.03),
        ("peak_acceleration<=68.64mm/rad^2", 0.06864),
        ("residual_vibration@200-400rpm<=0.6um", 0.6e-6),
        ("jump_speed>=450rpm", 450.0 * RPM),
        ("least_contact_force_rigid@450rpm>=5N", 5.0),
        ("pressure_angle≤30deg", math.radians(30.0)),
        ("sound_level_rigid@200-400rpm<=84dB", 84.0),
        ("sound_level_with_jumps@450rpm<=-3dB", -3.0),
        ("shaft_torque@100-300rpm<=5Nm", 5.0),
        ("event_angle@2<=120deg", math.radians(120.0)),
    ],
)
def test_a_limit_is_parsed_in_its_unit(text: str, value: float) -> None:
    """A limit such as lift@90deg>=5mm is parsed to its value in SI units.

    The key of the parsed quantity is parsed to the same quantity again.
    """
    limit = parse_limit(text, DESIGN_QUANTITIES)
    assert limit.value == pytest.approx(value, rel=1e-12)
    key = f"{limit.term.key}{limit.sense}{limit.value!r}"
    assert parse_term(key.split(limit.sense, maxsplit=1)[0], DESIGN_QUANTITIES) == limit.term


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("peak_acceleration", "allowed: quantity<=value"),
        ("peak_acceleration<=fast", "value is 'fast'"),
        ("peak_acceleration<=5N", "allowed: a number with one of mm/rad"),
        ("peak_acceleration>=5mm/rad^2", "not convex"),
        ("peak_accel<=start", "did you mean 'peak_acceleration'"),
        ("jump_speed@100rpm>=start", "allowed: jump_speed alone"),
        ("residual_vibration<=1um", "needed: a speed or a range of speeds"),
        ("residual_vibration@400-200rpm<=1um", "a rising range"),
        ("residual_vibration@200-400deg<=1um", "unit is 'deg'"),
        ("lift@400deg>=1mm", "angles of one turn"),
        ("lift@9o>=1mm", "unit is 'o'"),
        ("event_angle@1.5<=90deg", "such as event_angle@1"),
        ("", "allowed: quantity"),
    ],
)
def test_an_invalid_limit_is_refused_in_one_line(text: str, message: str) -> None:
    """An invalid limit is refused with the wrong part and the allowed form.

    The error has one line.
    """
    with pytest.raises(ConfigError, match=message) as caught:
        parse_limit(text, DESIGN_QUANTITIES)
    assert "\n" not in str(caught.value)


def test_a_design_has_exactly_one_goal() -> None:
    """A design (search for a law) with two goals, or with a limit as goal, is refused.

    The tests of the command cover a missing goal.
    """
    with pytest.raises(ConfigError, match="the goal must be one of"):
        parse_goal("lift@90deg")
    with pytest.raises(ConfigError, match="exactly one goal is required"):
        DesignRequest.of(minimise="peak_jerk", maximise="jump_speed")


def test_a_name_is_the_same_quantity_in_designs_and_campaigns() -> None:
    """A name means the same quantity in a design (search for a law) and in a campaign.

    A campaign is a batch of simulations. Its limits may be from above or below, and the title of
    the quantity includes the model.
    """
    for model in ("one_mass", "two_mass"):
        for name, quantity in campaign_quantities(model).items():
            assert quantity.value is QUANTITIES[name].value
            assert quantity.senses == ("<=", ">=")
    assert campaign_quantities("two_mass")["sound_level"].title == "sound level of two masses"
