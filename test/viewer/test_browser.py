"""The picture in a real browser: every curve can be seen, and a missing one is missed."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cam_rig.show import looks as colours
from cam_rig.show.looks import of_cam
from cam_rig.units import NS
from cam_rig.viewer import quantities as series
from cam_rig.viewer.live_folder import new_recording
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.server import serve, serve_file
from cam_rig.viewer.turn_chart import TurnChart
from tools.docs.browser import count, new_page, open_browser, photograph, why_no_browser

from .browser import Visit, look
from .conftest import SmallBag

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = pytest.mark.slow
#: A red box at once, and a green one that comes later.
LATE = """<body style="margin:0"><div style="width:100px;height:100px;background:#f00"></div>
<div id="late" style="width:0;height:100px;background:#0f0"></div>
<script>setTimeout(() => { late.style.width = "400px"; }, 1000);</script></body>"""

#: What has to be seen of the small run as it opens, by its own colour.
SHOWN = {
    line.entity: line.colour
    for line in (
        series.LIFT_LINE,
        series.LAW,
        series.VELOCITY_LINE,
        series.ACCELERATION_LINE,
        series.FORCE_LINE,
        series.GAP_LINE,
        series.LANDING,
        series.LIFT_OFF,
    )
} | {
    "cam": of_cam("poly345"),
    "body": colours.tint(of_cam("poly345")),
    "follower": colours.FOLLOWER,
}
LEFT_OUT = series.VELOCITY_LINE
#: Of no curve, and as far from each as the curves are from each other.
NOBODYS = {"green": 0x00FF00FF, "blue": 0x0000FFFF, "pink": 0xFF00FFFF}


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """One browser for all visits."""
    if why := why_no_browser():
        pytest.skip(f"no browser: {why}")
    with open_browser() as made:
        yield made


@pytest.fixture(scope="module")
def visit(chromium: Browser, bag: SmallBag, tmp_path_factory: pytest.TempPathFactory) -> Visit:
    """The small run as the command would serve it."""
    path = tmp_path_factory.mktemp("web") / "small run.rrd"
    save_recording(bag.path, path)
    with serve_file(path) as address:
        return look(chromium, address, SHOWN | NOBODYS, frozenset(NOBODYS))


def test_every_curve_is_seen(visit: Visit) -> None:
    """Pixels of each series' own colour, and none of a colour that nothing was drawn in.

    The time to the first of them is told.
    """
    print(f"first picture after {visit.seconds:.1f} s, pixels: {visit.most}")
    assert visit.missing() == set(NOBODYS)


def test_a_photograph_waits_for_every_colour(
    chromium: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page whose second box comes later: the picture has both."""
    page = tmp_path / "page.html"
    page.write_text(LATE, encoding="utf-8")
    monkeypatch.setattr("tools.docs.browser.open_browser", lambda: nullcontext(chromium))
    pixels = photograph(page.as_uri(), (0xFF0000FF, 0x00FF00FF), settled=0x00FF00FF)
    assert count(pixels, 0xFF0000FF) == 100 * 100
    assert count(pixels, 0x00FF00FF) == 400 * 100


def test_the_page_has_no_errors(visit: Visit) -> None:
    """Nothing on the console, no exception."""
    assert visit.errors == []


def test_the_page_asks_no_other_machine(visit: Visit) -> None:
    """No font, no version, no report of use: it works offline and tells nobody."""
    assert visit.outside == []


def test_the_cursor_begins_where_the_run_is_played_from(
    chromium: Browser, bag: SmallBag, tmp_path: Path
) -> None:
    """It gets there in a leap, though it plays at a tenth of the run's speed."""
    path, end = tmp_path / "late.rrd", float(bag.samples[0, -1])
    save_recording(bag.path, path)
    page, shown = new_page(chromium), [0.0]
    asked = re.compile(r"/shown\?ns=(\d+)")
    with serve_file(path, 0.9 * end) as address:
        page.goto(address)
        while shown[-1] < 0.9 * end:
            with page.expect_request(asked) as request:
                pass
            found = asked.search(request.value.url)
            assert found is not None
            shown.append(int(found[1]) / NS)
    page.context.close()
    assert np.diff(shown).max() > 0.5 * end


@pytest.mark.long
def test_a_page_at_rest_takes_up_one_run_after_the_other(chromium: Browser, bag: SmallBag) -> None:
    """Opened before there is any; it draws nothing meanwhile, and is told of each by name."""
    page, shown = new_page(chromium), re.compile(r"/shown\?ns=\d")
    with serve() as pages:
        page.goto(pages.address)
        for _ in range(5):  # its first second is full of pictures
            with page.expect_request(re.compile(r"/shown\?ns=-1")):
                pass
        for _ in range(2):
            recording = new_recording(pages.folder)
            with page.expect_response(re.compile(recording.name)) as answer:
                save_recording(bag.path, recording)
            assert answer.value.status == 200
            with page.expect_request(shown):
                pass
    page.context.close()


@pytest.mark.long
def test_a_curve_that_is_left_out_is_missed(
    chromium: Browser, bag: SmallBag, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same run without its velocity: that curve and no other is not seen."""
    send = TurnChart._strips

    def send_others(self: TurnChart, at: Any, entity: str, strips: Any) -> None:
        if entity.partition("/")[0] != "velocity":
            send(self, at, entity, strips)

    monkeypatch.setattr(TurnChart, "_strips", send_others)
    path = tmp_path / "poor.rrd"
    save_recording(bag.path, path)
    wanted = {LEFT_OUT.entity: LEFT_OUT.colour, series.FORCE_LINE.entity: series.FORCE_LINE.colour}
    with serve_file(path) as address:
        seen = look(chromium, address, wanted, frozenset({LEFT_OUT.entity}))
    assert seen.missing() == {LEFT_OUT.entity}


def test_no_two_curves_look_alike() -> None:
    """Else the one could stand for the other."""
    for one, other in itertools.combinations(SHOWN.values(), 2):
        channels = [abs((one >> shift & 255) - (other >> shift & 255)) for shift in (24, 16, 8)]
        assert max(channels) > 28
