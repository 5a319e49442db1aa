"""cam-rig panel: the address it prints, how it ends, what it refuses."""

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


@pytest.mark.usefixtures("heard_hangup")
@pytest.mark.variants(2)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_it_serves_until_it_is_ended_and_leaves_no_process(number: signal.Signals) -> None:
    """One line and 128 + signal, however it is asked; its address answers no more."""
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
    begun = children(process.pid)
    assert begun
    os.kill(process.pid, number)
    _, printed = process.communicate(timeout=WAIT_S)
    assert process.returncode == 128 + number
    assert printed.splitlines() == [
        "Ctrl-C ends the panel",
        f"cam-rig: interrupted by {number.name}",
    ]
    assert not [child for child in begun if Path(f"/proc/{child}").exists()]
    with socket.socket() as caller:
        assert caller.connect_ex(("127.0.0.1", url.port or 0)) != 0


#: Stands for a browser: says with what it was called, and stays.
BROWSER = """#!{python}
import os, pathlib, sys, time
pathlib.Path({said!r}).write_text(chr(10).join([str(os.getpid()), *sys.argv[1:], ""]))
time.sleep(600)
"""


def test_the_token_is_in_no_process_that_another_user_sees(tmp_path: Path) -> None:
    """Nobody else's list of processes has it while the browser runs; the file with it is ours."""
    said, browser = tmp_path / "said", tmp_path / "browser"
    browser.write_text(BROWSER.format(python=sys.executable, said=str(said)))
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
            until(lambda: said.exists() and said.read_text().endswith("\n"))
            pid, where = said.read_text().split()
            for arguments in Path("/proc").glob("[0-9]*/cmdline"):
                with suppress(OSError):  # it has ended meanwhile
                    assert token not in arguments.read_bytes()
            assert is_running(pid)
            page = Path(unquote(urlsplit(where).path))
            assert address in page.read_text(encoding="utf-8")
            assert page.stat().st_mode & 0o777 == 0o600
            assert page.parent.stat().st_mode & 0o777 == 0o700
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(WAIT_S)
            os.kill(int(pid), signal.SIGKILL)
    assert not page.exists()


def test_a_port_in_use_is_one_line() -> None:
    """With the remedy, and the code of a wrong argument."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        result = call("panel", "--port", port)
    assert result.exit_code == 2
    assert result.stderr == (
        f"cam-rig: --port: {port} is in use; allowed: another, or 0 for a free one\n"
    )


def test_a_law_that_cannot_be_drawn_is_one_line(tmp_path: Path) -> None:
    """A cam that never lifts; and one that is not there."""
    cam = tmp_path / "rests.yaml"
    cam.write_text(
        "name: rests\ntitle: Rests\nlift: {assumed: 1, unit: mm, source: none}\n"
        "follower: {type: flat, base_radius: {assumed: 20, unit: mm, source: none}}\n"
        "segments:\n  - {law: dwell, span: {assumed: 360, unit: deg, source: all}}\n",
        encoding="utf-8",
    )
    for given, words in ((cam, "rises by 0 mm, lift is 1 mm"), ("nobody", "no such file")):
        result = call("panel", given)
        assert result.exit_code == 2 and words in result.stderr
        assert result.stderr.count("\n") == 1


def test_a_folder_too_deep_for_a_socket_is_named(tmp_path):
    """With the limit and the remedy, before anything is served."""
    deep = tmp_path / ("x" * 100)
    deep.mkdir(mode=0o700)
    places = os.environ | {"XDG_RUNTIME_DIR": str(deep), "TMPDIR": str(deep)}
    done = ended(*COMMAND, "--no-rerun", "--out", deep, env=places)
    assert done.returncode == 2
    assert "allowed: 107; remedy: a shorter XDG_RUNTIME_DIR or TMPDIR" in done.stderr
    assert len(done.stderr.splitlines()) == 1
