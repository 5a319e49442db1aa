"""The bench in a real browser: its knob is the drive's parameter, by pointer and by keys."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

import cam_rig
from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.testing.client import RigClient
from tools.docs.browser import new_page

from ..conftest import Panel
from .conftest import WAIT_S, RunningPanel

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = [pytest.mark.ros, pytest.mark.slow]


class BenchInBrowser(Panel):
    """The bench's page as a browser shows it."""

    def begin(self, panel: RunningPanel) -> None:
        """Open the bench, and wait for its nodes."""
        self.page.goto(panel.address)
        self.page.goto(f"http://{urlsplit(panel.address).netloc}/bench")
        self.wait(lambda: self.page.locator("#start").is_enabled())

    def wait(self, condition: Callable[[], Any]) -> None:
        """Wait for what is to be seen on the page."""
        end = time.monotonic() + WAIT_S
        while not condition():
            said = [self.text(name) for name in ("graph", "status", "speed", "level", "ended")]
            assert time.monotonic() < end, f"never came; the page says {said}"
            self.page.wait_for_timeout(50)

    def value(self, name: str) -> str:
        """Of a field."""
        return str(self.page.locator(f"#{name}").input_value())

    def noted(self, rpm: int) -> bool:
        """Press the button; whether a reading at a speed is noted."""
        self.page.locator("#note").click()
        self.page.wait_for_timeout(200)
        return f" {rpm} rpm, " in self.text("noted") and "dB" in self.text("noted")

    def knob(self) -> float:
        """Where the knob stands, rpm."""
        return float(self.page.locator("#knob").get_attribute("aria-valuenow") or "nan")


@pytest.fixture
def bench(chromium: Browser, running_panel: RunningPanel) -> Iterator[BenchInBrowser]:
    """A page of a running bench; nothing may go wrong, and no other host be asked."""
    page = new_page(chromium)
    shown = BenchInBrowser(page)
    shown.begin(running_panel)
    yield shown
    page.context.close()
    assert shown.errors == []
    assert shown.outside == []


def test_the_knob_turns_the_cam_and_is_turned(bench: BenchInBrowser, ros_domain: int) -> None:
    """By keys and by the pointer; what another program sets is where it then stands."""
    bench.page.locator("#start").focus()
    bench.page.keyboard.press("Enter")
    bench.wait(lambda: bench.text("speed") == "200")
    knob = bench.page.locator("#knob")
    knob.focus()
    for key in ("PageUp", "PageUp", "ArrowUp"):
        bench.page.keyboard.press(key)
    bench.wait(lambda: bench.text("speed") == "221")
    assert bench.value("rpm") == "221"
    box = knob.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    bench.page.mouse.move(x, y - 50)
    bench.page.mouse.down()
    bench.page.mouse.move(x + 50, y, steps=8)
    bench.page.mouse.up()
    turned = bench.knob()
    assert turned > 400.0  # a third of the way round, on a scale of equal ratios
    bench.wait(lambda: bench.text("speed") == f"{turned:.0f}")
    with RigClient(ros_domain) as outside:
        outside.set_parameter("cam_drive", "rpm", 333.0)
    bench.wait(lambda: bench.knob() == 333.0 and bench.value("rpm") == "333")


@pytest.mark.long
def test_levels_are_noted_and_drawn(bench: BenchInBrowser, running_panel: RunningPanel) -> None:
    """A marker a reading; above the jump speed it is full, and the lamp was lit."""
    law, rig = cam_rig.build_law(cam_rig.load_cam("poly345")), cam_rig.load_rig("paper_table2")
    jump = find_jump(law, follower_of(rig), None).rpm  # the model that the bench begins with
    bench.page.locator("#start").click()
    for rpm in (round(0.8 * jump), round(1.3 * jump)):
        bench.page.locator("#rpm").fill(str(rpm))
        bench.page.locator("#rpm").press("Enter")
        bench.wait(lambda rpm=rpm: bench.text("speed") == str(rpm))
        bench.wait(lambda rpm=rpm: bench.noted(rpm))
    fills = [point.get_attribute("fill") for point in bench.page.locator("#noise .point").all()]
    assert fills[0] == "#fff"
    assert fills[-1] != "#fff"
    bench.wait(lambda: bench.text("contact") == "contact lost")
    rows = running_panel.get("/bench/readings.csv").decode().splitlines()
    contact = [row.split(",")[5] for row in rows[1:]]
    assert (contact[0], contact[-1]) == ("in contact", "contact lost")
    assert len(contact) == len(fills)


@pytest.mark.long
def test_a_killed_node_is_named_and_started_by_a_button(
    bench: BenchInBrowser, running_panel: RunningPanel
) -> None:
    """Its line goes when it is back, and the cam turns on."""
    bench.page.locator("#start").click()
    bench.wait(lambda: bench.text("level") != "–")
    os.kill(running_panel.nodes()["microphone"], signal.SIGKILL)
    button = bench.page.locator("#ended button")
    button.wait_for(timeout=WAIT_S * 1e3)
    assert "microphone was ended by signal 9" in bench.text("ended")
    button.click()
    bench.wait(lambda: bench.text("ended") == "")
    bench.page.locator("#rpm").fill("260")
    bench.page.locator("#rpm").press("Enter")
    bench.wait(lambda: bench.text("speed") == "260")


@pytest.mark.long
def test_a_narrow_page_has_all_of_it(bench: BenchInBrowser) -> None:
    """400 px wide, nothing beside the page; every control has a name."""
    bench.page.set_viewport_size({"width": 400, "height": 800})
    assert bench.page.evaluate("document.documentElement.scrollWidth") <= 400
    nameless = bench.page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, [role=slider], meter")]
          .filter((one) => !(one.textContent || one.getAttribute("aria-label")
            || one.labels?.length || one.getAttribute("aria-labelledby"))).map((one) => one.id)"""
    )
    assert nameless == []
