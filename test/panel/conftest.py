"""Fixtures and helpers: a served web panel with or without nodes, and its pages.

The panel has three pages: the drawing board for a motion law, the bench that controls the rig, and
the lab sheets for students.
"""

import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.sync.client import connect

import cam_rig
from cam_rig.panel.bench.drawing import MOTION, SOUND
from cam_rig.panel.bench.pages import BenchPages
from cam_rig.panel.bench.runner import BenchRunner
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.lab.labs import lab_sheet
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.lab.recorded import Notebook
from cam_rig.panel.server import serve
from tools.docs.browser import TIMEOUT_S, new_page, open_browser, why_no_browser

from ..processes import WAIT_S, children, until
from ..viewer.asking import Visitor, local

BOARD, BENCH = "/changes", "/bench/live"
#: Largest number of answers that a test writes on a lab sheet.
ANSWERS = 4


@pytest.fixture
def board(tmp_path):
    """Drawing board of the panel with the cam poly345."""
    return Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), tmp_path / "out")


def with_moved_ordinate(board, lifts, handle=7):
    """Return the ordinates of the drawn law with one of them moved by `lifts`.

    `lifts` is in multiples of the lift. By default the ordinate in the middle of the rise is moved.
    """
    ordinates = board.ordinates.tolist()
    ordinates[board.drawn.handles[handle].index] += lifts
    return ordinates


def sheet_of(rig="paper_table2", seed=None, cam="poly345", lab="jump"):
    return lab_sheet(lab, [cam_rig.load_cam(cam)], cam_rig.load_rig(rig), seed)


def socket_of(visitor, path):
    """Return a connection to the websocket at the path of a page."""
    return connect(
        f"ws://{visitor.url.netloc}{path}",
        sock=local(visitor.url.port),
        additional_headers=visitor.headers,
        origin=None,
        max_size=None,
    )


def received(socket, *kinds):
    """Return a dict with the first message of each kind that the socket receives.

    Answers to sent messages are included.
    """
    messages = {}
    while set(messages) != set(kinds):
        message = socket.recv(timeout=WAIT_S)
        if isinstance(message, str) and (read := json.loads(message))["type"] in kinds:
            messages.setdefault(read["type"], read)
    return messages


def blocks_of(data):
    """Return (start in s, step in s, samples) of each block in a binary message.

    A block has the samples of one tick, shape (6, n).
    """
    blocks = []
    while data:
        start, step, count = np.frombuffer(data, "<f8", 3).tolist()
        rows, data = data[24 : 24 + round(24 * count)], data[24 + round(24 * count) :]
        blocks.append((start, step, np.frombuffer(rows, "<f4").reshape(6, -1)))
    return blocks


class ServedPages(Visitor):
    """Client of a served panel with drawing board, bench and lab, without ROS nodes."""

    def __init__(self, board, bench, lab, address):
        super().__init__(address)
        self.pages, self.bench, self.lab = board, bench, lab
        self.board = board.board

    def page(self, path):
        return socket_of(self, path)

    def valid_message(self, path):
        """Return a message that the page at this path may send."""
        if path == BENCH:
            return {"do": "clear"}
        return {"ordinates": self.board.ordinates.tolist(), "rpm": 250}


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """Served panel, shared by the tests of a file."""
    folder, sheet = tmp_path_factory.mktemp("panel"), sheet_of()
    pages = BoardPages(Board(sheet.cam, sheet.rig, folder / "out"))
    bench = BenchPages(BenchRunner(sheet.rig, folder, folder / "out"), sheet.cam, pages.board)
    lab = LabPages(sheet, folder / "lab")
    with serve(pages, bench, lab) as panel:
        yield ServedPages(pages, bench, lab, panel.address)


class ServedLab(Visitor):
    """Client of a served lab sheet that sends the requests of its page."""

    def __init__(self, pages, address):
        super().__init__(address)
        self.pages = pages

    def request_data(self, index, rpm):
        """Return the data that the page sends for a set-up (index) at a speed (rpm)."""
        return vars(self.pages.notebook.sheet.setups[index]) | {"rpm": rpm}


