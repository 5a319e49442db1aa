"""The runner: which exit ends the run, which node is named, and without which the run continues."""

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
from cam_rig.runner.node_process import NodeProcess, environment, live
from cam_rig.runner.node_table import NODES, VIEWER, held_by
from cam_rig.runner.resources import log_folder

from ..processes import ended

KILLED = -signal.SIGKILL


@pytest.fixture
def made(monkeypatch, tmp_path):
    """Makes graphs whose nodes have ended, with a code for each start, or end when asked to."""
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
        nodes = live(tmp_path, tmp_path / "bag", screen=screen)
        return Graph(nodes, log=did.logged.append)

    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr("cam_rig.runner.graph.clean", lambda since, **_: did.cleaned.append(since))
    monkeypatch.setattr("cam_rig.runner.graph.LOCK_GRACE_S", 0.0)
    make.did = did
    return make


FAILED = [
    (other, KILLED, f"node {other} was ended by signal 9")
    for other in ("recorder", "follower", "microphone", "law_server")
]
FAILED.append(("recorder", 1, r"node recorder ended with code 1 before .*: no space"))


@pytest.mark.parametrize(("node", "code", "words"), FAILED)
def test_a_node_that_fails_beside_the_drive_is_named(made, node, code, words):
    """Name the node and the last line of its stderr, not the drive, which ended as it should."""
    graph = made(cam_drive=[0], **{node: [code]})
    graph._start_all()
    graph._progress.put('{"done": true}')
    with pytest.raises(RunError, match=words):
        list(graph.progress())


def test_the_fatal_error_of_a_node_is_its_reason(made):
    """Whatever it writes to stderr afterwards."""
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
def test_a_run_goes_on_without_its_viewer(made, code):
    """However it ended; one line reports it, once."""
    graph, logged = made(screen="address", **{VIEWER: [code]}), made.did.logged
    graph._start_all()
    for _ in range(3):
        graph.poll()
    assert graph.processes[VIEWER].has_ended
    assert [line.endswith("; the run continues without it") for line in logged] == [True]


def test_a_drive_that_was_stopped_has_not_done_its_program(made):
    """It ends in order, with code 0, and the run is not complete all the same."""
    words = "node cam_drive was stopped before the first tick"
    with pytest.raises(RunError, match=words), made(cam_drive=[0]) as graph:
        list(graph.progress())


@pytest.mark.parametrize(("code", "cleans"), [(1, True), (KILLED, True), (0, False), (None, False)])
def test_shared_memory_is_cleaned_after_a_run_that_failed(made, code, cleans):
    """A node that could not write, on a full disk, leaves pieces as a killed one does."""
    with made(microphone=[code]):
        pass
    assert bool(made.did.cleaned) == cleans


def test_an_interrupt_ends_all_and_the_recorder_last(made):
    """Whatever ends a run ends its nodes."""
    with pytest.raises(KeyboardInterrupt), made():
        raise KeyboardInterrupt
    assert made.did.stopped[-1] == "recorder" and len(made.did.stopped) == 5


def test_of_nodes_that_do_not_answer_the_first_of_the_chain_is_named():
    """Whichever of them do not answer, in whatever order they are given."""
    order = ["law_server", "follower", "microphone", "viewer", "recorder"]
    assert [entry.name for entry in reversed(NODES)][1:] == order
    assert held_by(["recorder"]) == "recorder"
    for number in range(2, len(order) + 1):
        for names in combinations(order, number):
            words = f"{names[0]}, and behind it {', '.join(names[1:])}"
            assert held_by(names) == held_by(names[::-1]) == words


# A node as a process, where the system has nothing left to start it with.

FULL = "node follower cannot be started \\({}\\); end other programs, or raise what .*ulimit -v"


def start(report=None):
    return NodeProcess("follower", {}, False, print, report)


@pytest.mark.parametrize("reports", [False, True])
def test_no_process_to_be_had(monkeypatch, reports):
    """One line with what is short and what to do; no pipe is left, however often it is tried."""
    for error, why in (
        (MemoryError(), "no memory"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "Resource temporarily"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "Cannot allocate memory"),
    ):
        refuse = Mock(side_effect=error)
        monkeypatch.setattr(process.subprocess, "Popen", refuse)
        before = len(list(Path("/proc/self/fd").iterdir()))
        with pytest.raises(RunError, match=FULL.format(f"{why}.*")):
            start(print if reports else None)
        assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize("which", [1, 2])
def test_no_thread_to_be_had(monkeypatch, which):
    """A node that could not be listened to does not stay behind."""
    begin, started, count = threading.Thread.start, [], iter(range(1, 9))
    popen = subprocess.Popen

    def refuse(self):
        if next(count) == which:
            raise RuntimeError("can't start new thread")
        begin(self)

    def spied(*args, **more):
        started.append(popen(*args, **more))
        return started[-1]

    monkeypatch.setattr(process.subprocess, "Popen", spied)
    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(RunError, match=FULL.format("can't start new thread")):
        start()
    assert [one.poll() for one in started] == [-signal.SIGKILL]


@pytest.mark.ros
@pytest.mark.long
@pytest.mark.parametrize("mebibytes", [350, 450, 550, 700, 850, 1000, 1200, 1500])
def test_a_run_with_little_memory(tmp_path, mebibytes):
    """However little it may have, it ends with a line and leaves no process, or records whole."""
    bag, limit = tmp_path / "bag", mebibytes * 2**20
    command = [sys.executable, "-m", "cam_rig.cli.main", "run", "quick", "--bag", str(bag)]
    done = ended(
        *command, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    )
    if done.returncode:
        assert "Traceback" not in done.stderr
        assert "cam-rig: " in done.stderr.strip().splitlines()[-1]
    assert ended("pgrep", "-f", bag).returncode == 1


def test_a_node_has_a_place_for_its_log_files(monkeypatch, tmp_path):
    """A service or a cron job has no home: ROS would end each node at once."""
    monkeypatch.delenv("HOME")
    monkeypatch.delenv("ROS_LOG_DIR", raising=False)
    tmp_path.chmod(0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert environment()["ROS_LOG_DIR"].startswith(str(tmp_path))
    assert log_folder()[1] == ""
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "elsewhere"))
    assert environment()["ROS_LOG_DIR"] == str(tmp_path / "elsewhere")


@pytest.mark.parametrize("name", ["HOME", "ROS_HOME", "ROS_LOG_DIR"])
def test_log_files_go_elsewhere_where_they_cannot_be_written(monkeypatch, tmp_path, name):
    """Each node would end at once; why and where is said."""
    for other in ("ROS_HOME", "ROS_LOG_DIR"):
        monkeypatch.delenv(other, raising=False)
    (tmp_path / "file").touch()
    own = tmp_path / "own"
    own.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(own))
    monkeypatch.setenv(name, str(tmp_path / "file"))
    place, words = log_folder()
    assert place.parent == own
    assert words.startswith(str(tmp_path / "file")) and words.endswith(str(place))
    assert environment()["ROS_LOG_DIR"] == str(place)
