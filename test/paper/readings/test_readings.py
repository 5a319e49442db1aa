"""Readings of Table 2: what the table's grid shows of a rig, and the search for one."""

import math

import numpy as np
import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.two_mass import first_lift_off
from cam_rig.errors import ConfigError
from cam_rig.laws import build_law
from cam_rig.paper.readings.readings import first_on_grid, follower_of, read, window
from cam_rig.paper.readings.search import BOUNDS, ReadingSearch, Trials
from cam_rig.paper.readings.study import ReadingsResult
from cam_rig.schema import load_cam, load_readings, load_rig, load_tables
from cam_rig.schema.load import config_root
from cam_rig.schema.published import PublishedJump
from cam_rig.show.result import Progress
from cam_rig.studies.jump.study import with_event
from cam_rig.units import RPM, TURN

from ...cli.conftest import call

CONFIG = config_root()
KNOWN = load_readings(CONFIG / "published" / "readings" / "table2.yaml")
PRINTED = load_tables(CONFIG / "published" / "tables" / "paper.yaml").table_2_jump
CAMS = {cam: load_cam(CONFIG / "cams" / f"{cam}.yaml") for cam in PRINTED}


def test_the_shipped_reading_is_the_shipped_rig():
    """One rig, told twice: the numbers of paper_table2 and of its cams."""
    reading = KNOWN.readings["shipped"]
    rig = load_rig(CONFIG / "rigs" / "paper_table2.yaml")
    assert follower_of(reading) == TwoMassParameters.from_rig(rig)
    for cam in CAMS.values():
        spans = build_law(with_event(cam, reading.event.si, reading.high_dwell.si)).spans
        np.testing.assert_allclose(spans, build_law(cam).spans, rtol=1e-12)


@pytest.mark.parametrize("cam", CAMS)
def test_events_and_high_dwell_are_what_was_asked(cam):
    """Rise, high dwell and fall by the law itself: where it moves, and where it is high."""
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
    """Contact is lost at it, and at no slower speed of the grid: 3-4-5 on a stem that vibrates."""
    law = build_law(CAMS["poly345"])
    follower = TwoMassParameters(0.5, 0.8, 1.26e6, 4030.0, 0.5, 0.5, 20.0)
    rpm = first_on_grid(law, follower, 500.0, 1.0)

    def lost(speed_rpm):
        return first_lift_off(law, follower, speed_rpm * RPM, np.zeros(2), 1.0) is not None

    assert lost(rpm)
    assert not any(lost(slower) for slower in np.arange(200.0, rpm, 5.0))
    assert math.isnan(first_on_grid(law, follower, rpm - 5.0, 1.0))


#: Lightly damped: vibration of 3-4-5 builds up for ten turns about 415 rpm.
LIGHT = TwoMassParameters(0.634, 0.666, 2.424962e6, 4030.0, 0.0105, 0.0105, 14.29)


