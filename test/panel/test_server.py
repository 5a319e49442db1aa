"""Web server of the panel: access, invalid messages, and clients that do not read."""

import ast
import asyncio
import itertools
import json
import os
import random
import re
import signal
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from urllib.parse import urljoin

import numpy as np
import pytest
from starlette.routing import Route
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import cam_rig
from cam_rig.errors import ConfigError
from cam_rig.panel import server
from cam_rig.panel.board.pages import DESIGN, WORKER
from cam_rig.panel.server import STATIC, PanelPages, serve
from cam_rig.viewer.web_server import MAX_MESSAGE

from ..processes import WAIT_S, children, until
from ..viewer.asking import Visitor, ask, local
from .conftest import BENCH, BOARD, received

PATHS = ["/", "/board", "/static/board/law.js", "/other/tm21", "/languages", "/nothing"]
PATHS += ["/save", "/dxf"]


@pytest.fixture
def panel(served):
    """Served panel, once the pages of the previous test have closed."""
    until(lambda: not served.pages._pages and not served.bench._pages)
    yield served


def test_every_path_needs_cookie_and_origin(panel):
    """A request without the cookie or from another site is refused with 403.

    A POST request must also have an Origin header.
    """
    assert panel.home == "/"
    assert "HttpOnly" in panel.set_cookie and "SameSite=Strict" in panel.set_cookie
    status, answered, _ = ask(panel.address, "/", Cookie=panel.cookie)
    policy = answered["Content-Security-Policy"]
    assert status == 200 and "unsafe" not in policy
    assert "default-src 'self'" in policy and "frame-ancestors 'none'" in policy
    cookie = {"Cookie": panel.cookie}
    foreign = cookie | {"Origin": "http://evil.example"}
    for path in PATHS:
        assert [ask(panel.address, path, **headers)[0] for headers in ({}, foreign)] == [403, 403]
    for headers in (cookie, foreign):
        assert ask(panel.address, "/save", "POST", "{}", **headers)[0] == 403


def test_a_websocket_needs_cookie_and_origin(panel):
    """A websocket without the cookie or with another origin is refused with 403."""
    url, valid_headers = f"ws://{panel.url.netloc}/changes", panel.headers
    with connect(url, sock=local(panel.url.port), additional_headers=valid_headers, origin=None):
        pass
    for headers in (
        {"Cookie": panel.cookie},
        valid_headers | {"Cookie": ""},
        valid_headers | {"Origin": "http://x"},
    ):
        with pytest.raises(InvalidStatus, match="403"):
            connect(url, sock=local(panel.url.port), additional_headers=headers, origin=None)


def test_only_the_files_of_the_pages_are_served(panel):
    """Each static file of the pages is served with its media type, and no other file.

    The Python package contains all of them.
    """
    for path in STATIC.glob("*/*"):
        text = path.read_text(encoding="utf-8")
        named = re.findall(r'(?:from|src=|href=)\s*"(\.[^"]+|/static/[^"]+)"', text)
        url_path = f"/static/{path.relative_to(STATIC)}"
        for name in [url_path, *(urljoin(url_path, name) for name in named)]:
            status, headers, _ = ask(panel.address, name, Cookie=panel.cookie)
            assert (name, status) == (name, 200)
            assert "text/plain" not in headers["Content-Type"]
        assert "//cdn" not in text and "https://" not in text
    for name in ("/static/../server.py", "/static/%2e%2e/server.py", "/static//etc/passwd"):
        assert ask(panel.address, name, Cookie=panel.cookie)[0] == 404
    setup = (Path(__file__).parents[2] / "setup.py").read_text(encoding="utf-8")
    assert '"panel/static/*/*"' in setup
    assert all(path.is_file() for path in STATIC.glob("*/*"))
    assert all(path.is_dir() for path in STATIC.iterdir())


class OnePage(PanelPages):
    """Page that never answers. The event `requested` is set by a request."""

    def __init__(self):
        self.requested = threading.Event()
        self.routes = (Route("/", self._answer),)

    async def _answer(self, _):
        self.requested.set()
        await asyncio.sleep(600.0)
        raise AssertionError


