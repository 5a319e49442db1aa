"""What is where on the bench's page, without nodes: nothing overlaps, the red button in sight."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

import cam_rig
from cam_rig.panel.bench.pages import BenchPages
from cam_rig.panel.bench.runner import BenchRunner
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import serve
from tools.docs.browser import new_page

from ..conftest import Panel

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = pytest.mark.slow
SIZES = [(1000, 700), (1250, 800), (1366, 768), (1600, 910)]
#: What a person reads or takes hold of.
THINGS = "button, input, select, output, meter, h1, h2, h3, a, li, #knob, #lamp, .chart"


class Bench(Panel):
    """The bench as a browser shows it, whose nodes never come."""

    def open_bench(self, address: str) -> None:
        self.page.goto(address)
        self.page.goto(f"http://{urlsplit(address).netloc}/bench")
        self.until(lambda: self.text("graph") != "")

    def boxes(self, things: str = THINGS) -> dict[str, tuple[float, float, float, float]]:
        """Left, top, right and bottom of what can be seen; what is in another has no own."""
        found: list[tuple[str, list[float]]] = self.page.evaluate(
            """(things) => [...document.querySelectorAll(things)]
              .filter((one) => one.checkVisibility() && !one.parentElement.closest(things))
              .map((one, i) => [`${one.id || one.textContent} ${i}`, one.getBoundingClientRect()])
              .filter(([, box]) => box.width && box.height)
              .map(([name, { left, top, right, bottom }]) => [name, [left, top, right, bottom]])""",
            things,
        )
        return {name: (box[0], box[1], box[2], box[3]) for name, box in found}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, BenchPages]]:
    folder = tmp_path_factory.mktemp("bench")
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    board = Board(cam, rig, folder / "out")
    pages = BenchPages(BenchRunner(rig, folder, folder / "out"), cam, board)
    with serve(BoardPages(board), pages) as panel:
        yield panel.address, pages


@pytest.fixture(params=["en", "es"])
def bench(
    chromium: Browser, served: tuple[str, BenchPages], request: pytest.FixtureRequest
) -> Iterator[Bench]:
    shown = Bench(new_page(chromium))
    shown.page.context.add_init_script(f"sessionStorage.setItem('language', '{request.param}')")
    shown.open_bench(served[0])
    assert shown.page.evaluate("document.documentElement.lang") == request.param
    yield shown
    shown.page.context.close()
    assert shown.errors == []
    assert shown.outside == []


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_nothing_lies_over_anything_and_the_stop_is_in_sight(
    bench: Bench, size: tuple[int, int]
) -> None:
    """By the boxes of all that is read or taken hold of, in every language, at every size."""
    width, height = size
    bench.page.set_viewport_size({"width": width, "height": height})
    boxes = bench.boxes()
    assert len(boxes) > 25
    for (one, a), (other, b) in itertools.combinations(boxes.items(), 2):
        apart = a[2] <= b[0] + 0.5 or b[2] <= a[0] + 0.5 or a[3] <= b[1] + 0.5 or b[3] <= a[1] + 0.5
        assert apart, f"{one} lies over {other}: {a}, {b}"
    columns = list(bench.boxes("main > section, main > div").values())
    for name, (left, top, right, bottom) in boxes.items():
        assert left >= 0 and right <= width, f"{name} sticks out of the page"
        if bottom > columns[0][1] and top >= min(column[1] for column in columns):
            held = any(c[0] <= left + 0.5 and right <= c[2] + 0.5 for c in columns)
            assert held, f"{name} sticks out of its column"
    (stop,) = bench.boxes("#emergency").values()
    assert stop[1] >= 0
    assert stop[3] <= height


def test_the_heading_names_the_rigs_own_model(bench: Bench, served: tuple[str, BenchPages]) -> None:
    """Two masses where the rig says how its mass is split, as on the board; then what is set up."""
    model = "#model option:checked"
    assert bench.page.locator("#model").input_value() == "two_mass"
    words = bench.page.locator(model).text_content()
    assert words and bench.text("title").endswith(f", {words}")
    assert served[1].live.setup.model == "two_mass"


class _Rerun(BaseHTTPRequestHandler):
    """Stands for Rerun's page, which says when it shows the rig."""

    said = False

    def do_GET(self) -> None:
        script = "const asking = setInterval(async () => {"
        script += "if (await (await fetch('/said')).text() !== 'yes') return;"
        script += "clearInterval(asking); parent.postMessage('shown', '*'); }, 50)"
        body = "yes" if _Rerun.said else "no"
        if self.path == "/":
            body = f"<!doctype html><body style='background:#f00'><script>{script}</script>"
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(body.encode())

    def log_message(self, *_words: Any) -> None:
        pass


def test_a_poster_stands_until_the_rig_is_shown(
    bench: Bench, served: tuple[str, BenchPages], tmp_path: Path
) -> None:
    """What it is, the cam drawn to scale, and Start; nothing of another program's empty page."""
    server, (_, pages) = HTTPServer(("127.0.0.1", 0), _Rerun), served
    Thread(target=server.serve_forever, daemon=True).start()
    try:
        poster = bench.page.locator("#poster")
        bench.page.locator("#poster_cam .curve").first.wait_for()
        _Rerun.said = False
        pages.live.screen = f"http://127.0.0.1:{server.server_address[1]}/"
        bench.page.reload()
        bench.page.locator("#rerun").wait_for(state="visible")
        bench.page.frame_locator("#rerun").locator("script").wait_for(state="attached")
        for size in SIZES:
            bench.page.set_viewport_size({"width": size[0], "height": size[1]})
            (rerun,), (over,) = bench.boxes("#rerun").values(), bench.boxes("#poster").values()
            assert over == rerun
        bench.page.locator("#poster_cam .curve").first.wait_for()
        assert bench.text("poster_title") == cam_rig.load_cam("poly345").title
        assert poster.locator("button").text_content() == bench.text("start")
        assert poster.is_visible()
        _Rerun.said = True
        poster.wait_for(state="hidden")
        bench.page.locator("#toggle").click()
        assert not bench.page.locator("#stage").is_visible()
        bench.page.locator("#toggle").click()
        poster.wait_for(state="hidden")
    finally:
        pages.live.screen = ""
        server.shutdown()
        server.server_close()