@contextmanager
def served_lab(sheet, out):
    pages = LabPages(sheet, out)
    with serve(pages, home="/lab") as served:
        yield ServedLab(pages, served.address)


def filled(sheet, folder, off=0.0, student="Ana"):
    """Return the path of a lab sheet with answers, each of another set-up.

    `off` is the relative error of the answers. If the lab requires an answer in addition to
    readings, the sheet also has a reading.
    """
    book = Notebook(sheet, folder)
    book.set_student({"student": student})
    if sheet.answer:
        book.record(vars(sheet.setups[0]) | {"rpm": sheet.knob[0] + 1.0})
    for setup in sheet.answerable_setups[:ANSWERS]:
        answer = sheet.true(setup) * (1.0 + off)
        if sheet.answer:
            book.answer(vars(setup) | {"answer": f"{answer:.3f}"})
        else:
            book.record(vars(setup) | {"rpm": answer})
    return book.path


# -- in a browser


@pytest.fixture(scope="module")
def chromium():
    """Browser without a window and without WebGL.

    Without an installed browser the test is skipped.
    """
    if why := why_no_browser():
        pytest.skip(why)
    with open_browser(webgl=False) as browser:
        yield browser


class BrowserPage:
    """Page of the panel in a real browser, with its errors and outside requests."""

    def __init__(self, page):
        self.page = page
        self.errors = []
        self.outside = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        page.on("request", lambda request: self._note(request.url))
        page.on("websocket", lambda socket: self._note(socket.url))

    def _note(self, url):
        parts = urlsplit(url)
        if parts.scheme not in ("data", "file") and not (parts.hostname or "").endswith(
            ".localhost"
        ):
            self.outside.append(url)

    def open(self, address, path=""):
        """Open the printed address with its token, and then a path on its server."""
        self.page.goto(address)
        self.page.wait_for_url(lambda url: "token" not in url)
        if path:
            self.page.goto(f"http://{urlsplit(address).netloc}{path}")

    def enter(self, name, value):
        """Fill the field with this element id and press Enter."""
        self.page.locator(f"#{name}").fill(str(value))
        self.page.locator(f"#{name}").press("Enter")

    def text(self, name):
        return str(self.page.evaluate("id => document.getElementById(id)?.textContent", name))

    def number(self, name):
        """Return the first word of an element as a number, or None if it is not a number.

        The decimal sign is that of the page's language.
        """
        try:
            return float(self.text(name).split()[0].replace(",", "."))
        except (ValueError, IndexError):
            return None

    def path(self, chart, kind=""):
        """Return the SVG path of a chart's main curve, or of another kind of curve.

        The other kinds are "ghost" (start law) and "second" (law for comparison).
        """
        script = """([id, kind]) => [...document.querySelectorAll(`#${id} .curve`)].find(
            (path) => kind ? path.classList.contains(kind)
              : !["ghost", "second"].some((other) => path.classList.contains(other))
        ).getAttribute("d") ?? ''"""
        return str(self.page.evaluate(script, [chart, kind]))

    def until(self, condition):
        """Wait until a condition of the page is true."""
        until(condition, self._page_texts, lambda: self.page.wait_for_timeout(40), TIMEOUT_S)

    def _page_texts(self):
        return [self.text(name) for name in ("status", "graph", "speed", "level")]

    def width(self, width):
        """Return the width (px) of the page's content in a window of this width (px)."""
        self.page.set_viewport_size({"width": width, "height": 800})
        drawn = "() => new Promise((done) => setTimeout(() => requestAnimationFrame(done)))"
        self.page.evaluate(drawn)
        return int(self.page.evaluate("() => document.documentElement.scrollWidth"))