def test_a_request_cancelled_at_shutdown_leaves_no_traceback(caplog):
    """A request that is cancelled by the end of the server logs no traceback."""
    page = OnePage()
    with ThreadPoolExecutor() as threads:
        with serve(page) as served:
            visitor = Visitor(served.address)
            asking = threads.submit(ask, served.address, "/", Cookie=visitor.cookie)
            assert page.requested.wait(60.0)
        with suppress(HTTPException, OSError):
            assert asking.result(60.0)[0] == 500
    assert "Cancel 1 running task" in caplog.text  # cancelled, not completed
    assert not [record for record in caplog.records if record.exc_info]
    assert "Traceback" not in caplog.text


def test_an_aborted_post_prints_nothing(panel, caplog, capfd):
    """A client that disconnects during its request causes no traceback.

    The server answers further requests.
    """
    page = open_request(panel, "POST /save HTTP/1.1", {"Content-Length": "1000"}, "{")
    page.close()
    assert panel.get("/languages")  # answered by the same loop
    assert "Traceback" not in caplog.text + capfd.readouterr().err
    assert not [record for record in caplog.records if record.exc_info]


def test_pages_receive_the_requested_language():
    """Pages get the language of the option `language`. An unknown one is refused."""
    with serve(OnePage(), language="es") as served:
        offers = json.loads(Visitor(served.address).get("/languages"))
    assert offers == {"language": "es", "languages": ["en", "es"], "pages": ["/"]}
    message = "--lang: is 'fr'; allowed: en, es"
    with pytest.raises(ConfigError, match=message), serve(OnePage(), language="fr"):
        pass


def test_every_language_has_all_texts_and_no_unused_text():
    """All languages have the same texts with the same placeholders.

    Every text is used by a page, and every text that a page requests exists.
    """
    texts = [json.loads(p.read_text("utf-8")) for p in sorted(STATIC.glob("texts/*.json"))]
    assert len(texts) == 2
    texts_of_first, texts_of_second = texts
    assert list(texts_of_first) == list(texts_of_second)
    for key, sentence in texts_of_first.items():
        assert sorted(re.findall(r"{\w+}", sentence)) == sorted(
            re.findall(r"{\w+}", texts_of_second[key])
        )
        assert (sentence == "") == (texts_of_second[key] == "")
    used, requested = {f"s{i}" for i in range(4)} | {"undercut", "pressure"}, set()
    for path in STATIC.glob("*/*"):
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".html":
            requested |= set(re.findall(r'data-(?:text|turning)="(\w+)"', text))
        if path.suffix == ".js":
            used |= set(re.findall(r'"([a-z_0-9]+)"', text))
            requested |= set(re.findall(r'\btext\("(\w+)"', text))
            prefixes = re.findall(
                r"`([a-z_]+_)\$\{", text
            )  # a composed key, such as `drive_${state}`
            used |= {key for key in texts_of_first if key.startswith(tuple(prefixes))}
    assert requested <= set(texts_of_first) <= used | requested


def message_template(node):
    """Return the message of a call with {1}, {2} for its values.

    The result is None if the message is not a literal.
    """
    if isinstance(node, ast.Constant):
        return node.value
    if not isinstance(node, ast.JoinedStr):
        return None
    numbers = itertools.count(1)
    return "".join(
        part.value if isinstance(part, ast.Constant) else f"{{{next(numbers)}}}"
        for part in node.values
    )


def test_every_refusal_is_translated():
    """Each message of a RefusedError has a translation with the same placeholders."""
    messages = set()
    for path in STATIC.parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "RefusedError":
                messages.add(message_template(node.args[0]))
    messages.discard(None)
    assert len(messages) > 20
    tables = {path.stem: json.loads(path.read_text("utf-8")) for path in STATIC.glob("errors/*")}
    assert sorted(tables) == [name for name in server.languages() if name != "en"]
    for table in tables.values():
        assert messages - table.keys() == set()
        for message, translation in table.items():
            values = [sorted(re.findall(r"{\d}", text)) for text in (message, translation)]
            assert values[0] == values[1]


