"""Running rig for tests: its nodes, progress and bag, and programs started next to it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import count
from pathlib import Path
from threading import Thread
from typing import Any

from cam_rig.errors import RunError
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import PROFILE_VARIABLE, SHUTDOWN_GRACE_S, environment, live_nodes
from cam_rig.runner.resources import domain_ports
from cam_rig.schema.load import resolve_path
from cam_rig.studies.simulate.recorded import read_bag
from cam_rig.studies.simulate.study import SceneRun
from cam_rig.testing.client import TIMEOUT_S, RigClient

# Programs that a test starts next to the rig.


#: Shell script that ends the process group $1 when its stdin is closed: SIGINT first, and SIGKILL
#: if it still runs after 10 s.
WATCHER = """read -r _
kill -s INT -- "-$1" 2>/dev/null
for _ in 1 2 3 4 5 6 7 8 9 10; do kill -s 0 -- "-$1" 2>/dev/null || exit 0; sleep 1; done
kill -s KILL -- "-$1" 2>/dev/null"""


class StartedProgram:
    """Program in a separate session, which ends with its children when the test ends.

    A second process watches the end of a pipe from this process. It ends the program if this
    process is terminated and cannot call `end`.
    """

    def __init__(self, command: Sequence[str], environment: dict[str, str]) -> None:
        scripts = (part for part in command if part.endswith(".py"))
        self.name = Path(next(scripts, command[0])).name
        self._output = tempfile.TemporaryFile()  # noqa: SIM115  # closed by `end`
        self._text = ""
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            env=environment | {"PYTHONUNBUFFERED": "1"},
            start_new_session=True,
        )
        self._watcher = subprocess.Popen(
            ["sh", "-c", WATCHER, "sh", str(self._process.pid)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    @property
    def code(self) -> int | None:
        """Exit code, or None if the program is running."""
        return self._process.poll()

    @property
    def output(self) -> str:
        """Text that the program has written to stdout and stderr."""
        if not self._output.closed:
            size = os.fstat(self._output.fileno()).st_size
            written = os.pread(
                self._output.fileno(), size, 0
            )  # does not move the position of the writer
            self._text = written.decode(errors="replace")
        return self._text

    def failure(self) -> RunError | None:
        """Return an error with exit code and last line if the program has failed, else None."""
        if not self.code:
            return None
        last = (self.output.strip() or "no output").rpartition("\n")[2]
        return RunError(f"program {self.name} ended with code {self.code}: {last}")

    def end(self) -> None:
        """End the program by SIGINT, and kill it and its children after `SHUTDOWN_GRACE_S`."""
        self._watcher.kill()
        self._watcher.wait()
        if self._watcher.stdin is not None:
            self._watcher.stdin.close()
        if self.code is None:
            self._process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(SHUTDOWN_GRACE_S)
        with suppress(ProcessLookupError):  # all processes of the group have ended
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        print(f"[{self.name}] {self.output.rstrip()}")
        self._output.close()


#: Longest time (s, wall clock) after the end of a run for which a test still waits for a condition.
#: Latched messages and services of the remaining nodes are discovered within 3 s on a busy machine.
AFTER_RUN_S = 5.0

# ROS domain of one test, limited to this machine.

#: ROS domains for tests. Their ports are below the ephemeral ports of Linux, and the low numbers
#: remain for the domain of the user.
DOMAINS = range(40, 101)

#: Counter from which the index of the next domain to try follows. It starts at the process id, so
#: that processes try different domains first.
_counter = count(os.getpid())

#: Environment variables that keep the sockets of a node on this machine.
_LOCAL_VARIABLES = (PROFILE_VARIABLE, "ROS_AUTOMATIC_DISCOVERY_RANGE", "SKIP_DEFAULT_XML_FILE")


@contextmanager
def hold_domain() -> Iterator[int]:
    """Reserve a ROS domain that no other test on this machine uses, and yield it.

    If all domains are in use, the call waits. A domain is locked by binding a UDP port that belongs
    to the domain and that no DDS participant uses. Processes that share the network therefore share
    the lock, and the kernel releases it at the end of the process.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as lock:
        while True:
            domain = DOMAINS[next(_counter) % len(DOMAINS)]
            with suppress(OSError):
                lock.bind(("127.0.0.1", domain_ports(domain)[9]))
                break
            time.sleep(0.02)
        yield domain


@contextmanager
def in_domain(domain: int) -> Iterator[None]:
    """Set the environment for processes in a domain, with sockets on this machine only."""
    local = environment()
    variables = {"ROS_DOMAIN_ID": str(domain)} | {name: local[name] for name in _LOCAL_VARIABLES}
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def isolated_domain() -> Iterator[int]:
    """Reserve a ROS domain, and set the environment variables of this process for it.

    The domain is limited to this machine. The variables are restored when the context ends.
    """
    with hold_domain() as domain, in_domain(domain):
        yield domain


