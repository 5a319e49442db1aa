"""Tests of the pictures of the documents, and of `make pictures`.

The command draws the pictures from a bag.
"""

from __future__ import annotations

import io
import re
import time
from pathlib import Path
from urllib.parse import urlsplit
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import pyplot as plt
from PIL import Image
from typer.testing import CliRunner

from cam_rig.errors import BagError, CamRigError
from cam_rig.show.looks import FORCE, GAP, LAW, LIFT, web
from tools.docs import browser, main, pictures, screenshot, stills
from tools.docs.browser import HEIGHT, WIDTH, Pixels, count, photographs, why_no_browser
from tools.docs.pictures import ANIMATION, SIDE_BY_SIDE, draw_pictures
from tools.docs.turn_archive import TurnArchive, gap, read_turns

from ..viewer.asking import ask
from ..viewer.conftest import SmallBag
from .conftest import DOCS, PAGES


@pytest.fixture(scope="module")
def archive(bag: SmallBag) -> TurnArchive:
    """Turns of the viewer tests' small bag, which has two cams and two speeds."""
    return read_turns(bag.path)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_picture_of_a_document_is_there(page: Path) -> None:
    """Each picture on a page exists and can be opened.

    An SVG contains paths, and other pictures are larger than 200 px, the size of an icon.
    """
    for name in re.findall(r"!\[[^\]]*\]\((?!https?:)([^)\s]+)\)", page.read_text("utf-8")):
        if name.endswith(".svg"):
            drawing = ElementTree.parse(page.parent / name)
            assert drawing.findall(".//{http://www.w3.org/2000/svg}path"), name
        else:
            with Image.open(page.parent / name) as picture:
                picture.verify()
                assert min(picture.size) > 200, name


def test_the_viewers_picture_shows_every_curve() -> None:
    """The picture of the viewer in docs/ contains the colour of each curve.

    At least 40 pixels have that colour, within a tolerance that exceeds the effect of compression.
    The picture has the size of the browser window.
    """
    with Image.open(DOCS / main.VIEWER) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    for colour in screenshot.SHOWN:
        assert count(pixels, colour) > 40, f"#{colour >> 8:06x}"


@pytest.mark.parametrize("name", screenshot.TABS)
def test_the_picture_of_each_tab_is_small_and_filled(name):
    """The picture of a tab has the size of the window, less than 200 kB, and the follower."""
    path = DOCS / name
    assert path.stat().st_size < 200_000
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    assert count(pixels, screenshot.colours.FOLLOWER) > 40
    assert name in (DOCS / "viewing.md").read_text("utf-8")


def test_a_photograph_is_of_the_bags_own_layout(bag, tmp_path, monkeypatch):
    """`photograph_viewer` serves a bag as a page, and writes the pixels of that page.

    It passes the colours that must be visible to the browser, which is a fake here.
    """
    pixels = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)

    def photograph(address: str, colours: tuple[int, ...], settled: int) -> Pixels:
        parts = urlsplit(address)
        assert ask(address, f"{parts.path}?{parts.query}")[0] == 200
        assert settled in colours and colours == screenshot.SHOWN
        return pixels

    monkeypatch.setattr(screenshot, "photograph", photograph)
    screenshot.photograph_viewer(bag.path, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), pixels)


