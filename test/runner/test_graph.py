"""Tests of the runner: which exits end the run, and which node is reported."""

import errno
import os
import resource
import signal
import subprocess
import sys
import threading
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from cam_rig.errors import RunError
from cam_rig.runner import node_process as process
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import NodeProcess, environment, live_nodes
from cam_rig.runner.node_table import NODES, VIEWER, blocking_text
from cam_rig.runner.resources import log_folder

from ..processes import ended

KILLED = -signal.SIGKILL


@pytest.fixture
def made(monkeypatch, tmp_path):
    """Factory of run graphs with fake node processes.

    `codes` are the exit codes of a node that has already ended. Other nodes end when they receive a
    signal, with the codes in `closing`.
    """
    did = SimpleNamespace(logged=[], stopped=[], cleaned=[])

    class Process:
        pid = os.getpid()

        def __init__(self, code, name, closing):
            self.code, self.name, self.closing = code, name, closing

        def poll(self):
            return self.code

        def send_signal(self, _number):
            if self.code is None:
                self.code = self.closing.pop(0) if self.closing else 0
                did.stopped.append(self.name)

        def wait(self, _timeout):
            return self.code

    def make(closing=(), screen=None, **codes):
        closing = list(closing)

        class Made(NodeProcess):
            def __init__(self, name, *_):
                self.name, self.stderr_lines, self._threads = name, ["no space"], []
                ends = codes.get(name, [])
                self.process = Process(ends.pop(0) if ends else None, name, closing)
                self.overdue = False

        monkeypatch.setattr("cam_rig.runner.graph.NodeProcess", Made)
        nodes = live_nodes(tmp_path, tmp_path / "bag", screen=screen)
        return Graph(nodes, log=did.logged.append)

    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(
        "cam_rig.runner.graph.remove_segments", lambda since, **_: did.cleaned.append(since)
    )
    monkeypatch.setattr("cam_rig.runner.graph.LOCK_GRACE_S", 0.0)
    make.did = did
    return make


FAILED = [
    (other, KILLED, f"node {other} was ended by signal 9")
    for other in ("recorder", "follower", "microphone", "law_server")
]
FAILED.append(("recorder", 1, r"node recorder ended with code 1 before .*: no space"))


@pytest.mark.parametrize(("node", "code", "words"), FAILED)
def test_failed_node_is_named_even_if_the_drive_has_finished(made, node, code, words):
    """A node that fails after the drive has finished is reported with its name.

    The error also has the last line of its stderr.
    """
    graph = made(cam_drive=[0], **{node: [code]})
    graph._start_all()
    graph._progress.put('{"done": true}')
    with pytest.raises(RunError, match=words):
        list(graph.progress())


def test_fatal_error_of_a_node_is_reported_as_its_reason(made):
    """The reason of a failed node is its fatal error, not a later line on stderr."""
    graph = made(follower=[1])
    graph._start_all()
    lines = [
        "[INFO] [1.0] [follower]: waits",
        "[FATAL] [2.0] [follower]: scene: wrong",
        "[WARN] late",
    ]
    graph.processes["follower"].stderr_lines = lines
    with pytest.raises(RunError, match=r"node follower ended with code 1 .*: scene: wrong$"):
        graph.poll()


@pytest.mark.parametrize("code", [KILLED, 1, 0])
def test_run_continues_without_its_viewer(made, code):
    """A run continues if the viewer ends with any exit code, and one line reports it."""
    graph, logged = made(screen="address", **{VIEWER: [code]}), made.did.logged
    graph._start_all()
    for _ in range(3):
        graph.poll()
    assert graph.processes[VIEWER].has_ended
    assert [line.endswith("; the run continues without it") for line in logged] == [True]


def test_stopped_drive_is_an_error(made):
    """A drive that ends before its last tick is an error, even with exit code 0.

    A tick is the interval between two cam states.
    """
    words = "node cam_drive was stopped before the first tick"
    with pytest.raises(RunError, match=words), made(cam_drive=[0]) as graph:
        list(graph.progress())


@pytest.mark.parametrize(("code", "cleans"), [(1, True), (KILLED, True), (0, False), (None, False)])
def test_shared_memory_is_cleaned_after_a_failed_run(made, code, cleans):
    """Shared memory is cleaned after a run in which a node failed, and only then.

    It is that of Fast DDS. A node on a full disk leaves segments like a killed node.
    """
    with made(microphone=[code]):
        pass
    assert bool(made.did.cleaned) == cleans


