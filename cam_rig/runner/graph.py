"""Run the node graph: start all nodes, monitor them, and end them together."""

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
from cam_rig.runner.node_table import ENTRIES, OPTIONAL, PROGRESS_TIMEOUT_S, RECORDER
from cam_rig.runner.resources import (
    LOCK_GRACE_S,
    domain_number,
    log_folder,
    remove_segments,
    require_shared_memory,
)

#: Time (s, wall clock) for which `Graph.poll` waits for the drive's first report.
REPORT_WAIT_S = 0.05
#: Period (s, wall clock) of the check for suspended processes, which reads one file per node.
SUSPENSION_CHECK_S = 0.5


class Graph:
    """Context manager that starts the nodes of one run and ends all of them at its exit.

    If an essential node ends for any reason, `poll` and `progress` raise a RunError that names it.

    Threads: one thread calls all methods. The threads that read the output of the nodes only call
    `log` and put lines into the queue `_progress`.

    Parameters
    ----------
    nodes : dict
        Parameters by node. The last node is the drive, or the player. Its end is that of the run.
    subnet : bool
        Allow discovery on the local subnet (default: this host only).
    log : callable
        Called with each line for the operator.
    namespace : str
        Namespace of the nodes, such as /rig1.
    server : ForkServer, optional
        Process from which the nodes are forked. It ends with the run.
    """

    def __init__(
        self,
        nodes: dict[str, Arguments],
        subnet: bool = False,
        log: Callable[[str], None] = lambda _line: None,
        namespace: str = "",
        server: ForkServer | None = None,
    ) -> None:
        self._server = server or ForkServer()
        self._nodes, self._subnet = nodes, subnet
        self._namespace, self._log = namespace, log
        self._progress_text = "before the first tick"
        self._drive = list(nodes)[-1]
        self.processes: dict[str, NodeProcess] = {}
        self._ended_optional: set[str] = set()
        self._progress: Queue[str] = Queue()
        self._started_at = time.time()
        self._bag = Path(str(nodes[RECORDER]["output_uri"]))
        self._is_bag_unclosed, self._bag_text = False, ""
        self._is_done = False
        #: True if the run is over and the recorder has closed the bag.
        self.finished = False
        self._suspended_since: dict[str, float] = {}
        self._suspension_checked_at = -math.inf
        self._progress_timeout = float(
            str(nodes[self._drive].get("progress_timeout", PROGRESS_TIMEOUT_S))
        )

    def __enter__(self) -> Graph:
        require("rclpy")
        require_shared_memory()
        require_loopback()
        if warning := log_folder()[1]:
            self._log(warning)
        with ExitStack() as stack:  # ends the nodes after an interrupt or if memory is exhausted
            stack.callback(self._end)
            self._start_all()
            stack.pop_all()
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        self._end()
        from cam_rig.bag.recover import NOTHING_RECORDED

        if error is not None or self._is_bag_unclosed:
            is_empty = self._bag_text == NOTHING_RECORDED
            self._log(self._bag_text if is_empty else f"bag {self._bag}: {self._bag_text}")

    def _end(self) -> None:
        """End all nodes, the recorder last, and clean up the shared memory after a failure."""
        from cam_rig.bag.files import is_unclosed
        from cam_rig.bag.recover import recording_state

        started = [self.processes[n] for n in reversed(self._nodes) if n in self.processes]
        recorder = [process for process in started if process.name == RECORDER]
        self._server.close()
        stop_all([process for process in started if process not in recorder])
        stop_all(recorder)  # last, so that it receives all messages of the others
        self._is_bag_unclosed = self._bag.is_dir() and is_unclosed(self._bag)
        self._bag_text = recording_state(self._bag)
        # a killed node leaves segments in the shared memory, as does one that found it full
        if any(node.process.poll() for node in started):
            time.sleep(LOCK_GRACE_S)  # afterwards segments of a new run are locked
            remove_segments(self._started_at, domain=domain_number())

    def progress(self) -> Iterator[dict[str, float | str]]:
        """Yield the reports of the drive until it has finished."""
        while not self.finished:
            yield from self.poll()

    def poll(self) -> list[dict[str, float | str]]:
        """Return new reports of the drive, and handle ended nodes.

        Raises
        ------
        RunError
            If an essential node has ended, is suspended for longer than the timeout of the drive,
            or if the drive ended before its program was done.
        """
        ended = [n for n, process in self.processes.items() if process.has_ended]
        if self._drive in ended:
            self.processes[self._drive].wait_for_output()
        reports = self._take_reports()
        self._check_suspended()
        is_drive_finished = self._drive in ended and self.processes[self._drive].code == 0
        if is_drive_finished and not self._is_done:
            raise RunError(
                f"node {self._drive} was stopped {self._progress_text}, before it was done"
            )
        for name in ended:
            is_expected = is_drive_finished and (name == self._drive or name in OPTIONAL)
            if name not in self._ended_optional and not is_expected:
                self._handle_exit(name)
        if is_drive_finished:
            stop_all([self.processes[RECORDER]])  # it closes the bag
            self.finished = True
        return reports

    def require_closed(self) -> None:
        """Raise RunError if the recorder has not closed the bag.

        The method must be called after all nodes have ended.
        """
        if self._is_bag_unclosed:
            raise RunError(self._exit_text(RECORDER) + self._last_line(RECORDER))

    def _check_suspended(self) -> None:
        """Raise RunError if an essential node is suspended for longer than allowed.

        The limit is the timeout of the drive.
        """
        now = time.monotonic()
        if now - self._suspension_checked_at < SUSPENSION_CHECK_S:
            return
        self._suspension_checked_at = now
        for name, process in self.processes.items():
            if not process.is_suspended:
                self._suspended_since.pop(name, None)
                continue
            since = self._suspended_since.setdefault(name, now)
            if ENTRIES[name].essential and now - since > self._progress_timeout:
                raise RunError(f"node {name} is suspended (SIGSTOP) {self._progress_text}")

    def _take_reports(self) -> list[dict[str, float | str]]:
        """Return all reports of the drive received so far.

        The call waits up to `REPORT_WAIT_S` for the first report.
        """
        lines = list[str]()
        with suppress(Empty):
            lines.append(self._progress.get(timeout=REPORT_WAIT_S))
            lines += [self._progress.get_nowait() for _ in range(self._progress.qsize())]
        reports = [json.loads(line) for line in lines]
        self._is_done |= any("done" in report for report in reports)
        reports = [report for report in reports if "done" not in report]
        for last in reports[-1:]:
            self._progress_text = f"after tick {last['tick']} ({last['cam']}, {last['rpm']:g} rpm)"
        return reports

    def _handle_exit(self, name: str) -> None:
        """Handle the end of a node: raise RunError if it is essential, or else log it."""
        text = self._exit_text(name) + self._last_line(name)
        if ENTRIES[name].essential:
            raise RunError(text)
        self._ended_optional.add(name)
        self._log(f"{text}; the run continues without it")

    def _exit_text(self, name: str) -> str:
        return f"node {self.processes[name].exit_summary()} {self._progress_text}"

    def _last_line(self, name: str) -> str:
        """Return the error on a node's stderr with a leading ": ", for a message.

        The result is empty if the node was killed.
        """
        process = self.processes[name]
        return "" if process.was_killed else f": {process.last_stderr_line()}"

    @interruptible
    def _start_all(self) -> None:
        for name in self._nodes:
            self._start(name)

    def _start(self, name: str) -> None:
        report = self._progress.put if name == self._drive else None
        self.processes[name] = NodeProcess(
            name, self._nodes[name], self._subnet, self._log, report, self._namespace, self._server
        )
