"""Fork server: process with preloaded modules, from which nodes are forked.

`cam_rig.runner.fork_server` sends its requests over a socket. The process ends when the runner
closes the socket. The process must have one thread: a fork has only the thread that forks, and the
locks of other threads would stay locked. It therefore does not import rclpy, which starts threads
(of LTTng). Each node imports rclpy after the fork.
"""

from __future__ import annotations

import ctypes
import fcntl
import gc
import inspect
import json
import os
import socket
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from cam_rig.nodes.__main__ import main

#: Modules that the nodes of every run import, except rclpy and `cam_rig.nodes`.
PRELOADED = (
    "cam_rig.bag.recorder",
    "cam_rig.live.drive",
    "cam_rig.live.law_server",
    "cam_rig.live.playback",
    "cam_rig.live.queues",
    "cam_rig.messages.motion",
    "cam_rig.runner.resources",
    "cam_rig.studies.simulate.sound",
    "diagnostic_msgs.msg",
    "geometry_msgs.msg",
    "logging",
    "rcl_interfaces.msg",
    "rcl_interfaces.srv",
    "rosgraph_msgs.msg",
    "sensor_msgs.msg",
    "std_msgs.msg",
    "std_srvs.srv",
    "trajectory_msgs.msg",
    "type_description_interfaces.srv",
    "visualization_msgs.msg",
)
#: Largest length of a request to fork a node, bytes.
MAX_REQUEST = 1 << 20
#: Number of file descriptors of a request: leash, stdout, stderr, and a pipe for the drive's
#: progress. The leash is a pipe that is closed without a byte if the node must not start.
MAX_STREAMS = 4
#: Number of the option of prctl(2) that sets the name of this process.
PR_SET_NAME = 15


def preload() -> None:
    """Import the modules in `PRELOADED`.

    A failed import is ignored here: the node repeats it and reports the error.
    """
    for name in PRELOADED:
        with suppress(Exception):
            import_module(name)
        if name.endswith((".msg", ".srv")):
            with suppress(Exception):
                import_module("rosidl_generator_py").import_type_support(name.partition(".")[0])
    inspect.getframeinfo(sys._getframe())  # rclpy's logger calls it; the first call is slow
    gc.freeze()  # otherwise a collection in a node would copy the memory pages of all objects


def serve(requests: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Fork a node for each request.

    Returns only in the forked node, with the request and its file descriptors. The runner receives
    the process identifier of the node, or an empty answer if the fork failed.
    """
    while True:
        data, streams, _, _ = socket.recv_fds(requests, MAX_REQUEST, MAX_STREAMS)
        if not data or len(os.listdir("/proc/self/task")) > 1:  # closed, or not safe to fork
            os._exit(0)
        read, write = os.pipe()
        parent = os.fork()
        if parent == 0:
            try:
                node = os.fork()
            except OSError:
                os._exit(1)
            if node == 0:
                os.setsid()  # Ctrl-C reaches only the runner, which ends the nodes in order
                os.write(write, str(os.getpid()).encode())
                for descriptor in (requests.fileno(), read, write):
                    os.close(descriptor)
                return json.loads(data), streams
            os._exit(0)  # the node becomes an orphan, which the runner adopts
        os.close(write)
        pid = os.read(read, 32)  # empty if the fork failed
        os.waitpid(parent, 0)
        requests.send(pid)
        for stream in (read, *streams):
            os.close(stream)


def run_node(request: dict[str, Any], streams: list[int]) -> None:
    """Run the requested node in this process, once the runner has registered it."""
    leash, *streams = streams
    if not os.read(leash, 1):
        os._exit(0)
    os.close(leash)
    numbers = request["numbers"]
    first_free = max(*streams, *numbers) + 1  # so that no copy occupies a requested number
    copies = [fcntl.fcntl(stream, fcntl.F_DUPFD, first_free) for stream in streams]
    for stream in streams:
        os.close(stream)
    for copy, number in zip(copies, numbers, strict=True):
        os.dup2(copy, number)
        os.close(copy)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    command = request["argv"]
    _, _, _, name, *arguments = command
    show_command(name, command)
    sys.argv[1:] = arguments
    main(name)


def show_command(name: str, command: list[str]) -> None:
    """Set the command line of this process that `ps` and `pgrep -f` display.

    The text of the original command line in the memory of the process is overwritten, so the new
    text is truncated to its length.
    """
    with suppress(OSError, ValueError):
        fields = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        first, last = int(fields[45]), int(fields[46])  # arg_start and arg_end, see proc(5)
        text = b"\0".join(os.fsencode(part) for part in command)[: last - first - 1]
        ctypes.memset(first, 0, last - first)
        ctypes.memmove(first, text, len(text))
    ctypes.CDLL(None).prctl(PR_SET_NAME, name.encode())


if __name__ == "__main__":
    requests = socket.socket(fileno=int(sys.argv[1]))
    show_command("fork_server", sys.orig_argv[:-1])  # the last argument reserves space
    preload()
    run_node(*serve(requests))