# -- invalid messages


def answer_to(page, number):
    """Return the answer to the message with this number."""
    while True:
        message = json.loads(page.recv(timeout=WAIT_S))
        if message["type"] in ("fast", "refused") and message["number"] == number:
            return message
        if message["type"] == "answer" and message["answer"] == number:
            return message


TEXTS = ["", "x", "\\ud800", "\\udfff\\ud800", "\\u0000", "é" * 200, "__proto__", "/../..", "\\n"]
NUMBERS = ["9" * 400, "-" + "9" * 5000, "1e999", "NaN", "-Infinity", "1e308", "-0", "5e-324", "7"]


def value(rng, depth=0):
    """Return a random value as JSON, or as almost valid JSON."""
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


def invalid_message(rng, names, count):
    """Return a message whose members are all invalid, or that is not an object."""
    if rng.random() < 0.2:
        return value(rng)
    ordinates = f"[{','.join([rng.choice(NUMBERS[:5])] * count)}]"
    members = {name: ordinates if rng.random() < 0.3 else value(rng) for name in names}
    text = "{" + ",".join(f'"{name}":{member}' for name, member in members.items()) + "}"
    return text if len(text.encode()) <= MAX_MESSAGE else invalid_message(rng, names, count)


#: Messages that are almost valid, or empty.
NEARLY = ["", "[]", "1", "{", "{}", '{"number": 1}', '{"number": 1, "ordinates": [], "rpm": 1}']
NEARLY += ['{"do": 1}', '{"do": "set"}', '{"do": "set_up", "value": [1]}']


@pytest.mark.parametrize("path", [BOARD, BENCH])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_invalid_messages_are_refused_in_one_line_and_the_page_stays(panel, path, seed, caplog):
    """Each invalid message on a websocket is refused in one line.

    It changes nothing, and the next valid message is accepted.
    """
    rng, count, before = random.Random(seed), panel.board.ordinates.size, panel.board.version
    names = ("number", "ordinates", "rpm") if path == BOARD else ("number", "do", "value", "name")
    texts = NEARLY + [invalid_message(rng, names, count) for _ in range(150 if seed else 60)]
    with panel.page(path) as page:
        for number, text in enumerate(texts):
            page.send(text.encode() if rng.random() < 0.2 else text)
            kinds = ("refused", "answer")
            while (answer := json.loads(page.recv(timeout=WAIT_S)))["type"] not in kinds:
                assert answer["type"] != "fast", text[:80]
            assert answer.get("success") is not True, text[:80]
            assert 0 < len(answer["message"]) < 400 and len(answer["message"].splitlines()) == 1
            page.send(json.dumps(panel.valid_message(path) | {"number": number}))
            answer = answer_to(page, number)
            assert answer.get("success", True) and answer["type"] != "refused"
    assert panel.board.version - before == (len(texts) if path == BOARD else 0)
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


def test_invalid_requests_are_refused_in_one_line_and_the_connection_stays(panel, caplog):
    """An invalid POST request is answered with 400 or 409 and one line.

    400 is for a body that is not a JSON object, 409 for a refusal. The connection stays open.
    """
    connection = HTTPConnection("127.0.0.1", panel.url.port, timeout=WAIT_S)
    connection.connect()
    open_socket = connection.sock
    for path, names in POSTS.items():
        rng, statuses = random.Random(path), set()
        bodies = [
            invalid_message(rng, names, panel.board.ordinates.size).encode() for _ in range(16)
        ]
        for body in (*bodies, rng.randbytes(50), b"", b"{}"):
            connection.request("POST", path, body, panel.headers | {"Host": panel.url.netloc})
            answer = connection.getresponse()
            text = json.loads(answer.read())["message"]
            statuses.add(answer.status)
            assert len(text.splitlines()) == 1 and len(text) < 400
            assert connection.sock is open_socket
        assert statuses == {400, 409}, path
    connection.close()
    assert [record.getMessage() for record in caplog.records if record.exc_info] == []
    for name in ("no_such", "%00", "%ff", "%ED%A0%80", "a" * 5000, "..%2f..", "%C3%A9"):
        for path in ("/other", "/bench/cam"):
            status, _, body_text = ask(panel.address, f"{path}/{name}", **panel.headers)
            assert status in (400, 404) and len(body_text.splitlines()) == 1