class RunningRig(RigClient):
    """Context manager that starts the nodes of a run and ends all of them at its exit.

    Each node is a process. The nodes are in a separate ROS domain, limited to this machine. The
    class is for tests without the fixture `start_rig`. Each method that waits raises `RunError` as
    soon as a node has ended early, with the last line that the node wrote.

    Threads: `_watch` runs in the thread `_watcher`, appends to `ticks`, and
    sets `_done_at`, then `_done`, or `_failure`. The thread of the test calls all other methods. It
    only reads these attributes until the watcher has ended, so they need no lock.

    Parameters
    ----------
    scene : str or Path
        Name of a shipped scene, or a path.
    bag : str or Path
        Folder to record into, which must not exist.
    timeout : float
        Wall time (s) after which a wait fails.
    **drive
        Parameters of cam_drive, such as ``pacing="20x"``. With ``autostart=False`` the cam is
        stopped until ``call("/cam_drive/start")``.

    Attributes
    ----------
    domain : int
        ROS domain of the rig.
    environment : dict
        Environment for programs in that domain.
    ticks : list of dict
        Report of the drive on each tick: ``tick``, ``cam``, ``rpm``, ``time`` (s).
    log : list of str
        Lines that the runner logged.

    Examples
    --------
    >>> from cam_rig.testing.running_rig import RunningRig
    >>> with RunningRig("quick", "out/bag", autostart=False) as rig:  # doctest: +SKIP
    ...     rig.call("/cam_drive/start")
    ...     rig.wait_for_tick(3)["rpm"]
    200.0
    """

    def __init__(
        self, scene: str | Path, bag: str | Path, timeout: float = TIMEOUT_S, **drive: Any
    ) -> None:
        self.scene, self.bag = resolve_path("scenes", scene), Path(bag)
        self.ticks: list[dict[str, Any]] = []
        self.log: list[str] = []
        self._drive: dict[str, Any] = {"progress_timeout": timeout, **drive}
        self._client_timeout = timeout
        self._programs: list[StartedProgram] = []
        self._started = self._done = self._ending = False
        self._done_at = 0.0  # s, monotonic
        self._failure: RunError | None = None
        self._reported = False
        self._stack = ExitStack()

    def __enter__(self) -> RunningRig:
        if self._started:  # the fixture has entered the context
            return self
        self._started = True
        with ExitStack() as stack:
            self.domain = stack.enter_context(hold_domain())
            with in_domain(self.domain):
                self.environment = dict(os.environ)
                nodes = live_nodes(self.scene, self.bag, **self._drive)
                self._graph = stack.enter_context(Graph(nodes, log=self.log.append))
                super().__init__(self.domain, self._client_timeout)
            stack.callback(RigClient.__exit__, self)
            self._watcher = Thread(target=self._watch, daemon=True)
            self._watcher.start()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self.end()
        if error[:1] in ((), (None,)) and not self._reported:
            self._require_no_failure()
            self._graph.require_closed()

    @property
    def pids(self) -> dict[str, int]:
        """Process id of each node by name, for tests that kill or suspend a node."""
        return {name: node.process.pid for name, node in self._graph.processes.items()}

    def end(self) -> None:
        """End all nodes and programs. The recorder closes the bag."""
        if self._ending:
            return
        self._check_programs()
        self._ending = True
        self._stack.close()
        self._watcher.join()
        for name, process in self._graph.processes.items():
            process.wait_for_output()
            if process.code and self._failure is None:  # it failed before, as SIGINT gives code 0
                last = "" if process.was_killed else f": {process.last_stderr_line()}"
                self._failure = RunError(f"node {process.exit_summary()}{last}")
            for line in process.stderr_lines:
                print(f"[{name}] {line.rstrip()}")

    def read_bag(self) -> SceneRun:
        """End the rig, and return its recording, see `cam_rig.read_bag`."""
        self.end()
        return read_bag(self.bag)

    def wait_for(self, condition: Callable[[], Any], what: str = "the condition") -> Any:
        """Wait for a condition as `RigClient.wait_for`.

        Raises
        ------
        RunError
            If a node or a program has ended early, if the rig has been ended, or if the condition
            is not true `AFTER_RUN_S` after the run is over. Only messages in transit and services
            of the remaining nodes can make it true then.
        """
        started_at = time.monotonic()

        def checked() -> Any:
            self._require_no_failure()
            if value := condition():
                return value
            if self._ending:
                raise RunError(f"{what}: the rig has been ended")
            waited = time.monotonic() - max(started_at, self._done_at)
            if self._done and waited > AFTER_RUN_S:
                raise RunError(f"{what}: the run is over, so it cannot be reached any more")
            return None

        return super().wait_for(checked, what)

    def wait_for_tick(self, number: int = 1) -> dict[str, Any]:
        """Wait for a tick, and return the drive's report on it.

        A tick is the time between two cam states, counted from 1. The report has the keys ``tick``,
        ``cam``, ``rpm`` and ``time`` (s).

        Raises
        ------
        RunError
            If the run is over before this tick.
        """

        def report_of_tick() -> Any:
            done = self._done
            reports = (report for report in self.ticks if report["tick"] >= number)
            if (report := next(reports, None)) is None and done:
                raise RunError(f"tick {number}: the run was over after tick {len(self.ticks) - 1}")
            return report

        return dict(self.wait_for(report_of_tick, f"tick {number}"))

    def wait_until_done(self) -> None:
        """Wait until the scene is complete and the bag is closed.

        All ticks (times between two cam states) are then acknowledged.
        """
        self.wait_for(lambda: self._done, "the end of the run")

    def start_program(self, *command: str) -> StartedProgram:
        """Start a program, such as another node, in the ROS domain of the rig.

        The program ends with the rig.
        """
        program = StartedProgram(command, self.environment)
        self._programs.append(program)
        self._stack.callback(program.end)
        return program

    def _watch(self) -> None:
        """Store the reports of the drive until the run is over, in the thread `_watcher`."""
        try:
            for report in self._graph.progress():
                self.ticks.append(report)
            self._done_at, self._done = time.monotonic(), True
        except RunError as error:
            if not self._ending:
                self._failure = error

    def _check_programs(self) -> None:
        """Store the failure of a program, unless the rig is ending its programs."""
        if not self._ending:
            failures = (program.failure() for program in self._programs)
            self._failure = self._failure or next(filter(None, failures), None)

    def _require_no_failure(self) -> None:
        self._check_programs()
        if self._failure is not None:
            self._reported = True
            raise self._failure
