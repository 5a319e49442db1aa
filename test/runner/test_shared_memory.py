"""What a killed node leaves in /dev/shm is taken away, and nothing else."""

import fcntl
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from cam_rig.errors import OutputError
from cam_rig.runner.resources import MIN_FREE, clean, require_room, why_killed

DEAD, LIVE, OLD = "fastdds_0123456789abcdef", "fastdds_port7411", "fastdds_fedcba9876543210"


def make(folder, name, age=5.0):
    path = folder / name
    path.write_bytes(b"x")
    then = time.time() - age
    os.utime(path, (then, then))
    return path


def test_only_unlocked_files_of_this_user_and_run_are_removed(tmp_path):
    """A held lock, another time, another name: each stays."""
    since = time.time() - 60.0
    for name in (DEAD, DEAD + "_el", "fastdds_port7499", "sem.fastdds_port7499_mutex", "other"):
        make(tmp_path, name)
    for name in (OLD, OLD + "_el"):
        make(tmp_path, name, age=3600.0)
    make(tmp_path, "fastdds_port7500", age=0.0)  # may just be in the making
    make(tmp_path, LIVE)
    with make(tmp_path, LIVE + "_el").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        removed = clean(since, tmp_path)
    assert sorted(removed) == sorted(
        [DEAD, DEAD + "_el", "fastdds_port7499", "sem.fastdds_port7499_mutex"]
    )
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"other", OLD, OLD + "_el", "fastdds_port7500", LIVE, LIVE + "_el"}


def test_without_such_a_folder_nothing_happens(tmp_path):
    """Other systems keep shared memory elsewhere."""
    assert clean(0.0, tmp_path / "none") == []


def leave(monkeypatch, free):
    """As if so many bytes were free."""
    monkeypatch.setattr(
        os, "statvfs", lambda _: SimpleNamespace(f_bavail=free // 512, f_frsize=512)
    )


def test_a_full_shared_memory_is_seen_before_a_run(monkeypatch, tmp_path):
    """One line that names the place, the room, the limit and the remedy."""
    leave(monkeypatch, MIN_FREE)
    require_room(tmp_path)
    leave(monkeypatch, MIN_FREE - 512)
    with pytest.raises(OutputError, match=r"has 10\d\d KiB free; allowed: at least 1024 KiB, so "):
        require_room(tmp_path)


def test_a_bus_error_is_explained(monkeypatch, tmp_path):
    """And no other signal or code is."""
    leave(monkeypatch, 4096)
    assert why_killed(-signal.SIGBUS, tmp_path).startswith(f" (SIGBUS: {tmp_path} was full, 4 KiB")
    assert [why_killed(code, tmp_path) for code in (0, 1, -signal.SIGKILL)] == ["", "", ""]


def test_where_there_is_no_such_folder_nothing_is_asked(tmp_path):
    """Other systems keep shared memory elsewhere."""
    require_room(tmp_path / "none")
    assert why_killed(-signal.SIGBUS, tmp_path / "none") == ""


#: Runs a command where /dev/shm is another, of one page, which is full.
FULL = "mount -t tmpfs -o size=4k tmpfs /dev/shm && head -c 4096 /dev/zero > /dev/shm/fill && exec "


def in_a_full_one(*command):
    """What the command gives in a mount namespace of its own."""
    unshare = shutil.which("unshare")
    if (
        unshare is None
        or subprocess.run([unshare, "-m", "true"], check=False, timeout=100).returncode
    ):
        pytest.skip("no mount namespace can be made here")
    line = FULL + shlex.join(command)
    done = subprocess.run(
        [unshare, "-m", "sh", "-c", line], capture_output=True, text=True, check=False, timeout=100
    )
    if "mount:" in done.stderr:
        pytest.skip("no file system can be mounted here")
    return done


def test_a_run_in_a_full_shared_memory_is_refused(tmp_path):
    """Before a node is started; nothing is recorded."""
    bag = str(tmp_path / "bag")
    done = in_a_full_one(sys.executable, "-m", "cam_rig.cli.main", "run", "quick", "--bag", bag)
    assert done.returncode == 1
    assert (
        done.stderr.strip()
        .splitlines()[-1]
        .startswith(
            "cam-rig: /dev/shm: has 0 KiB free; allowed: at least 1024 KiB, so remove what fills it"
        )
    )
    assert not (tmp_path / "bag").exists()


NODE = """
from cam_rig.runner.node_process import NodeProcess
node = NodeProcess("follower", {}, False, lambda _line: None)
node.process.wait(60)
print(node.exit_summary())
"""


@pytest.mark.ros
def test_a_node_in_a_full_shared_memory(tmp_path):
    """It is ended by SIGBUS, and the exit summary names the cause."""
    script = tmp_path / "node.py"
    script.write_text(NODE)
    done = in_a_full_one(sys.executable, str(script))
    words = "follower was ended by signal 7 (SIGBUS: /dev/shm was full, 0 KiB are free now; remove "
    assert done.stdout.startswith(words), done.stderr
