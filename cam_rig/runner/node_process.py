"""Start a node as a process, read its output, and end it."""

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
from cam_rig.runner.fork_server import SINGLE_THREAD, ForkedProcess, ForkServer, block_signals
from cam_rig.runner.node_table import (
    CONSUMERS,
    DRIVE,
    NODES,
    PANEL,
    PLAYER,
    PROGRESS_TIMEOUT_S,
    RECORDER,
    VIEWER,
    WAIT,
)
from cam_rig.runner.resources import explain_signal, log_folder

#: Wall time (s) after SIGINT within which a node must end. After it the node is killed.
SHUTDOWN_GRACE_S = 10.0
#: Environment variable with the path of the Fast DDS profile.
PROFILE_VARIABLE = "FASTDDS_DEFAULT_PROFILES_FILE"
#: Maximum number of stored lines of a node's stderr. Each further line replaces the last.
MAX_STDERR_LINES = 1000
#: Type of the parameters of a node, by name.
Arguments = dict[str, str | bool | float | list[str]]
#: Type of a node's process: started in a new interpreter, or forked.
Process = subprocess.Popen[str] | ForkedProcess


class NodeProcess:
    """Running node, forked from a server or started in a new interpreter.

    Threads: one thread per stream reads lines and calls `log`, `report` or `_keep_stderr`. The
    thread of the graph calls all other methods. `stderr_lines` needs no lock: one thread appends to
    it, and it is complete after `wait_for_output`.

    Parameters
    ----------
    name : str
        Executable of the node.
    arguments : dict
        Parameters of the node.
    subnet : bool
        True to allow discovery on the local subnet, see `environment`.
    log : callable
        Called with each line of stdout, which only the middleware writes.
    report : callable, optional
        Called with each line of progress, which the node writes to a pipe.
    namespace : str
        Namespace of the node, such as /rig1.
    server : ForkServer, optional
        Server from which the node is forked.

    Raises
    ------
    RunError
        If the system has no process, memory or thread left for the node.
    """

    def __init__(
        self,
        name: str,
        arguments: Arguments,
        subnet: bool,
        log: Callable[[str], None],
        report: Callable[[str], None] | None = None,
        namespace: str = "",
        server: ForkServer | None = None,
    ) -> None:
        self.name = name
        self.stderr_lines: list[str] = []
        self._threads: list[threading.Thread] = []
        #: True if the node did not end within `SHUTDOWN_GRACE_S` after SIGINT and was killed.
        self.overdue = False
        try:
            command = _command(name, arguments, namespace)
            self.process, progress = _start(command, subnet, report is not None, server)
        except (OSError, MemoryError) as error:
            raise _start_error(name, getattr(error, "strerror", None) or "no memory") from None
        try:
            self._start_reader(self.process.stdout, lambda line: log(line.rstrip()))
            self._start_reader(self.process.stderr, self._keep_stderr)
            if report is not None:
                self._start_reader(progress, report)
        except RuntimeError as error:  # no thread can be started, so the output is not read
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            raise _start_error(name, str(error)) from None

    @property
    def code(self) -> int | None:
        """Exit code, or None if the node is running.

        The code of SIGALRM is reported as 0: the node had completed its work.
        """
        code = self.process.poll()
        return 0 if code == -signal.SIGALRM else code

    @property
    def has_ended(self) -> bool:
        """True if the node has ended."""
        return self.code is not None

    @property
    def was_killed(self) -> bool:
        """True if a signal ended the node."""
        return (self.code or 0) < 0

    @property
    def is_suspended(self) -> bool:
        """True if the node is suspended by a signal (SIGSTOP)."""
        try:
            with open(f"/proc/{self.process.pid}/stat", encoding="ascii", errors="replace") as line:
                return line.read(4096).rpartition(")")[2].split()[:1] == ["T"]
        except OSError:  # the node has ended, or this is not Linux
            return False

    def exit_summary(self) -> str:
        """Return a text that states how the node ended."""
        if self.overdue:
            return f"{self.name} did not end within {SHUTDOWN_GRACE_S:g} s and was killed"
        code = self.code or 0
        text = f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"
        return f"{self.name} {text}{explain_signal(code)}"

    @property
    def warnings(self) -> list[str]:
        """Warnings on stderr, without time and node name."""
        return [line.split("]: ", 1)[-1].strip() for line in self.stderr_lines if "[WARN]" in line]

    def last_stderr_line(self) -> str:
        """Return the fatal error that the node logged, or else its last line on stderr."""
        self.wait_for_output()
        lines = [line.strip() for line in self.stderr_lines if line.strip()]
        fatal = [line.split("]: ", 1)[-1] for line in lines if line.startswith("[FATAL]")]
        return (fatal[:1] or lines[-1:] or ["no line on stderr"])[0]

    def wait_for_output(self) -> None:
        """Wait until all output of the ended node has been read."""
        for thread in self._threads:
            thread.join(SHUTDOWN_GRACE_S)

    def _start_reader(self, stream: Iterable[str] | None, take: Callable[[str], None]) -> None:
        thread = threading.Thread(target=_drain, args=(stream, take), daemon=True)
        thread.start()
        self._threads.append(thread)

    def _keep_stderr(self, line: str) -> None:
        if len(self.stderr_lines) < MAX_STDERR_LINES:
            self.stderr_lines.append(line)
        else:
            self.stderr_lines[-1] = line


