"""The sheet in a real browser, by keyboard alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from cam_rig.panel.lab.marking import mark_sheet
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.server import serve
from tools.docs.browser import TIMEOUT_S, new_page

from ..conftest import Panel
from .conftest import sheet_of

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Dialog

pytestmark = pytest.mark.slow
#: Whether what is shown is of the speed that is set.
SHOWN = """() => JSON.parse(document.body.dataset.shown || "{}").rpm
  === document.getElementById("rpm").valueAsNumber"""


class LabPage(Panel):
    """A page of a lab sheet, worked by keys."""

    def open_sheet(self, address: str) -> None:
        self.page.goto(address)
        self.settle()

    def settle(self) -> None:
        """Wait until the force is that of the knob's speed."""
        self.until(lambda: self.page.evaluate(SHOWN))

    def press(self, key: str) -> None:
        """A key on the knob."""
        self.page.locator("#knob").press(key)
        self.settle()

    def lost(self) -> bool:
        return self.text("contact") == "contact lost"

    def up_until(self, key: str, condition: Callable[[], bool]) -> None:
        """Press a key until something is so."""
        end = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < end
            self.press(key)


@pytest.fixture
def lab(chromium: Browser, tmp_path: Path) -> Iterator[tuple[LabPage, LabPages]]:
    pages = LabPages(sheet_of(seed="group-3"), tmp_path)
    with serve(pages, home="/lab") as served:
        shown = LabPage(new_page(chromium))
        shown.open_sheet(served.address)
        yield shown, pages
        shown.page.context.close()
    assert shown.errors == []
    assert shown.outside == []


def test_a_reading_taken_by_keys_is_within_1_rpm_of_the_truth(
    lab: tuple[LabPage, LabPages],
) -> None:
    """Up by tens until contact is lost, down by ones until it holds: read, recorded, marked."""
    page, pages = lab
    sheet = pages.notebook.sheet
    page.page.locator("#student").fill("Ana")
    page.page.locator("#student").press("Enter")
    page.page.locator("#spring_stiffness input").first.press("ArrowDown")  # the second spring
    page.settle()
    assert not page.lost()
    before = page.path("force")
    page.up_until("PageUp", page.lost)
    page.up_until("ArrowDown", lambda: not page.lost())
    page.press("ArrowUp")
    assert page.lost()
    assert page.path("force") != before
    page.page.locator("#record").press("Enter")
    page.until(lambda: page.text("recorded").startswith("Reading 1"))
    page.page.reload()
    page.settle()
    assert page.page.locator("#rows tr").count() == 1
    assert page.page.locator("#plot .point").count() == 1
    assert page.page.locator("#student").input_value() == "Ana"
    assert not page.page.locator("#theory").is_visible()
    path = pages.notebook.path
    assert path is not None
    (mark,) = mark_sheet(path, 1.0, lambda _: sheet.cam, lambda _: sheet.rig).marks
    assert mark.reading.setup.spring_stiffness == sheet.springs[1]
    assert 0.0 < mark.difference_rpm < 1.0


def test_a_reading_in_contact_is_asked_about(lab: tuple[LabPage, LabPages]) -> None:
    """It is taken where the student says so, and only there; with the lamp lit nobody is asked."""
    page, pages = lab
    asked: list[str] = []
    answers = [False, True]

    def answer(dialog: Dialog) -> None:
        asked.append(dialog.message)
        (dialog.accept if answers.pop(0) else dialog.dismiss)()

    page.page.on("dialog", answer)
    record, readings = page.page.locator("#record"), len(pages.notebook.recorded.readings)
    assert not page.lost()
    record.click()
    page.until(lambda: asked)
    record.click()
    page.until(lambda: len(pages.notebook.recorded.readings) == readings + 1)
    low, high = pages.notebook.sheet.knob
    assert all(f" {low:g} rpm" in words for words in asked)
    # At once: what is asked about is the speed that is recorded, not the one the lamp was of.
    page.page.locator("#rpm").fill(str(high))
    page.page.locator("#rpm").press("Enter")
    record.click()
    page.until(lambda: len(pages.notebook.recorded.readings) == readings + 2)
    assert len(asked) == 2
    assert [r.rpm for r in pages.notebook.recorded.readings[readings:]] == [low, high]


@pytest.mark.parametrize("width", [400, 1000, 1600])
def test_nothing_sticks_out_of_the_sheet(lab: tuple[LabPage, LabPages], width: int) -> None:
    """No scrolling sideways at any width."""
    page, _ = lab
    page.page.set_viewport_size({"width": width, "height": 800})
    assert page.page.evaluate("() => document.documentElement.scrollWidth") <= width


def test_the_theory_is_shown_when_it_is_asked_for(chromium: Browser, tmp_path: Path) -> None:
    """Without a seed; the line goes away again."""
    with serve(LabPages(sheet_of("tm21"), tmp_path), home="/lab") as served:
        page = LabPage(new_page(chromium))
        page.open_sheet(served.address)
        line = page.page.locator("#plot .theory")
        assert not line.get_attribute("d")
        page.page.locator("#theory").press("Enter")
        page.until(lambda: line.get_attribute("d"))
        page.page.locator("#theory").press("Enter")
        page.until(lambda: not line.get_attribute("d"))
        links = page.page.locator("nav a:visible")
        assert [link.get_attribute("href") for link in links.all()] == ["/lab"]  # what is served
        page.page.context.close()
    assert page.errors == []
