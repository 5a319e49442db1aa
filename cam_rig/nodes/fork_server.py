"""The process that the runner's nodes are forked from, with what all of them import in memory.

Asked over a socket by `cam_rig.runner.fork_server`, it ends with whoever asks. It has one thread,
and imports nothing of rclpy, which starts threads of its own (LTTng's): a fork has none but the one
that forks, and finds the locks of the others locked. Each node imports rclpy after the fork.
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

#: What the nodes of every run import, beside rclpy and `cam_rig.nodes`, with all that these import.
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
#: Bytes of a request, at most.
MAX_REQUEST = 1 << 20
#: Streams of a request: its leash, stdout, stderr, and a pipe for the drive's progress.
MAX_STREAMS = 4
#: prctl's number for the name of this process.
NAME = 15


def preload() -> None:
    """Import what nodes need; what cannot be imported fails in the node, in its own words."""
    for name in PRELOADED:
        with suppress(Exception):
            import_module(name)
        if name.endswith((".msg", ".srv")):
            with suppress(Exception):
                import_module("rosidl_generator_py").import_type_support(name.partition(".")[0])
    inspect.getframeinfo(sys._getframe())  # as rclpy's logger does: the first looks at all modules
    gc.freeze()  # a collection in a node would copy the pages of all of them


def serve(requests: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Fork a node for each request; returns in the node, with what it is to be."""
    while True:
        data, streams, _, _ = socket.recv_fds(requests, MAX_REQUEST, MAX_STREAMS)
        if not data or len(os.listdir("/proc/self/task")) > 1:  # a thread's locks stay locked
            os._exit(0)
        read, write = os.pipe()
        between = os.fork()
        if between == 0:
            try:
                node = os.fork()
            except OSError:
                os._exit(1)
            if node == 0:
                os.setsid()  # Ctrl-C reaches the runner alone, which ends all in order
                os.write(write, str(os.getpid()).encode())
                for own in (requests.fileno(), read, write):
                    os.close(own)
                return json.loads(data), streams
            os._exit(0)  # so that the node is an orphan, whom the runner adopts
        os.close(write)
        pid = os.read(read, 32)  # nothing, where no process was to be had
        os.waitpid(between, 0)
        requests.send(pid)
        for stream in (read, *streams):
            os.close(stream)


def become(request: dict[str, Any], streams: list[int]) -> None:
    """Be the node that was asked for, once the runner knows of it."""
    leash, *streams = streams
    if not os.read(leash, 1):
        os._exit(0)
    os.close(leash)
    numbers = request["numbers"]
    above = max(*streams, *numbers) + 1  # no copy lies where another stream belongs
    apart = [fcntl.fcntl(stream, fcntl.F_DUPFD, above) for stream in streams]
    for stream in streams:
        os.close(stream)
    for copy, number in zip(apart, numbers, strict=True):
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
    """Let `ps` and `pgrep -f` show the node's command line, as far as there is room for it."""
    with suppress(OSError, ValueError):
        numbers = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        first, last = int(numbers[45]), int(numbers[46])
        text = b"\0".join(os.fsencode(part) for part in command)[: last - first - 1]
        ctypes.memset(first, 0, last - first)
        ctypes.memmove(first, text, len(text))
    ctypes.CDLL(None).prctl(NAME, name.encode())


if __name__ == "__main__":
    asked = socket.socket(fileno=int(sys.argv[1]))
    show_command("fork_server", sys.orig_argv[:-1])  # without the room for a node's
    preload()
    become(*serve(asked))
