"""The page server: the recording, Rerun's own viewer behind a guard, and nothing else."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from cam_rig.viewer.server.process import HOST
from cam_rig.viewer.server.web import serve, serve_file


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    path = tmp_path_factory.mktemp("web") / "a run.rrd"
    path.write_bytes(b"RRF2 of a kind")
    with serve_file(path) as address:
        yield address


def get(address: str) -> tuple[str, bytes, str]:
    with urllib.request.urlopen(address, timeout=20) as answer:
        policy = answer.headers["Content-Security-Policy"]
        return answer.url, answer.read(), policy


def test_the_short_address_leads_to_the_recording(page: str) -> None:
    """It is on this machine alone, and so is the recording it names."""
    assert page.startswith(f"http://{HOST}:")
    url, body, policy = get(page)
    found = re.search("url=(.*)", url)
    assert found is not None
    recording = urllib.request.unquote(found[1])  # type: ignore[attr-defined]
    assert recording.startswith(page)
    assert get(recording)[1] == b"RRF2 of a kind"
    assert b'"https://fonts' not in body
    assert body.index(b"window.fetch = ") < body.index(b"re_viewer.js")
    assert f"connect-src 'self' blob: data: http://{HOST}:*" in policy


def test_the_viewers_own_files_are_handed_on(page: str) -> None:
    """Code and WebAssembly come through; what there is not is not found."""
    assert b"wasm" in get(f"{page}re_viewer.js")[1]
    assert get(f"{page}re_viewer_bg.wasm")[1].startswith(b"\0asm")
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(f"{page}../../etc/passwd")


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", ""])
@pytest.mark.parametrize("path", ["", "a%20run.rrd", "re_viewer.js"])
def test_a_page_of_another_name_gets_nothing(page: str, host: str, path: str) -> None:
    """A site whose name is made to point to this machine cannot read the run."""
    port = urllib.request.urlparse(page).port  # type: ignore[attr-defined]
    asked = urllib.request.Request(f"{page}{path}", headers={"Host": host.format(port=port)})
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(asked, timeout=20)
    named = urllib.request.Request(f"{page}{path}", headers={"Host": f"localhost:{port}"})
    assert urllib.request.urlopen(named, timeout=20).status == 200


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
    page: str, asked: bytes, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing asked for is taken for a host, so that no name is looked up; no traceback."""
    looked_up: list[object] = []
    original = socket.getaddrinfo

    def spied(host: object, *rest: object, **more: object) -> object:
        looked_up.append(host)
        return original(host, *rest, **more)  # type: ignore[arg-type]

    port = urllib.request.urlparse(page).port  # type: ignore[attr-defined]
    with socket.create_connection((HOST, port), timeout=20) as asker:
        monkeypatch.setattr(socket, "getaddrinfo", spied)
        asker.sendall(b"GET " + asked + b" HTTP/1.1\r\nHost: %s:%d\r\n\r\n" % (HOST.encode(), port))
        answer = b"".join(iter(lambda: asker.recv(4096), b""))
    assert answer.startswith(b"HTTP/1.0 400 ")
    assert set(looked_up) <= {HOST}
    assert "Traceback" not in capfd.readouterr().err


def test_no_proxy_is_asked(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The viewer is on this machine: whatever the environment says, nobody else is asked for it."""
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    monkeypatch.delenv("no_proxy", raising=False)
    monkeypatch.setattr(urllib.request, "_opener", None)  # made once, with the proxies of then
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    assert b"wasm" in opener.open(f"{page}re_viewer.js", timeout=20).read()


def test_a_live_page_names_the_stream() -> None:
    """The page asks the viewer's own server on this machine for the run."""
    with serve() as pages:
        assert pages.stream.startswith(f"rerun+http://{HOST}:")
        assert urllib.request.quote(pages.stream, safe="") in get(pages.address)[0]  # type: ignore[attr-defined]


def test_the_viewer_ends_with_a_killed_server(tmp_path: Path) -> None:
    """kill -9 of the command: the kernel ends the viewer behind it."""
    path = tmp_path / "a.rrd"
    path.write_bytes(b"")
    serve = (
        "import sys, time; from pathlib import Path\n"
        "from cam_rig.viewer.server.web import serve_file\n"
        "with serve_file(Path(sys.argv[1])) as address: print(address, flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", serve, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        assert server.stdout.readline().startswith("http")
        viewers = Path(f"/proc/{server.pid}/task/{server.pid}/children").read_text().split()
        assert len(viewers) == 1
        server.kill()
    for _ in range(100):
        if not Path(f"/proc/{viewers[0]}").exists():
            break
        time.sleep(0.05)
    assert not Path(f"/proc/{viewers[0]}").exists()