def test_a_huge_message_closes_only_its_page(panel):
    """A message that is too long closes only the connection of its page."""
    with panel.page(BOARD) as good, panel.page(BOARD) as page:
        page.send("x" * (MAX_MESSAGE + 1))
        with pytest.raises(ConnectionClosed) as closed:
            answer_to(page, None)
        assert closed.value.rcvd.code == 1009
        good.send(json.dumps(panel.valid_message(BOARD) | {"number": 1}))
        assert answer_to(good, 1)["type"] == "fast"


# -- clients that do not read


def open_request(panel, first, more, body=""):
    """Return a socket on which a request was sent, and whose answer is not read."""
    page = socket.socket()
    page.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    page.connect(("127.0.0.1", panel.url.port))
    headers = {"Host": panel.url.netloc} | panel.headers | more
    lines = [first, *(f"{name}: {value}" for name, value in headers.items()), "", body]
    page.sendall("\r\n".join(lines).encode())
    return page


#: Headers of a request for a websocket.
UPGRADE = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
UPGRADE |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}


@pytest.mark.parametrize("path", [BOARD, BENCH])
def test_only_a_page_that_reads_nothing_is_dropped(panel, path, monkeypatch):
    """A client that does not read is disconnected, and other pages are answered."""
    monkeypatch.setattr(server, "MESSAGE_PERIOD_S", 0.0)
    monkeypatch.setattr(server, "SEND_TIMEOUT_S", 1.0)
    pages = panel.pages._pages if path == BOARD else panel.bench._pages
    with panel.page(path) as first, panel.page(path) as second:
        until(lambda: len(pages) == 2)
        sleeper = open_request(panel, f"GET {path} HTTP/1.1", UPGRADE)
        until(lambda: len(pages) == 3)
        number, deadline = 0, time.monotonic() + WAIT_S
        while len(pages) == 3:
            assert time.monotonic() < deadline, "the page that reads nothing was not dropped"
            number += 1
            # A large state fills the network buffers soon.
            monkeypatch.setattr(panel.bench.live, "log", ["x" * 200_000 + str(number)])
            first.send(json.dumps(panel.valid_message(path) | {"number": number}))
            answer_to(first, number)
            second.recv(timeout=WAIT_S)
        assert number > 10
        second.send(json.dumps({"number": -1}))
        assert answer_to(second, -1)["message"]
        assert len(pages) == 2
        sleeper.close()


def test_an_incomplete_request_blocks_no_other(panel):
    """A request is answered while another client's request is still incomplete."""
    length = {"Content-Length": "100"}
    with open_request(panel, "POST /lab/student HTTP/1.1", length, '{"student"'):
        assert panel.send("/lab/student", {"student": "A"})[0] == 200
    assert panel.lab.notebook.recorded.student == "A"


def test_only_the_newest_state_is_queued(panel, monkeypatch):
    """A page that gets few messages receives the newest state, not each earlier one."""
    monkeypatch.setattr(server, "MESSAGE_PERIOD_S", 0.5)
    with panel.page(BOARD) as first, panel.page(BOARD) as second:
        for number in range(1, 41):
            first.send(
                json.dumps(panel.valid_message(BOARD) | {"number": number, "rpm": 300 + number})
            )
            answer_to(first, number)
        speeds = []
        while not speeds or speeds[-1] != 340.0:
            message = json.loads(second.recv(timeout=WAIT_S))
            speeds += [message["rpm"]] if message["type"] == "changed" else []
    assert speeds == sorted(speeds) and len(speeds) < 40


# -- slow results and designs


