"""A panel that is served, without nodes or with them, and its pages, in a browser or without."""

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
from cam_rig.viewer.web_server import LOCAL_HOST
from tools.docs.browser import TIMEOUT_S, new_page, open_browser, why_no_browser

from ..processes import WAIT_S, children, until
from ..viewer.asking import Visitor, local

BOARD, BENCH = "/changes", "/bench/live"
#: On a sheet that a test fills: of the lab with the most set-ups.
ANSWERS = 4


@pytest.fixture
def board(tmp_path):
    return Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), tmp_path / "out")


def with_one_moved(board, lifts, handle=7):
    """The ordinates, one of them moved (by default in the middle of the rise)."""
    ordinates = board.ordinates.tolist()
    ordinates[board.drawn.handles[handle].index] += lifts
    return ordinates


def sheet_of(rig="paper_table2", seed=None, cam="poly345", lab="jump"):
    return lab_sheet(lab, [cam_rig.load_cam(cam)], cam_rig.load_rig(rig), seed)


def socket_of(visitor, path):
    """A page's websocket."""
    return connect(
        f"ws://{visitor.url.netloc}{path}",
        sock=local(visitor.url.port),
        additional_headers=visitor.headers,
        origin=None,
        max_size=None,
    )


def received(socket, *kinds):
    """The first message of each kind that comes, answers to what was sent among them."""
    found = {}
    while set(found) != set(kinds):
        message = socket.recv(timeout=WAIT_S)
        if isinstance(message, str) and (read := json.loads(message))["type"] in kinds:
            found.setdefault(read["type"], read)
    return found


def blocks_of(data):
    """Begin and step (s), and the rows of each tick's block, as a page is sent them."""
    found = []
    while data:
        begin, step, count = np.frombuffer(data, "<f8", 3).tolist()
        rows, data = data[24 : 24 + round(24 * count)], data[24 + round(24 * count) :]
        found.append((begin, step, np.frombuffer(rows, "<f4").reshape(6, -1)))
    return found


class ServedPages(Visitor):
    """A panel with board, bench and lab, without nodes, and who has its whole address."""

    def __init__(self, board, bench, lab, address):
        super().__init__(address)
        self.pages, self.bench, self.lab = board, bench, lab
        self.board = board.board

    def page(self, path):
        return socket_of(self, path)

    def right(self, path):
        """A message that a page may send."""
        if path == BENCH:
            return {"do": "clear"}
        return {"ordinates": self.board.ordinates.tolist(), "rpm": 250}


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """One panel for the tests of a file."""
    folder, sheet = tmp_path_factory.mktemp("panel"), sheet_of()
    pages = BoardPages(Board(sheet.cam, sheet.rig, folder / "out"))
    bench = BenchPages(BenchRunner(sheet.rig, folder, folder / "out"), sheet.cam, pages.board)
    lab = LabPages(sheet, folder / "lab")
    with serve(pages, bench, lab) as panel:
        yield ServedPages(pages, bench, lab, panel.address)


class ServedLab(Visitor):
    """A lab sheet as its page asks it."""

    def __init__(self, pages, address):
        super().__init__(address)
        self.pages = pages

    def asked(self, index, rpm):
        """What the page sends of a set-up at a speed."""
        return vars(self.pages.notebook.sheet.setups[index]) | {"rpm": rpm}


@contextmanager
def served_lab(sheet, out):
    pages = LabPages(sheet, out)
    with serve(pages, home="/lab") as served:
        yield ServedLab(pages, served.address)


def filled(sheet, folder, off=0.0, student="Ana"):
    """The sheet's file with answers, each of another set-up, so far (relative) off.

    With a reading before, where what is read is not yet the answer.
    """
    book = Notebook(sheet, folder)
    book.set_student(student)
    if sheet.answer:
        book.record(vars(sheet.setups[0]) | {"rpm": sheet.knob[0] + 1.0})
    for setup in sheet.answerable_setups[:ANSWERS]:
        found = sheet.true(setup) * (1.0 + off)
        if sheet.answer:
            book.answer(vars(setup) | {"answer": f"{found:.3f}"})
        else:
            book.record(vars(setup) | {"rpm": found})
    return book.path


# -- in a browser -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chromium():
    if why := why_no_browser():
        pytest.skip(why)
    with open_browser(webgl=False) as browser:
        yield browser


