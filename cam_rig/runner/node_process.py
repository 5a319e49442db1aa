"""One node as a process: started, its output read, ended."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path

from cam_rig.bag.split import Split
from cam_rig.errors import RunError
from cam_rig.runner.fork_server import ONE_THREAD, ForkedProcess, ForkServer, signals_blocked
from cam_rig.runner.node_table import (
    CONSUMERS,
    DRIVE,
    NODES,
    PANEL,
    PATIENCE_S,
    PLAYER,
    RECORDER,
    VIEWER,
    WAIT,
)
from cam_rig.runner.resources import log_folder, why_killed

#: Wall time (s) a node has to end when asked to, before it is killed.
SHUTDOWN_GRACE_S = 10.0
#: The variable that names Fast DDS's profile.
PROFILES = "FASTDDS_DEFAULT_PROFILES_FILE"
#: Lines of stderr that are kept.
MAX_STDERR_LINES = 1000
Arguments = dict[str, str | bool | float | list[str]]
Process = subprocess.Popen[str] | ForkedProcess


class NodeProcess:
    """A node that runs, forked from ``server`` or started by itself.

    ``log`` gets each line of its stdout, where no node writes but the middleware may; ``report``
    each line of its progress, which it writes into a pipe. `RunError` where the system has no
    process, no memory or no thread left for it.
    """

    def __init__(
        self,
        name: str,
        arguments: Arguments,
        network: bool,
        log: Callable[[str], None],
        report: Callable[[str], None] | None = None,
        namespace: str = "",
        server: ForkServer | None = None,
    ) -> None:
        self.name = name
        self.stderr_lines: list[str] = []
        self._threads: list[threading.Thread] = []
        #: Whether it did not end when it was asked to, so that it had to be killed.
        self.overdue = False
        try:
            command = _command(name, arguments, namespace)
            self.process, progress = _start(command, network, report is not None, server)
        except (OSError, MemoryError) as error:
            raise _none_left(name, getattr(error, "strerror", None) or "no memory") from None
        try:
            self._read(self.process.stdout, lambda line: log(line.rstrip()))
            self._read(self.process.stderr, self._keep_stderr)
            if report is not None:
                self._read(progress, report)
        except RuntimeError as error:  # of a thread: its output cannot be read, so it must not run
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            raise _none_left(name, str(error)) from None

    @property
    def code(self) -> int | None:
        """The exit code; None while it runs. One of SIGALRM is 0: all it had to do was done."""
        code = self.process.poll()
        return 0 if code == -signal.SIGALRM else code

    @property
    def has_ended(self) -> bool:
        """Whether it has ended."""
        return self.code is not None

    @property
    def was_killed(self) -> bool:
        """Whether a signal ended it."""
        return (self.code or 0) < 0

    @property
    def is_suspended(self) -> bool:
        """Whether it is suspended by a signal (SIGSTOP)."""
        try:
            with open(f"/proc/{self.process.pid}/stat", encoding="ascii", errors="replace") as line:
                return line.read(4096).rpartition(")")[2].split()[:1] == ["T"]
        except OSError:  # it has ended, or this is not Linux
            return False

    def exit_summary(self) -> str:
        """How it ended."""
        if self.overdue:
            return f"{self.name} did not end within {SHUTDOWN_GRACE_S:g} s and was killed"
        code = self.code or 0
        how = f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"
        return f"{self.name} {how}{why_killed(code)}"

    @property
    def warnings(self) -> list[str]:
        """The warnings in its stderr, without time and name."""
        return [line.split("]: ", 1)[-1].strip() for line in self.stderr_lines if "[WARN]" in line]

    def last_stderr_line(self) -> str:
        """Return the fatal error that the node logged, or else its last line on stderr."""
        self.settle()
        lines = [line.strip() for line in self.stderr_lines if line.strip()]
        fatal = [line.split("]: ", 1)[-1] for line in lines if line.startswith("[FATAL]")]
        return (fatal[:1] or lines[-1:] or ["nothing on stderr"])[0]

    def settle(self) -> None:
        """Once it has ended: wait until all its output has been read."""
        for thread in self._threads:
            thread.join(SHUTDOWN_GRACE_S)

    def _read(self, stream: Iterable[str] | None, take: Callable[[str], None]) -> None:
        thread = threading.Thread(target=_drain, args=(stream, take), daemon=True)
        thread.start()
        self._threads.append(thread)

    def _keep_stderr(self, line: str) -> None:
        if len(self.stderr_lines) < MAX_STDERR_LINES:
            self.stderr_lines.append(line)
        else:
            self.stderr_lines[-1] = line


def _start(
    command: list[str], network: bool, reports: bool, server: ForkServer | None
) -> tuple[Process, Iterable[str]]:
    """A node's process, and the lines of its progress, which come through a pipe."""
    if not reports:
        return _started(command, network, None, server), ()
    progress, pipe = os.pipe()
    with ExitStack() as unread:
        lines = unread.enter_context(os.fdopen(progress))
        try:
            command = [*command, "-p", f"progress_fd:={pipe}"]
            process = _started(command, network, pipe, server)
        finally:
            os.close(pipe)
        unread.pop_all()
    return process, lines


