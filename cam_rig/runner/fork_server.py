"""Client of the fork server, a process from which the nodes are forked.

The fork server (`cam_rig.nodes.fork_server`) imports the modules of the nodes once, so a forked
node starts with its imports in memory, and the five nodes of a run start faster. A forked node is
a separate process and a child of the runner, with a separate pid, session, output and exit code.

If the server is not available (the system is not Linux, or the server was killed), each node is
started in a new interpreter, as by `ros2 run`.

The fork server of the standard library is not suitable for nodes. Its children are not children of
the runner, so that pids, output and signals would need as much code again. Each of its children
would import the main module of the runner, and receive its task by pickle.
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

#: Option of prctl(2): make this process the parent of orphaned descendants.
PR_SET_CHILD_SUBREAPER = 36
#: Option of prctl(2): read whether this process is the parent of orphaned descendants.
PR_GET_CHILD_SUBREAPER = 37
#: Longest wall time (s) to wait for the server's answer to a request. A suspended server never
#: answers.
ANSWER_TIMEOUT_S = 60.0
#: Period (s, wall clock) of the check for the end of a node in `ForkedProcess.wait`.
POLL_S = 0.01
#: Number of bytes reserved in the server's command line. A forked node replaces them by the text
#: that `ps` displays for it.
COMMAND_LINE_BYTES = 8192
#: Default environment of the server and its nodes: one thread per numerical library. The server
#: exits instead of forking if it has several threads, because their locks would stay locked.
SINGLE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: Lock of the process-wide setting that `_adopt_orphans` changes and restores.
_adoption_lock = Lock()


class ForkedProcess:
    """Forked node, a child of this process, with an interface as `subprocess.Popen`.

    A lock ensures that only one thread waits for the child, because a second would not find it.
    """

    def __init__(self, pid: int, stdout: int, stderr: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdout, self.stderr = os.fdopen(stdout), os.fdopen(stderr)
        self._wait_lock = Lock()

    def poll(self) -> int | None:
        """Return the exit code, negative after a signal, or None if the node is running."""
        with self._wait_lock:
            if self.returncode is None:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                if pid:
                    self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end of the node and return its exit code.

        Raises
        ------
        subprocess.TimeoutExpired
            If the node is still running after `timeout` (s, wall clock).
        """
        start = time.monotonic()
        while (code := self.poll()) is None:
            if timeout is not None and time.monotonic() - start > timeout:
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
            time.sleep(POLL_S)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the node has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Terminate the node by SIGKILL."""
        self.send_signal(signal.SIGKILL)


class ForkServer:
    """Process from which nodes are forked, started with the first node.

    As a context manager it is closed at the end of the block.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._requests: socket.socket | None = None
        self._usable = sys.platform == "linux"

    def __enter__(self) -> ForkServer:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def begin(self) -> ForkServer:
        """Start the fork server if possible and not yet done, without waiting for it."""
        if not self._usable or self._process is not None:
            return self
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        descriptor, padding = str(theirs.fileno()), " " * COMMAND_LINE_BYTES
        command = [sys.executable, "-m", "cam_rig.nodes.fork_server", descriptor, padding]
        try:
            with theirs, block_signals():
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,  # an error of an import is repeated in the node
                    pass_fds=(theirs.fileno(),),
                    env=SINGLE_THREAD | os.environ,
                    start_new_session=True,
                )
        except (OSError, MemoryError):
            ours.close()
            self._usable = False
        else:
            ours.settimeout(ANSWER_TIMEOUT_S)
            self._requests = ours
        return self

    def start(
        self, command: Sequence[str], environment: dict[str, str], pipe: int | None
    ) -> ForkedProcess | None:
        """Fork a node, or return None if the server is not available.

        Parameters
        ----------
        command : sequence of str
            Command line of the node.
        environment : dict
            Environment of the node.
        pipe : int or None
            File descriptor to pass to the node, under the same number.
        """
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
        process = None
        try:
            if pid := self._fork(request, theirs):
                process = ForkedProcess(pid, out, err)
                # the node ends if it does not receive this, as when a signal interrupts the start
                os.write(go, b"!")
        finally:
            for end in (leash, go, node_out, node_err, *(() if process else (out, err))):
                os.close(end)
        return process

    @interruptible
    def _fork(self, request: dict[str, object], descriptors: list[int]) -> int | None:
        """Return the process id of a forked node, or None if the server does not answer.

        ``request`` describes the node, and ``descriptors`` are the file descriptors to pass to it.
        """
        assert self._requests is not None
        pid = b""
        try:
            with _adopt_orphans(), suppress(OSError):  # the server was killed, or is suspended
                socket.send_fds(self._requests, [json.dumps(request).encode()], descriptors)
                pid = self._requests.recv(32)
        finally:
            if not pid:  # a late answer must not be taken for that of the next request
                self.close()
        return int(pid) if pid else None

    def close(self) -> None:
        """Terminate the fork server. The forked nodes continue."""
        if self._requests is not None:
            self._requests.close()
            self._requests = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._usable = False


@contextmanager
def block_signals() -> Iterator[None]:
    """Start processes with SIGINT and SIGTERM blocked in this context.

    Such a process receives these signals only after it has unblocked them.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _adopt_orphans() -> Iterator[None]:
    """Make this process the parent of forked nodes in this context.

    The fork server lets each node become an orphan, which this process adopts.
    """
    prctl, before = ctypes.CDLL(None).prctl, ctypes.c_int()
    with _adoption_lock:
        prctl(PR_GET_CHILD_SUBREAPER, ctypes.byref(before))
        prctl(PR_SET_CHILD_SUBREAPER, 1)
        try:
            yield
        finally:
            prctl(PR_SET_CHILD_SUBREAPER, before)