class BrowserPage:
    """A page of the panel: what it shows, and what went wrong or to another host."""

    def __init__(self, page):
        self.page = page
        self.errors = []
        self.outside = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        page.on("request", lambda asked: self._note(asked.url))
        page.on("websocket", lambda socket: self._note(socket.url))

    def _note(self, url):
        if urlsplit(url).scheme not in ("data", "file") and urlsplit(url).hostname != LOCAL_HOST:
            self.outside.append(url)

    def open(self, address, path=""):
        """Open what a printed address leads to, and a path from there."""
        self.page.goto(address)
        self.page.wait_for_url(lambda url: "token" not in url)
        if path:
            self.page.goto(f"http://{urlsplit(address).netloc}{path}")

    def enter(self, name, value):
        """Fill a field, and press Enter."""
        self.page.locator(f"#{name}").fill(str(value))
        self.page.locator(f"#{name}").press("Enter")

    def text(self, name):
        return str(self.page.evaluate("id => document.getElementById(id)?.textContent", name))

    def number(self, name):
        """The first word of a readout, if it is a number."""
        try:
            return float(self.text(name).split()[0])
        except (ValueError, IndexError):
            return None

    def path(self, chart, kind=""):
        """The points of the curve itself, or of another kind of it."""
        script = """([id, kind]) => [...document.querySelectorAll(`#${id} .curve`)].find(
            (path) => kind ? path.classList.contains(kind)
              : !["ghost", "second"].some((other) => path.classList.contains(other))
        ).getAttribute("d") ?? ''"""
        return str(self.page.evaluate(script, [chart, kind]))

    def until(self, condition):
        """Wait for what is to be seen on the page."""
        until(condition, self._said, lambda: self.page.wait_for_timeout(40), TIMEOUT_S)

    def _said(self):
        return [self.text(name) for name in ("status", "graph", "speed", "level")]

    def width(self, width):
        """How wide the page is that is shown in so many pixels."""
        self.page.set_viewport_size({"width": width, "height": 800})
        drawn = "() => new Promise((done) => setTimeout(() => requestAnimationFrame(done)))"
        self.page.evaluate(drawn)
        return int(self.page.evaluate("() => document.documentElement.scrollWidth"))


@contextmanager
def in_browser(chromium, kind, **context):
    """A page of its own; nothing may go wrong on it, and no other host be asked."""
    page = chromium.new_context(**context).new_page() if context else new_page(chromium)
    shown = kind(page)
    yield shown
    page.context.close()
    assert shown.errors == [] and shown.outside == []


# -- with nodes -------------------------------------------------------------------------------


class BenchPage:
    """A page of the bench without a browser: what it is told, and what it commands."""

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
        found = json.loads(message)
        if found["type"] == "live":
            self.live = self.live | found  # what has changed
        return found

    def until(self, condition):
        """Wait until the bench is so; what it then shows."""
        until(lambda: self.live and condition(self.live), lambda: self.live, self._next)
        return self.live

    def ask(self, do, **more):
        """What a command is answered with."""
        self.number += 1
        self.socket.send(json.dumps({"number": self.number, "do": do, **more}))
        return self.answer(self.number)

    def answer(self, number):
        """The answer to the command of a number; None of one without."""
        while (message := self._next()).get("type") != "answer" or message["answer"] != number:
            pass
        return message

    def do(self, do, **more):
        """A command that must not be refused."""
        answer = self.ask(do, **more)
        assert answer["success"], answer["words"]
        return answer

    def running(self):
        """Wait until the nodes are there and have told their parameters."""
        return self.until(lambda live: live["graph"] == "running" and len(live["values"]) == 3)

    def turning(self, rpm):
        """Wait until the cam turns at a speed."""
        return self.until(lambda live: abs(live["state"].get("rpm", 0.0) - rpm) < 1e-6)

    def turned(self, seconds):
        """Start, and wait until the cam has turned for some rig time (s)."""
        self.do("call", value="start")
        return self.comes_to(seconds)

    def comes_to(self, seconds):
        """Watch until the follower has come to a rig time (s)."""
        self.do("watch", value=True)
        return self.until(lambda _: self.motion and self.motion[-1][0] > seconds)

    def keep(self):
        """Keep the bag that is recorded; its path."""
        kept = len(self.live["kept"])
        self.do("keep")
        return Path(self.until(lambda live: len(live["kept"]) > kept)["kept"][-1])


class RunningPanel(Visitor):
    """cam-rig panel as a process that keeps its bags in a folder ``out``."""

    def __init__(self, process, out):
        self.process, self.out = process, out
        super().__init__(process.stdout.readline().strip())

    @contextmanager
    def page(self):
        """A page of the bench, which begins the nodes."""
        self.get("/bench")
        with socket_of(self, BENCH) as socket:
            yield BenchPage(socket)

    def nodes(self):
        """The processes of its nodes by name."""
        found = children(self.process.pid).items()
        return {words[3]: pid for pid, words in found if words[2:3] == ["cam_rig.nodes"]}

    def end(self, number):
        """End it by a signal; its exit code."""
        self.process.send_signal(number)
        return self.process.wait(WAIT_S)


def begin_panel(out, *options, stderr=subprocess.PIPE):
    """A process of `cam-rig panel` without Rerun."""
    command = [Path(sys.executable).parent / "cam-rig", "panel", "--no-rerun", "--out", out]
    words = [*map(str, command), *options]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=stderr, text=True)


@contextmanager
def panel_process(out, *options):
    """A panel without Rerun, as long as the context lasts."""
    with begin_panel(out, *options) as process:
        try:
            yield RunningPanel(process, out)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=WAIT_S)
