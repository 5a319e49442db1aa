"""Goals and limits as people write them."""

from __future__ import annotations

import math

import pytest

from cam_rig.errors import ConfigError
from cam_rig.quantities.catalogue import DESIGNED, QUANTITIES, measured_in
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
def test_a_limit_is_read_in_its_unit(text: str, value: float) -> None:
    """The number becomes SI."""
    limit = parse_limit(text, DESIGNED)
    assert limit.value == pytest.approx(value, rel=1e-12)
    again = f"{limit.term.key}{limit.sense}{limit.value!r}"
    assert parse_term(again.split(limit.sense, maxsplit=1)[0], DESIGNED) == limit.term


@pytest.mark.parametrize(
    ("text", "words"),
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
def test_a_limit_that_is_none_is_refused_in_one_line(text: str, words: str) -> None:
    """It says what was written and what is allowed."""
    with pytest.raises(ConfigError, match=words) as caught:
        parse_limit(text, DESIGNED)
    assert "\n" not in str(caught.value)


def test_a_goal_is_one() -> None:
    """Two goals or a limit are refused; none, and the other way round: the command's test."""
    with pytest.raises(ConfigError, match="is a limit, not a goal"):
        parse_goal("lift@90deg")
    with pytest.raises(ConfigError, match="needed: one"):
        DesignRequest.of(minimise="peak_jerk", maximise="jump_speed")


def test_a_name_is_one_quantity_in_designs_and_campaigns() -> None:
    """The same number of the same law; a campaign limits it on either side, and names its model."""
    for model in ("one_mass", "two_mass"):
        for name, one in measured_in(model).items():
            assert one.value is QUANTITIES[name].value
            assert one.senses == ("<=", ">=")
    assert measured_in("two_mass")["sound_level"].title == "sound level of two masses"
