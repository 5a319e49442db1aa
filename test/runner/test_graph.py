"""The runner: which exit ends the run, which node is started again, which one is named."""

import errno
import resource
import signal
import subprocess
import sys
import threading
from itertools import combinations
from pathlib import Path
from typing import ClassVar

import pytest

from cam_rig.bag.writer import BagWriter
from cam_rig.errors import RunError
from cam_rig.runner import node_process as process
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import NodeProcess, environment, live
from cam_rig.runner.node_table import NODES, VIEWER, held_by
from cam_rig.runner.resources import log_folder

KILLED = -signal.SIGKILL


class Process:
    """Stands in for a node's process: it has ended with a code, or runs."""

    codes: dict
    overdue = is_suspended = False

    def __init__(self, name, *_):
        self.name = name
        self.code = self.codes[name].pop(0) if self.codes.get(name) else None

    @property
    def has_ended(self):
        return self.code is not None

    @property
    def leaves_pieces(self):
        return bool(self.code)

    @property
    def was_killed(self):
        return self.has_ended and self.code < 0

    def settle(self):
        pass

    def exit_summary(self):
        return f"{self.name} ended with {self.code}"

    def last_stderr_line(self):
        return "no space"


def torn_bag(bag):
    """What a recorder leaves that was killed before it closed the bag."""
    BagWriter(bag).flush()


@pytest.fixture
def progress(monkeypatch, tmp_path):
    """Start nodes of which some end at once, with these codes; what was started and logged."""
    started, logged, closing = [], [], []
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

    def stop(nodes):
        for node in nodes:
            node.code = closing.pop(0) if closing else 0

    def make(respawn, killed_closing=0, **codes):
        closing.extend([KILLED] * killed_closing)

        class Made(Process):
            def __init__(self, name, *rest):
                super().__init__(name, *rest)
                started.append(name)

        Made.codes = {name: [code] for name, code in codes.items() if name != "again"}
        for name, code in codes.get("again", {}).items():
            Made.codes[name].append(code)
        monkeypatch.setattr("cam_rig.runner.graph.NodeProcess", Made)
        monkeypatch.setattr("cam_rig.runner.graph.clean", lambda _: [])
        monkeypatch.setattr("cam_rig.runner.graph.stop_all", stop)
        graph = Graph(live(tmp_path, tmp_path / "bag"), respawn, log=logged.append)
        for name in graph._nodes:
            graph._start(name)
        started.clear()
        if killed_closing:
            torn_bag(tmp_path / "bag")
        graph._progress.put('{"done": true}')
        list(graph.progress())
        return started, logged

    return make


@pytest.mark.parametrize("other", ["follower", "microphone", "law_server"])
def test_a_node_that_ends_after_the_drive_costs_nothing(progress, other):
    """With --respawn: the drive's end is the run's, and no node is started in vain."""
    started, logged = progress(True, cam_drive=0, **{other: KILLED})
    assert started == []
    assert logged == [f"node {other} ended with -9 before the first tick, when all was published"]


def test_a_recorder_killed_after_the_drive_has_a_successor(progress):
    """It had answered for ticks that it had not flushed: the drive sends its last ones again."""
    codes = {"cam_drive": 0, "recorder": KILLED, "follower": KILLED, "again": {"cam_drive": 0}}
    started, logged = progress(True, **codes)
    assert sorted(started) == ["cam_drive", "follower", "recorder"]
    assert [line.split()[1] for line in logged] == ["recorder", "follower"]


def test_a_recorder_that_is_killed_while_it_closes_is_started_again(progress):
    """With --respawn: the drive sends its last states to the successor, which closes the bag."""
    codes = {"cam_drive": 0, "again": {"cam_drive": 0}}
    started, logged = progress(True, killed_closing=1, **codes)
    assert sorted(started) == ["cam_drive", "recorder"]
    assert logged == ["node recorder ended with -9 before the first tick: started again"]


@pytest.mark.parametrize("code", [KILLED, 1, 0])
def test_a_run_goes_on_without_its_viewer(monkeypatch, tmp_path, code):
    """It is started again a few times, however it ended; then one line reports it."""
    logged = []

    class Made(Process):
        codes: ClassVar = {VIEWER: [code] * 4}

    monkeypatch.setattr("cam_rig.runner.graph.NodeProcess", Made)
    monkeypatch.setattr("cam_rig.runner.graph.clean", lambda _: [])
    graph = Graph(live(tmp_path, tmp_path / "bag", screen="address"), log=logged.append)
    for name in graph._nodes:
        graph._start(name)
    for _ in range(3):
        graph._handle_exit(VIEWER)
    assert graph.processes[VIEWER].has_ended
    graph._handle_exit(VIEWER)
    assert logged[:3] == [f"node viewer ended with {code} before the first tick: started again"] * 3
    assert logged[3].endswith("; the run goes on without it") and len(logged) == 4


