"""Pages that sleep, send nonsense or come in twos: no other page notices, and the server stays."""

from __future__ import annotations

import json
import random
import socket
import time
from collections.abc import Callable, Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

import cam_rig
from cam_rig.panel import live_page
from cam_rig.panel.bench.pages import BenchPages
from cam_rig.panel.bench.runner import BenchRunner
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.lab.sheet import LabSheet
from cam_rig.panel.server import MAX_MESSAGE, serve

from .asking import ask

#: Wall time (s) after which something that has not come true never will, however busy the machine.
WAIT_S = 60.0
BOARD, BENCH = "/changes", "/bench/live"


class AllPages:
    """A panel with board, bench and lab, without nodes."""

    def __init__(self, folder: Path) -> None:
        cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("tm21")
        self.board = BoardPages(Board(cam, rig, folder / "out"))
        runner = BenchRunner(rig, folder, folder / "out", screen=False)
        self.bench = BenchPages(runner, cam, self.board.board)
        self.lab = LabPages(LabSheet("jump", cam, rig, None), folder / "out")
        self.address = self.cookie = ""

    @property
    def headers(self) -> dict[str, str]:
        return {"Cookie": self.cookie, "Origin": f"http://{urlsplit(self.address).netloc}"}

    def page(self, path: str) -> ClientConnection:
        """A page's websocket."""
        return connect(
            f"ws://{urlsplit(self.address).netloc}{path}",
            additional_headers=self.headers,
            origin=None,
            max_size=None,
        )

    def asleep(self, path: str) -> socket.socket:
        """A page's websocket that reads nothing, not even the answer to its handshake."""
        page = socket.socket()
        page.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        url = urlsplit(self.address)
        page.connect((url.hostname, url.port))
        upgrade = {"Host": url.netloc, "Upgrade": "websocket", "Connection": "Upgrade"}
        key = {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version": "13"}
        lines = [f"{name}: {value}" for name, value in (upgrade | key | self.headers).items()]
        page.sendall("\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode())
        return page

    def right(self, path: str) -> dict[str, Any]:
        """A message that a page may send."""
        if path == BENCH:
            return {"do": "clear"}
        return {"ordinates": self.board.board.ordinates.tolist(), "rpm": 250}


@pytest.fixture
def panel(tmp_path: Path) -> Iterator[AllPages]:
    pages = AllPages(tmp_path)
    with serve(pages.board, pages.bench, pages.lab) as served:
        pages.address = served.address
        answer = ask(served.address, f"/?{urlsplit(served.address).query}")
        pages.cookie = str(answer[1]["Set-Cookie"]).split(";")[0]
        yield pages


def answer_to(page: ClientConnection, number: int | None) -> dict[str, Any]:
    """What the message of a number is answered with."""
    while True:
        found: dict[str, Any] = json.loads(page.recv(timeout=WAIT_S))
        if found["type"] in ("exact", "refused") and found["number"] == number:
            return found
        if found["type"] == "answer" and found["answer"] == number:
            return found


def until(condition: Callable[[], Any]) -> None:
    end = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.01)


# -- what is wrong ----------------------------------------------------------------------------

TEXTS = [
    "",
    "x",
    "\\ud800",
    "\\udfff\\ud800",
    "\\u0000",
    "é" * 200,
    "__proto__",
    "/../..",
    "\\n\\t",
]
NUMBERS = ["9" * 400, "-" + "9" * 5000, "1e999", "NaN", "-Infinity", "1e308", "-0", "5e-324", "7"]


def value(rng: random.Random, depth: int = 0) -> str:
    """A value as JSON, or nearly so."""
    kind = rng.randrange(4 if depth > 3 else 6)
    if kind == 0:
        return rng.choice(["true", "false", "null"])
    if kind in (1, 2):
        return rng.choice(NUMBERS) if kind == 1 else f'"{rng.choice(TEXTS)}"'
    if kind == 3:
        return rng.choice(["", "{", "[1,", '"', "nul", "[" * 5000, "{}}", "\x00"])
    inner = [value(rng, depth + 1) for _ in range(rng.randrange(5))]
    if kind == 4:
        return f"[{','.join(inner)}]"
    return "{" + ",".join(f'"{rng.choice(TEXTS)}{i}":{v}' for i, v in enumerate(inner)) + "}"


def wrong(rng: random.Random, names: tuple[str, ...], count: int) -> str:
    """An object whose every name has something that is never right, or no object at all."""
    if rng.random() < 0.2:
        return value(rng)
    ordinates = f"[{','.join([rng.choice(NUMBERS[:5])] * count)}]"
    members = {name: ordinates if rng.random() < 0.3 else value(rng) for name in names}
    text = "{" + ",".join(f'"{name}":{member}' for name, member in members.items()) + "}"
    return text if len(text.encode()) <= MAX_MESSAGE else wrong(rng, names, count)


@pytest.mark.parametrize("path", [BOARD, BENCH])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_wrong_messages_are_refused_in_a_line_and_the_page_stays(
    panel: AllPages, path: str, seed: int, caplog: pytest.LogCaptureFixture
) -> None:
    """Text and bytes, of any nonsense: each is answered, nothing is changed, and the next taken."""
    rng, count = random.Random(seed), panel.board.board.ordinates.size
    names = ("number", "ordinates", "rpm") if path == BOARD else ("number", "do", "value", "name")
    with panel.page(path) as page:
        for number in range(150):
            text = wrong(rng, names, count)
            page.send(text.encode() if rng.random() < 0.2 else text)
            while (answer := json.loads(page.recv(timeout=WAIT_S)))["type"] not in (
                "refused",
                "answer",
            ):
                assert answer["type"] != "exact", text[:80]
            assert answer.get("success") is not True, text[:80]
            assert 0 < len(answer["words"]) < 400
            assert len(answer["words"].splitlines()) == 1
            page.send(json.dumps(panel.right(path) | {"number": number}))
            answer = answer_to(page, number)
            assert answer.get("success", True) and answer["type"] != "refused"
    assert panel.board.board.version == (150 if path == BOARD else 0)
    assert [record.getMessage() for record in caplog.records if record.exc_info] == []


POSTS = {
    "/save": ("name", "ordinates"),
    "/dxf": ("ordinates",),
    "/design": ("name",),
    "/bench/mount": ("ordinates",),
    "/lab/turn": ("rpm", "spring_stiffness", "added_mass", "preload"),
    "/lab/record": ("rpm", "spring_stiffness", "added_mass", "preload"),
    "/lab/student": ("name",),
}


@pytest.mark.variants(2)
@pytest.mark.parametrize("path", POSTS)
def test_wrong_requests_are_refused_in_a_line_and_the_connection_stays(
    panel: AllPages, path: str, caplog: pytest.LogCaptureFixture
) -> None:
    """400 for what is no object of JSON, 409 for one that asks for nothing: never 500."""
    rng, url = random.Random(path), urlsplit(panel.address)
    connection = HTTPConnection(str(url.hostname), url.port, timeout=WAIT_S)
    connection.connect()
    kept = connection.sock
    statuses = set()
    for _ in range(60):
        body = wrong(rng, POSTS[path], panel.board.board.ordinates.size).encode()
        if rng.random() < 0.1:
            body = rng.randbytes(50)
        connection.request("POST", path, body, panel.headers | {"Host": url.netloc})
        answer = connection.getresponse()
        words = json.loads(answer.read())["words"]
        statuses.add(answer.status)
        assert len(words.splitlines()) == 1
        assert len(words) < 400
        assert connection.sock is kept
    connection.close()
    assert statuses == {400, 409}
    assert [record.getMessage() for record in caplog.records if record.exc_info] == []


@pytest.mark.parametrize(
    "name", ["no_such", "%00", "%ff", "%ED%A0%80", "a" * 5000, "..%2f..", "%C3%A9"]
)
def test_a_cam_of_no_name_is_not_found(panel: AllPages, name: str) -> None:
    """Whatever the address has in its place."""
    for path in ("/other", "/bench/cam"):
        status, _, body = ask(panel.address, f"{path}/{name}", **panel.headers)
        assert status in (400, 404)
        assert len(body.splitlines()) == 1


def test_a_huge_message_ends_its_own_page_alone(panel: AllPages) -> None:
    """It is never held in memory; the other page goes on."""
    with panel.page(BOARD) as good, panel.page(BOARD) as page:
        page.send("x" * (MAX_MESSAGE + 1))
        with pytest.raises(ConnectionClosed) as closed:
            answer_to(page, None)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009
        good.send(json.dumps(panel.right(BOARD) | {"number": 1}))
        assert answer_to(good, 1)["type"] == "exact"


# -- who sleeps -------------------------------------------------------------------------------


@pytest.mark.parametrize("path", [BOARD, BENCH])
def test_a_page_that_reads_nothing_is_dropped_alone(
    panel: AllPages, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While it sleeps others are answered and follow; then it is no page any more."""
    monkeypatch.setattr(live_page, "TELL_EVERY_S", 0.0)
    monkeypatch.setattr(live_page, "READS_WITHIN_S", 1.0)
    panel.bench.live.log = ["x" * 50_000]  # a state that soon fills what may wait in the network
    pages = panel.board._pages if path == BOARD else panel.bench._pages
    with panel.page(path) as one, panel.page(path) as two:
        until(lambda: len(pages) == 2)
        asleep = panel.asleep(path)
        until(lambda: len(pages) == 3)
        number, end = 0, time.monotonic() + WAIT_S
        while len(pages) == 3:
            assert time.monotonic() < end, "the page that sleeps was not dropped"
            number += 1
            one.send(json.dumps(panel.right(path) | {"number": number}))
            answer_to(one, number)
            two.recv(timeout=WAIT_S)
        assert number > 10
        two.send(json.dumps({"number": -1}))
        assert answer_to(two, -1)["words"]
        assert len(pages) == 2
        asleep.close()


def test_a_request_that_never_ends_holds_no_other_up(panel: AllPages) -> None:
    """A lab's page that has sent half of its reading, of a browser that is suspended."""
    url = urlsplit(panel.address)
    with socket.create_connection((url.hostname, url.port)) as asleep:
        lines = [f"{name}: {x}" for name, x in ({"Host": url.netloc} | panel.headers).items()]
        head = ["POST /lab/student HTTP/1.1", *lines, "Content-Length: 100", "", '{"student"']
        asleep.sendall("\r\n".join(head).encode())
        body = json.dumps({"student": "A"})
        assert ask(panel.address, "/lab/student", "POST", body, **panel.headers)[0] == 200
    assert panel.lab.notebook.recorded.student == "A"


def test_the_newest_state_alone_waits(panel: AllPages, monkeypatch: pytest.MonkeyPatch) -> None:
    """A page that is told once in a while misses what was between, and never the last."""
    monkeypatch.setattr(live_page, "TELL_EVERY_S", 0.5)
    with panel.page(BOARD) as one, panel.page(BOARD) as two:
        for number in range(1, 41):
            one.send(json.dumps(panel.right(BOARD) | {"number": number, "rpm": 300 + number}))
            answer_to(one, number)
        told = []
        while not told or told[-1] != 340.0:
            message = json.loads(two.recv(timeout=WAIT_S))
            told += [message["rpm"]] if message["type"] == "moved" else []
    assert told == sorted(told)
    assert len(told) < 40
