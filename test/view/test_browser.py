"""The picture in a real browser: every curve can be seen, and a missing one is missed."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest

from cam_rig.view import colours, series
from cam_rig.view.recording import save_recording
from cam_rig.view.series import SeriesWriter
from cam_rig.view.web import serve_file

from .browser import Look, Visit, browser
from .conftest import SmallBag

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]

#: What has to be seen of the small run, by its own colour.
SHOWN = {
    line.entity: line.colour
    for line in (
        series.LIFT,
        series.LAW,
        series.VELOCITY,
        series.ACCELERATION,
        series.FORCE,
        series.ZERO,
        series.LEVEL,
        series.SPEED,
        series.LANDING,
        series.LIFT_OFF,
    )
} | {"bars": colours.BANDS, "cam": colours.CAMS[0], "follower": colours.FOLLOWER}
LEFT_OUT = series.VELOCITY


@pytest.fixture(scope="module")
def look() -> Iterator[Look]:
    """One browser for all visits."""
    with browser() as visit:
        yield visit


@pytest.fixture(scope="module")
def visit(look: Look, bag: SmallBag, tmp_path_factory: pytest.TempPathFactory) -> Visit:
    """The small run as the command would serve it."""
    path = tmp_path_factory.mktemp("web") / "small run.rrd"
    save_recording(bag.path, path)
    with serve_file(path) as address:
        return look(address, SHOWN, frozenset())


def test_every_curve_is_seen(visit: Visit) -> None:
    """Pixels of each series' own colour; the time to the first of them is told."""
    print(f"first picture after {visit.seconds:.1f} s, pixels: {visit.most}")
    assert visit.missing() == set()


def test_the_page_has_no_errors(visit: Visit) -> None:
    """Nothing on the console, no exception."""
    assert visit.errors == []


def test_the_page_asks_no_other_machine(visit: Visit) -> None:
    """No font, no version, no report of use: it works offline and tells nobody."""
    assert visit.outside == []


def test_a_curve_that_is_left_out_is_missed(
    look: Look, bag: SmallBag, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same run without its velocity: that curve and no other is not seen."""
    add = SeriesWriter.add

    def add_others(self: SeriesWriter, *values: object) -> None:
        if self.series is not LEFT_OUT:
            add(self, *values)  # type: ignore[arg-type]

    monkeypatch.setattr(SeriesWriter, "add", add_others)
    path = tmp_path / "poor.rrd"
    save_recording(bag.path, path)
    wanted = {LEFT_OUT.entity: LEFT_OUT.colour, series.FORCE.entity: series.FORCE.colour}
    with serve_file(path) as address:
        seen = look(address, wanted, frozenset({LEFT_OUT.entity}))
    assert seen.missing() == {LEFT_OUT.entity}


def test_no_two_curves_look_alike() -> None:
    """Else the one could stand for the other."""
    for one, other in itertools.combinations(SHOWN.values(), 2):
        channels = [abs((one >> shift & 255) - (other >> shift & 255)) for shift in (24, 16, 8)]
        assert max(channels) > 28