def test_a_drive_that_was_stopped_has_not_done_its_program(monkeypatch, tmp_path):
    """It ends in order, with code 0, and the run is not complete all the same."""

    class Made(Process):
        codes: ClassVar = {"cam_drive": [0]}

    monkeypatch.setattr("cam_rig.runner.graph.NodeProcess", Made)
    monkeypatch.setattr("cam_rig.runner.graph.stop_all", lambda _: None)
    graph = Graph(live(tmp_path, tmp_path / "bag"))
    with pytest.raises(RunError, match="node cam_drive was stopped before the first tick"), graph:
        list(graph.progress())


def test_without_respawn_a_recorder_killed_while_it_closes_is_not(progress):
    """Its bag is recovered when all have ended."""
    assert progress(False, killed_closing=1, cam_drive=0) == ([], [])


def test_without_respawn_a_node_killed_beside_the_drive_is_named(progress):
    """Not the drive, which has ended as it should."""
    for other in ("recorder", "follower", "microphone", "law_server"):
        with pytest.raises(RunError, match=f"node {other} ended with -9"):
            progress(False, cam_drive=0, **{other: KILLED})


def test_a_node_that_fails_beside_the_drive_is_named_with_its_error(progress):
    """A full disk is none that goes away by starting again."""
    with pytest.raises(RunError, match=r"node recorder ended with 1 before .*: no space"):
        progress(True, cam_drive=0, recorder=1)


@pytest.mark.parametrize(("code", "cleans"), [(1, True), (KILLED, True), (0, False), (None, False)])
def test_shared_memory_is_cleaned_after_a_run_that_failed(monkeypatch, tmp_path, code, cleans):
    """A node that could not write, on a full disk, leaves pieces as a killed one does."""
    cleaned = []

    class Made(Process):
        codes: ClassVar = {"microphone": [code]}

    monkeypatch.setattr("cam_rig.runner.graph.NodeProcess", Made)
    monkeypatch.setattr("cam_rig.runner.graph.stop_all", lambda _: None)
    monkeypatch.setattr("cam_rig.runner.graph.clean", cleaned.append)
    monkeypatch.setattr("cam_rig.runner.graph.LOCK_GRACE_S", 0.0)
    with Graph(live(tmp_path, tmp_path / "bag")):
        pass
    assert bool(cleaned) == cleans


def test_an_interrupt_ends_all_and_the_recorder_last(monkeypatch, tmp_path):
    """Whatever ends a run ends its nodes."""
    stopped = []

    class Made(Process):
        codes: ClassVar = {}

    monkeypatch.setattr("cam_rig.runner.graph.NodeProcess", Made)
    monkeypatch.setattr("cam_rig.runner.graph.stop_all", stopped.extend)
    with pytest.raises(KeyboardInterrupt), Graph(live(tmp_path, tmp_path / "bag")):
        raise KeyboardInterrupt
    assert [node.name for node in stopped][-1] == "recorder"
    assert len(stopped) == 5


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


def start():
    return NodeProcess("follower", {}, False, lambda _line: None)


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (MemoryError(), "no memory"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "Resource temporarily"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "Cannot allocate memory"),
    ],
    ids=["memory", "processes", "fork"],
)
def test_no_process_to_be_had(monkeypatch, error, why):
    """One line with what is short and what to do."""

    def refuse(*_args, **_more):
        raise error

    monkeypatch.setattr(process.subprocess, "Popen", refuse)
    with pytest.raises(RunError, match=FULL.format(f"{why}.*")):
        start()


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
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        timeout=100,
    )
    if done.returncode:
        assert "Traceback" not in done.stderr
        assert "cam-rig: " in done.stderr.strip().splitlines()[-1]
    assert not [pid for pid in Path("/proc").glob("[0-9]*") if str(bag) in _command(pid)]


def _command(process: Path) -> str:
    try:
        return (process / "cmdline").read_text(errors="replace")
    except OSError:  # it has ended meanwhile
        return ""


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


@pytest.mark.parametrize("reports", [False, True])
def test_a_node_that_cannot_be_started_leaves_no_pipe(monkeypatch, reports):
    """Both ends of its progress are closed; a run may start a node again many times."""

    def refuse(*_args, **_more):
        raise MemoryError

    monkeypatch.setattr(process.subprocess, "Popen", refuse)
    before = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(RunError):
        NodeProcess("follower", {}, False, print, print if reports else None)
    assert len(list(Path("/proc/self/fd").iterdir())) == before
