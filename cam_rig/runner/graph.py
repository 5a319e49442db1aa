"""The node graph as processes: started together, watched, and all ended together."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import Empty, Queue

from cam_rig.errors import RunError
from cam_rig.extras import require
from cam_rig.interrupts import interruptible
from cam_rig.live.sockets import require_loopback
from cam_rig.runner.fork_server import ForkServer
from cam_rig.runner.node_process import Arguments, NodeProcess, stop_all
from cam_rig.runner.node_table import ENTRIES, PATIENCE_S, RECORDER
from cam_rig.runner.resources import (
    LOCK_GRACE_S,
    CheckpointFolder,
    DeadPorts,
    clean,
    domain_number,
    log_folder,
    require_room,
)

#: Wall time (s) that a look waits for the drive's first report.
LOOK_S = 0.05
#: Wall time (s) between two looks for suspended processes, each of which reads a file a node.
MOVING_EVERY_S = 0.5


class Graph:
    """The nodes of one run; a context manager that leaves no process behind.

    ``nodes`` are parameters by node, the last one being the drive, whose end is the run's. With
    ``respawn`` a node that was killed is started again, instead of ending the run: as soon as
    ``permit``, asked with its name and how it ended, says so. Without ``network`` the nodes are
    discovered on this machine alone; the ``server`` that they are forked from ends with the run.
    """

    def __init__(
        self,
        nodes: dict[str, Arguments],
        respawn: bool = False,
        network: bool = False,
        log: Callable[[str], None] = lambda _line: None,
        namespace: str = "",
        server: ForkServer | None = None,
        permit: Callable[[str, str], bool] = lambda _name, _words: True,
    ) -> None:
        self._server = server or ForkServer()
        self._nodes, self._respawn, self._network = nodes, respawn, network
        self._namespace, self._permit = namespace, permit
        self._log, self._when = log, "before the first tick"
        self._drive = list(nodes)[-1]
        self.processes: dict[str, NodeProcess] = {}
        self._respawned = dict.fromkeys(nodes, 0)
        self._left_out: set[str] = set()
        self._progress: Queue[str] = Queue()
        self._checkpoints: CheckpointFolder | None = None
        self._begun = time.time()
        self._dead_ports = DeadPorts(self._begun)
        self._bag = Path(str(nodes[RECORDER]["bag"]))
        self._unclosed, self._kept = False, ""
        self._recorder_is_new = False
        self._done = False
        #: Whether the run is over, and its bag closed.
        self.finished = False
        self._suspended: dict[str, float] = {}
        self._looked = -math.inf
        self._patience = float(str(nodes[self._drive].get("patience", PATIENCE_S)))

    def __enter__(self) -> Graph:
        require("rclpy")
        require_room()
        require_loopback()
        if words := log_folder()[1]:
            self._log(words)
        self._checkpoints = CheckpointFolder() if self._respawn else None
        with ExitStack() as stack:  # interrupted or out of memory: no node is left behind
            stack.callback(self._end)
            self._start_all()
            stack.pop_all()
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        self._end()
        from cam_rig.bag.recover import NOTHING_RECORDED

        if error is not None or self._unclosed:
            there = f"what was recorded so far is in {self._bag}: "
            self._log(self._kept if self._kept == NOTHING_RECORDED else there + self._kept)

    def _end(self) -> None:
        from cam_rig.bag.files import is_unclosed
        from cam_rig.bag.recover import state_words

        started = [self.processes[n] for n in reversed(self._nodes) if n in self.processes]
        recorder = [process for process in started if process.name == RECORDER]
        self._server.close()
        stop_all([process for process in started if process not in recorder])
        stop_all(recorder)  # last, so that it receives the others' messages to the end
        self._unclosed = self._bag.is_dir() and is_unclosed(self._bag)
        self._kept = state_words(self._bag)
        if self._checkpoints is not None:
            self._checkpoints.remove()
        self._dead_ports.release()
        # a killed node leaves segments behind, and so does one that could not write them whole
        if any(node.process.poll() for node in started) or any(self._respawned.values()):
            time.sleep(LOCK_GRACE_S)  # by then, what has no lock is not a new run's
            clean(self._begun, domain=domain_number())

    def progress(self) -> Iterator[dict[str, float | str]]:
        """What the drive reports, until it has finished."""
        while not self.finished:
            yield from self.look()

    def look(self) -> list[dict[str, float | str]]:
        """What the drive reported since the last look, waiting a moment; deals with ended nodes."""
        ended = [name for name, process in self.processes.items() if process.has_ended]
        ended = [name for name in ended if name not in self._left_out]
        if self._drive in ended:
            self.processes[self._drive].settle()
        reports = self._reports()
        self._require_moving()
        resend = self._drive in ended and self.processes[self._drive].code == 0
        if resend:
            if not self._done:
                raise RunError(f"node {self._drive} was stopped {self._when}, before it was done")
            ended.remove(self._drive)
            if not self._last_ticks_are_lost(ended):
                if self._recorder_closes():
                    self.finished = True
                    return reports
                ended = [RECORDER]
        for name in ended:
            self._handle_exit(name)
        if resend:
            self._start_again(self._drive)
        return reports

    def require_closed(self) -> None:
        """To be called when all have ended, since the recorder then has closed the bag."""
        if self._unclosed:
            raise RunError(self._exit_words(RECORDER) + self._last_line(RECORDER))

    def _last_ticks_are_lost(self, ended: list[str]) -> bool:
        """Whether the drive, which has ended in order, must send its last ticks once more.

        A recorder may be killed with what it has not flushed, though it has acknowledged it: now,
        or while the drive was ending, which then has not heard of the successor. Nothing tells
        that from a kill long before. Any other node that ends now has published all it had to.
        """
        for name in ended:
            if ENTRIES[name].essential and not self._returns(name):
                self._handle_exit(name)
        if RECORDER in ended or self._recorder_is_new:
            return True
        for name in ended:
            self._log(f"{self._exit_words(name)}, when all was published")
        return False

    def _recorder_closes(self) -> bool:
        """Ask the recorder to close the bag; False when it was killed, and is to start again."""
        from cam_rig.bag.files import is_unclosed

        recorder = self.processes[RECORDER]
        stop_all([recorder])
        return recorder.overdue or not (self._returns(RECORDER) and is_unclosed(self._bag))

    def _require_moving(self) -> None:
        """Suspended processes are waited for as the drive waits for an answer, no longer."""
        now = time.monotonic()
        if now - self._looked < MOVING_EVERY_S:
            return
        self._looked = now
        for name, process in self.processes.items():
            since = self._suspended.setdefault(name, now) if process.is_suspended else None
            if since is None:
                self._suspended.pop(name, None)
            elif ENTRIES[name].essential and now - since > self._patience:
                raise RunError(f"node {name} is suspended (SIGSTOP) {self._when}")

    def _reports(self) -> list[dict[str, float | str]]:
        """All reports there are; where there is none, a moment is waited for the first."""
        lines = list[str]()
        with suppress(Empty):
            lines.append(self._progress.get(timeout=LOOK_S))
            lines += [self._progress.get_nowait() for _ in range(self._progress.qsize())]
        reports = [json.loads(line) for line in lines]
        self._done |= any("done" in report for report in reports)
        reports = [report for report in reports if "done" not in report]
        for last in reports[-1:]:
            self._when = f"after tick {last['tick']} ({last['cam']}, {last['rpm']:g} rpm)"
        return reports

    def _handle_exit(self, name: str) -> None:
        """Start a node again, where asked for, or go on without it; else the run is over."""
        words = self._exit_words(name)
        if self._returns(name):
            if not self._permit(name, words):
                return
            self._log(f"{words}: started again")
            self._respawned[name] += 1
            self._start_again(name)
        elif ENTRIES[name].essential:
            raise RunError(words + self._last_line(name))
        else:
            self._left_out.add(name)
            self._log(f"{words}{self._last_line(name)}; the run goes on without it")

    def _returns(self, name: str) -> bool:
        """Whether a node that has ended is to be started again."""
        entry = ENTRIES[name]
        wanted = self._respawn and self.processes[name].was_killed
        return (wanted or not entry.essential) and self._respawned[name] < entry.max_respawns

    def _exit_words(self, name: str) -> str:
        return f"node {self.processes[name].exit_summary()} {self._when}"

    def _last_line(self, name: str) -> str:
        """The last line of stderr of a node that was not killed."""
        process = self.processes[name]
        return "" if process.was_killed else f": {process.last_stderr_line()}"

    def _start_again(self, name: str) -> None:
        self._dead_ports.hold()
        clean(self._begun)
        self._start(name)
        if name in (RECORDER, self._drive):
            self._recorder_is_new = name == RECORDER

    @interruptible
    def _start_all(self) -> None:
        for name in self._nodes:
            self._start(name)

    def _start(self, name: str) -> None:
        arguments = self._nodes[name]
        if self._checkpoints is not None:
            arguments = arguments | {"checkpoint": str(self._checkpoints.path)}
        report = self._progress.put if name == self._drive else None
        self.processes[name] = NodeProcess(
            name, arguments, self._network, self._log, report, self._namespace, self._server
        )
