"""A program that a test starts beside the rig: its output is kept, and it is ended."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from cam_rig.errors import RunError
from cam_rig.runner.node_process import SHUTDOWN_GRACE_S


class StartedProgram:
    """A process with a session of its own, so that its children end with it."""

    def __init__(self, command: Sequence[str], environment: dict[str, str]) -> None:
        own = (part for part in command if part.endswith(".py"))
        self.name = Path(next(own, command[0])).name
        self._output = tempfile.TemporaryFile()  # noqa: SIM115  # closed by `end`
        self._text = ""
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            env=environment | {"PYTHONUNBUFFERED": "1"},
            start_new_session=True,
        )

    @property
    def code(self) -> int | None:
        """The exit code; None while it runs."""
        return self._process.poll()

    @property
    def output(self) -> str:
        """What it has written so far, to stdout and stderr."""
        if not self._output.closed:
            size = os.fstat(self._output.fileno()).st_size
            written = os.pread(self._output.fileno(), size, 0)  # leaves the writer's place alone
            self._text = written.decode(errors="replace")
        return self._text

    def failure(self) -> RunError | None:
        """Its exit code and its last line, where it has failed."""
        if not self.code:
            return None
        last = (self.output.strip() or "no output").rpartition("\n")[2]
        return RunError(f"program {self.name} ended with code {self.code}: {last}")

    def end(self) -> None:
        """Interrupt it (SIGINT), and kill what has not ended in time, its children too."""
        if self.code is None:
            self._process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(SHUTDOWN_GRACE_S)
        with suppress(ProcessLookupError):  # nothing of it is left
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        print(f"[{self.name}] {self.output.rstrip()}")
        self._output.close()
