"""Picture of the virtual bench in the documents, as displayed by a browser.

    .venv/bin/python -m tools.docs.bench_picture

``make pictures`` draws it too. The bench is a page of `cam-rig panel`. The nodes run, and levels
are recorded at several speeds, for half a minute.
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
from tools.docs.browser import TIMEOUT_S, new_page, open_browser, save_picture

if TYPE_CHECKING:
    from playwright.sync_api import Page

PICTURE = Path("docs/bench.png")
SIZE = {"width": 1600, "height": 1130}
#: JavaScript condition that the rig is drawn. Before that its canvas has a single colour.
RIG_DRAWN = """() => {
  const canvas = document.querySelector("#rig canvas");
  if (!canvas) return false;
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return new Uint32Array(data.buffer).some((pixel, _, all) => pixel !== all[0]);
}"""
#: Wall time (ms) after which the curves of the previous speed have disappeared.
FADE_MS = 3000
#: Speeds (rpm) at which levels of two cams are recorded. At the last speeds the follower flies.
SPEEDS = {"poly345": range(200, 550, 50), "tm21": range(200, 500, 50)}


def photograph_bench(path: Path) -> None:
    """Write a picture of the bench with readings of two cams. The follower flies."""
    with panel_address() as address, open_browser(webgl=False) as browser:
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
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_timeout(FADE_MS)
        page.screenshot(path=path)


def _note(page: Page, cam: str, rpm: int) -> None:
    """Record the level of a cam at a speed as soon as it is available."""
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
def panel_address() -> Iterator[str]:
    """Start `cam-rig panel`, and provide its address while the context is open."""
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
    save_picture(PICTURE, photograph_bench)
