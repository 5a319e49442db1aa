"""Tests of the interpretations ("readings") of Table 2 of the paper.

A reading is a set of values for the four numbers of the rig that the paper does not print. Further
tests cover the search for readings.
"""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.two_mass import first_lift_off
from cam_rig.laws import build_law
from cam_rig.units import RPM, TURN
from examples.paper import readings as script
from examples.paper import readings_search
from examples.paper.readings import TABLE_2, first_on_grid, load_readings, read, tables, window
from examples.paper.readings_search import BOUNDS, Trials, search
from examples.paper.refit import with_event

READINGS, RUN = load_readings()
CAMS = {cam: cam_rig.load_cam(cam) for cam in TABLE_2}


def test_the_shipped_reading_is_the_shipped_rig():
    """The reading "shipped" has the parameters of the rig file paper_table2.

    Its laws have the angles of the shipped cams.
    """
    reading = READINGS["shipped"]
    assert reading.follower == TwoMassParameters.from_rig(cam_rig.load_rig("paper_table2"))
    for name, cam in CAMS.items():
        np.testing.assert_allclose(reading.law(name).spans, build_law(cam).spans, rtol=1e-12)


@pytest.mark.parametrize("cam", CAMS)
def test_events_and_high_dwell_are_as_requested(cam):
    """The law of a reading has the requested angles of rise, high dwell and fall.

    Bézier 15 has no dwell, so it stays a single curve.
    """
    law = build_law(with_event(CAMS[cam], 2.0, 0.9))
    if cam == "bezier15":
        assert law.spans.size == 1
        return
    still = np.abs(law.derivative_ordinates(1)).max(axis=0) == 0.0
    high = law.ordinates.min(axis=0) > 0.5 * law.lift
    assert law.spans[~still].sum() == pytest.approx(4.0)
    assert law.spans[still & high].sum() == pytest.approx(0.9)
    assert law.spans.sum() == pytest.approx(TURN)


def test_the_first_speed_of_the_grid_by_the_exact_model():
    """`first_on_grid` returns the first speed of a 5 rpm grid with a loss of contact.

    The exact simulation loses contact there, and keeps contact at every lower speed of the grid.
    """
    law = build_law(CAMS["poly345"])
    follower = TwoMassParameters(0.5, 0.8, 1.26e6, 4030.0, 0.5, 0.5, 20.0)
    rpm = first_on_grid(law, follower, 500.0, 1.0)

    def lost(speed_rpm):
        return first_lift_off(law, follower, speed_rpm * RPM, np.zeros(2), 1.0) is not None

    assert lost(rpm) and not any(lost(slower) for slower in np.arange(200.0, rpm, 5.0))
    assert math.isnan(first_on_grid(law, follower, rpm - 5.0, 1.0))


#: Follower of two masses with little damping. The vibration of the 3-4-5 cam grows for ten turns
#: near 415 rpm.
LIGHT = TwoMassParameters(0.634, 0.666, 2.424962e6, 4030.0, 0.0105, 0.0105, 14.29)


def test_a_window_by_the_exact_model():
    """`window` returns the width (rpm) of the speeds with the printed lift-off time.

    The lift-off time of a simulation may differ from the printed time by half a turn. The width
    agrees with simulations at 501 speeds within 0.04 rpm.
    """
    law = build_law(CAMS["poly345"])
    printed = (415.0, 1.2)
    speeds = np.linspace(410.0, 420.0, 501)
    near = []
    for rpm in speeds:
        found = first_lift_off(law, LIGHT, rpm * RPM, np.zeros(2), 2.0)
        near.append(found is not None and abs(found - 1.2) <= 30.0 / 415.0)
    assert any(near)
    exact = 10.0 * float(np.mean(near))
    assert window(law, LIGHT, printed, 2.0) == pytest.approx(exact, abs=0.04)


def test_a_trial_that_shows_the_table_has_no_miss():
    """A trial rig has no error if its jump speed is the printed one.

    A printed speed that is 5 rpm higher or lower gives an error.
    """
    reading = READINGS["shipped"]
    numbers = {key: np.array([getattr(reading, key).si]) for key in BOUNDS}
    numbers |= {"mass": np.array([1.3]), "spring_stiffness": np.array([4030.0])}
    for cam in CAMS:
        rpm = first_on_grid(reading.law(cam), reading.follower, 650.0, RUN)
        for printed, hits in ((rpm, True), (rpm - 5.0, False), (rpm + 5.0, False)):
            speed, _ = Trials.of(cam, (printed, 1.0)).misses(numbers, RUN, nearby=False)
            assert bool(speed[0] == 0.0) is hits, (cam, printed)