@pytest.mark.long
@pytest.mark.skipif(why_no_browser() is not None, reason=f"no browser: {why_no_browser()}")
def test_the_viewer_is_photographed(bag: SmallBag, tmp_path: Path) -> None:
    """Chromium loads the page of a bag, and the screenshot has the expected size."""
    screenshot.photograph_viewer(bag.path, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (WIDTH, HEIGHT)


@pytest.mark.long
def test_the_command_writes_all_but_what_needs_a_browser(bag, tmp_path, monkeypatch):
    """Without a browser `pictures` writes all pictures except that of the viewer.

    The output reports that the picture of the viewer is not changed.
    """
    monkeypatch.setattr(pictures, "FRAMES", 6)
    monkeypatch.setattr("tools.docs.browser.why_no_browser", lambda: "none is installed")
    app = main.typer.Typer()
    app.command()(main.pictures)
    result = CliRunner().invoke(app, [str(bag.path), "--to", str(tmp_path)])
    assert result.exit_code == 0, result.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == [SIDE_BY_SIDE, "small.png", ANIMATION]
    assert f"{main.VIEWER}: not replaced (no browser: none is installed)" in result.stderr
    with Image.open(tmp_path / ANIMATION) as film:
        assert film.n_frames == 6


def test_the_cam_with_the_highest_jump_is_animated(archive, tmp_path, monkeypatch):
    """The cam with the largest gap in flight is animated, here poly345 at 700 rpm.

    The bag contains this cam and a cam with a smaller gap.
    """
    shown: list[str] = []
    monkeypatch.setattr(pictures, "animate", lambda _, turn, path: shown.append(turn.cam))
    monkeypatch.setattr(pictures, "side_by_side", lambda *_: None)
    draw_pictures(archive, lambda path: None, tmp_path)
    gaps = {cam: gap(archive.loaded, archive.turn(cam, 700.0)).max() for cam in archive.profiles}
    assert shown == [max(gaps, key=lambda cam: float(gaps[cam]))] == ["poly345"]


def test_a_speed_that_was_not_reached_is_an_error(archive: TurnArchive) -> None:
    """A speed without a complete turn raises BagError with cam and speed."""
    with pytest.raises(BagError, match="no whole turn of 'poly345' at 500 rpm"):
        archive.turn("poly345", 500.0)


def test_the_curves_are_the_turns(archive: TurnArchive) -> None:
    """The drawn curves are the lifts of law and follower in mm, and the force in N.

    They extend over the turn, from 0 to 360°.
    """
    turn = archive.turn("poly345", 700.0)
    figure, (lift, force) = plt.subplots(2)
    stills.draw_curves(lift, force, archive.loaded, turn)
    drawn = {line.get_color(): np.asarray(line.get_ydata()) for line in lift.lines + force.lines}
    plt.close(figure)
    np.testing.assert_array_equal(drawn[web(LIFT)], 1e3 * turn.rows[1])
    np.testing.assert_array_equal(drawn[web(FORCE)], turn.rows[4])
    np.testing.assert_allclose(
        drawn[web(LAW)], 1e3 * archive.loaded.laws["poly345"](turn.angle), rtol=1e-12
    )
    assert stills.degrees(turn)[0] == 0.0 and 359.0 < stills.degrees(turn)[-1] < 360.0


def test_the_gap_is_drawn_in_flight_and_a_force_in_contact(archive: TurnArchive) -> None:
    """In flight a red line has the length of the gap. In contact an arrow is drawn."""
    turn = archive.turn("poly345", 700.0)
    gaps = gap(archive.loaded, turn)
    figure, axes = plt.subplots()
    for sample in (int(gaps.argmax()), int(turn.rows[4].argmax())):
        axes.clear()
        stills.draw_rig(axes, archive, turn, sample)
        red = [line.get_xydata() for line in axes.lines if line.get_color() == web(GAP)]
        lengths = [float(np.hypot(*(line[1] - line[0]))) for line in map(np.asarray, red)]
        in_flight = gaps[sample] > 0.0
        assert len(axes.texts) == int(not in_flight)  # the arrow
        assert lengths == pytest.approx([1e3 * gaps[sample]] if in_flight else [], rel=1e-9)
    plt.close(figure)


# -- screenshots are repeated after a failure of the browser, until a deadline


class FailingPage:
    """Fake browser page that fails a number of times before each screenshot."""

    url = "http://127.0.0.1/"

    def __init__(self, failures: int) -> None:
        self._error = pytest.importorskip("playwright.sync_api").Error
        self._failures, self._left = failures, failures

    def screenshot(self, timeout: float) -> bytes:
        assert timeout > 0.0
        if self._left:
            self._left -= 1
            words = "Protocol error (Page.captureScreenshot): Unable to capture screenshot"
            raise self._error(words)
        self._left = self._failures
        data = io.BytesIO()
        Image.new("RGB", (40, 30), (0x56, 0xB4, 0xE9)).save(data, format="png")
        return data.getvalue()


@pytest.mark.parametrize("failures", [0, 1, 7])
def test_a_failure_is_tried_again(failures: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """`photographs` yields complete pictures although screenshots fail up to 7 times.

    Three pictures in a row are complete.
    """
    monkeypatch.setattr(browser, "PAUSE_S", 0.001)
    taken = photographs(FailingPage(failures), time.monotonic() + 30.0)  # type: ignore[arg-type]
    for _ in range(3):
        assert count(next(taken), 0x56B4E9FF) == 40 * 30


def test_trying_ends() -> None:
    """If the browser never takes a picture, CamRigError is raised at the deadline.

    The message contains that of the browser.
    """
    with pytest.raises(CamRigError, match=r"cannot take a picture .*Unable to capture screenshot"):
        next(photographs(FailingPage(10**9), time.monotonic() + 0.2))  # type: ignore[arg-type]


def test_only_near_colours_are_counted() -> None:
    """`count` counts only pixels that are within the limit in each colour channel.

    Of the four pixels only the first is within the limit.
    """
    pixels = np.array([[[86, 180, 233], [86, 180, 200], [60, 180, 233], [0, 0, 0]]], np.uint8)
    assert count(pixels, 0x56B4E9FF) == 1
