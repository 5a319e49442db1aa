"""The node graph as processes: started together, watched, and all ended together."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Empty, Queue
from types import FrameType, TracebackType
from typing import Any

from cam_rig.errors import RunError
from cam_rig.schema.load import config_root

#: Started in this order, ended in the other: who listens must outlive who speaks.
NODES = ("recorder", "microphone", "follower", "law_server", "cam_drive")
#: Signals that end a run; a closed terminal is one of them.
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Wall time (s) a node has to end when asked to, before it is killed.
GRACE = 10.0


class Graph:
    """The five nodes of one run; a context manager that leaves no process behind.

    Parameters
    ----------
    scene : the scene's file
    bag : the folder to record into
    """

    def __init__(self, scene: Path, bag: Path) -> None:
        self._scene, self._bag = scene, bag
        self.processes: dict[str, subprocess.Popen[str]] = {}
        self._errors: dict[str, list[str]] = {}
        self._lines: Queue[str] = Queue()
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Graph:
        for number in STOPPING:
            self._handlers[int(number)] = signal.signal(number, _interrupt)
        try:
            for name in NODES:
                self._start(name)
        except BaseException:  # interrupted or out of memory: leave no node behind
            self._end()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end()

    def _end(self) -> None:
        for number in STOPPING:  # a second Ctrl-C must not leave nodes behind
            signal.signal(number, signal.SIG_IGN)
        *speakers, recorder = [self.processes[n] for n in reversed(NODES) if n in self.processes]
        _stop(speakers)
        _stop([recorder])  # last, so that it hears the others to the end
        for stopping, handler in self._handlers.items():
            signal.signal(stopping, handler)

    def progress(self) -> Iterator[dict[str, float | str]]:
        """What the drive reports, until it has finished.

        Raises
        ------
        RunError : a node ended before its time, with what it said
        """
        while True:
            ended = {name: p.poll() for name, p in self.processes.items()}
            try:
                while True:
                    yield json.loads(self._lines.get(timeout=0.05))
            except Empty:
                pass
            dead = [name for name, code in ended.items() if code is not None]
            if dead == ["cam_drive"] and ended["cam_drive"] == 0:
                return
            if dead:
                raise RunError(self._obituary(dead[0], ended[dead[0]] or 0))

    def _start(self, name: str) -> None:
        arguments: dict[str, str | bool] = {"scene": str(self._scene)}
        if name == "recorder":
            arguments["bag"] = str(self._bag)
        if name == "cam_drive":
            arguments["report_progress"] = True
        # as JSON, which is YAML too: a folder called yes or 1e3 stays a text
        pairs = (f"{key}:={json.dumps(value)}" for key, value in arguments.items())
        ros = [part for pair in pairs for part in ("-p", pair)]
        process = subprocess.Popen(
            [sys.executable, "-m", f"cam_rig.nodes.{name}", "--ros-args", *ros],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
            start_new_session=True,  # Ctrl-C reaches us alone; we end them in order
        )
        self.processes[name] = process
        self._errors[name] = []
        say = self._lines.put if name == "cam_drive" else (lambda _line: None)
        for stream, take in ((process.stdout, say), (process.stderr, self._errors[name].append)):
            threading.Thread(target=_drain, args=(stream, take), daemon=True).start()

    def _obituary(self, name: str, code: int) -> str:
        time.sleep(0.2)  # let its last words arrive
        words = [line.strip() for line in self._errors[name] if line.strip()]
        said = words[-1] if words else "it said nothing"
        how = f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"
        return f"node {name} {how}: {said}"


class InterruptError(RunError):
    """The run was told to stop; the exit code is the shell's convention, 128 + signal."""

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted by {signal.Signals(number).name}")
        self.exit_code = 128 + number


def _interrupt(number: int, _frame: FrameType | None) -> None:
    raise InterruptError(number)


def environment() -> dict[str, str]:
    """The nodes' environment: no socket leaves this machine unless the user says otherwise."""
    own = dict(os.environ)
    # The nodes' matrices are small: threads inside one node only take the cores of the others.
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        own.setdefault(threads, "1")
    own["CAM_RIG_RUNNER"] = str(os.getpid())
    own.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(config_root() / "fastdds_loopback.xml"))
    return own


def _drain(stream: object, take: Callable[[str], None]) -> None:
    for line in stream:  # type: ignore[attr-defined]
        take(line)


def _stop(processes: list[subprocess.Popen[str]]) -> None:
    """Ask all to end, wait for them, and kill who does not."""
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    deadline = time.monotonic() + GRACE
    for process in processes:
        try:
            process.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
