"""What a real browser sees of an address: colours, errors, and whom else it asks."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import numpy as np

from tools.docs.browser import MIN_PIXELS, TIMEOUT_S, Pixels, count, new_page, photographs

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@dataclass
class Visit:
    """What a browser saw of one address."""

    pixels: Pixels
    seconds: float = float("nan")
    errors: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)
    most: dict[str, int] = field(default_factory=dict)

    def missing(self) -> set[str]:
        """The names of the colours that never were there."""
        return {name for name, count in self.most.items() if count < MIN_PIXELS}


def look(
    chromium: Browser, address: str, colours: dict[str, int], without: frozenset[str]
) -> Visit:
    """Visit an address until all colours were seen, but those not expected."""
    visit = Visit(np.zeros((1, 1, 3), np.uint8), most=dict.fromkeys(colours, 0))
    page, begun = new_page(chromium), time.monotonic()
    note(page, visit)
    page.goto(address)
    more = 3 if without else 0  # what is not expected has time to come all the same
    for pixels in photographs(page, begun + TIMEOUT_S):
        visit.pixels = pixels
        for name, colour in colours.items():
            visit.most[name] = max(visit.most[name], count(pixels, colour))
        if np.isnan(visit.seconds) and max(visit.most.values()) >= MIN_PIXELS:
            visit.seconds = time.monotonic() - begun
        if not visit.missing() - without:
            more -= 1
            if more < 0:
                break
    page.context.close()
    return visit


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
