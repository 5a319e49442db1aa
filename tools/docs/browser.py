"""Browser without a window: screenshots of pages, and search for colours in them."""

from __future__ import annotations

import importlib.util
import io
import shutil
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cam_rig.errors import CamRigError
from cam_rig.files import atomic_write
from cam_rig.show.command import user_errors
from cam_rig.show.terminal import console

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: Options of Chromium for pages without WebGL.
PLAIN = (
    "--no-sandbox",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
#: Options of Chromium for WebGL, with a software renderer that needs no graphics card.
FLAGS = (*PLAIN, "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
#: Width of a page (px).
WIDTH = 1600
#: Height of a page (px).
HEIGHT = 1000
#: Wall time (s) within which a page must be complete, on a slow and busy machine.
TIMEOUT_S = 150.0
#: Wall time (s) between two screenshots, in which the page can draw.
PAUSE_S = 0.3
#: Largest difference of a colour channel between a pixel and the searched colour.
MAX_CHANNEL_DIFFERENCE = 14
#: Smallest number of pixels of a visible curve.
MIN_PIXELS = 12
#: Relative change of the number of pixels below which a curve is complete.
MAX_CHANGE = 0.01

Pixels = NDArray[np.uint8]


def why_no_browser() -> str | None:
    """Return the reason for a missing browser, or None if a browser is installed."""
    if importlib.util.find_spec("playwright") is None:
        return "playwright is not installed"
    if not any(map(shutil.which, BROWSERS)):
        return f"none of {', '.join(BROWSERS)} is installed"
    return None


@contextmanager
def open_browser(webgl: bool = True) -> Iterator[Browser]:
    """Open a Chromium without a window. Without WebGL it is faster."""
    if why := why_no_browser():
        raise CamRigError(f"no browser: {why}")
    from playwright.sync_api import sync_playwright

    program = next(filter(None, map(shutil.which, BROWSERS)))
    flags = list(FLAGS) if webgl else [*PLAIN, "--disable-gpu"]
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=program, args=flags, timeout=TIMEOUT_S * 1e3
        )
        try:
            yield chromium
        finally:
            chromium.close()


def new_page(browser: Browser) -> Page:
    """Return an empty page of `WIDTH` by `HEIGHT`, in a separate context."""
    context = browser.new_context(viewport={"width": WIDTH, "height": HEIGHT})
    context.add_init_script("console.debug = () => {}")
    context.set_default_timeout(TIMEOUT_S * 1e3)
    return context.new_page()


def photographs(page: Page, deadline: float) -> Iterator[Pixels]:
    """Yield screenshots ``(h, w, 3)`` of a page until a deadline of `time.monotonic`.

    A busy browser cannot always take a screenshot. It is then requested again.
    """
    from playwright.sync_api import Error

    failed: Error | None = None
    taken = 0
    while time.monotonic() < deadline or not taken:
        left = deadline - time.monotonic()
        if left <= 0.0:
            raise CamRigError(f"the browser cannot take a picture of {page.url}: {failed}")
        try:
            data = page.screenshot(timeout=left * 1e3)
        except Error as error:
            failed = error
        else:
            taken += 1
            yield np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
        time.sleep(PAUSE_S)


def photograph(address: str, colours: Collection[int], settled: int) -> Pixels:
    """Return a screenshot of a page on which all colours 0xRRGGBBAA are visible.

    ``settled`` is the colour of a curve that is drawn while the page loads, and must be complete.
    """
    with open_browser() as browser:
        page, deadline = new_page(browser), time.monotonic() + TIMEOUT_S
        page.goto(address)
        before = 0
        for pixels in photographs(page, deadline):
            missing = [colour for colour in colours if count(pixels, colour) < MIN_PIXELS]
            size = count(pixels, settled)
            if not missing and abs(size - before) <= MAX_CHANGE * size:
                return pixels
            before = size
    names = ", ".join(f"#{colour >> 8:06x}" for colour in missing)
    reason = f"does not show {names}" if names else "is still being drawn"
    raise CamRigError(f"{address}: the page {reason} after {TIMEOUT_S:g} s")


def until(page: Page, condition: str, also: Callable[[], bool] = lambda: True) -> None:
    """Wait until a condition is true in the page, and another in this process."""
    deadline = time.monotonic() + TIMEOUT_S
    while not (also() and page.evaluate(condition)):
        if time.monotonic() > deadline:
            raise CamRigError(f"{page.url}: not true after {TIMEOUT_S:g} s: {condition}")
        page.wait_for_timeout(50)


def save_picture(picture: Path, photograph: Callable[[Path], None]) -> None:
    """Write a picture for the documents, and print its size."""
    with user_errors():
        with atomic_write(picture) as part:
            photograph(part)
        console.print(f"{picture}: {picture.stat().st_size / 1e3:.0f} kB", soft_wrap=True)


def count(pixels: Pixels, colour: int) -> int:
    """Return the number of pixels of a colour 0xRRGGBBAA."""
    wanted = np.array([colour >> 24 & 255, colour >> 16 & 255, colour >> 8 & 255])
    difference = np.abs(pixels.astype(np.int16) - wanted).max(axis=2)
    return int((difference <= MAX_CHANNEL_DIFFERENCE).sum())
