"""Command `cam-rig panel`: printed address, end by signals, errors."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from ..processes import WAIT_S, children, ended, is_running, until
from .conftest import BIN, call

COMMAND = (BIN / "cam-rig", "panel")


@pytest.mark.usefixtures("hangup_enabled")
@pytest.mark.variants(2)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_ends_the_panel_and_its_processes(number: signal.Signals) -> None:
    """A signal ends the panel with code 128 + number, its processes and its port.

    One line is printed.
    """
    process = subprocess.Popen(
        COMMAND, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    url = urlsplit(process.stdout.readline().strip())
    assert re.fullmatch(r"[0-9a-f]{16}\.localhost", url.hostname or "")
    connection = HTTPConnection("127.0.0.1", url.port or 0, timeout=WAIT_S)
    connection.request("GET", f"/?{url.query}", headers={"Host": url.netloc})
    assert connection.getresponse().status == 200
    connection.close()
    started = children(process.pid)
    assert started
    os.kill(process.pid, number)
    _, printed = process.communicate(timeout=WAIT_S)
    assert process.returncode == 128 + number
    assert printed.splitlines() == [
        "Ctrl-C ends the panel",
        f"cam-rig: interrupted by {number.name}",
    ]
    assert not [child for child in started if Path(f"/proc/{child}").exists()]
    with socket.socket() as caller:
        assert caller.connect_ex(("127.0.0.1", url.port or 0)) != 0


#: Program used as browser: writes its process ID and arguments to a file, and waits.
BROWSER = """#!{python}
import os, pathlib, sys, time
pathlib.Path({report!r}).write_text(chr(10).join([str(os.getpid()), *sys.argv[1:], ""]))
time.sleep(600)
"""


def test_token_is_not_visible_to_other_users(tmp_path: Path) -> None:
    """No command line contains the token while the browser of --open runs.

    The browser opens a private file with the address, which is removed at the end.
    """
    report, browser = tmp_path / "report", tmp_path / "browser"
    browser.write_text(BROWSER.format(python=sys.executable, report=str(report)))
    browser.chmod(0o700)
    with subprocess.Popen(
        [*COMMAND, "--open"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"BROWSER": f"{browser} %s &"},
    ) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            token = address.partition("token=")[2].encode()
            assert token
            until(lambda: report.exists() and report.read_text().endswith("\n"))
            pid, page_url = report.read_text().split()
            for arguments in Path("/proc").glob("[0-9]*/cmdline"):
                with suppress(OSError):  # the process has ended
                    assert token not in arguments.read_bytes()
            assert is_running(pid)
            page = Path(unquote(urlsplit(page_url).path))
            assert address in page.read_text(encoding="utf-8")
            assert page.stat().st_mode & 0o777 == 0o600
            assert page.parent.stat().st_mode & 0o777 == 0o700
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(WAIT_S)
            os.kill(int(pid), signal.SIGKILL)
    assert not page.exists()


def test_port_in_use_is_one_line() -> None:
    """--port with a port in use ends with code 2 and one line with the remedy."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        result = call("panel", "--port", port)
    assert result.exit_code == 2
    assert result.stderr == (
        f"cam-rig: --port {port} is in use; choose another port, or 0 for a free port\n"
    )


def test_cam_without_a_law_is_one_line(tmp_path: Path) -> None:
    """A cam without a rise or without a file ends the panel with code 2 and one line."""
    cam = tmp_path / "rests.yaml"
    cam.write_text(
        "name: rests\ntitle: Rests\nlift: {assumed: 1, unit: mm, source: none}\n"
        "follower: {type: flat, base_radius: {assumed: 20, unit: mm, source: none}}\n"
        "segments:\n  - {law: dwell, span: {assumed: 360, unit: deg, source: all}}\n",
        encoding="utf-8",
    )
    for argument, words in ((cam, "rises by 0 mm, lift is 1 mm"), ("nobody", "no such file")):
        result = call("panel", argument, "--rig", "tm21")
        assert result.exit_code == 2 and words in result.stderr
        assert result.stderr.count("\n") == 1


def test_folder_too_deep_for_a_socket_is_refused(tmp_path):
    """A runtime folder whose path is too long for a socket is refused in one line.

    The line has the limit and the remedy.
    """
    deep = tmp_path / ("x" * 100)
    deep.mkdir(mode=0o700)
    environment = os.environ | {"XDG_RUNTIME_DIR": str(deep), "TMPDIR": str(deep)}
    done = ended(*COMMAND, "--no-rerun", "--out", deep, env=environment)
    assert done.returncode == 2
    assert "allowed: 107; remedy: a shorter XDG_RUNTIME_DIR or TMPDIR" in done.stderr
    assert len(done.stderr.splitlines()) == 1
