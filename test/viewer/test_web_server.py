"""Tests of the web page with Rerun's viewer, served only with a secret token."""

import itertools
import os
import re
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest

from cam_rig.errors import CamRigError
from cam_rig.live.sockets import LOOPBACK
from cam_rig.viewer import page as page_module
from cam_rig.viewer.page import PageTime, new_recording, page_delay, page_script
from cam_rig.viewer.rerun_page import serve, serve_file
from cam_rig.viewer.timeline import RIG_TIME
from cam_rig.viewer.web_server import LOCAL_HOST, Access, _has_ipv6_loopback

from ..processes import WAIT_S, children, ended, sockets, until
from .asking import Visitor, ask, opened

RECORDED = b"RRF2 of a kind"

# -- access control

ACCESS = Access(8123, "right")
OWN = f"{LOCAL_HOST}:8123"
HOSTS = {OWN: True, "127.0.0.1:8123": False, "localhost:8123": False, LOCAL_HOST: False}
ORIGINS = {
    None: True,
    f"http://{OWN}": True,
    "http://127.0.0.1:8123": False,
    f"http://{LOCAL_HOST}:8124": False,
    "null": False,
    f"https://{OWN}": False,
}
COOKIES = {
    "cam_rig_8123=right": True,
    "a=b; cam_rig_8123=right; c": True,
    "cam_rig_8124=right": False,
    "cam_rig_8123=righ": False,
    "cam_rig_8123=": False,
    'cam_rig_8123="right"': False,  # quotes are kept: removing is slow
    "é\ud800=1": False,
    "": False,
}


def test_host_origin_and_cookie_must_all_be_right():
    """A request with a wrong host, origin or cookie is refused by the page server.

    The reason is one line, which does not contain the secret token.
    """
    for host, origin, cookie, needed in itertools.product(HOSTS, ORIGINS, COOKIES, (False, True)):
        given = {"host": host, "origin": origin, "cookie": cookie}
        headers = {name: value for name, value in given.items() if value is not None}
        reason = ACCESS.refusal_reason(headers, None, needed)
        right = HOSTS[host] and ORIGINS[origin] and COOKIES[cookie]
        assert (reason == "") == (right and not (needed and origin is None)), given
        assert reason == "" or "must be" in reason or "token is missing or wrong" in reason
        assert "right" not in reason
        assert len(reason.splitlines()) <= 1


def test_a_token_in_the_address_takes_precedence_and_is_unique():
    """A wrong token in a page's address is refused even with the right cookie.

    A token is a secret in the printed address. Tokens are long and unique.
    """
    headers = {"host": OWN}
    assert ACCESS.refusal_reason(headers, "right") == ""
    for wrong in ("", "wrong", "\ud800"):
        assert ACCESS.refusal_reason(headers | {"cookie": "cam_rig_8123=right"}, wrong) != ""
    tokens = {Access(1).token for _ in range(100)}
    assert len(tokens) == 100 and min(map(len, tokens)) >= 32


