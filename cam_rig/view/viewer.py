"""The Rerun viewer as a child that ends with us."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

from cam_rig.errors import CamRigError

ADVICE = "use --save FILE.rrd and open the file where there is a screen, with: rerun FILE.rrd"
#: ``python -m rerun_cli`` would lose the viewer's exit code.
COMMAND = "import sys; from rerun_cli.__main__ import main; sys.exit(main())"
#: A viewer of its own, that nobody else on the network can send to.
OPTIONS = ("--new", "--bind", "127.0.0.1", "--hide-welcome-screen")


def require_display() -> None:
    """Raise before the work is done, when no window can be opened after it.

    Raises
    ------
    CamRigError : neither X11 nor Wayland is there
    """
    names = ("WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in names):
        raise CamRigError(f"no display to open the viewer on (DISPLAY is not set); {ADVICE}")


def show(path: Path) -> None:
    """Open a recording in the viewer, until its window is closed.

    Raises
    ------
    CamRigError : the viewer failed
    """
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *OPTIONS, str(path)],
        stdin=subprocess.DEVNULL,
        env={"RUST_LOG": "error"} | os.environ,
        start_new_session=True,  # the viewer is a child of this child: end both at once
    )
    try:
        code = process.wait()
    except BaseException:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
        raise
    if code != 0:
        raise CamRigError(f"the viewer ended with code {code}, see above; {ADVICE}")
