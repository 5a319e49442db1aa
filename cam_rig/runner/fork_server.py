"""The runner's half of the fork server: nodes that start with all their imports in memory.

Five interpreters would import the same hundreds of modules. One process imports them for all
(`cam_rig.nodes.fork_server`), and each node is forked from it: a process of its own all the same, a
child of the runner's, with its own pid, session, output and exit code.

Without the server (not Linux, it was killed) a node is started by itself, as `ros2 run` does. The
standard library's fork server is none for nodes: its children are not the runner's, so their pids,
their output and a signal that ends them would need as much code again; each would import the
runner's main module; and what it runs comes by pickle.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from threading import Lock

from cam_rig.interrupts import interruptible

#: prctl's numbers for: orphans below this process become its children; whether they do.
ADOPT, ADOPTS = 36, 37
#: Wall time (s) that the server has to answer; a suspended one never does.
PATIENCE_S = 60.0
#: Wall time (s) between two looks whether a node has ended.
POLL_S = 0.01
#: Bytes that a command line may have for `ps` to show all of it.
COMMAND_ROOM = 8192
#: Of the server and its nodes, unless the user has set another: with more it forks nothing.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_adopting_alone = Lock()


class ForkedProcess:
    """A forked node, a child of this process: as much of `subprocess.Popen` as the runner uses."""

    def __init__(self, pid: int, stdout: int, stderr: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdout, self.stderr = os.fdopen(stdout), os.fdopen(stderr)
        self._one_at_a_time = Lock()

    def poll(self) -> int | None:
        """The exit code, negative for a signal that ended it; None while it runs."""
        with self._one_at_a_time:  # a second thread would find no child any more
            if self.returncode is None:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                if pid:
                    self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end."""
        begun = time.monotonic()
        while (code := self.poll()) is None:
            if timeout is not None and time.monotonic() - begun > timeout:
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
            time.sleep(POLL_S)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it by SIGKILL."""
        self.send_signal(signal.SIGKILL)


class ForkServer:
    """The process that nodes are forked from, begun with the first; it ends with the runner."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._requests: socket.socket | None = None
        self._usable = sys.platform == "linux"

    def __enter__(self) -> ForkServer:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def begin(self) -> ForkServer:
        """Start it, where that is possible and not done yet; it is not waited for."""
        if not self._usable or self._process is not None:
            return self
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        number = str(theirs.fileno())
        command = [sys.executable, "-m", "cam_rig.nodes.fork_server", number, " " * COMMAND_ROOM]
        try:
            with theirs, signals_blocked():
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,  # what fails here fails again in the node itself
                    pass_fds=(theirs.fileno(),),
                    env=ONE_THREAD | os.environ,
                    start_new_session=True,
                )
        except (OSError, MemoryError):
            ours.close()
            self._usable = False
        else:
            ours.settimeout(PATIENCE_S)
            self._requests = ours
        return self

    def start(
        self, command: Sequence[str], environment: dict[str, str], pipe: int | None
    ) -> ForkedProcess | None:
        """Fork the node of a command, with the descriptor ``pipe`` too; None where it cannot."""
        self.begin()
        if self._requests is None:
            return None
        (out, node_out), (err, node_err), (leash, go) = os.pipe(), os.pipe(), os.pipe()
        theirs = [leash, node_out, node_err, *([] if pipe is None else [pipe])]
        request: dict[str, object] = {
            "argv": list(command),
            "environment": environment,
            "folder": os.getcwd(),
            "numbers": [1, 2, *([] if pipe is None else [pipe])],
        }
        started = None
        try:
            if pid := self._fork(request, theirs):
                started = ForkedProcess(pid, out, err)
                os.write(go, b"!")  # without it, as when a signal interrupts this, the node ends
        finally:
            for end in (leash, go, node_out, node_err, *(() if started else (out, err))):
                os.close(end)
        return started

    @interruptible
    def _fork(self, request: dict[str, object], streams: list[int]) -> int | None:
        """The pid of a forked node, a child of this process; None from a server that is lost."""
        assert self._requests is not None
        pid = b""
        try:
            with _adopting(), suppress(OSError):  # it was killed, or suspended
                socket.send_fds(self._requests, [json.dumps(request).encode()], streams)
                pid = self._requests.recv(32)
        finally:
            if not pid:  # nor may an answer that still comes be taken for the next one's
                self.close()
        return int(pid) if pid else None

    def close(self) -> None:
        """End it; the nodes stay."""
        if self._requests is not None:
            self._requests.close()
            self._requests = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._usable = False


@contextmanager
def signals_blocked() -> Iterator[None]:
    """A process that is started here gets no signal that ends it until it unblocks them itself."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _adopting() -> Iterator[None]:
    """Meanwhile what the server leaves an orphan becomes a child of this process."""
    prctl, before = ctypes.CDLL(None).prctl, ctypes.c_int()
    with _adopting_alone:
        prctl(ADOPTS, ctypes.byref(before))
        prctl(ADOPT, 1)
        try:
            yield
        finally:
            prctl(ADOPT, before)
