"""The page server: the recording, Rerun's own viewer behind a guard, and nothing else."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from cam_rig.viewer import live_folder
from cam_rig.viewer.live_folder import new_recording, next_part, page_delay
from cam_rig.viewer.process import HOST
from cam_rig.viewer.server import Pages, serve, serve_file

RECORDED = b"RRF2 of a kind"


class Reader:
    """Asks a server for its paths, with the cookie that its address is answered with."""

    def __init__(self, address: str) -> None:
        self.url = urlsplit(address)
        status, headers, _ = self.get(f"/?{self.url.query}")
        assert (status, headers["Location"][:2]) == (302, "/?")
        assert "HttpOnly" in headers["Set-Cookie"]
        self.cookie = headers["Set-Cookie"].split(";")[0]
        self.home = headers["Location"]

    def open(self, path: str, **headers: str) -> HTTPConnection:
        """A connection on which a path has been asked for."""
        connection = HTTPConnection(HOST, self.url.port, timeout=20)
        connection.putrequest("GET", path, skip_host=True)
        for name, value in ({"Host": self.url.netloc} | headers).items():
            connection.putheader(name, value)
        connection.endheaders()
        return connection

    def get(self, path: str, **headers: str) -> tuple:
        """Status, headers and body."""
        connection = self.open(path, **headers)
        answer = connection.getresponse()
        found = answer.status, answer.headers, answer.read()
        connection.close()
        return found

    def own(self, path: str) -> bytes:
        """The body of a path, as a page of its own asks for it."""
        status, _, body = self.get(path, Cookie=self.cookie)
        assert status == 200
        return body


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reader]:
    path = tmp_path_factory.mktemp("web") / "a run.rrd"
    path.write_bytes(RECORDED)
    with serve_file(path) as address:
        yield Reader(address)


def test_the_address_leads_to_the_viewer_and_the_viewer_to_the_recording(page: Reader) -> None:
    """The token leaves the address; the page is told by name what to show, and asks nobody else."""
    status, headers, body = page.get(page.home, Cookie=page.cookie)
    assert (status, "token" in page.home) == (200, False)
    assert b'"https://fonts' not in body
    assert body.index(b"window.fetch = ") < body.index(b"re_viewer.js")
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'self' ")
    assert "http://127.0.0.1:*" not in policy.split("frame-ancestors")[0]
    name = page.own("/shown?ns=-1")
    assert name == b"a%20run.rrd"
    assert page.own(f"/{name.decode()}") == RECORDED


def test_the_viewers_own_files_are_handed_on(page: Reader) -> None:
    """Code and WebAssembly come through; what there is not is not found."""
    assert b"wasm" in page.own("/re_viewer.js")
    assert page.own("/re_viewer_bg.wasm").startswith(b"\0asm")
    assert page.get("/../../etc/passwd", Cookie=page.cookie)[0] == 404


PATHS = ["/", "/a%20run.rrd", "/re_viewer.js", "/shown?ns=1", "/nothing"]


@pytest.mark.parametrize("path", PATHS)
def test_without_the_token_there_is_nothing(page: Reader, path: str) -> None:
    """Neither recording nor viewer: to another user, to a site of another name, to its pages."""
    assert page.get(path, Cookie=page.cookie)[0] != 403
    wrong: list[dict[str, str]] = [{}, {"Cookie": page.cookie[:-1]}, {"Cookie": "x=y"}]
    hosts = ("evil.example", f"evil.example:{page.url.port}", HOST, "")
    wrong += [{"Cookie": page.cookie, "Host": host} for host in hosts]
    wrong += [{"Cookie": page.cookie, "Origin": "http://evil.example"}]
    for headers in wrong:
        status, answered, body = page.get(path, **headers)
        assert (status, answered["Set-Cookie"]) == (403, None)
        assert RECORDED not in body
    assert page.get(f"{path.partition('?')[0]}?token=wrong", Cookie=page.cookie)[0] == 403


def listening_ports(pids: list[int]) -> set[int]:
    """The TCP ports at which processes listen."""
    inodes = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").iterdir():
            try:
                inodes.add(os.readlink(link).removeprefix("socket:[").rstrip("]"))
            except OSError:  # closed meanwhile
                continue
    rows = [
        row.split()
        for name in ("tcp", "tcp6")
        for row in Path(f"/proc/net/{name}").read_text().splitlines()[1:]
    ]
    return {int(row[1].split(":")[1], 16) for row in rows if row[3] == "0A" and row[9] in inodes}


def children(pid: int) -> list[int]:
    """A process and all that it has begun."""
    found = [pid]
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in task.read_text().split():
            found += children(int(child))
    return found


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's own tables")
@pytest.mark.parametrize("live", [False, True], ids=["file", "live"])
def test_no_port_is_open_that_asks_for_no_token(tmp_path: Path, live: bool) -> None:
    """Of the server's process and of what it has begun: each port refuses who has no token."""
    (tmp_path / "a.rrd").write_bytes(RECORDED)
    script = (
        "import sys, time; from pathlib import Path\n"
        "from cam_rig.viewer.server import serve, serve_file\n"
        f"with serve{'()' if live else '_file(Path(sys.argv[1]))'} as pages:\n"
        "  print(getattr(pages, 'address', pages), flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "a.rrd")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            address = server.stdout.readline().strip()
            ports = listening_ports(children(server.pid))
            assert ports == {urlsplit(address).port}
            assert Reader(address).get("/")[0] == 403
        finally:
            server.kill()


@pytest.fixture
def live() -> Iterator[tuple[Pages, Reader]]:
    with serve() as pages:
        yield pages, Reader(pages.address)


def test_a_live_run_is_sent_while_it_is_written(live: tuple[Pages, Reader]) -> None:
    """What is written comes at once; the next run is named, and ends what was sent of this one."""
    pages, reader = live
    assert reader.own("/shown?ns=-1") == b""
    recording = new_recording(pages.folder)
    with recording.open("wb", buffering=0) as node:
        node.write(b"begin")
        name = reader.own("/shown?ns=-1").decode()
        assert name == recording.name
        connection = reader.open(f"/{name}", Cookie=reader.cookie)
        answer = connection.getresponse()
        assert answer.read(5) == b"begin"
        node.write(b"more")
        assert answer.read(4) == b"more"
        node.write(b"last")
        new_recording(pages.folder).write_bytes(b"another")
        assert answer.read() == b"last"
        assert reader.own("/shown?ns=1").decode() != name
        connection.close()


def test_a_page_that_reads_nothing_holds_no_other_up(live: tuple[Pages, Reader]) -> None:
    """Its own thread waits for it; the run is written, and another page has it whole."""
    pages, reader = live
    recording = new_recording(pages.folder)
    with recording.open("wb", buffering=0) as node:
        node.write(b"begin")
        asleep = reader.open(f"/{recording.name}", Cookie=reader.cookie)
        for _ in range(64):
            node.write(bytes(1 << 20))
        awake = reader.open(f"/{recording.name}", Cookie=reader.cookie)
        assert len(awake.getresponse().read(5 + (64 << 20))) == 5 + (64 << 20)
        for connection in (asleep, awake):
            connection.close()


def test_a_long_run_goes_on_from_part_to_part(
    live: tuple[Pages, Reader], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One answer has them one after the other; a page that comes late has first part and newest."""
    pages, reader = live
    monkeypatch.setattr(live_folder, "MAX_PART", 1)
    first = part = new_recording(pages.folder)
    part.write_bytes(b"0")
    connection = reader.open(f"/{first.name}", Cookie=reader.cookie)
    answer = connection.getresponse()
    assert answer.read(1) == b"0"
    for i in range(1, 10):
        part = next_part(part) or part
        part.write_bytes(b"%d" % i)
        assert answer.read(1) == b"%d" % i
    kept = b"0" + b"".join(b"%d" % i for i in range(10 - live_folder.KEPT_PARTS, 10))
    late = reader.open(f"/{first.name}", Cookie=reader.cookie)
    assert late.getresponse().read(len(kept)) == kept
    for each in (answer, connection, late):
        each.close()


def test_a_closed_page_is_followed_no_more(live: tuple[Pages, Reader]) -> None:
    """Also where nothing more is written, which alone would tell."""
    pages, reader = live
    new_recording(pages.folder).write_bytes(b"begin")
    name, before = reader.own("/shown?ns=-1").decode(), set(threading.enumerate())
    connection = reader.open(f"/{name}", Cookie=reader.cookie)
    answer = connection.getresponse()
    assert answer.read(5) == b"begin"
    (follows,) = set(threading.enumerate()) - before
    answer.close()
    connection.close()
    follows.join(timeout=20.0)
    assert not follows.is_alive()


def test_the_page_says_what_it_shows(live: tuple[Pages, Reader]) -> None:
    """The served page carries the script; what it says ends the waiting, and the node reads it."""
    pages, reader = live
    assert b"/shown?ns=" in reader.own(reader.home)
    waiting = threading.Thread(target=pages.page.wait, daemon=True)
    waiting.start()
    pages.page.driven(0.5)
    reader.own("/shown?ns=500000000")
    waiting.join(timeout=20.0)
    assert not waiting.is_alive()
    assert pages.page.behind() is not None
    assert page_delay(pages.folder) is not None


@pytest.mark.parametrize(
    "asked",
    [
        b"foo",
        b"@x.invalid/y",
        b":1/y",
        b"http://x.invalid/",
        b"/a\x01b",
        b"/\xe9",
        b"x:y@z.invalid",
    ],
)
def test_what_is_no_path_is_refused(
    page: Reader, asked: bytes, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing asked for is taken for a host, so that no name is looked up; no traceback."""
    looked_up: list[object] = []
    original = socket.getaddrinfo

    def spied(host: object, *rest: object, **more: object) -> object:
        looked_up.append(host)
        return original(host, *rest, **more)  # type: ignore[arg-type]

    port = page.url.port
    with socket.create_connection((HOST, port), timeout=20) as asker:
        monkeypatch.setattr(socket, "getaddrinfo", spied)
        asker.sendall(b"GET " + asked + b" HTTP/1.1\r\nHost: %s:%d\r\n\r\n" % (HOST.encode(), port))
        answer = b"".join(iter(lambda: asker.recv(4096), b""))
    assert answer.startswith(b"HTTP/1.0 400 ")
    assert set(looked_up) <= {HOST}
    assert "Traceback" not in capfd.readouterr().err