def test_a_search_finds_a_rig_that_shows_the_table(capsys):
    """A search for two parameters of a known rig reproduces its jump speeds.

    The remaining error is 0 rpm on the grid of the table.
    """
    reading = READINGS["shipped"]
    made = {
        cam: (first_on_grid(reading.law(cam), reading.follower, 650.0, RUN), 1.0)
        for cam in ("bezier15", "poly4567")
    }
    fixed = {key: getattr(reading, key).si for key in (*BOUNDS, "mass", "spring_stiffness")}
    best = search(fixed, ("event", "preload"), RUN, generations=20, table=made)
    assert best.miss == 0.0
    assert capsys.readouterr().out.splitlines()[-1].endswith("best misses 0.00 rpm in all")
    assert set(best.numbers) == {"event", "preload"}
    for key, number in best.numbers.items():
        assert BOUNDS[key][0] <= number <= BOUNDS[key][1]


@pytest.fixture(scope="module")
def shipped():
    """Result of the reading "shipped" for every cam of Table 2 of the paper."""
    return read("shipped", READINGS["shipped"], RUN)


def test_numbers_of_the_report(shipped):
    """Jump speeds and times of the shipped reading are those of the report.

    The report is that on the paper. A reading is a set of the four numbers of the rig that the
    paper does not print.
    """
    readings, cams = tables([shipped])
    assert "".join(readings.rows[0][:8]).count("*") == len(shipped.reading.fitted) == 4
    assert readings.for_report.text_rows[0][8:] == ["4", "4", "0", "0.41"]
    rows = [[row[3], row[4], *row[6:]] for row in cams.for_report.text_rows]
    assert rows == [
        ["570", "569.0", "0.076", "0.076", "0.076", "0.00", "-0.8"],
        ["415", "413.4", "0.133", "0.133", "0.133", "0.00", "-4.4"],
        ["390", "388.6", "0.105", "0.260", "0.105", "0.00", "-2.6"],
        ["415", "412.1", "0.098", "0.099", "0.098", "0.00", "+4.6"],
        ["400", "397.9", "0.101", "0.103", "0.102", "0.00", "-2.0"],
    ]
    assert not shipped.hidden


@pytest.mark.slow
def test_what_agrees_in_each_reading():
    """The agreement of each reading with Table 2 of the paper is that of the report.

    It is the number of equal jump speeds and times, and the r.m.s. difference in per cent. The
    widest range of speeds with a printed time is as reported too.
    """
    found = script.study()
    assert [(one.name, one.speeds, one.times, round(100.0 * one.rms, 2)) for one in found] == [
        ("printed_stem", 2, 0, 3.97),
        ("weight", 4, 0, 6.49),
        ("shipped", 4, 0, 0.41),
        ("five_speeds", 5, 0, 7.48),
        ("nearby", 2, 0, 30.86),
        ("times", 1, 0, 3.95),
    ]
    assert max(row.window for one in found for row in one.rows) == pytest.approx(0.02, abs=1e-4)
    five = found[3]
    row = five.hidden[0]  # the 5 rpm grid hides a jump
    law, speed = five.reading.law(row.cam), row.jump * 1.00001 * RPM
    assert first_lift_off(law, five.reading.follower, speed, np.zeros(2), RUN) is not None


def test_the_scripts(shipped, tmp_path, capsys, monkeypatch):
    """The scripts on readings of Table 2 print their tables and summary.

    The search is limited to one generation.
    """
    monkeypatch.setattr(script, "study", lambda: [shipped])
    script.main(["--out", str(tmp_path)])
    assert "nearest on shipped, 0.41% r.m.s." in capsys.readouterr().out
    monkeypatch.setattr(readings_search, "read", lambda *_: shipped)
    readings_search.main(["printed_stem", "--nearby", "--generations", "1"])
    assert "best of 128 trials" in capsys.readouterr().out
