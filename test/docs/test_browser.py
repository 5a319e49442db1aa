"""Pictures of a page are taken again where the browser could not, and not for ever."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest
from PIL import Image

from cam_rig.errors import CamRigError
from tools.docs import browser
from tools.docs.browser import count, photographs

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")


class Page:
    """Stands for a page that fails a few times before each picture, as on a loaded machine."""

    url = "http://127.0.0.1/"

    def __init__(self, failures: int) -> None:
        self._failures, self._left = failures, failures

    def screenshot(self, timeout: float) -> bytes:
        assert timeout > 0.0
        if self._left:
            self._left -= 1
            words = "Protocol error (Page.captureScreenshot): Unable to capture screenshot"
            raise sync_api.Error(words)
        self._left = self._failures
        data = io.BytesIO()
        Image.new("RGB", (40, 30), (0x56, 0xB4, 0xE9)).save(data, format="png")
        return data.getvalue()


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(browser, "PAUSE_S", 0.001)


@pytest.mark.parametrize("failures", [0, 1, 7])
def test_a_failure_is_tried_again(failures: int) -> None:
    """Picture after picture comes, each whole."""
    taken = photographs(Page(failures), time.monotonic() + 30.0)  # type: ignore[arg-type]
    for _ in range(3):
        assert count(next(taken), 0x56B4E9FF) == 40 * 30


def test_trying_ends() -> None:
    """A browser that never gives a picture is an error in the time given, with its own words."""
    begun = time.monotonic()
    with pytest.raises(CamRigError, match=r"gives no picture .*Unable to capture screenshot"):
        next(photographs(Page(10**9), begun + 0.2))  # type: ignore[arg-type]
    assert time.monotonic() - begun < 5.0


def test_only_near_colours_are_counted() -> None:
    """One of four pixels is within the limit in every channel."""
    pixels = np.array([[[86, 180, 233], [86, 180, 200], [60, 180, 233], [0, 0, 0]]], np.uint8)
    assert count(pixels, 0x56B4E9FF) == 1