def _start(
    command: list[str], subnet: bool, reports: bool, server: ForkServer | None
) -> tuple[Process, Iterable[str]]:
    """Start a node, and return its process and an iterable of its progress lines.

    The node writes these lines to a pipe. If `reports` is False, the node gets no pipe and the
    iterable is empty. ``command`` is the command line of the node. ``server`` is the fork server,
    or None. ``subnet`` is True to allow discovery on the local subnet.
    """
    if not reports:
        return _launch(command, subnet, None, server), ()
    progress, pipe = os.pipe()
    with ExitStack() as stack:  # closes the pipe if the start fails
        lines = stack.enter_context(os.fdopen(progress))
        try:
            command = [*command, "-p", f"progress_fd:={pipe}"]
            process = _launch(command, subnet, pipe, server)
        finally:
            os.close(pipe)
        stack.pop_all()
    return process, lines


def _command(name: str, arguments: Arguments, namespace: str) -> list[str]:
    """Return the command line of a node."""
    # values as JSON, which is valid YAML: a folder named yes or 1e3 remains a text
    pairs = (f"{key}:={json.dumps(value)}" for key, value in arguments.items())
    parameters = [part for pair in pairs for part in ("-p", pair)]
    remapping = ("-r", f"__ns:={namespace}") if namespace else ()
    return [sys.executable, "-m", "cam_rig.nodes", name, "--ros-args", *remapping, *parameters]


def _launch(
    command: list[str], subnet: bool, pipe: int | None, server: ForkServer | None
) -> Process:
    """Start a command, forked from the server if possible, and pass the pipe to it."""
    variables = environment(subnet)
    forked = server.start(command, variables, pipe) if server is not None else None
    if forked is not None:
        return forked
    with block_signals():
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            pass_fds=() if pipe is None else (pipe,),
            env=variables,
            start_new_session=True,  # Ctrl-C reaches only the runner, which ends the nodes in order
        )


def _start_error(name: str, reason: str) -> RunError:
    return RunError(
        f"node {name} cannot be started ({reason}); end other programs, or raise the limits of "
        "memory and processes (ulimit -v, ulimit -u)"
    )


