"""A reading is the mean square of a second at one speed, or it is refused."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from cam_rig.errors import RefusedError
from cam_rig.panel.bench.live_state import Meter, NotedReading, to_csv
from cam_rig.units import NS


def turned(meter: Meter, rpm: float, seconds: float, level: float, begin: float = 0.0) -> float:
    """Twelve ticks a turn at a speed, of one level; the time (s) of the end."""
    tick = 60.0 / rpm / 12
    count = round(seconds / tick)
    for k in range(count):
        meter.state(round((begin + k * tick) * NS), rpm)
        meter.level(round((begin + (k + 1) * tick) * NS), level)
    return begin + count * tick


@pytest.mark.parametrize("rpm", [20.0, 97.0, 300.0, 3000.0])
def test_a_steady_speed_can_be_read(rpm: float) -> None:
    """After whole turns of a second or more to settle, the mean of as many."""
    meter = Meter()
    end = turned(meter, 50.0, 3.0, 60.0)
    turned(meter, rpm, 2.0 * (1.0 + 60.0 / rpm), 80.0, end)
    found = meter.steady(0.125)
    assert found[:2] == pytest.approx((rpm, 80.0))


def test_a_slow_meter_is_waited_for() -> None:
    """With time weighting S, eight of its seconds more: it still tells of what was before."""
    meter = Meter()
    turned(meter, 300.0, 5.0, 80.0)
    assert meter.steady(0.125)[1] == pytest.approx(80.0)
    with pytest.raises(RefusedError, match=r"after 9\.0 s"):
        meter.steady(1.0)


def test_the_mean_is_of_the_square() -> None:
    """Half the time 80 dB and half 90 is 87.4 dB: 10 lg of (1 + 10) / 2 over 80."""
    meter = Meter()
    begin = turned(meter, 300.0, 2.0, 70.0)
    for _ in range(30):
        begin = turned(meter, 300.0, 1 / 60, 80.0, begin)
        begin = turned(meter, 300.0, 1 / 60, 90.0, begin)
    assert meter.steady(0.125)[1] == pytest.approx(80.0 + 10 * np.log10(5.5), abs=1e-9)


def test_a_speed_that_has_just_changed_is_refused() -> None:
    """With how long it has been, and how long it takes."""
    meter = Meter()
    end = turned(meter, 300.0, 5.0, 80.0)
    turned(meter, 310.0, 0.5, 90.0, end)
    with pytest.raises(
        RefusedError, match=r"310 rpm for 0\.5 s of rig time; allowed: after 2\.3 s"
    ):
        meter.steady(0.125)


def test_nothing_that_turns_is_refused() -> None:
    """Before the first tick, and while the cam stands after an emergency stop."""
    meter = Meter()
    with pytest.raises(RefusedError, match="nothing turns"):
        meter.steady(0.125)
    end = turned(meter, 300.0, 3.0, 80.0)
    meter.state(round(end * NS), 0.0)
    meter.level(round((end + 1.0) * NS), 40.0)
    with pytest.raises(RefusedError, match="nothing turns"):
        meter.steady(0.125)


def test_a_level_before_any_state_is_passed_over() -> None:
    """A page's node that joins late has the level of a tick whose beginning it has not seen."""
    meter = Meter()
    meter.level(1000, 80.0)
    assert meter.latest is None


def test_the_readings_as_csv_are_read_back() -> None:
    """A row each, units in the names, whatever the cam's name."""
    one = NotedReading("a,b", "one_mass", 300.0, 83.25, "LAF", "in contact", 0.5, 4030.0, 30.6)
    (row,) = csv.DictReader(to_csv([one]).splitlines())
    assert row["cam"] == "a,b"
    assert float(row["level_db"]) == 83.25
    assert float(row["preload_n"]) == 30.6
