"""The node graph as processes: started together, watched, and all ended together."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Empty, Queue
from types import FrameType, TracebackType
from typing import Any

from cam_rig.errors import RunError
from cam_rig.extras import require
from cam_rig.runner.checkpoint_folder import MemoryFolder
from cam_rig.runner.process import NodeProcess, stop_all
from cam_rig.runner.shared_memory import YOUNG, clean, require_room

#: Started right after the recorder when a run is to be seen, and then waited for.
VIEWER = "viewer"
#: Signals that end a run; a closed terminal is one of them.
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Wall time (s) without an answer after which the drive of a run gives up.
PATIENCE = 120.0
#: A node that was killed this often is not started again.
MAX_RESPAWNS = 20

Arguments = dict[str, str | bool | float | list[str]]


def live(
    scene: Path, bag: Path, screen: str | None = None, **drive: str | bool | float
) -> dict[str, Arguments]:
    """The nodes of a run, who listens before who speaks, with their parameters.

    ``screen`` is where a viewer takes the picture of the run; None starts no viewer node.
    """
    named: Arguments = {"scene": str(scene)}
    nodes: dict[str, Arguments] = {"recorder": {**named, "bag": str(bag)}}
    if screen is not None:
        nodes[VIEWER] = {**named, "address": screen}
    nodes |= {"microphone": named, "follower": named}
    # who has ended is seen here at once, so a busy machine may take its time to answer
    waited: Arguments = {"report_progress": True, "consumers": list(nodes), "patience": PATIENCE}
    return nodes | {"law_server": named, "cam_drive": {**named, **waited, **drive}}


def replayed(scene: Path, bag: Path, recorded: Path) -> dict[str, Arguments]:
    """The nodes that hear a recorded drive and law server."""
    nodes = live(scene, bag)
    heard = {name: nodes[name] for name in ("recorder", "microphone", "follower")}
    player: Arguments = {"bag": str(recorded), "report_progress": True, "patience": PATIENCE}
    return heard | {"player": player}


class Graph:
    """The nodes of one run; a context manager that leaves no process behind.

    Parameters
    ----------
    nodes : parameters by node, the last one being the drive, whose end is the run's
    respawn : start a node again that was killed, instead of ending the run
    network : let the nodes be heard in the whole subnet, not on this machine alone
    say : told what happened, a line at a time
    """

    def __init__(
        self,
        nodes: dict[str, Arguments],
        respawn: bool = False,
        network: bool = False,
        say: Callable[[str], None] = lambda _line: None,
    ) -> None:
        self._nodes, self._respawn, self._network = nodes, respawn, network
        self._say, self._last = say, "before the first tick"
        self._drive = list(nodes)[-1]
        self.processes: dict[str, NodeProcess] = {}
        self._respawned = dict.fromkeys(nodes, 0)
        self._lines: Queue[str] = Queue()
        self._handlers: dict[int, Any] = {}
        self._handover = MemoryFolder() if respawn else None
        self._begun = time.time()
        self._bag = Path(str(nodes["recorder"]["bag"]))
        self._unclosed, self._kept = False, ""
        self._done = False
        self._suspended: dict[str, float] = {}
        self._patience = float(str(nodes[self._drive].get("patience", PATIENCE)))

    def __enter__(self) -> Graph:
        require("rclpy")
        require_room()
        for number in STOPPING:
            self._handlers[int(number)] = signal.signal(number, _interrupt)
        try:
            for name in self._nodes:
                self._start(name)
        except BaseException:  # interrupted or out of memory: leave no node behind
            self._end()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end()
        from cam_rig.bag.recording.recover import NOTHING

        if error is not None or self._unclosed:
            there = f"what was recorded so far is in {self._bag}: "
            self._say(self._kept if self._kept == NOTHING else there + self._kept)

    def _end(self) -> None:
        from cam_rig.bag.files import is_torn
        from cam_rig.bag.recording.recover import state_words

        for number in STOPPING:  # a second Ctrl-C must not leave nodes behind
            signal.signal(number, signal.SIG_IGN)
        speakers = [self.processes[n] for n in reversed(self._nodes) if n in self.processes]
        recorder = [process for process in speakers if process.name == "recorder"]
        stop_all([process for process in speakers if process not in recorder])
        stop_all(recorder)  # last, so that it hears the others to the end
        self._unclosed = self._bag.is_dir() and is_torn(self._bag)
        self._kept = state_words(self._bag)
        if self._handover is not None:
            self._handover.remove()
        # who was killed leaves segments behind, and who could not write them whole
        if any(process.code for process in speakers) or any(self._respawned.values()):
            time.sleep(YOUNG)  # a port that was made anew at the end is none of a new run
            clean(self._begun)
        for stopping, handler in self._handlers.items():
            signal.signal(stopping, handler)

    def progress(self) -> Iterator[dict[str, float | str]]:
        """What the drive reports, until it has finished.

        Raises
        ------
        RunError : a node ended before its time, with what it said
        """
        while True:
            dead = [name for name, process in self.processes.items() if process.has_ended]
            if self._drive in dead:
                self.processes[self._drive].settle()
            yield from self._reports()
            self._require_moving()
            if self._drive in dead and self.processes[self._drive].code == 0:
                if not self._done:
                    raise RunError(f"node {self._drive} was told to end {self._last}, not yet done")
                dead.remove(self._drive)
                if not self._last_ticks_are_lost(dead):
                    if self._recorder_closes():
                        return
                    dead = ["recorder"]
                self._start_again(self._drive)  # to say them to the recorder's successor
            for name in dead:
                self._mourn(name)

    def require_closed(self) -> None:
        """To be asked when all have ended, for then the recorder has closed the bag.

        Raises
        ------
        RunError : it did not; how it ended instead
        """
        recorder = self.processes["recorder"]
        if self._unclosed:
            raise RunError(f"node {recorder.obituary()} {self._last}{_last_words(recorder)}")

    def _last_ticks_are_lost(self, dead: list[str]) -> bool:
        """Whether the drive, which has ended as it should, must say its last ticks once more.

        A recorder may die with what it has not flushed, though it has answered for it. What else
        dies now has said all it had to say.

        Raises
        ------
        RunError : a node ended before its time, and is not to be started again
        """
        for name in dead:
            if name != VIEWER and not self._returns(name):
                self._mourn(name)
        if "recorder" in dead:
            return True
        for name in dead:
            self._say(f"node {self.processes[name].obituary()} {self._last}, when all was said")
        return False

    def _recorder_closes(self) -> bool:
        """Ask the recorder to close the bag while all it has heard can still be said again.

        False when it was killed instead, and is to be started again.
        """
        from cam_rig.bag.files import is_torn

        recorder = self.processes["recorder"]
        stop_all([recorder])
        return recorder.overdue or not (self._returns("recorder") and is_torn(self._bag))

    def _require_moving(self) -> None:
        """Suspended processes are waited for as the drive waits for an answer, no longer.

        Raises
        ------
        RunError : one that has stood still for that long
        """
        now = time.monotonic()
        for name, process in self.processes.items():
            since = self._suspended.setdefault(name, now) if process.is_suspended else None
            if since is None:
                self._suspended.pop(name, None)
            elif now - since > self._patience:
                raise RunError(f"node {name} stands suspended (SIGSTOP) {self._last}")

    def _reports(self) -> Iterator[dict[str, float | str]]:
        try:
            while True:
                line = self._lines.get(timeout=0.05)
                try:
                    report = json.loads(line)
                except ValueError:  # the middleware's own words
                    self._say(line.rstrip())
                    continue
                if "done" in report:
                    self._done = True
                    continue
                self._last = f"after tick {report['tick']} ({report['cam']}, {report['rpm']:g} rpm)"
                yield report
        except Empty:
            pass

    def _mourn(self, name: str) -> None:
        """Start a killed node again, where that is asked for; else the run is over."""
        process = self.processes[name]
        words = f"node {process.obituary()} {self._last}"
        if not self._returns(name):
            raise RunError(words + _last_words(process))
        self._say(f"{words}: started again")
        self._respawned[name] += 1
        self._start_again(name)

    def _returns(self, name: str) -> bool:
        """Whether a dead node is to be started again."""
        # A spectator must not cost the measurement.
        again = (self._respawn or name == VIEWER) and self.processes[name].was_killed
        return again and self._respawned[name] < MAX_RESPAWNS

    def _start_again(self, name: str) -> None:
        clean(self._begun)
        self._start(name)

    def _start(self, name: str) -> None:
        arguments = self._nodes[name]
        if self._handover is not None:
            arguments = arguments | {"handover": str(self._handover.path)}
        hear = self._lines.put if name == self._drive else (lambda _line: None)
        self.processes[name] = NodeProcess(name, arguments, self._network, hear)


def _last_words(process: NodeProcess) -> str:
    """What a node said that was not killed."""
    return "" if process.was_killed else f": {process.last_words()}"


class InterruptError(RunError):
    """The run was told to stop; the exit code is the shell's convention, 128 + signal."""

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted by {signal.Signals(number).name}")
        self.exit_code = 128 + number


def _interrupt(number: int, _frame: FrameType | None) -> None:
    raise InterruptError(number)