def stop_all(nodes: list[NodeProcess]) -> None:
    """End nodes by SIGINT, wait for them, and kill those that exceed `SHUTDOWN_GRACE_S`."""
    for node in nodes:
        if not node.has_ended:
            node.process.send_signal(signal.SIGINT)
            node.process.send_signal(signal.SIGCONT)  # so that a suspended node ends, too
    deadline = time.monotonic() + SHUTDOWN_GRACE_S
    for node in nodes:
        try:
            node.process.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            node.overdue = True
            os.killpg(node.process.pid, signal.SIGKILL)
            node.process.wait()


def environment(subnet: bool = False) -> dict[str, str]:
    """Return the environment of the nodes.

    If `subnet` is False, no socket leaves this machine. If it is True, a Fast DDS profile and a
    discovery range set by the user apply.
    """
    from cam_rig.schema.load import config_root

    # the matrices of the nodes are small, so threads in a node only take the cores of the others
    variables = SINGLE_THREAD | os.environ
    variables["ROS_LOG_DIR"] = str(log_folder()[0])
    variables["CAM_RIG_RUNNER"] = str(os.getpid())
    if subnet:
        variables.setdefault(PROFILE_VARIABLE, str(config_root() / "fastdds_subnet.xml"))
    else:
        variables[PROFILE_VARIABLE] = str(config_root() / "fastdds_loopback.xml")
        # a default profile in the working directory would open the subnet
        variables["SKIP_DEFAULT_XML_FILE"] = "1"
        # any other range, LOCALHOST included, would replace the transports of the profile
        variables["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    return variables


def _drain(stream: Iterable[str], take: Callable[[str], None]) -> None:
    """Pass each line of a stream to a function, until the stream ends."""
    for line in stream:
        take(line)


def live_nodes(
    scene: Path,
    bag: Path,
    screen: str | None = None,
    split: Split | None = None,
    **drive: str | bool | float,
) -> dict[str, Arguments]:
    """Return the nodes of a run with their parameters, in the order of their start.

    Parameters
    ----------
    scene : Path
        Scene file.
    bag : Path
        Folder to record into.
    screen : str, optional
        Address of Rerun for the viewer (default: no viewer).
    split : Split, optional
        Limits of each file of the bag (default: one file).
    **drive : str, bool or float
        Parameters of the drive.
    """
    names = [entry.name for entry in NODES if screen is not None or entry.name != VIEWER]
    consumers = [name for name in names if name in CONSUMERS]
    by_node: dict[str, Arguments] = {
        RECORDER: {"output_uri": str(bag), **(split or Split()).parameters},
        VIEWER: {"address": screen or ""},
        # the runner detects an ended node at once, so the drive can wait long on a busy machine
        DRIVE: {"consumers": consumers, "progress_timeout": PROGRESS_TIMEOUT_S, **drive},
    }
    # the nodes wait at the end of the run, because the runner ends them in order
    common = {"scene": str(scene), "on_finish": WAIT}
    return {name: {**common, **by_node.get(name, {})} for name in names}


def replay_nodes(scene: Path, bag: Path, recorded: Path) -> dict[str, Arguments]:
    """Return the nodes of a replay with their parameters: the consumers and the player.

    The player replaces the drive and the law server. `bag` is the folder to record into and
    `recorded` the bag to play.
    """
    nodes = {name: values for name, values in live_nodes(scene, bag).items() if name in CONSUMERS}
    player: Arguments = {
        "input_uri": str(recorded),
        "progress_timeout": PROGRESS_TIMEOUT_S,
        "on_finish": WAIT,
    }
    return nodes | {PLAYER.name: player}


def panel_nodes(
    scene: Path, bag: Path, socket: Path, screen: str | None, **drive: str | bool | float
) -> dict[str, Arguments]:
    """Return the nodes of a run that a page controls, with their parameters.

    The panel node connects them with the page, through the `socket` of `cam-rig panel`.
    """
    nodes = live_nodes(scene, bag, screen, None, **drive)
    panel: Arguments = {"scene": str(scene), "on_finish": WAIT, "socket": str(socket)}
    return {PANEL.name: panel} | nodes
