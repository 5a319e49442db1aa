"""Entry points of the executables: start one node in this process.

Run `python -m cam_rig.nodes follower`, or the executable with the name of the node.

Signal handlers are installed before the slow imports. A node that receives a signal early therefore
also ends with code 0, and without incomplete files.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from functools import partial
from importlib import import_module

from cam_rig.errors import CamRigError
from cam_rig.extras import friendly_import_errors, source_date

#: Name of each node's class by the name of the node, which is also the name of its module.
NODES = {"law_server": "LawServer", "cam_drive": "CamDrive", "follower": "Follower",
         "microphone": "Microphone", "recorder": "Recorder", "viewer": "Viewer",
         "player": "Player", "panel": "Panel"}  # fmt: skip
#: Options of the command line that print the help text of a node.
HELP = ("-h", "--help")
#: Signals that end a node.
STOPPING = (signal.SIGINT, signal.SIGTERM)


def main(name: str) -> None:
    """Run a node, then end the process with the exit code of the node."""
    try:
        start(name)
    except SystemExit as exit_request:
        if isinstance(exit_request.code, str):  # an error text, which the interpreter prints
            raise
        # All resources are closed. The regular end takes twice as long, because it frees modules.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(exit_request.code or 0)


def start(name: str) -> None:
    """Run a node until it ends or receives SIGINT or SIGTERM, or print its help."""
    if any(option in sys.argv[1:] for option in HELP):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # no error if a pager closes early
        print(import_module("cam_rig.nodes.parameters").usage(name))
        return
    # During the imports the process can end at once. The handler also replaces SIG_IGN, which a
    # shell sets for SIGINT of a background process.
    for number in STOPPING:
        signal.signal(number, lambda *_: os._exit(0))
    # The runner starts this process with both signals blocked, so that they arrive after this line.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPPING)
    _end_with_runner()
    try:
        source_date()  # checked here, because an invalid date makes the import of scipy fail
        with friendly_import_errors():
            module = import_module(f"cam_rig.nodes.{name}")
            process = import_module("cam_rig.nodes.process")
        process.run(name, getattr(module, NODES[name]))
    except CamRigError as error:
        print(f"cam_rig: {error}", file=sys.stderr)
        sys.exit(error.exit_code)


def _end_with_runner() -> None:
    """Request SIGINT for this process when the runner ends, even if it is killed.

    The request is PR_SET_PDEATHSIG of Linux. The environment variable CAM_RIG_RUNNER is the process
    identifier of the runner.
    """
    runner = os.environ.get("CAM_RIG_RUNNER")
    if runner is not None and sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGINT)
        if os.getppid() != int(runner):
            sys.exit(f"the runner {runner} has ended")


# entry points of the executables, which have the names of the nodes
globals().update({name: partial(main, name) for name in NODES})


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in NODES:
        text = f"usage: python -m cam_rig.nodes {{{','.join(NODES)}}} [--help] [--ros-args ...]"
        if not set(sys.argv[1:]) & set(HELP):
            sys.exit(text)
        print(text)
        sys.exit(0)
    main(sys.argv.pop(1))
