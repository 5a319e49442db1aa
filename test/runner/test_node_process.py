"""A node as a process, where the system has nothing left to start it with."""

import errno
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from cam_rig.errors import RunError
from cam_rig.runner import node_process as process
from cam_rig.runner.log_folder import log_folder
from cam_rig.runner.node_process import NodeProcess, environment

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
