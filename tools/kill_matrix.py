"""Kill matrix: every node, at every moment of a run, by every signal.

Run it from the project's root:

    .venv/bin/python tools/kill_matrix.py             # 75 cases, about ten minutes
    .venv/bin/python tools/kill_matrix.py --busy      # with as many busy loops as cores
    .venv/bin/python tools/kill_matrix.py --node recorder --moment closing --signal SIGSTOP

A case passes if the run ends within its time, names the node in case of a failure, leaves a
readable bag whose loss is reported in numbers (or reports that nothing was recorded), and leaves no
process and no shared memory. Exit code 1 if a case does not pass.
"""

from __future__ import annotations

import argparse
import itertools
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

from cam_rig.bag.reader import read_counts
from cam_rig.errors import CamRigError
from cam_rig.runner import graph as graph_module
from cam_rig.runner import node_process as node_process_module
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import NodeProcess, live_nodes
from cam_rig.runner.resources import reserve_domain

NODES = ("recorder", "microphone", "follower", "law_server", "cam_drive")
MOMENTS = ("start", "first", "middle", "last", "closing")
SIGNALS = ("SIGKILL", "SIGTERM", "SIGSTOP")
TICKS = 80
SCENE = """
name: matrix
title: Two cams at two speeds
cams: [tm21, bezier15]
rig: tm21
model: one_mass
sample_rate: {assumed: 2, unit: kHz, source: "keeps a case short"}
schedule:
  speeds: {assumed: [300, 400], unit: rpm, source: "a case"}
  turns: {assumed: 10, unit: turns, source: "a case"}
  transient_turns: {assumed: 1, unit: turns, source: "a case"}
  ticks_per_turn: 2
"""
#: Wall time (s) that a run waits for a node without progress.
PATIENCE_S = 20.0
#: Longest wall time (s) of a case.
MAX_CASE_S = 180.0


@dataclass
class Case:
    """Node, time and signal of a case, and its result."""

    node: str
    moment: str
    signal: str
    impact: bool = False
    log: list[str] = field(default_factory=list)
    error: str = ""
    seconds: float = 0.0

    def strike(self, processes: dict[str, NodeProcess]) -> None:
        """Send the signal to the node, once."""
        if not self.impact and self.node in processes:
            self.impact = True
            with suppress(ProcessLookupError):
                os.kill(processes[self.node].process.pid, getattr(signal, self.signal))

    def run(self, scene: Path, bag: Path) -> None:
        """Run the scene, and send the signal at the time of the case."""
        start_time, stop_all = time.monotonic(), node_process_module.stop_all
        nodes = live_nodes(scene, bag, progress_timeout=PATIENCE_S)
        made = Graph(nodes, log=self.log.append)

        def closing(processes: list[NodeProcess]) -> None:
            if self.moment == "closing":
                self.strike(made.processes)
            stop_all(processes)

        tick = {"first": 0, "middle": TICKS // 2, "last": TICKS}.get(self.moment)
        with mock.patch.object(graph_module, "stop_all", closing):
            try:
                with made:
                    if self.moment == "start":
                        self.strike(made.processes)
                    for report in made.progress():
                        if tick is not None and int(report["tick"]) >= tick:
                            self.strike(made.processes)
                made.require_closed()
            except CamRigError as error:
                self.error = str(error)
        self.seconds = time.monotonic() - start_time

    def faults(self, bag: Path, before: set[str]) -> list[str]:
        """Return the promises that the run violated. Without violations the list is empty."""
        faults = [] if self.impact else ["the signal was never sent"]
        if self.seconds > MAX_CASE_S:
            faults.append(f"took {self.seconds:.0f} s")
        if self.error and self.node not in self.error:
            faults.append(f"does not name {self.node}: {self.error}")
        lines = (line for line in self.log if line.startswith(("bag ", "nothing was recorded")))
        text = next(lines, "")
        try:
            counts = read_counts(bag) if bag.exists() else {}
        except CamRigError as error:
            counts = {}
            faults.append(f"bag: {error}")
        ticks = counts.get("/follower/samples", 0)
        if not self.error and ticks != TICKS:
            faults.append(f"{ticks} of {TICKS} ticks, and no error")
        if self.error and not sum(counts.values()) and "nothing was recorded" not in text:
            faults.append(f"an empty bag is called {text!r}")
        if self.error and sum(counts.values()) and not any(c.isdigit() for c in text):
            faults.append(f"loss without numbers: {text!r}")
        left = subprocess.run(["pgrep", "-f", str(bag)], capture_output=True, check=False).stdout
        if left:
            faults.append(f"processes left: {left.split()}")
        if more := segments() - before:
            faults.append(f"shared memory left: {sorted(more)[:3]}")
        return faults


def segments() -> set[str]:
    """Return the files of Fast DDS in shared memory that no process uses.

    Ports, which all processes share, are not included.
    """
    used: set[str] = set()
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            lines = (process / "maps").read_text(encoding="utf-8", errors="replace").splitlines()
            used |= {line.split("/")[-1] for line in lines}
            used |= {link.readlink().name for link in (process / "fd").iterdir()}
    names = {path.name for path in Path("/dev/shm").glob("fastdds_*")}
    return {name for name in names - used if "port" not in name and not name.endswith("_el")}


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """Load a number of cores with endless loops while the context is open."""
    with ExitStack() as stack:
        for _ in range(loops):
            process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(process.wait)
            stack.callback(process.kill)
        yield


def options() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--node", choices=NODES, action="append")
    parser.add_argument("--moment", choices=MOMENTS, action="append")
    parser.add_argument("--signal", choices=SIGNALS, action="append")
    parser.add_argument("--busy", action="store_true")
    return parser.parse_args()


def main() -> int:
    """Run the cases, and print a line for each. Return 1 if a case violates a promise."""
    arguments, wrong = options(), 0
    signals = arguments.signal or SIGNALS
    cases = itertools.product(arguments.node or NODES, arguments.moment or MOMENTS, signals)
    with tempfile.TemporaryDirectory() as folder, reserve_domain(), ExitStack() as stack:
        if arguments.busy:
            stack.enter_context(busy(os.cpu_count() or 1))
        scene = Path(folder) / "scenes" / "matrix.yaml"
        scene.parent.mkdir()
        scene.write_text(SCENE, encoding="utf-8")
        for i, (node, moment, number) in enumerate(cases):
            case = Case(node, moment, number)
            bag, before = Path(folder) / f"{i}", segments()
            case.run(scene, bag)
            faults = case.faults(bag, before)
            wrong += bool(faults)
            verdict = "; ".join(faults) or case.error or "complete"
            print("FAIL" if faults else "ok  ", f"{node:10} {moment:8} {number:8}", end=" ")
            print(f"{case.seconds:5.1f} s  {verdict}", flush=True)
            for line in case.log:
                print(f"       {line}")
    print(f"{wrong} of the cases are not as promised")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