# -- page of a recording


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Client of a page server that serves one recording."""
    path = tmp_path_factory.mktemp("web") / "a run.rrd"
    path.write_bytes(RECORDED)
    with serve_file(path) as address:
        yield Visitor(address)


def test_the_address_leads_to_the_viewer_and_the_viewer_to_the_recording(page):
    """The printed address leads to the viewer, which loads the recording.

    The token is removed from the address. No part comes from another host.
    """
    assert "token" not in page.home and "HttpOnly; Path=/; SameSite=Strict" in page.set_cookie
    status, headers, body = ask(page.address, page.home, Cookie=page.cookie)
    assert (status, headers.get_content_type()) == (200, "text/html")
    assert b'"https://fonts' not in body
    assert body.index(b"window.fetch = ") < body.index(b"re_viewer.js")
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'self' ")
    assert "localhost" not in policy.split("frame-ancestors")[0]
    name = page.get("/shown?ns=-1").decode()
    assert name == "a%20run.rrd"
    assert page.get(f"/{name}") == RECORDED
    assert ask(page.address, f"/{name}")[0] == ask(page.address, "/re_viewer.js")[0] == 403
    assert b"wasm" in page.get("/re_viewer.js")
    assert page.get("/re_viewer_bg.wasm").startswith(b"\0asm")
    assert ask(page.address, "/", Cookie=page.cookie)[1]["Location"] == page.home
    assert ask(page.address, "/../../etc/passwd", Cookie=page.cookie)[0] == 404


def test_the_cookie_belongs_to_a_host_that_no_other_server_knows(page):
    """Each process has a random host name, to which its cookie belongs.

    Otherwise the browser would send the cookie to the servers at all ports of the host.
    """
    assert page.url.hostname == LOCAL_HOST and "Domain" not in page.set_cookie
    code = "from cam_rig.viewer.web_server import LOCAL_HOST; print(LOCAL_HOST)"
    names = {ended(sys.executable, "-c", code).stdout.strip() for _ in range(2)}
    assert len(names | {LOCAL_HOST}) == 3 and all(name.endswith(".localhost") for name in names)


@pytest.mark.skipif(not _has_ipv6_loopback(), reason="this machine has no IPv6 loopback")
def test_no_other_server_can_take_the_same_port_of_ipv6(page):
    """No other process can listen on IPv6 at the port of the page server.

    A browser tries both loopback addresses.
    """
    with socket.socket(socket.AF_INET6) as other, pytest.raises(OSError, match="in use"):
        other.bind(("::1", page.url.port))


def test_the_entry_page_leads_to_no_other_host(page):
    """The page that sets the cookie redirects only to its server, for any path."""
    for path in ("/%2Fevil.example", "/%5Cevil.example", "/%22%3E%3Cscript%3E"):
        status, _, body = ask(page.address, f"{path}?{page.url.query}")
        led = re.search(rb'0; url=([^"]*)"', body)[1]
        assert status == 200 and re.fullmatch(rb"/[\w.%]+", led), (path, body)


def test_requests_without_the_cookie_are_refused(page):
    """A request without the cookie, or from another site, is answered with 403.

    The answer contains neither recording nor cookie.
    """
    cookie = {"Cookie": page.cookie}
    for path in ("/", "/a%20run.rrd", "/re_viewer.js", "/shown?ns=1", "/nothing"):
        assert ask(page.address, path, **cookie)[0] != 403
        for headers in ({}, cookie | {"Origin": "http://evil.example"}):
            status, answered, body = ask(page.address, path, **headers)
            assert (status, answered["Set-Cookie"]) == (403, None)
            assert RECORDED not in body


INVALID_PATHS = [
    b"foo",
    b"@x.invalid/y",
    b":1/y",
    b"http://x.invalid/",
    b"/a\x01b",
    b"/\xe9",
    b"x:y@z",
    b"//x.invalid/",
]


def test_invalid_paths_are_refused(page, capfd, monkeypatch):
    """An invalid path is answered with 400, without a name lookup or a traceback."""
    resolved = []
    original = socket.getaddrinfo

    def spied(host, *rest, **more):
        resolved.append(host)
        return original(host, *rest, **more)

    for path in INVALID_PATHS:
        with socket.create_connection((LOOPBACK, page.url.port), timeout=WAIT_S) as asker:
            monkeypatch.setattr(socket, "getaddrinfo", spied)
            lines = (b"GET " + path + b" HTTP/1.1", b"Host: " + page.url.netloc.encode())
            asker.sendall(b"\r\n".join((*lines, b"Connection: close", b"", b"")))
            answer = b"".join(iter(lambda: asker.recv(4096), b""))
            monkeypatch.undo()
        assert answer.startswith(b"HTTP/1.1 400 "), path
    assert set(resolved) <= {LOOPBACK}
    assert "Traceback" not in capfd.readouterr().err


def listening_ports(pids):
    """Return the TCP ports at which the processes with these ids listen."""
    rows = [row for pid in pids for row in sockets(pid, "tcp", "tcp6")]
    return {int(row[1].split(":")[1], 16) for row in rows if row[3] == "0A"}


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's own tables")
def test_every_open_port_requires_the_token(tmp_path):
    """Each port of a process that serves a file and a live run requires the token.

    The token is a secret in the printed address.
    """
    (tmp_path / "a.rrd").write_bytes(RECORDED)
    script = (
        "import sys, time; from pathlib import Path\n"
        "from cam_rig.viewer.rerun_page import serve, serve_file\n"
        "with serve() as pages, serve_file(Path(sys.argv[1])) as address:\n"
        "  print(pages.address, address, flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "a.rrd")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            addresses = server.stdout.readline().split()
            pids = [server.pid]
            for pid in pids:
                pids += children(pid)
            ports = listening_ports(pids)
            assert ports == {urlsplit(address).port for address in addresses}
            assert [ask(address, "/")[0] for address in addresses] == [403, 403]
        finally:
            server.kill()


# -- page of a live run


@pytest.fixture(scope="module")
def served():
    """Page server of live runs, and its client."""
    with serve() as pages:
        yield pages, Visitor(pages.address)


@pytest.fixture
def live(served):
    """Page server and its client, before a run has started."""
    for recording in served[0].folder.iterdir():
        recording.unlink()
    return served


def test_a_live_run_is_sent_while_it_is_written(live):
    """Data of a live run are sent while the run writes them.

    A new run ends the response of the previous run.
    """
    pages, reader = live
    assert reader.get("/shown?ns=-1") == b""
    recording = new_recording(pages.folder)
    with recording.open("wb", buffering=0) as node:
        node.write(b"begin")
        name = reader.get("/shown?ns=-1").decode()
        assert name == recording.name
        connection = opened(reader.address, f"/{name}", Cookie=reader.cookie)
        answer = connection.getresponse()
        assert answer.read(5) == b"begin"
        node.write(b"more")
        assert answer.read(4) == b"more"
        node.write(b"last")
        new_recording(pages.folder).write_bytes(b"another")
        assert answer.read() == b"last"
        assert reader.get("/shown?ns=1").decode() != name
        connection.close()


def test_a_page_that_does_not_read_blocks_no_other_page(live):
    """A viewer page that does not read blocks neither the run nor another page."""
    pages, reader = live
    recording = new_recording(pages.folder)
    with recording.open("wb", buffering=0) as node:
        node.write(b"begin")
        asleep = opened(reader.address, f"/{recording.name}", Cookie=reader.cookie)
        for _ in range(64):
            node.write(bytes(1 << 20))
        awake = opened(reader.address, f"/{recording.name}", Cookie=reader.cookie)
        assert len(awake.getresponse().read(5 + (64 << 20))) == 5 + (64 << 20)
        for connection in (asleep, awake):
            connection.close()


def test_a_long_run_is_sent_part_by_part(live, monkeypatch):
    """One response contains all parts of a long run.

    A page that is opened later receives the first and the newest parts.
    """
    pages, reader = live
    monkeypatch.setattr(page_module, "MAX_PART", 1)
    first = part = new_recording(pages.folder)
    part.write_bytes(b"0")
    connection = opened(reader.address, f"/{first.name}", Cookie=reader.cookie)
    answer = connection.getresponse()
    assert answer.read(1) == b"0"
    for i in range(1, 10):
        part = page_module.next_part(part) or part
        part.write_bytes(b"%d" % i)
        assert answer.read(1) == b"%d" % i
    kept = b"0" + b"".join(b"%d" % i for i in range(10 - page_module.KEPT_PARTS, 10))
    late = opened(reader.address, f"/{first.name}", Cookie=reader.cookie)
    assert late.getresponse().read(len(kept)) == kept
    for each in (answer, connection, late):
        each.close()


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="reads Linux's own tables")
def test_the_recording_is_closed_after_its_page(live):
    """The server closes a recording if its page is closed, even without new data."""
    pages, reader = live
    recording = new_recording(pages.folder)
    recording.write_bytes(b"begin")

    def is_open():
        """Return True if this process, the server, has the recording file open."""
        links = [link for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
        return any(os.path.realpath(link) == str(recording) for link in links)

    connection = opened(reader.address, f"/{recording.name}", Cookie=reader.cookie)
    answer = connection.getresponse()
    assert answer.read(5) == b"begin"
    assert is_open()
    answer.close()
    connection.close()
    until(lambda: not is_open())  # fails if the response continues


def test_the_page_reports_its_rig_time(live):
    """The viewer's page reports its displayed time to the server.

    The server computes the delay of the page from it. The first report ends `until_open`.
    """
    pages, reader = live
    assert b"/shown?ns=" in reader.get(reader.home)
    waiting = threading.Thread(target=pages.page.until_open, daemon=True)
    waiting.start()
    pages.page.record_drive(0.5)
    reader.get("/shown?ns=500000000")
    waiting.join(timeout=WAIT_S)
    assert not waiting.is_alive()
    assert pages.page.behind() is not None
    assert page_delay(pages.folder) is not None


# -- folder between node and server


def test_a_long_run_keeps_its_first_and_newest_parts(tmp_path, monkeypatch):
    """Of a long run the page server keeps the first and the newest recording files.

    The others are deleted. A new recording deletes the old one.
    """
    monkeypatch.setattr(page_module, "MAX_PART", 10)
    assert page_module.newest_recording(tmp_path) is None
    first = part = new_recording(tmp_path)
    assert page_module.next_part(part) is None
    for i in range(40):
        part.write_bytes(bytes(9))
        assert page_module.next_part(part) is None
        part.write_bytes(bytes([i]) * 10)
        following = page_module.next_part(part)
        following.touch()
        part = following
        parts = sorted(tmp_path.glob("*.rrd"))
        assert parts[0] == first == page_module.newest_recording(tmp_path) and parts[-1] == part
        assert len(parts) <= page_module.KEPT_PARTS + 1
    assert page_module.part_after(first) == parts[1]
    assert page_module.part_after(parts[1]) == parts[2] and page_module.part_after(part) is None
    other = new_recording(tmp_path)
    assert page_module.part_after(first) is None
    assert not first.exists()
    assert other > first
    with pytest.raises(CamRigError, match="gone: must be the folder of a page"):
        new_recording(tmp_path / "gone")


def test_the_delay_is_the_last_written_and_grows_when_overdue(tmp_path):
    """The delay of a page is the last written value, and grows without reports.

    It is None without a file, with an incomplete file, and without the folder.
    """
    assert page_delay(tmp_path) is None
    page_module.write_delay(tmp_path, None)
    assert page_delay(tmp_path) is None
    page_module.write_delay(tmp_path, 1.5)
    assert page_delay(tmp_path) == pytest.approx(1.5)
    for silent in (3.0, 60.0):
        page_module.write_delay(tmp_path, 0.5)
        then = time.time() - silent
        os.utime(tmp_path / page_module.BEHIND, (then, then))
        late = page_delay(tmp_path)
        assert -1e-2 <= late - (0.5 + silent - page_module.REPORT_EVERY_S) <= 5.0
    (tmp_path / page_module.BEHIND).write_text("")
    assert page_delay(tmp_path) is None and page_delay(tmp_path / "gone") is None


# -- script of the page and its delay


@pytest.mark.parametrize("factor", [0.5, 1.0, 20.0])
def test_the_delay_is_wall_clock_time_at_any_factor(factor):
    """The delay of a page is in wall-clock seconds at any real-time factor.

    It grows if the page no longer reports.
    """
    wall = SimpleNamespace(now=0.0)
    page = PageTime(lambda: wall.now)
    for i in range(40):
        wall.now = 0.25 * i
        page.record_drive(factor * wall.now)
        if i >= 4:
            page.take(f"ns={round(factor * (wall.now - 1.0) * 1e9)}")
            assert page.behind() == pytest.approx(1.0)
    assert page.longest == pytest.approx(1.0)
    wall.now += page_module.REPORT_EVERY_S
    assert page.behind() == pytest.approx(1.0)
    wall.now += 7.0
    assert page.behind() == pytest.approx(8.0)


def test_a_page_without_rig_time_or_ahead_of_the_drive_is_not_late():
    """The reported delay is None for a page without a time.

    It is 0 for a page that is ahead.
    """
    page = PageTime(lambda: 0.0)
    page.record_drive(1.0)
    page.take("ns=-1")
    page.until_open()
    for words in ("", "ns=", "ns=x", "other=3"):
        page.take(words)
    assert page.behind() is None
    page.take("ns=2000000000")
    assert page.behind() == 0.0


def test_the_request_contains_timeline_and_time():
    """The request that moves the viewer's cursor contains timeline and time.

    It is encoded with the field numbers of Rerun's Viewer Control API.
    """
    assert page_module.TIMELINE == RIG_TIME == "rig_time"
    for time_ns, varint in (
        (1, b"\x01"),
        (127, b"\x7f"),
        (128, b"\x80\x01"),
        (300_000_000, b"\x80\xc6\x86\x8f\x01"),
    ):
        parts = b"\x12\x0a\x0a\x08rig_time\x1a" + bytes([1 + len(varint)]) + b"\x08" + varint
        assert page_module.cursor_request(time_ns) == b"\x32" + bytes([len(parts)]) + parts


def test_only_a_recording_with_a_start_time_moves_the_cursor():
    """Only the page of a recording with a start time moves its viewer's time cursor.

    The page of a live run does not.
    """
    assert "viewer_control" not in page_script() and "viewer_control" in page_script(0.3)
    assert "300000000n" in page_script(0.3)