def test_interrupt_ends_all_nodes_and_the_recorder_last(made):
    """An interrupt of a run ends all five nodes, the recorder last."""
    with pytest.raises(KeyboardInterrupt), made():
        raise KeyboardInterrupt
    assert made.did.stopped[-1] == "recorder" and len(made.did.stopped) == 5


def test_blocking_node_is_the_first_of_the_chain():
    """Of several missing nodes the text starts with the node that the others wait for."""
    order = ["law_server", "follower", "microphone", "viewer", "recorder"]
    assert [entry.name for entry in reversed(NODES)][1:] == order
    assert blocking_text(["recorder"]) == "recorder"
    for number in range(2, len(order) + 1):
        for names in combinations(order, number):
            words = f"{names[0]}, which blocks {', '.join(names[1:])}"
            assert blocking_text(names) == blocking_text(names[::-1]) == words


# Start of a node if the system has no memory, process or thread left.

FULL = "node follower cannot be started \\({}\\); end other programs, or raise the .*ulimit -v"


def start(report=None):
    return NodeProcess("follower", {}, False, print, report)


@pytest.mark.parametrize("reports", [False, True])
def test_start_without_free_processes_or_memory(monkeypatch, reports):
    """A node that cannot start for lack of memory or processes raises RunError.

    The error names the resource and the remedy. No file descriptor is left open.
    """
    for error, reason in (
        (MemoryError(), "no memory"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "Resource temporarily"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "Cannot allocate memory"),
    ):
        refuse = Mock(side_effect=error)
        monkeypatch.setattr(process.subprocess, "Popen", refuse)
        before = len(list(Path("/proc/self/fd").iterdir()))
        with pytest.raises(RunError, match=FULL.format(f"{reason}.*")):
            start(print if reports else None)
        assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize("which", [1, 2])
def test_start_without_free_threads_kills_the_node(monkeypatch, which):
    """A node whose output cannot be read, for lack of threads, is killed."""
    start_thread, started, count = threading.Thread.start, [], iter(range(1, 9))
    popen = subprocess.Popen

    def refuse(self):
        if next(count) == which:
            raise RuntimeError("can't start new thread")
        start_thread(self)

    def spied(*args, **more):
        started.append(popen(*args, **more))
        return started[-1]

    monkeypatch.setattr(process.subprocess, "Popen", spied)
    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(RunError, match=FULL.format("can't start new thread")):
        start()
    assert [node.poll() for node in started] == [-signal.SIGKILL]


@pytest.mark.ros
@pytest.mark.long
@pytest.mark.parametrize("mebibytes", [350, 450, 550, 700, 850, 1000, 1200, 1500])
def test_run_with_little_memory(tmp_path, mebibytes):
    """A run with 350 to 1500 MiB of memory completes, or ends with a one-line error.

    It leaves no process in either case.
    """
    bag, limit = tmp_path / "bag", mebibytes * 2**20
    command = [sys.executable, "-m", "cam_rig.cli.main", "run", "quick", "--bag", str(bag)]
    done = ended(
        *command, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    )
    if done.returncode:
        assert "Traceback" not in done.stderr
        assert "cam-rig: " in done.stderr.strip().splitlines()[-1]
    assert ended("pgrep", "-f", bag).returncode == 1


def test_log_folder_without_home(monkeypatch, tmp_path):
    """Without HOME the nodes log into the private runtime folder.

    A service or a cron job has no HOME, and ROS would end each node at once without a folder.
    """
    monkeypatch.delenv("HOME")
    monkeypatch.delenv("ROS_LOG_DIR", raising=False)
    tmp_path.chmod(0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert environment()["ROS_LOG_DIR"].startswith(str(tmp_path))
    assert log_folder()[1] == ""
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "elsewhere"))
    assert environment()["ROS_LOG_DIR"] == str(tmp_path / "elsewhere")


@pytest.mark.parametrize("name", ["HOME", "ROS_HOME", "ROS_LOG_DIR"])
def test_log_folder_that_is_not_writable_is_replaced(monkeypatch, tmp_path, name):
    """A log folder that is not writable is replaced by a private one with a warning.

    The warning names both folders.
    """
    for other in ("ROS_HOME", "ROS_LOG_DIR"):
        monkeypatch.delenv(other, raising=False)
    (tmp_path / "file").touch()
    runtime = tmp_path / "own"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.setenv(name, str(tmp_path / "file"))
    folder, warning = log_folder()
    assert folder.parent == runtime
    assert warning.startswith(str(tmp_path / "file")) and warning.endswith(str(folder))
    assert environment()["ROS_LOG_DIR"] == str(folder)
