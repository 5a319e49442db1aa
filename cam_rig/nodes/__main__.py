"""Starting a node's process: `python -m cam_rig.nodes follower`, or the executable of its name.

Signal handlers are set before anything heavy is imported, so that a signal which comes early ends
the node in order as well: with nothing half made, nothing left behind, and code 0.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from functools import partial
from importlib import import_module

from cam_rig.errors import CamRigError
from cam_rig.extras import libraries_named, source_date

#: The class of each node, by its name and its module's.
NODES = {"law_server": "LawServer", "cam_drive": "CamDrive", "follower": "Follower",
         "microphone": "Microphone", "recorder": "Recorder", "viewer": "Viewer",
         "player": "Player", "panel": "Panel"}  # fmt: skip
HELP = ("-h", "--help")
STOPPING = (signal.SIGINT, signal.SIGTERM)


def main(name: str) -> None:
    """Be a node's process, which ends with it."""
    try:
        start(name)
    except SystemExit as ended:
        if isinstance(ended.code, str):  # which the interpreter prints
            raise
        # all is closed: to take a thousand modules apart would only double the time of its end
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(ended.code or 0)


def start(name: str) -> None:
    """Run a node until it finishes, fails, or gets SIGINT or SIGTERM; or print its help."""
    if any(word in sys.argv[1:] for word in HELP):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # a pager may be left before the end
        print(import_module("cam_rig.nodes.parameters").usage(name))
        return
    # while the imports run there is nothing to close; also where a shell that started this process
    # in the background has set SIGINT to be ignored
    for number in STOPPING:
        signal.signal(number, lambda *_: os._exit(0))
    # the runner starts this process with both blocked, so that none can come before this line
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPPING)
    _end_with_the_runner()
    try:
        source_date()  # scipy's import ends at what is none
        with libraries_named():
            module = import_module(f"cam_rig.nodes.{name}")
            process = import_module("cam_rig.nodes.process")
        process.run(name, getattr(module, NODES[name]))
    except CamRigError as error:
        print(f"cam_rig: {error}", file=sys.stderr)
        sys.exit(error.exit_code)


def _end_with_the_runner() -> None:
    """A runner that is killed outright must not leave its nodes behind (PR_SET_PDEATHSIG)."""
    runner = os.environ.get("CAM_RIG_RUNNER")
    if runner is not None and sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGINT)
        if os.getppid() != int(runner):
            sys.exit(f"the runner {runner} has ended")


# the executables, by the nodes' names
globals().update({name: partial(main, name) for name in NODES})


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in NODES:
        how = f"usage: python -m cam_rig.nodes {{{','.join(NODES)}}} [--help] [--ros-args ...]"
        if not set(sys.argv[1:]) & set(HELP):
            sys.exit(how)
        print(how)
        sys.exit(0)
    main(sys.argv.pop(1))
