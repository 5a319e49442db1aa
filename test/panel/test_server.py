"""Who gets what: pages with the token, of this host and origin, and nobody else."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import socket
import threading
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from http.client import HTTPException
from pathlib import Path
from urllib.parse import urljoin, urlsplit

import pytest
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from cam_rig.errors import ConfigError
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import STATIC, serve

from .asking import ask

PATHS = ["/", "/board", "/static/board/law.js", "/other/tm21", "/languages", "/nothing"]
PATHS += ["/save", "/dxf"]


@pytest.fixture
def cookie(address: str) -> str:
    """What the printed address is answered with."""
    url = urlsplit(address)
    status, headers, _ = ask(address, f"/?{url.query}")
    assert (status, headers["Location"]) == (303, "/")
    words = headers["Set-Cookie"]
    assert "HttpOnly" in words
    assert "SameSite=Lax" in words
    return str(words.split(";")[0])


def test_the_token_becomes_a_cookie_with_which_the_page_is_read(address: str, cookie: str) -> None:
    """The address in the browser's history has no token any more."""
    assert address.startswith("http://127.0.0.1:")
    status, headers, body = ask(address, "/", Cookie=cookie)
    assert status == 200
    assert b"main.js" in body
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert "unsafe" not in headers["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert ask(address, "/board", Cookie=cookie)[0] == 200


def test_without_the_token_there_is_nothing(address: str, cookie: str) -> None:
    """Neither page nor file, also with another's token."""
    name = cookie.split("=", maxsplit=1)[0]
    for path in PATHS:
        for wrong in ({}, {"Cookie": f"{name}=wrong"}, {"Cookie": f"{name}="}, {"Cookie": "é=1"}):
            status, _, body = ask(address, path, **wrong)
            assert status == 403
            assert b"token" in body
        assert ask(address, f"{path}?token=wrong", Cookie=cookie)[0] == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", ""])
def test_another_host_name_gets_nothing(address: str, cookie: str, host: str) -> None:
    """A site whose name is made to point to this machine, even with the cookie."""
    host = host.format(port=urlsplit(address).port)
    for path in PATHS:
        assert ask(address, path, Cookie=cookie, Host=host)[0] == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:{port}"])
def test_another_origin_gets_nothing(address: str, cookie: str, origin: str) -> None:
    """Neither by a request nor by a websocket; a POST without an origin is refused too."""
    origin = origin.format(port=urlsplit(address).port)
    for path in PATHS:
        assert ask(address, path, Cookie=cookie, Origin=origin)[0] == 403
    assert ask(address, "/save", "POST", "{}", Cookie=cookie, Origin=origin)[0] == 403
    assert ask(address, "/save", "POST", "{}", Cookie=cookie)[0] == 403


def socket_status(address: str, **headers: str) -> int:
    """How a websocket's handshake is answered."""
    url = urlsplit(address)
    given = {name: value for name, value in headers.items() if name != "Host"}
    try:
        with connect(f"ws://{url.netloc}/changes", additional_headers=given, origin=None):
            return 101
    except InvalidStatus as error:
        return error.response.status_code


def test_a_websocket_needs_cookie_and_origin(address: str, cookie: str) -> None:
    """As a page of the panel sends them: both, and nothing else will do."""
    own = "http://" + urlsplit(address).netloc
    assert socket_status(address, Cookie=cookie, Origin=own) == 101
    assert socket_status(address, Cookie=cookie) == 403
    assert socket_status(address, Origin=own) == 403
    assert socket_status(address, Cookie=f"{cookie}x", Origin=own) == 403
    assert socket_status(address, Cookie=cookie, Origin="http://evil.example") == 403


@pytest.mark.parametrize(
    "text", ["", "[]", "1", "{", "{}", '{"number": 1}', '{"number": 1, "ordinates": [], "rpm": 1}']
)
def test_a_wrong_message_is_refused_and_the_next_is_taken(
    board: Board, address: str, cookie: str, text: str
) -> None:
    """The page is told why, and what was drawn stays."""
    headers = {"Cookie": cookie, "Origin": "http://" + urlsplit(address).netloc}
    with connect(
        f"ws://{urlsplit(address).netloc}/changes", additional_headers=headers, origin=None
    ) as page:
        assert json.loads(page.recv())["type"] == "moved"
        page.send(text)
        answer = next_of(page, "refused")
        assert "allowed" in answer["words"]
        assert board.version == 0
        change = {"number": 7, "ordinates": board.ordinates.tolist(), "rpm": 250}
        page.send(json.dumps(change))
        assert next_of(page, "exact")["number"] == 7
        assert board.rpm == 250.0


def next_of(page: object, kind: str) -> dict:
    """The next message of a kind."""
    while True:
        message = json.loads(page.recv(timeout=60))  # type: ignore[attr-defined]
        if message["type"] == kind:
            return dict(message)


def test_only_the_last_law_is_answered_at_rest(board: Board, address: str, cookie: str) -> None:
    """What comes late is of the newest change, and says of which."""
    headers = {"Cookie": cookie, "Origin": "http://" + urlsplit(address).netloc}
    with connect(
        f"ws://{urlsplit(address).netloc}/changes", additional_headers=headers, origin=None
    ) as page:
        assert next_of(page, "rest")["version"] == 0
        for number in range(1, 21):
            change = {"number": number, "ordinates": board.ordinates.tolist(), "rpm": 200 + number}
            page.send(json.dumps(change))
        answer = next_of(page, "rest")
        while answer["version"] < 20:
            answer = next_of(page, "rest")
        assert answer["rpm"] == 220.0


def test_a_worker_that_is_killed_is_named_and_another_begins(
    board: Board, address: str, cookie: str
) -> None:
    """The next change is answered again."""
    headers = {"Cookie": cookie, "Origin": "http://" + urlsplit(address).netloc}
    with connect(
        f"ws://{urlsplit(address).netloc}/changes", additional_headers=headers, origin=None
    ) as page:
        assert "jump" in next_of(page, "rest")
        tasks = Path(f"/proc/{os.getpid()}/task").glob("*/children")
        for child in (number for task in tasks for number in task.read_text().split()):
            if b"cam_rig.panel.board.worker" in Path(f"/proc/{child}/cmdline").read_bytes():
                os.kill(int(child), signal.SIGKILL)
        change = {"number": 1, "ordinates": board.ordinates.tolist(), "rpm": 200}
        page.send(json.dumps(change))
        assert "ended" in next_of(page, "rest")["words"]
        page.send(json.dumps(change | {"number": 2}))
        assert "jump" in next_of(page, "rest")


def test_the_page_asks_for_no_file_that_is_not_there(address: str, cookie: str) -> None:
    """Every module and style that a file names is served, with its kind."""
    for path in STATIC.glob("*/*"):
        text = path.read_text(encoding="utf-8")
        named = re.findall(r'(?:from|src=|href=)\s*"(\.[^"]+|/static/[^"]+)"', text)
        own = f"/static/{path.relative_to(STATIC)}"
        for name in [own, *(urljoin(own, name) for name in named)]:
            status, headers, _ = ask(address, name, Cookie=cookie)
            assert (name, status) == (name, 200)
            assert "text/plain" not in headers["Content-Type"]
        assert "//cdn" not in text
        assert "https://" not in text


def test_a_folder_is_not_left(address: str, cookie: str) -> None:
    """Nothing beside the page's own files."""
    for path in ("/static/../server.py", "/static/%2e%2e/server.py", "/static//etc/passwd"):
        assert ask(address, path, Cookie=cookie)[0] == 404


def test_a_port_in_use_is_named(board: Board) -> None:
    """With what to do about it."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        words = f"--port: {port} is in use; allowed: another"
        with pytest.raises(ConfigError, match=words), serve(BoardPages(board), port=port):
            pass


def test_the_contour_is_answered_as_a_file_or_refused_in_words(
    board: Board, address: str, cookie: str
) -> None:
    """DXF for the board's ordinates; for others than a list of them the reason."""
    own = "http://" + urlsplit(address).netloc
    body = json.dumps({"ordinates": board.ordinates.tolist()})
    status, headers, drawn = ask(address, "/dxf", "POST", body, Cookie=cookie, Origin=own)
    assert (status, headers["Content-Type"]) == (200, "image/vnd.dxf")
    assert drawn.rstrip().endswith(b"EOF")
    status, _, words = ask(address, "/dxf", "POST", "{}", Cookie=cookie, Origin=own)
    assert status == 409
    assert b"ordinates: allowed" in words


def test_pages_are_told_the_language_that_was_asked_for(board: Board) -> None:
    """Beside all that there are; another is refused by name before anything is served."""
    with serve(BoardPages(board), language="es") as served:
        url = urlsplit(served.address)
        answer = ask(served.address, f"/languages?{url.query}")
        cookie = str(answer[1]["Set-Cookie"]).split(";")[0]
        found = json.loads(ask(served.address, "/languages", Cookie=cookie)[2])
    assert (found["language"], found["languages"]) == ("es", ["en", "es"])
    assert "/" in found["pages"]
    assert "/lab" not in found["pages"]
    with (
        pytest.raises(ConfigError, match="--lang: is 'fr'; allowed: en, es"),
        serve(BoardPages(board), language="fr"),
    ):
        pass


def test_every_language_has_the_same_texts() -> None:
    """The same keys in the same order, each with the same values in its words, none left empty."""
    texts = [json.loads(p.read_text(encoding="utf-8")) for p in STATIC.glob("texts/*.json")]
    assert len(texts) == 2
    one, other = texts
    assert list(one) == list(other)
    for key, words in one.items():
        assert sorted(re.findall(r"{\w+}", words)) == sorted(re.findall(r"{\w+}", other[key]))
        assert (words == "") == (other[key] == "")


def test_every_word_of_the_page_is_in_the_texts() -> None:
    """A language is one file: nothing is asked of it that it has not, or has in vain."""
    words = json.loads((STATIC / "texts" / "en.json").read_text(encoding="utf-8"))
    used, asked = set(), set()
    for path in STATIC.glob("*/*"):
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".html":
            asked |= set(re.findall(r'data-text="(\w+)"', text))
        if path.suffix == ".js":
            used |= set(re.findall(r'"([a-z_0-9]+)"', text))
            used |= {f"s{i}" for i in range(4)} | {"undercut", "pressure"}
            begun = re.findall(r"`([a-z_]+_)\$\{", text)  # a key put together, as `drive_${state}`
            used |= {key for key in words if key.startswith(tuple(begun))}
    assert asked <= set(words) <= used | asked


def test_the_files_are_in_the_package() -> None:
    """As many as a wheel is told to take."""
    setup = (Path(__file__).parents[2] / "setup.py").read_text(encoding="utf-8")
    assert '"panel/static/*/*"' in setup
    assert all(path.is_file() for path in STATIC.glob("*/*"))
    assert all(path.is_dir() for path in STATIC.iterdir())


class EndlessPages:
    """One request that is never answered, as a long turn of the lab; ``asked`` when it has come."""

    def __init__(self) -> None:
        self.asked = threading.Event()
        self.routes = (Route("/", self._answer),)

    @asynccontextmanager
    async def alive(self) -> AsyncIterator[None]:
        yield

    async def _answer(self, _: Request) -> Response:
        self.asked.set()
        await asyncio.sleep(600.0)
        raise AssertionError


def test_a_request_that_the_end_cuts_off_leaves_no_traceback(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Ctrl-C while a turn is computed: the request is cancelled, and nothing is said of it."""
    pages = EndlessPages()
    with ThreadPoolExecutor() as threads:
        with serve(pages) as served:
            url = urlsplit(served.address)
            cookie = ask(served.address, f"/?{url.query}")[1]["Set-Cookie"].split(";")[0]
            asking = threads.submit(ask, served.address, "/", Cookie=cookie)
            assert pages.asked.wait(60.0)
        with suppress(HTTPException, OSError):
            assert asking.result(60.0)[0] == 500
    assert "Cancel 1 running task" in caplog.text  # it was cut off, not over
    assert not [record for record in caplog.records if record.exc_info]
    assert "Traceback" not in caplog.text