def _command(name: str, arguments: Arguments, namespace: str) -> list[str]:
    # as JSON, which is YAML too: a folder called yes or 1e3 stays a text
    pairs = (f"{key}:={json.dumps(value)}" for key, value in arguments.items())
    ros = [part for pair in pairs for part in ("-p", pair)]
    place = ("-r", f"__ns:={namespace}") if namespace else ()
    return [sys.executable, "-m", "cam_rig.nodes", name, "--ros-args", *place, *ros]


def _started(
    command: list[str], network: bool, pipe: int | None, server: ForkServer | None
) -> Process:
    own = environment(network)
    forked = server.start(command, own, pipe) if server is not None else None
    if forked is not None:
        return forked
    with signals_blocked():
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            pass_fds=() if pipe is None else (pipe,),
            env=own,
            start_new_session=True,  # Ctrl-C reaches the runner alone, which ends all in order
        )


def _none_left(name: str, why: str) -> RunError:
    return RunError(
        f"node {name} cannot be started ({why}); end other programs, or raise what a process or "
        "a user may have (ulimit -v, ulimit -u)"
    )


def stop_all(nodes: list[NodeProcess]) -> None:
    """Ask all to end, wait for them, and kill those that do not."""
    for node in nodes:
        if not node.has_ended:
            node.process.send_signal(signal.SIGINT)
            node.process.send_signal(signal.SIGCONT)  # one that was suspended ends in order too
    deadline = time.monotonic() + SHUTDOWN_GRACE_S
    for node in nodes:
        try:
            node.process.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            node.overdue = True
            os.killpg(node.process.pid, signal.SIGKILL)
            node.process.wait()


def environment(network: bool = False) -> dict[str, str]:
    """The nodes' environment; only with ``network`` sockets leave this machine, as the user set."""
    from cam_rig.schema.load import config_root

    # The nodes' matrices are small: threads inside one node only take the cores of the others.
    own = ONE_THREAD | os.environ
    own["ROS_LOG_DIR"] = str(log_folder()[0])
    own["CAM_RIG_RUNNER"] = str(os.getpid())
    if network:
        own.setdefault(PROFILES, str(config_root() / "fastdds_subnet.xml"))
    else:
        own[PROFILES] = str(config_root() / "fastdds_loopback.xml")
        own["SKIP_DEFAULT_XML_FILE"] = "1"  # one in the working directory would open the subnet
        # any other range, LOCALHOST too, would replace the profile's transports
        own["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    return own


def _drain(stream: Iterable[str], take: Callable[[str], None]) -> None:
    for line in stream:
        take(line)


def live(
    scene: Path,
    bag: Path,
    screen: str | None = None,
    split: Split | None = None,
    **drive: str | bool | float,
) -> dict[str, Arguments]:
    """The nodes of a run; a viewer draws to ``screen``, if any; ``split`` limits each file."""
    names = [entry.name for entry in NODES if screen is not None or entry.name != VIEWER]
    consumers = [name for name in names if name in CONSUMERS]
    given: dict[str, Arguments] = {
        RECORDER: {"bag": str(bag), **(split or Split()).parameters},
        VIEWER: {"address": screen or ""},
        # a node that has ended is noticed here at once, so a busy machine may answer late
        DRIVE: {"consumers": consumers, "patience": PATIENCE_S, **drive},
    }
    # the runner ends its nodes itself, when it need not start one again for another
    common = {"scene": str(scene), "at_end": WAIT}
    return {name: {**common, **given.get(name, {})} for name in names}


def replayed(scene: Path, bag: Path, recorded: Path) -> dict[str, Arguments]:
    """The consumers of a run, and the player in place of the drive and the law server."""
    nodes = {name: given for name, given in live(scene, bag).items() if name in CONSUMERS}
    player: Arguments = {"bag": str(recorded), "patience": PATIENCE_S, "at_end": WAIT}
    return nodes | {PLAYER.name: player}


def steered(
    scene: Path, bag: Path, socket: Path, screen: str | None, **drive: str | bool | float
) -> dict[str, Arguments]:
    """The nodes of a run that a page steers, through the panel's node at ``socket``."""
    nodes = live(scene, bag, screen, None, **drive)
    panel: Arguments = {"scene": str(scene), "at_end": WAIT, "socket": str(socket)}
    return {PANEL.name: panel} | nodes