@contextmanager
def in_browser(chromium, kind, **context):
    """Open a page in a new browser context, and check it at the end.

    It must have no errors and no requests to other hosts. `kind` is the class of the page object.
    """
    page = chromium.new_context(**context).new_page() if context else new_page(chromium)
    shown = kind(page)
    try:
        yield shown
    finally:
        page.context.close()
    assert shown.errors == [] and shown.outside == []


# -- with nodes


class BenchPage:
    """Client of the bench's websocket without a browser, with received values."""

    def __init__(self, socket):
        self.socket, self.number, self.sound = socket, 0, b""
        self.motion = []
        self.live = {}

    def _next(self):
        message = self.socket.recv(timeout=WAIT_S)
        if isinstance(message, bytes):
            if message.startswith(SOUND):
                self.sound += message[len(SOUND) :]
            else:
                self.motion += blocks_of(message.removeprefix(MOTION))
            return {}
        data = json.loads(message)
        if data["type"] == "live":
            self.live = self.live | data  # only changed values are sent
        return data

    def until(self, condition):
        """Wait until a condition of the bench's values is true, and return them."""
        until(lambda: self.live and condition(self.live), lambda: self.live, self._next)
        return self.live

    def request(self, do, **more):
        """Send a command to the bench and return its answer."""
        self.number += 1
        self.socket.send(json.dumps({"number": self.number, "do": do, **more}))
        return self.answer(self.number)

    def answer(self, number):
        """Return the answer to the command with this number."""
        while (message := self._next()).get("type") != "answer" or message["answer"] != number:
            pass
        return message

    def do(self, do, **more):
        """Send a command that must be accepted, and return its answer."""
        answer = self.request(do, **more)
        assert answer["success"], answer["message"]
        return answer

    def running(self):
        """Wait until the nodes run and have reported their parameters."""
        return self.until(lambda live: live["graph"] == "running" and len(live["parameters"]) == 3)

    def turning(self, rpm):
        """Wait until the cam turns at a speed (rpm)."""
        return self.until(lambda live: abs(live["state"].get("rpm", 0.0) - rpm) < 1e-6)

    def turned(self, seconds):
        """Start the cam and wait until it has turned for a simulated time (s)."""
        self.do("call", value="start")
        return self.wait_for_rig_time(seconds)

    def wait_for_rig_time(self, seconds):
        """Wait until the received samples reach a simulated time (s)."""
        self.do("watch", value=True)
        return self.until(lambda _: self.motion and self.motion[-1][0] > seconds)

    def keep(self):
        """Keep the bag that is being recorded, and return its path."""
        kept = len(self.live["kept_bags"])
        self.do("keep")
        return Path(self.until(lambda live: len(live["kept_bags"]) > kept)["kept_bags"][-1])


class RunningPanel(Visitor):
    """Process of `cam-rig panel` that stores kept bags in the folder `out`."""

    def __init__(self, process, out):
        self.process, self.out = process, out
        super().__init__(process.stdout.readline().strip())

    @contextmanager
    def page(self):
        """Open a page of the bench, which starts the nodes."""
        self.get("/bench")
        with socket_of(self, BENCH) as socket:
            yield BenchPage(socket)

    def nodes(self):
        """Return the process IDs of the panel's nodes by node name."""
        processes = children(self.process.pid).items()
        return {words[3]: pid for pid, words in processes if words[2:3] == ["cam_rig.nodes"]}

    def end(self, number):
        """End the panel process by a signal and return its exit code."""
        self.process.send_signal(number)
        return self.process.wait(WAIT_S)


def start_panel(out, *options, command=("panel",), stderr=subprocess.PIPE):
    """Start a process of `cam-rig panel`, or of another command, without Rerun."""
    words = [Path(sys.executable).parent / "cam-rig", *command, "--no-rerun", "--out", out]
    arguments = [*map(str, words), *options]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=stderr, text=True)


@contextmanager
def panel_process(out, *options):
    """Run a panel without Rerun while the context is active."""
    with start_panel(out, *options) as process:
        try:
            yield RunningPanel(process, out)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=WAIT_S)