def test_slow_results_are_those_of_the_last_law_and_a_killed_worker_is_replaced(panel):
    """Slow results have the version and the speed of the newest change.

    If their worker process is killed, this is reported, and another one starts.
    """
    change = {"ordinates": panel.board.ordinates.tolist()}
    with panel.page(BOARD) as page:
        start = panel.board.version
        for number in range(1, 21):
            page.send(json.dumps(change | {"number": number, "rpm": 200 + number}))
        answer = received(page, "full")["full"]
        while answer["version"] < start + 20:
            answer = received(page, "full")["full"]
        assert answer["rpm"] == 220.0
        for child in child_processes(WORKER):
            os.kill(child, signal.SIGKILL)
        page.send(json.dumps(change | {"number": 21, "rpm": 200}))
        assert "ended" in received(page, "full")["full"]["message"]
        page.send(json.dumps(change | {"number": 22, "rpm": 200}))
        assert "jump" in received(page, "full")["full"]


def child_processes(*arguments):
    """Return the IDs of child processes whose command lines contain these words."""
    return [pid for pid, command in children(os.getpid()).items() if {*arguments} <= {*command}]


def design(panel, name):
    """Request a design and return status and answer."""
    return panel.send("/design", {"name": name})


@pytest.mark.slow
def test_one_design_runs_at_a_time_and_can_be_stopped(panel):
    """A second design at the same time is refused.

    A stopped design leaves no process and no file.
    """
    out = panel.board.out
    for name in ("start", "other"):
        panel.board.save(name, panel.board.drawn.ordinates.tolist())
    with panel.page(BOARD) as page:
        assert design(panel, "start")[0] == 202
        status, reply = design(panel, "other")
        assert status == 409 and "stop it first" in reply["message"]
        assert panel.post("/design/stop")[0] == 200
        while not received(page, "design")["design"].get("stopped"):
            pass
        assert child_processes(WORKER, DESIGN) == []
        assert sorted(path.name for path in out.iterdir()) == ["other.yaml", "start.yaml"]


@pytest.mark.slow
def test_a_design_that_fails_reports_the_reason(panel):
    """A design that cannot be computed is answered with the reason.

    Reasons are a start law that is not saved, an invalid name, and an unsupported follower.
    """
    status, reply = design(panel, "nothing")
    assert status == 409 and "nothing.yaml" in reply["message"]
    for name in ("../poly345", "", "A"):
        status, reply = design(panel, name)
        assert status == 409 and reply["message"].startswith("name: allowed")
    frame = Path(__file__).parents[2] / "config/cams/constant_breadth.yaml"
    panel.board.out.mkdir(exist_ok=True)
    (panel.board.out / "frame.yaml").write_text(frame.read_text(encoding="utf-8"))
    with panel.page(BOARD) as page:
        assert design(panel, "frame")[0] == 202
        assert "got constant_breadth" in received(page, "design")["design"]["message"]


@pytest.mark.long
@pytest.mark.slow
def test_a_design_reports_its_progress_and_is_written(panel):
    """A design reports rising jump speeds and writes a cam file with its best law.

    The page receives the law of the file. A second design does not overwrite the file.
    """
    board = panel.board
    board.save("begin", board.drawn.ordinates.tolist())
    with panel.page(BOARD) as page:
        assert design(panel, "begin")[0] == 202
        message, best = received(page, "design")["design"], []
        while "best_rpm" in message:
            best.append(message["best_rpm"])
            message = received(page, "design")["design"]
    assert best and best == sorted(best)
    law = cam_rig.build_law(cam_rig.load_cam(message["path"]))
    jump = cam_rig.jump_speed(law, board.rig).rpm
    assert message["rpm"] == pytest.approx(jump, rel=1e-3)
    assert jump > 1.2 * cam_rig.jump_speed(board.drawn.start.law, board.rig).rpm
    assert message["law"]["law"]["breaks"] == law.breaks.tolist()
    off = np.abs(np.array(message["law"]["law"]["ordinates"]).T - law.ordinates).max()
    assert off <= 1e-9 * law.lift
    status, reply = design(panel, "begin")
    assert status == 409 and "begin_designed.yaml: exists already" in reply["message"]
