"""The Rerun viewer as a child process that ends with us: in a window, or behind a browser."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cam_rig.errors import CamRigError
from cam_rig.interrupts import interruptible
from cam_rig.live.sockets import LOOPBACK, require_loopback

ADVICE = (
    "use --web for a browser, or --save FILE.rrd and open the file where there is a screen, "
    "with: rerun FILE.rrd"
)
#: Becomes the viewer itself, which the kernel ends with us however we end (PR_SET_PDEATHSIG).
COMMAND = """
import ctypes, os, signal, sys
from pathlib import Path
from rerun_cli import __main__ as cli
if sys.platform != "linux":
    sys.exit(cli.main())
ctypes.CDLL(None).prctl(1, signal.SIGTERM)
viewer = str(Path(cli.__file__).parent / "rerun")
os.execv(viewer, [viewer, *sys.argv[1:]])
"""
#: Only this machine is served.
OPTIONS = ("--bind", LOOPBACK, "--hide-welcome-screen")
#: Wall time (s) that the viewer has to listen.
TIMEOUT_S = 30.0
#: Wall time (s) that it has to end, once asked.
END_S = 3.0
#: The viewer reports no usage where CI is set. Its own switch would change the user's settings.
SILENT = {"RUST_LOG": "error", "CI": "1"}


def require_display() -> None:
    """Raise before the work is done, when no window can be opened after it."""
    names = ("WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in names):
        raise CamRigError(f"no display to open the viewer on (DISPLAY is not set); {ADVICE}")


def show(path: Path) -> None:
    """Open a recording in the viewer, until its window is closed."""
    with child("--new", str(path)) as process:
        wait(process)


def wait(process: subprocess.Popen[bytes]) -> None:
    """Wait until the viewer is closed."""
    code = process.wait()
    if code != 0:
        raise CamRigError(f"the viewer ended with code {code}, see above; {ADVICE}")


def end(process: subprocess.Popen[bytes]) -> None:
    """End a viewer and its children, also one that does not let itself be asked."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@contextmanager
def child(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer that is ended with the context."""
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *OPTIONS, *arguments],
        stdin=subprocess.DEVNULL,
        env=os.environ | SILENT,
        start_new_session=True,  # Ctrl-C reaches us alone; we end it and its children
    )
    try:
        yield process
    finally:
        end(process)


@contextmanager
def listening(*arguments: str, ports: tuple[int, ...]) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer that can be reached at all of its ports."""
    require_loopback()
    with child(*arguments) as process:
        _await(process, ports)
        yield process


@interruptible
def _await(process: subprocess.Popen[bytes], ports: tuple[int, ...]) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not all(_open(port) for port in ports):
        if process.poll() is not None:
            raise CamRigError(f"the viewer ended with code {process.returncode}; {ADVICE}")
        if time.monotonic() > deadline:
            raise CamRigError(f"the viewer does not listen after {TIMEOUT_S:g} s; {ADVICE}")
        time.sleep(0.05)


@contextmanager
def window() -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """An empty viewer, and the address at which it takes a live run."""
    port = free_port()
    with listening("--port", str(port), "--expect-data-soon", ports=(port,)) as process:
        yield process, stream_address(port)


def free_port() -> int:
    """A port of this machine that nobody listens at."""
    with socket.socket() as listener:
        listener.bind((LOOPBACK, 0))
        return int(listener.getsockname()[1])


def stream_address(port: int) -> str:
    """Where a live run is sent."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def _open(port: int) -> bool:
    with socket.socket() as caller:
        caller.settimeout(0.5)
        return caller.connect_ex((LOOPBACK, port)) == 0
