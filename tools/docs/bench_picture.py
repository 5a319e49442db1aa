"""The picture of the bench in the documents, as a browser shows it.

    .venv/bin/python -m tools.docs.bench_picture

``make pictures`` makes it too. The nodes run, levels are noted at some speeds, and Rerun's page
shows the rig: without a graphics card that takes a minute.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from cam_rig.errors import CamRigError
from cam_rig.show.looks import LIFT
from tools.docs.browser import (
    MIN_PIXELS,
    TIMEOUT_S,
    count,
    new_page,
    open_browser,
    photographs,
    put,
)

if TYPE_CHECKING:
    from playwright.sync_api import Page

PICTURE = Path("docs/bench.png")
SIZE = {"width": 1600, "height": 910}
#: Speeds (rpm) at which each of two cams is noted; from the last ones the follower flies.
SPEEDS = {"poly345": range(200, 550, 50), "tm21": range(200, 500, 50)}


def photograph_bench(path: Path) -> None:
    """Write the bench with the readings of two cams, and the rig in Rerun."""
    with _panel() as address, open_browser() as browser:
        page = new_page(browser)
        page.set_viewport_size(SIZE)  # type: ignore[arg-type]
        page.goto(address)
        page.locator("nav a[href='/bench']").click()
        page.locator("#start:enabled").click(timeout=TIMEOUT_S * 1e3)
        for cam, speeds in SPEEDS.items():
            page.locator("#cam").select_option(cam)
            page.locator("#cam").blur()
            for rpm in speeds:
                _note(page, cam, rpm)
        for pixels in photographs(page, time.monotonic() + TIMEOUT_S):
            if count(pixels, LIFT) >= MIN_PIXELS:
                page.screenshot(path=path)
                return
    raise CamRigError(f"{path}: Rerun's page does not show the rig")


def _note(page: Page, cam: str, rpm: int) -> None:
    """Note the level of a cam at a speed, as soon as it can be."""
    page.locator("#rpm").fill(str(rpm))
    page.locator("#rpm").press("Enter")
    page.locator("#rpm").blur()
    deadline = time.monotonic() + TIMEOUT_S
    while f" {rpm} rpm, " not in (page.locator("#noted").text_content() or ""):
        if time.monotonic() > deadline:
            raise CamRigError(f"{cam} at {rpm} rpm: no level could be noted")
        page.wait_for_timeout(500)
        if (page.locator("#speed").text_content() or "") == str(rpm):
            page.locator("#note").click()


@contextmanager
def _panel() -> Iterator[str]:
    """A panel's address, as long as the context lasts."""
    command = [str(Path(sys.executable).parent / "cam-rig"), "panel", "--out"]
    with (
        tempfile.TemporaryDirectory() as out,
        subprocess.Popen([*command, out], stdout=subprocess.PIPE, text=True) as process,
    ):
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(TIMEOUT_S)


if __name__ == "__main__":
    put(PICTURE, photograph_bench)
