"""The viewer's page in a real browser: every curve is visible.

The tests count the pixels of each colour. A missing curve must be detected.
"""

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
#: Page with a red box, and a green box that appears a second later.
LATE = """<body style="margin:0"><div style="width:100px;height:100px;background:#f00"></div>
<div id="late" style="width:0;height:100px;background:#0f0"></div>
<script>setTimeout(() => { late.style.width = "400px"; }, 1000);</script></body>"""

#: Start of the playback as a fraction of the small run, when its second cam lifts off.
BEGIN = 0.9
#: Colours of the curves that must be visible from this start on, by curve.
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
#: Colours that no curve of the viewer has. They differ from the curves as much as these from each
#: other.
UNUSED = {"green": 0x00FF00FF, "blue": 0x0000FFFF, "pink": 0xFF00FFFF}


@dataclass
class Visit:
    """Observations of a browser on the viewer's page.

    `most` is the largest number of pixels of each colour. `times` are the rig times (s) that the
    page displayed.
    """

    most: dict[str, int]
    times: list[float] = field(default_factory=lambda: [0.0])
    errors: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)

    def missing(self):
        """Return the names of the colours that were never visible."""
        return {name for name, pixels in self.most.items() if pixels < browser.MIN_PIXELS}

    def watch(self, page):
        """Record console errors, requests to other machines, and displayed times."""
        page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("request", lambda asked: self._asked(asked.url))

    def _asked(self, url):
        if urlsplit(url).hostname not in (None, LOCAL_HOST):
            self.outside.append(url)
        if shown := re.search(r"/shown\?ns=(\d+)", url):
            self.times.append(int(shown[1]) / NS)


def look(chromium, address, shown, missing, until=0.0):
    """Visit the viewer's page until all colours except `missing` were visible.

    The visit also waits until the page displays the rig time `until` (s). The `Visit` is returned.
    """
    visit, page, start = Visit(dict.fromkeys(shown, 0)), new_page(chromium), time.monotonic()
    visit.watch(page)
    page.set_viewport_size({"width": 1000, "height": 640})  # small, because there is no GPU
    page.goto(address)
    extra_photographs = 1 if missing else 0  # time for unexpected colours to appear
    for pixels in browser.photographs(page, start + browser.TIMEOUT_S):
        for name, colour in shown.items():
            visit.most[name] = max(visit.most[name], count(pixels, colour))
        if visit.missing() <= missing and visit.times[-1] >= until:
            extra_photographs -= 1
            if extra_photographs < 0:
                break
    page.context.close()
    return visit


@pytest.fixture(scope="module")
def path(bag, tmp_path_factory):
    """Path of the recording of the small run, as the command `cam-rig view` serves it."""
    path = tmp_path_factory.mktemp("web") / "small run.rrd"
    save_recording(bag.path, path)
    return path


@pytest.mark.long
def test_every_curve_is_visible_at_the_start_of_the_playback(chromium, bag, path):
    """Each curve of a served recording is visible, and the playback advances.

    The page causes no errors and no requests to other hosts.
    """
    end = float(bag.samples[0, -1])
    with serve_file(path, BEGIN * end) as address:
        visit = look(chromium, address, SHOWN | UNUSED, set(UNUSED), BEGIN * end)
    assert visit.missing() == set(UNUSED)
    assert visit.errors == [] and visit.outside == []
    assert np.diff(visit.times).max() > 0.5 * end


def test_a_photograph_waits_for_every_colour(chromium, tmp_path, monkeypatch):
    """A screenshot is taken only when each requested colour is visible on the page.

    The green box of the page appears later than the red one.
    """
    page = tmp_path / "page.html"
    page.write_text(LATE, encoding="utf-8")
    monkeypatch.setattr("tools.docs.browser.open_browser", lambda: nullcontext(chromium))
    pixels = browser.photograph(page.as_uri(), (0xFF0000FF, 0x00FF00FF), settled=0x00FF00FF)
    assert count(pixels, 0xFF0000FF) == 100 * 100 and count(pixels, 0x00FF00FF) == 400 * 100


@pytest.mark.long
def test_an_idle_page_displays_one_run_after_the_other(chromium, bag):
    """A viewer page that is opened before the first run displays each new run."""
    page, shown = new_page(chromium), re.compile(r"/shown\?ns=\d")
    with serve() as pages:
        page.goto(pages.address)
        for _ in range(5):  # at first it is redrawn continuously
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
def test_a_missing_curve_is_detected(chromium, bag, tmp_path, monkeypatch):
    """If a recording has no velocity, exactly the colour of the velocity is missing.

    This proves that the test of visible curves can fail.
    """
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


def test_no_two_curves_have_similar_colours():
    """The colours of any two curves differ by more than 28 of 255 in one channel.

    The test of visible curves therefore cannot take one curve for another.
    """
    for one, other in itertools.combinations(SHOWN.values(), 2):
        channels = [abs((one >> shift & 255) - (other >> shift & 255)) for shift in (24, 16, 8)]
        assert max(channels) > 28
