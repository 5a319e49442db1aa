"""Rerun viewer as a child process, which ends with its parent."""

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
#: Python program that turns its own process into the viewer. On Linux the kernel terminates the
#: viewer when its parent ends for any reason (PR_SET_PDEATHSIG).
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
#: Options of the viewer, which only accepts connections from this machine.
OPTIONS = ("--bind", LOOPBACK, "--hide-welcome-screen")
#: Longest wall-clock time (s) from the start of the viewer until it listens at its ports.
TIMEOUT_S = 30.0
#: Longest wall-clock time (s) from SIGTERM until the viewer ends.
END_S = 3.0
#: Environment variables that keep the viewer from reporting its usage to its maker. The option of
#: the viewer for this would change the user's settings, but it also reports nothing if CI is set.
SILENT = {"RUST_LOG": "error", "CI": "1"}


def require_display() -> None:
    """Check that a window can be opened.

    Call it before any long computation.

    Raises
    ------
    CamRigError
        If there is no display.
    """
    names = ("WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in names):
        raise CamRigError(f"no display to open the viewer on (DISPLAY is not set); {ADVICE}")


def show(path: Path) -> None:
    """Open a recording in the Rerun viewer, and wait until its window is closed."""
    with child("--new", str(path)) as process:
        wait(process)


def wait(process: subprocess.Popen[bytes]) -> None:
    """Wait until the viewer is closed.

    Raises CamRigError if the process of the viewer ends with an exit code other than 0.
    """
    code = process.wait()
    if code != 0:
        raise CamRigError(f"the viewer ended with code {code}, see above; {ADVICE}")


def end(process: subprocess.Popen[bytes]) -> None:
    """Terminate a viewer and its children, by SIGKILL if SIGTERM has no effect."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@contextmanager
def child(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start a Rerun viewer as a child process, and terminate it when the context ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *OPTIONS, *arguments],
        stdin=subprocess.DEVNULL,
        env=os.environ | SILENT,
        start_new_session=True,  # Ctrl-C only reaches this process, which ends its children
    )
    try:
        yield process
    finally:
        end(process)


@contextmanager
def listening(*arguments: str, ports: tuple[int, ...]) -> Iterator[subprocess.Popen[bytes]]:
    """Start a Rerun viewer, and wait until it listens at all ``ports``.

    ``arguments`` are those of the viewer. It is terminated when the context ends.
    """
    require_loopback()
    with child(*arguments) as process:
        _wait_for_ports(process, ports)
        yield process


@interruptible
def _wait_for_ports(process: subprocess.Popen[bytes], ports: tuple[int, ...]) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not all(_is_open(port) for port in ports):
        if process.poll() is not None:
            raise CamRigError(f"the viewer ended with code {process.returncode}; {ADVICE}")
        if time.monotonic() > deadline:
            raise CamRigError(f"the viewer does not listen after {TIMEOUT_S:g} s; {ADVICE}")
        time.sleep(0.05)


@contextmanager
def window() -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Start an empty Rerun viewer, and yield its process and its address.

    A live run sends its recording to this address.
    """
    port = find_free_port()
    with listening("--port", str(port), "--expect-data-soon", ports=(port,)) as process:
        yield process, stream_address(port)


def find_free_port() -> int:
    """Return a free port of this machine."""
    with socket.socket() as listener:
        listener.bind((LOOPBACK, 0))
        return int(listener.getsockname()[1])


def stream_address(port: int) -> str:
    """Return the address at which a Rerun viewer receives a live run.

    `port` is its port on this machine.
    """
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def _is_open(port: int) -> bool:
    with socket.socket() as caller:
        caller.settimeout(0.5)
        return caller.connect_ex((LOOPBACK, port)) == 0
