"""A served drawing board, and a page of it in a real browser."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import urlsplit

import pytest

import cam_rig
from cam_rig.panel.board.board import START_RPM, Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import serve
from tools.docs.browser import HEIGHT, TIMEOUT_S, WIDTH, new_page, open_browser, why_no_browser

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture
def board(tmp_path: Path) -> Board:
    return Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), tmp_path / "out")


@pytest.fixture
def address(board: Board) -> Iterator[str]:
    """The address that is printed, with its token."""
    with serve(BoardPages(board)) as served:
        yield served.address


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    if why := why_no_browser():
        pytest.skip(why)
    with open_browser(webgl=False) as browser:
        yield browser


class Panel:
    """A page of the board: what it shows, and what went wrong or to another host."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.errors: list[str] = []
        self.outside: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        page.on("request", lambda asked: self._note(asked.url))
        page.on("websocket", lambda socket: self._note(socket.url))

    def _note(self, url: str) -> None:
        if urlsplit(url).scheme != "data" and urlsplit(url).hostname != "127.0.0.1":
            self.outside.append(url)

    def open(self, address: str) -> None:
        self.page.goto(address)
        self.until(lambda: self.number("jump_rigid") is not None and not self.stale("jump_rigid"))

    def text(self, name: str) -> str:
        return str(self.page.evaluate("id => document.getElementById(id)?.textContent", name))

    def number(self, name: str) -> float | None:
        """The first word of a readout, if it is a number."""
        try:
            return float(self.text(name).split()[0])
        except (ValueError, IndexError):
            return None

    def stale(self, name: str) -> bool:
        script = "id => document.getElementById(id).classList.contains('stale')"
        return bool(self.page.evaluate(script, name))

    def path(self, chart: str, kind: str = "") -> str:
        """The points of the curve itself, or of another kind of it."""
        script = """([id, kind]) => [...document.querySelectorAll(`#${id} .curve`)].find(
            (path) => kind ? path.classList.contains(kind)
              : !["ghost", "second"].some((other) => path.classList.contains(other))
        ).getAttribute("d") ?? ''"""
        return str(self.page.evaluate(script, [chart, kind]))

    def until(self, condition: Callable[[], Any]) -> None:
        """Wait for what is to be seen on the page."""
        deadline = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < deadline, f"never came; the page says {self.text('status')!r}"
            self.page.wait_for_timeout(20)

    def settled(self) -> None:
        """Wait until all numbers are of the law that is shown."""
        names = ("jump_rigid", "jump", "residual", "level")
        self.until(lambda: not any(self.stale(name) for name in names))

    def drag(self, handle: int, down: float) -> None:
        """Take a handle with the pointer, move it, and let go."""
        box = self.page.locator(".handle").nth(handle).bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x, y + down, steps=6)
        self.page.mouse.up()


@pytest.fixture(scope="module")
def shared(chromium: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shared]:
    """One server and one page for all tests of the page: each begins with the start anew."""
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    board = Board(cam, rig, tmp_path_factory.mktemp("panel"))
    with serve(BoardPages(board)) as served:
        page = new_page(chromium)
        yield Shared(board, Panel(page), served.address)
        page.context.close()


class Shared(NamedTuple):
    """A board, a page of it, and its address."""

    board: Board
    panel: Panel
    address: str


@pytest.fixture
def panel(shared: Shared, tmp_path: Path) -> Iterator[Panel]:
    """The board as a browser shows it; nothing may go wrong, and no other host be asked."""
    board, shown = shared.board, shared.panel
    board.out = tmp_path / "out"
    board.take(board.drawn.ordinates.tolist(), START_RPM)
    shown.page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    shown.open(shared.address)
    shown.settled()
    yield shown
    shown.page.evaluate("() => sessionStorage.clear()")  # the language that was chosen
    errors, outside = shown.errors[:], shown.outside[:]
    shown.errors.clear()
    shown.outside.clear()
    assert errors == []
    assert outside == []
