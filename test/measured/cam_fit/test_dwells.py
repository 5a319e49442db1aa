"""Dwells found in readings: those that are there, where they are, and no others."""

import numpy as np
import pytest

from cam_rig.measured.cam_fit.dwells import find_dwells
from cam_rig.measured.cam_fit.gauge import put_in_order
from cam_rig.units import TURN

from .conftest import table_of

#: Start and span (deg) and level (parts of the lift) of the shipped cams' dwells.
TRUE = {
    "poly345": [(148.75, 62.5, 1.0), (328.75, 62.5, 0.0)],
    "cycloidal": [(148.75, 62.5, 1.0), (328.75, 62.5, 0.0)],
    "flat": [(160.0, 40.0, 1.0), (320.0, 80.0, 0.0)],
    "modified_trapezoid": [(148.75, 62.5, 1.0), (328.75, 62.5, 0.0)],
}


def degrees(dwell):
    return np.degrees([dwell.rest.start, dwell.rest.span])


@pytest.mark.parametrize("name", TRUE)
@pytest.mark.parametrize(("count", "near"), [(36, 8.0), (72, 3.0), (360, 1.0)])
def test_dwells_of_2_um_scatter(measured, name, count, near):
    """Each one, its ends within a degree of 360 readings, its level within the scatter."""
    readings = measured(name, count, zero=0.003)
    found = find_dwells(readings, readings.scatter)
    assert len(found) == len(TRUE[name])
    for dwell, (start, span, level) in zip(found, TRUE[name], strict=True):
        begin, width = degrees(dwell)
        assert begin == pytest.approx(start, abs=near)
        assert begin + width == pytest.approx(start + span, abs=near)
        assert dwell.rest.level == pytest.approx(0.003 + 0.01 * level, abs=2e-6)


@pytest.mark.parametrize("count", [36, 72, 360])
def test_no_dwell_where_none_is(measured, count):
    """A ripple of 0.3 % of the lift is no dwell, nor is the low point of one Bézier curve."""
    readings = measured("bezier15", count)
    assert find_dwells(readings, readings.scatter) == ()


def test_the_tops_of_waves_are_no_dwells():
    """Seeded random harmonics: extremes are rounded, and nothing rests."""
    angles = np.linspace(0.0, TURN, 360, endpoint=False)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        lifts = sum(
            rng.normal() * 0.005 / k**2 * np.cos(k * angles + rng.uniform(0.0, TURN))
            for k in range(1, 5)
        )
        table = table_of(angles, lifts + rng.normal(scale=2e-6, size=360))
        readings = put_in_order(table, table.columns[0])
        assert find_dwells(readings, readings.scatter) == ()


def test_a_dwell_across_the_turns_end_is_one(measured):
    """The low dwell of `flat`: half before 360°, half behind 0°."""
    readings = measured("flat")
    low = find_dwells(readings, readings.scatter)[1]
    assert low.rest.start + low.rest.span > TURN
    assert low.count == pytest.approx(81, abs=2)
    assert low.scatter == pytest.approx(2e-6, rel=0.4)


def test_two_dwells_of_one_level_have_one_level():
    """Two events a turn: the base circle between them is one, to the last bit."""
    angles = np.linspace(0.0, TURN, 360, endpoint=False)
    inside = np.clip((angles % np.pi) / np.radians(90.0), 0.0, 1.0)
    lifts = 0.01 * np.sin(np.pi * inside) ** 4
    table = table_of(angles, lifts + np.random.default_rng(3).normal(scale=2e-6, size=360))
    readings = put_in_order(table, table.columns[0])
    found = find_dwells(readings, readings.scatter)
    assert len(found) == 2
    assert found[0].rest.level == found[1].rest.level


def test_a_stretch_without_readings_is_a_dwell(scaled):
    """Readings of the event alone, resting at both ends: the dwell reaches across the gap."""
    angles = np.radians(np.arange(25.0, 346.0, 5.0))
    noise = np.random.default_rng(0).normal(scale=2e-6, size=angles.size)
    kept = angles < np.radians(331.0)
    table = table_of(angles[kept], (scaled("flat")(angles) + noise)[kept])
    readings = put_in_order(table, table.columns[0])
    low = find_dwells(readings, readings.scatter)[-1]
    begin, width = degrees(low)
    assert begin == pytest.approx(320.0, abs=4.0)
    assert begin + width == pytest.approx(400.0, abs=4.0)
