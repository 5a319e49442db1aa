"""A real browser without a screen, and looking for a curve by its colour."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: Debian's Chromium with its own software renderer, which needs no graphics card.
FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
#: A pixel is of a colour when no channel is farther from it than this.
NEAR = 14
#: So many pixels make a curve; a point or a gap is small.
ENOUGH = 12


@dataclass
class Visit:
    """What a browser saw of one address."""

    pixels: NDArray[np.uint8]
    seconds: float = float("nan")
    errors: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)
    most: dict[str, int] = field(default_factory=dict)

    def missing(self) -> set[str]:
        """The names of the colours that never were there."""
        return {name for name, count in self.most.items() if count < ENOUGH}


Look = Callable[[str, dict[str, int], frozenset[str]], Visit]
#: Wall time (s) for a picture to be complete, on a machine that does other things too.
PATIENCE = 80.0


@contextmanager
def browser() -> Iterator[Look]:
    """A function that visits an address until all colours were seen, but those not expected."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(BROWSERS)} is installed")
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=found, args=list(FLAGS))

        def look(address: str, colours: dict[str, int], without: frozenset[str]) -> Visit:
            context = chromium.new_context(viewport={"width": 1600, "height": 1000})
            context.add_init_script("console.debug = () => {}")
            page = context.new_page()
            visit = Visit(np.zeros((1, 1, 3), np.uint8), most=dict.fromkeys(colours, 0))
            note(page, visit)
            begun = time.monotonic()
            page.goto(address)
            more = 3 if without else 0  # what is not expected has time to come all the same
            while time.monotonic() - begun < PATIENCE and (visit.missing() - without or more):
                more -= not visit.missing() - without
                picture = Image.open(io.BytesIO(page.screenshot(timeout=60_000))).convert("RGB")
                visit.pixels = np.asarray(picture)
                for name, colour in colours.items():
                    visit.most[name] = max(visit.most[name], count(visit.pixels, colour))
                if np.isnan(visit.seconds) and max(visit.most.values()) >= ENOUGH:
                    visit.seconds = time.monotonic() - begun
            context.close()
            return visit

        try:
            yield look
        finally:
            chromium.close()


def note(page: object, visit: Visit) -> None:
    """Write down errors on the console, and requests to any other machine."""

    def console(message: object) -> None:
        if message.type == "error":  # type: ignore[attr-defined]
            visit.errors.append(message.text)  # type: ignore[attr-defined]

    def request(asked: object) -> None:
        url = urlsplit(asked.url)  # type: ignore[attr-defined]
        if url.hostname not in (None, "127.0.0.1"):
            visit.outside.append(url.geturl())

    page.on("console", console)  # type: ignore[attr-defined]
    page.on("pageerror", lambda error: visit.errors.append(str(error)))  # type: ignore[attr-defined]
    page.on("request", request)  # type: ignore[attr-defined]


def count(pixels: NDArray[np.uint8], colour: int) -> int:
    """How many pixels are of a colour 0xRRGGBBAA."""
    wanted = np.array([colour >> 24 & 255, colour >> 16 & 255, colour >> 8 & 255])
    return int((np.abs(pixels.astype(np.int16) - wanted).max(axis=2) <= NEAR).sum())
