"""One node as a process: started, listened to, ended."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from cam_rig.errors import RunError
from cam_rig.runner.shared_memory import why_killed
from cam_rig.runner.user_folder import user_folder
from cam_rig.schema.load import config_root

#: Wall time (s) a node has to end when asked to, before it is killed.
GRACE = 10.0
#: Where Fast DDS looks for its profile.
PROFILES = "FASTDDS_DEFAULT_PROFILES_FILE"
#: Lines of its errors that are kept.
MAX_WORDS = 1000


class NodeProcess:
    """A node that runs.

    Parameters
    ----------
    name : the node's name, and its module's
    arguments : its parameters
    network : see `environment`
    hear : told each line of its stdout

    Raises
    ------
    RunError : the system has no process, no memory or no thread left for it
    """

    def __init__(
        self,
        name: str,
        arguments: dict[str, str | bool | float | list[str]],
        network: bool,
        hear: Callable[[str], None],
    ) -> None:
        self.name = name
        self.words: list[str] = []
        self._threads: list[threading.Thread] = []
        #: Whether it did not end when it was asked to, so that it had to be killed.
        self.overdue = False
        # as JSON, which is YAML too: a folder called yes or 1e3 stays a text
        pairs = (f"{key}:={json.dumps(value)}" for key, value in arguments.items())
        ros = [part for pair in pairs for part in ("-p", pair)]
        command = [sys.executable, "-m", "cam_rig.nodes", name, "--ros-args", *ros]
        try:
            self.process = _started(command, network)
        except (OSError, MemoryError) as error:
            raise _none_left(name, getattr(error, "strerror", None) or "no memory") from None
        try:
            self._listen(hear)
        except RuntimeError as error:  # of a thread: it cannot be heard, so it must not run
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            raise _none_left(name, str(error)) from None

    @property
    def code(self) -> int | None:
        """The exit code; None while it runs."""
        return self.process.poll()

    @property
    def has_ended(self) -> bool:
        """Whether it runs no more."""
        return self.code is not None

    @property
    def was_killed(self) -> bool:
        """Whether a signal ended it."""
        return (self.code or 0) < 0

    @property
    def is_suspended(self) -> bool:
        """Whether a signal made it stand still (SIGSTOP)."""
        try:
            with open(f"/proc/{self.process.pid}/stat", encoding="ascii", errors="replace") as line:
                return line.read(4096).rpartition(")")[2].split()[:1] == ["T"]
        except OSError:  # it has ended, or this is no Linux
            return False

    def obituary(self) -> str:
        """How it ended."""
        if self.overdue:
            return f"{self.name} did not end within {GRACE:g} s and was killed"
        code = self.code or 0
        how = f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"
        return f"{self.name} {how}{why_killed(code)}"

    @property
    def warnings(self) -> list[str]:
        """What it warned of, without time and name."""
        return [line.split("]: ", 1)[-1].strip() for line in self.words if "[WARN]" in line]

    def last_words(self) -> str:
        """The last line it wrote to stderr."""
        self.settle()
        words = [line.strip() for line in self.words if line.strip()]
        return words[-1] if words else "it said nothing"

    def _listen(self, hear: Callable[[str], None]) -> None:
        for stream, take in ((self.process.stdout, hear), (self.process.stderr, self._hear_words)):
            thread = threading.Thread(target=_drain, args=(stream, take), daemon=True)
            thread.start()
            self._threads.append(thread)

    def settle(self) -> None:
        """Once it has ended: wait until all that it wrote has been read."""
        for thread in self._threads:
            thread.join(GRACE)

    def _hear_words(self, line: str) -> None:
        if len(self.words) < MAX_WORDS:
            self.words.append(line)
        else:
            self.words[-1] = line


def _started(command: list[str], network: bool) -> subprocess.Popen[str]:
    with _signals_held_back():
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(network),
            start_new_session=True,  # Ctrl-C reaches the runner alone, which ends all in order
        )


def _none_left(name: str, why: str) -> RunError:
    return RunError(
        f"node {name} cannot be started ({why}); end other programs, or raise what a process or "
        "a user may have (ulimit -v, ulimit -u)"
    )


@contextmanager
def _signals_held_back() -> Iterator[None]:
    """What is started here has no signal that ends it until it lets them through itself."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def stop_all(nodes: list[NodeProcess]) -> None:
    """Ask all to end, wait for them, and kill who does not."""
    for node in nodes:
        if not node.has_ended:
            node.process.send_signal(signal.SIGINT)
            node.process.send_signal(signal.SIGCONT)  # one that was suspended ends in order too
    deadline = time.monotonic() + GRACE
    for node in nodes:
        try:
            node.process.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            node.overdue = True
            os.killpg(node.process.pid, signal.SIGKILL)
            node.process.wait()


def environment(network: bool = False) -> dict[str, str]:
    """The nodes' environment: no socket leaves this machine, unless ``network`` says otherwise.

    Then a profile of the user's own counts, where there is one.
    """
    own = dict(os.environ)
    # The nodes' matrices are small: threads inside one node only take the cores of the others.
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        own.setdefault(threads, "1")
    if not own.get("HOME"):  # a service or a cron job: ROS would find nowhere for its log files
        own.setdefault("ROS_LOG_DIR", str(user_folder() / "cam_rig-ros-log"))
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
