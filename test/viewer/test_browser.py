"""The picture in a real browser: every curve can be seen, and a missing one is missed."""

from __future__ import annotations

import itertools
import re
import time
from contextlib import nullcontext
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import numpy as np
import pytest

from cam_rig.show import looks as colours
from cam_rig.show.looks import of_cam
from cam_rig.units import NS
from cam_rig.viewer import quantities as series
from cam_rig.viewer.page import new_recording
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.rerun_page import serve, serve_file
from cam_rig.viewer.turn_chart import TurnChart
from cam_rig.viewer.web_server import LOCAL_HOST
from tools.docs import browser
from tools.docs.browser import count, new_page

pytestmark = pytest.mark.slow
#: A red box at once, and a green one that comes later.
LATE = """<body style="margin:0"><div style="width:100px;height:100px;background:#f00"></div>
<div id="late" style="width:0;height:100px;background:#0f0"></div>
<script>setTimeout(() => { late.style.width = "400px"; }, 1000);</script></body>"""

#: Where the small run is begun, as a share of it: its second cam turns, and flies.
BEGIN = 0.9
#: What has to be seen there, by its own colour.
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
    "cam": of_cam("bezier15"),
    "body": colours.tint(of_cam("bezier15")),
    "follower": colours.FOLLOWER,
}
LEFT_OUT = series.VELOCITY_LINE
#: Of no curve, and as far from each as the curves are from each other.
NOBODYS = {"green": 0x00FF00FF, "blue": 0x0000FFFF, "pink": 0xFF00FFFF}


@dataclass
class Visit:
    """What a browser saw of one address: the most pixels of each colour, and times (s) shown."""

    most: dict[str, int]
    times: list[float] = field(default_factory=lambda: [0.0])
    errors: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)

    def missing(self):
        """The names of the colours that never were there."""
        return {name for name, pixels in self.most.items() if pixels < browser.MIN_PIXELS}

    def watch(self, page):
        """Write down errors on the console, requests to any other machine, and times shown."""
        page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("request", lambda asked: self._asked(asked.url))

    def _asked(self, url):
        if urlsplit(url).hostname not in (None, LOCAL_HOST):
            self.outside.append(url)
        if shown := re.search(r"/shown\?ns=(\d+)", url):
            self.times.append(int(shown[1]) / NS)


def look(chromium, address, shown, without, until=0.0):
    """Visit an address until all colours were seen but some, and a rig time (s) was reached."""
    visit, page, begun = Visit(dict.fromkeys(shown, 0)), new_page(chromium), time.monotonic()
    visit.watch(page)
    page.set_viewport_size({"width": 1000, "height": 640})  # drawn by a processor
    page.goto(address)
    more = 1 if without else 0  # what is not expected has time to come all the same
    for pixels in browser.photographs(page, begun + browser.TIMEOUT_S):
        for name, colour in shown.items():
            visit.most[name] = max(visit.most[name], count(pixels, colour))
        if visit.missing() <= without and visit.times[-1] >= until:
            more -= 1
            if more < 0:
                break
    page.context.close()
    return visit


@pytest.fixture(scope="module")
def path(bag, tmp_path_factory):
    """The small run as the command would serve it."""
    path = tmp_path_factory.mktemp("web") / "small run.rrd"
    save_recording(bag.path, path)
    return path


@pytest.mark.long
def test_every_curve_is_seen_from_where_the_run_is_played(chromium, bag, path):
    """By pixels of its own colour; no error, no request elsewhere; the cursor leaps there."""
    end = float(bag.samples[0, -1])
    with serve_file(path, BEGIN * end) as address:
        visit = look(chromium, address, SHOWN | NOBODYS, set(NOBODYS), BEGIN * end)
    assert visit.missing() == set(NOBODYS)
    assert visit.errors == [] and visit.outside == []
    assert np.diff(visit.times).max() > 0.5 * end


def test_a_photograph_waits_for_every_colour(chromium, tmp_path, monkeypatch):
    """A page whose second box comes later: the picture has both."""
    page = tmp_path / "page.html"
    page.write_text(LATE, encoding="utf-8")
    monkeypatch.setattr("tools.docs.browser.open_browser", lambda: nullcontext(chromium))
    pixels = browser.photograph(page.as_uri(), (0xFF0000FF, 0x00FF00FF), settled=0x00FF00FF)
    assert count(pixels, 0xFF0000FF) == 100 * 100 and count(pixels, 0x00FF00FF) == 400 * 100


@pytest.mark.long
def test_a_page_at_rest_takes_up_one_run_after_the_other(chromium, bag):
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
def test_a_curve_that_is_left_out_is_missed(chromium, bag, tmp_path, monkeypatch):
    """The same run without its velocity: that curve and no other is not seen."""
    send = TurnChart._strips

    def send_others(self, at, entity, strips):
        if entity.partition("/")[0] != "velocity":
            send(self, at, entity, strips)

    monkeypatch.setattr(TurnChart, "_strips", send_others)
    poor = tmp_path / "poor.rrd"
    save_recording(bag.path, poor)
    wanted = {LEFT_OUT.entity: LEFT_OUT.colour, series.FORCE_LINE.entity: series.FORCE_LINE.colour}
    with serve_file(poor) as address:
        seen = look(chromium, address, wanted, {LEFT_OUT.entity})
    assert seen.missing() == {LEFT_OUT.entity}


def test_no_two_curves_look_alike():
    """Else the one could stand for the other."""
    for one, other in itertools.combinations(SHOWN.values(), 2):
        channels = [abs((one >> shift & 255) - (other >> shift & 255)) for shift in (24, 16, 8)]
        assert max(channels) > 28