def test_damping_decides_how_much_a_time_tells():
    """With the printed damping turns are alike: no speed about 415 rpm gives 1.50 s."""
    law = build_law(CAMS["poly345"])
    damped = TwoMassParameters(0.5, 0.8, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
    printed = PublishedJump(rpm=415.0, time_s=1.5)
    assert window(law, damped, printed, 2.0) == 0.0
    assert window(law, LIGHT, printed, 2.0) >= 0.02


def test_a_window_by_the_exact_model():
    """It loses contact about the printed time at as many speeds as the window says."""
    law = build_law(CAMS["poly345"])
    printed = PublishedJump(rpm=415.0, time_s=1.2)
    speeds = np.linspace(410.0, 420.0, 501)
    near = []
    for rpm in speeds:
        found = first_lift_off(law, LIGHT, rpm * RPM, np.zeros(2), 2.0)
        near.append(found is not None and abs(found - 1.2) <= 30.0 / 415.0)
    assert any(near)
    exact = 10.0 * float(np.mean(near))
    assert window(law, LIGHT, printed, 2.0) == pytest.approx(exact, abs=0.04)


def test_a_trial_that_shows_the_table_misses_nothing():
    """At the speed of the exact model a trial misses nothing, 5 rpm beside it does."""
    reading = KNOWN.readings["shipped"]
    numbers = {key: np.array([getattr(reading, key).si]) for key in BOUNDS}
    numbers |= {"mass": np.array([1.3]), "spring_stiffness": np.array([4030.0])}
    for cam, config in CAMS.items():
        law = build_law(with_event(config, reading.event.si, reading.high_dwell.si))
        rpm = first_on_grid(law, follower_of(reading), 650.0, 2.0)
        for printed, hits in ((rpm, True), (rpm - 5.0, False), (rpm + 5.0, False)):
            trial = Trials.of(config, PublishedJump(rpm=printed, time_s=1.0))
            speed, _ = trial.misses(numbers, 2.0, nearby=False)
            assert bool(speed[0] == 0.0) is hits, (cam, printed)


class Told(Progress):
    """What a search tells."""

    done, total, words = 0, 0, ""

    def start(self, total, words=""):
        self.total = total

    def advance(self, steps=1):
        self.done += steps

    def describe(self, words):
        self.words = words


def test_a_search_finds_a_rig_that_shows_the_table():
    """Speeds made by a known rig: the search for two of its numbers ends at no miss."""
    reading = KNOWN.readings["shipped"]
    made = {}
    for cam in ("bezier15", "poly4567"):
        rpm = first_on_grid(build_law(CAMS[cam]), follower_of(reading), 650.0, 2.0)
        made[cam] = PublishedJump(rpm=rpm, time_s=1.0)
    given = {key: getattr(reading, key).si for key in BOUNDS}
    given |= {"mass": 1.3, "spring_stiffness": 4030.0}
    trials = {cam: Trials.of(CAMS[cam], row) for cam, row in made.items()}
    told = Told()
    search = ReadingSearch(trials, given, ("event", "preload"), False, 2.0)
    found = search.best(20, 1, told)
    assert found.miss == 0.0
    assert 1 <= told.done <= told.total == 20
    assert told.words == "best misses 0.00 rpm in all"
    assert set(found.numbers) == {"event", "preload"}
    for key, number in found.numbers.items():
        assert BOUNDS[key][0] <= number <= BOUNDS[key][1]


def test_nothing_to_seek_is_refused():
    """A reading that identified nothing."""
    reading = KNOWN.readings["printed_stem"]
    event = reading.event.model_copy(update={"identified": None, "assumed": 117.4})
    fixed = reading.model_copy(update={"event": event})
    with pytest.raises(ConfigError, match="nothing in it is identified"):
        ReadingSearch.of(fixed, CAMS, PRINTED, False, 2.0)


def test_tables_of_the_readings(monkeypatch):
    """A row a reading, its fitted numbers marked and counted; times only where they are found."""
    monkeypatch.setattr("cam_rig.paper.readings.readings.SPEEDS", 32)
    reading = KNOWN.readings["shipped"]
    found = ReadingsResult((read("shipped", reading, CAMS, PRINTED, KNOWN.run_s),))
    readings, cams = found.to_display()
    assert len(readings.rows) == 1
    assert "".join(readings.text_rows[0]).count("*") == len(reading.fitted) == 4
    assert len(cams.rows) == len(CAMS)
    data = found.data()
    assert data["readings"][0]["event"] == reading.event.si
    assert [row["published_rpm"] for row in data["cams"]] == [row.rpm for row in PRINTED.values()]
    assert f"{found.found[0].speeds} of 5 speeds" in found.summary()[0]


@pytest.mark.long
def test_the_grid_may_hide_a_jump():
    """The reading with all five speeds jumps between slower ones of the grid, the shipped not."""
    shipped, five = (
        read(name, KNOWN.readings[name], CAMS, PRINTED, KNOWN.run_s)
        for name in ("shipped", "five_speeds")
    )
    assert not shipped.hidden and shipped.rms < 0.005
    assert five.speeds == 5 and five.hidden
    row = five.hidden[0]
    law = build_law(with_event(CAMS[row.cam], five.reading.event.si, five.reading.high_dwell.si))
    at_jump = first_lift_off(
        law, follower_of(five.reading), row.jump * 1.00001 * RPM, np.zeros(2), KNOWN.run_s
    )
    assert at_jump is not None
    assert shipped.limit_times == 0


# The command.


def test_a_search_says_what_it_found_and_misses(tmp_path, monkeypatch):
    """One number over one generation: a table of numbers, one of misses, and both as CSV."""
    monkeypatch.setattr("cam_rig.paper.readings.readings.SPEEDS", 32)
    out = tmp_path / "found.csv"
    result = call(
        "readings", "--search", "printed_stem", "--nearby", "--generations", 1, "--csv", out
    )
    assert result.exit_code == 0, result.stderr
    assert "best of 128 trials" in result.output
    assert out.read_text(encoding="utf-8").startswith("reading,event,high_dwell,")
    lines = (tmp_path / "found.cams.csv").read_text(encoding="utf-8")
    assert all(cam in lines for cam in ("bezier15", "bezier_segments"))
    search = (tmp_path / "found.search.csv").read_text(encoding="utf-8")
    assert search.startswith("trials,miss\n128,")
