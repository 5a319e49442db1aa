"""Cost of a start: imports of each node, and whole commands.

A node can start alone, or be forked from a server process that has already imported modules.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from cam_rig.show.tables import DataTable, Header, tabulate

#: Nodes of a run.
NODES = ("recorder", "microphone", "follower", "law_server", "cam_drive")

#: Number of starts, of which the median counts.
REPEATS = 5

#: Arguments of an interpreter that does nothing, the reference for all starts.
BARE = ("-c", "pass")

_IMPORTS = "import cam_rig.nodes.{0}, cam_rig.nodes.process\n"

#: Code that prints CPU time and modules of the imports of a node: alone, then forked.
ALONE = _IMPORTS + "import sys, time; print(time.process_time(), len(sys.modules))"

FORKED = (
    """\
import os, sys, time
from cam_rig.nodes.fork_server import preload
preload()
known = len(sys.modules)
if os.fork():
    os.wait()
    os._exit(0)
"""
    + _IMPORTS
    + "print(time.process_time(), len(sys.modules) - known, flush=True)"
)


@dataclass(frozen=True)
class NodeStart:
    """CPU time (s) and modules of the imports of a node, alone and forked."""

    node: str
    alone_s: float
    alone_modules: int
    forked_s: float
    forked_modules: int


@dataclass(frozen=True)
class CommandTime:
    """Wall time and CPU time (s) of a command, and wall time of an empty interpreter.

    The times include child processes.
    """

    command: str
    wall_s: float
    cpu_s: float
    bare_s: float


def node_starts(repeats: int = REPEATS) -> list[NodeStart]:
    """Return the starts of each node of a run, alternately alone and forked."""
    return [_node_start(name, repeats) for name in NODES]


def command_times(
    commands: Iterable[tuple[str, Sequence[str]]], repeats: int = REPEATS
) -> list[CommandTime]:
    """Return the times of commands, alternately with an empty interpreter.

    ``commands`` are pairs of title and arguments of Python.
    """
    rows = []
    for command, arguments in commands:
        runs = [(_timed(arguments), _timed(BARE)) for _ in range(repeats)]
        wall, cpu = (median(run[0][i] for run in runs) for i in (0, 1))
        rows.append(CommandTime(command, wall, cpu, median(run[1][0] for run in runs)))
    return rows


def node_table(starts: Iterable[NodeStart]) -> DataTable:
    """Return a table with a row per node."""
    return tabulate(
        "Imports of a node",
        starts,
        (
            (Header("node"), lambda start: start.node),
            (Header("by itself", "s", ".2f"), lambda start: start.alone_s),
            (Header("forked", "s", ".2f"), lambda start: start.forked_s),
        ),
    )


def command_table(times: Iterable[CommandTime]) -> DataTable:
    """Return a table with a row per command."""
    return tabulate(
        "Whole commands",
        times,
        (
            (Header("command"), lambda time: time.command),
            (Header("wall", "s", ".2f"), lambda time: time.wall_s),
            (Header("CPU", "s", ".2f"), lambda time: time.cpu_s),
            (Header("x bare Python", "", ".0f"), lambda time: time.wall_s / time.bare_s),
        ),
    )


def _node_start(name: str, repeats: int) -> NodeStart:
    pairs = [(_printed(ALONE.format(name)), _printed(FORKED.format(name))) for _ in range(repeats)]
    alone, forked = ([pair[i] for pair in pairs] for i in (0, 1))
    return NodeStart(
        name,
        median(cpu for cpu, _ in alone),
        int(alone[0][1]),
        median(cpu for cpu, _ in forked),
        int(forked[0][1]),
    )


def _printed(code: str) -> list[float]:
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=_alone())
    return [float(word) for word in done.stdout.split()]


def _timed(arguments: Sequence[str]) -> tuple[float, float]:
    """Return wall and CPU time (s) of Python with arguments and its child processes."""
    start_time = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=_alone(),
    ) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, list(arguments))
    return time.perf_counter() - start_time, used.ru_utime + used.ru_stime


def _alone() -> dict[str, str]:
    """Return the environment with one thread for BLAS, as it is for nodes."""
    return os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
