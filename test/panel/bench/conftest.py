"""A panel with its nodes, as a process of its own, and pages of its bench without a browser."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.sync.client import ClientConnection, connect

from ..asking import ask

#: Wall time (s) after which something that has not come true never will, however busy the machine.
WAIT_S = 60.0


class BenchPage:
    """A page of the bench: what it is told, and what it commands."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket, self.number, self.sound = socket, 0, b""
        self.live: dict[str, Any] = {}

    def _next(self) -> dict[str, Any]:
        message = self.socket.recv(timeout=WAIT_S)
        if isinstance(message, bytes):
            self.sound += message
            return {}
        found: dict[str, Any] = json.loads(message)
        if found["type"] == "live":
            self.live = found
        return found

    def until(self, condition: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Wait until the bench is so; what it then shows."""
        end = time.monotonic() + WAIT_S
        while not (self.live and condition(self.live)):
            assert time.monotonic() < end, f"it never came true: {self.live}"
            self._next()
        return self.live

    def ask(self, do: str, **more: Any) -> dict[str, Any]:
        """What a command is answered with."""
        self.number += 1
        self.socket.send(json.dumps({"number": self.number, "do": do, **more}))
        return self.answer(self.number)

    def answer(self, number: int | None) -> dict[str, Any]:
        """The answer to the command of a number; None of one without."""
        while (message := self._next()).get("type") != "answer" or message["answer"] != number:
            pass
        return message

    def do(self, do: str, **more: Any) -> dict[str, Any]:
        """A command that must not be refused."""
        answer = self.ask(do, **more)
        assert answer["success"], answer["words"]
        return answer

    def running(self) -> dict[str, Any]:
        """Wait until the nodes are there and have told their parameters."""
        return self.until(lambda live: live["graph"] == "running" and len(live["values"]) == 3)

    def turning(self, rpm: float) -> dict[str, Any]:
        """Wait until the cam turns at a speed."""
        return self.until(lambda live: abs(live["state"].get("rpm", 0.0) - rpm) < 1e-6)


class RunningPanel:
    """cam-rig panel as a process.

    Parameters
    ----------
    out : where it keeps bags
    """

    def __init__(self, process: subprocess.Popen[str], out: Path) -> None:
        self.process, self.out = process, out
        assert process.stdout is not None
        self.address = process.stdout.readline().strip()
        url = urlsplit(self.address)
        _, headers, _ = ask(self.address, f"/?{url.query}")
        self.cookie = str(headers["Set-Cookie"].split(";")[0])

    def get(self, path: str) -> bytes:
        """What is served under a path."""
        status, _, body = ask(self.address, path, Cookie=self.cookie)
        assert status == 200
        return bytes(body)

    @contextmanager
    def page(self) -> Iterator[BenchPage]:
        """A page of the bench, which begins the nodes."""
        self.get("/bench")
        host = urlsplit(self.address).netloc
        headers = {"Cookie": self.cookie, "Origin": f"http://{host}"}
        with connect(
            f"ws://{host}/bench/live", additional_headers=headers, origin=None, max_size=None
        ) as socket:
            yield BenchPage(socket)

    def nodes(self) -> dict[str, int]:
        """The processes of its nodes by name."""
        found = subprocess.run(
            ["ps", "--ppid", str(self.process.pid), "-o", "pid=,args="],
            capture_output=True,
            text=True,
            check=False,
            timeout=100,
        )
        lines = [line.split() for line in found.stdout.splitlines() if "-m cam_rig.nodes " in line]
        return {words[words.index("cam_rig.nodes") + 1]: int(words[0]) for words in lines}

    def end(self, number: signal.Signals) -> int:
        """End it by a signal; its exit code."""
        self.process.send_signal(number)
        return self.process.wait(WAIT_S)


@pytest.fixture
def running_panel(ros_domain: int, tmp_path: Path) -> Iterator[RunningPanel]:
    """A panel without Rerun, in a ROS domain of its own."""
    with ExitStack() as stack:
        yield stack.enter_context(panel_process(tmp_path / "out"))


@contextmanager
def panel_process(out: Path, *options: str) -> Iterator[RunningPanel]:
    """A panel as long as the context lasts."""
    command = [Path(sys.executable).parent / "cam-rig", "panel", "--no-rerun", "--out", out]
    with subprocess.Popen(
        [*map(str, command), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield RunningPanel(process, out)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=WAIT_S)
