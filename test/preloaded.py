"""Nodes forked from a process that has imported all they need, for tests of what comes after.

A node's own start takes a second and a half of computing, five of them most of a short run.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from threading import Lock

from cam_rig.runner.node_process import environment

NODES = ("law_server", "cam_drive", "follower", "microphone", "recorder", "player")
#: Ask the kernel to end this process with its parent, or to hand it the orphans below it.
DEATH_SIGNAL, ADOPT = 1, 36
PRCTL = ctypes.CDLL(None).prctl


class Adopted:
    """A forked node, as much of `subprocess.Popen` as the runner and the tests use."""

    def __init__(self, pid: int, stdout: int, stderr: int) -> None:
        self.pid, self.returncode = pid, None
        self._one_at_a_time = Lock()
        self.stdout, self.stderr = os.fdopen(stdout), os.fdopen(stderr)

    def poll(self) -> int | None:
        with self._one_at_a_time:  # a second thread would find no child any more
            if self.returncode is None:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                if pid:
                    self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.poll() is None:
            handle = os.pidfd_open(self.pid)
            ready, _, _ = select.select([handle], [], [], timeout)
            os.close(handle)
            if not ready:
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
        return self.poll()

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Preloaded:
    """The process that nodes are forked from; they become children of the test's."""

    def __init__(self) -> None:
        self._ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        command = [sys.executable, __file__, str(theirs.fileno())]
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()]
        )
        theirs.close()

    def start(self, command: list[str], network: bool, pipe: int | None = None) -> Adopted:
        """What `cam_rig.runner.node_process` starts by this command."""
        (read_out, out), (read_err, err) = os.pipe(), os.pipe()
        request = {"argv": command[2:], "env": environment(network), "folder": os.getcwd()}
        numbers = {1: out, 2: err} | ({} if pipe is None else {pipe: pipe})
        request["numbers"] = list(numbers)
        with _adopting():
            socket.send_fds(self._ours, [json.dumps(request).encode()], list(numbers.values()))
            pid = int(self._ours.recv(32))
        os.close(out)
        os.close(err)
        return Adopted(pid, read_out, read_err)

    def close(self) -> None:
        self._ours.close()
        self._process.wait()


@contextmanager
def _adopting() -> Iterator[None]:
    PRCTL(ADOPT, 1)
    try:
        yield
    finally:
        PRCTL(ADOPT, 0)


def serve(requests: socket.socket) -> None:
    """Fork a node for each request, until nobody is left to ask."""
    PRCTL(DEATH_SIGNAL, signal.SIGKILL)
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))  # as the runner does
    for name in NODES:
        import_module(f"cam_rig.nodes.{name}")
    read, write = os.pipe()
    while True:
        data, streams, _, _ = socket.recv_fds(requests, 1 << 20, 3)
        if not data:
            return
        if os.fork() == 0:
            between = os.getpid()
            if os.fork():
                os._exit(0)  # so that the node is an orphan, whom the test's process adopts
            os.setsid()
            os.write(write, str(os.getpid()).encode())
            while os.getppid() == between:
                time.sleep(1e-3)
            for own in (requests.fileno(), read, write):
                os.close(own)
            become(json.loads(data), streams)
        pid = os.read(read, 32)
        os.wait()
        requests.send(pid)
        for stream in streams:
            os.close(stream)


def become(request: dict, streams: list[int]) -> None:
    """Be the node that was asked for."""
    PRCTL(DEATH_SIGNAL, 0)
    apart = [fcntl.fcntl(stream, fcntl.F_DUPFD, 1000) for stream in streams]  # from all numbers
    for stream in streams:
        os.close(stream)
    for copy, number in zip(apart, request["numbers"], strict=True):
        os.dup2(copy, number)
        os.close(copy)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["env"])
    _, name, *sys.argv[1:] = request["argv"]
    import_module("cam_rig.nodes.__main__").start(name)


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
