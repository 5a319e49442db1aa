"""Tests of resources that runs share: ROS domains, namespaces, /dev/shm, locks."""

import ctypes
import fcntl
import mmap
import os
import shlex
import shutil
import signal
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cam_rig.errors import ConfigError, OutputError, RunError
from cam_rig.runner import resources
from cam_rig.runner.resources import (
    domain_number,
    explain_signal,
    remove_segments,
    require_shared_memory,
    reserve_domain,
)

from ..processes import ended

# ROS domains and their namespaces.


@pytest.fixture
def temporary(monkeypatch, tmp_path):
    """Temporary folder of this test, and no runtime folder (XDG_RUNTIME_DIR)."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    return tmp_path


@pytest.fixture(params=["runtime", "temporary"])
def place(request, monkeypatch, temporary):
    """Folder that contains the lock of a domain.

    It is the runtime folder of the user, then a folder in the temporary folder.
    """
    if request.param == "temporary":
        return temporary / f"cam_rig-{os.getuid()}"
    folder = temporary / "run"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    return folder


def check_refused(error, words, namespace=""):
    """Check that the domain of the environment cannot be reserved.

    `error` and `words` are the expected error and its text.
    """
    with pytest.raises(error, match=words), reserve_domain(namespace):
        pass


def test_domain_is_reserved_by_one_run(monkeypatch, place):
    """A second run in the same ROS domain is refused, and the error names the domain.

    A run in another domain, or after the first, is allowed.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with reserve_domain():
        check_refused(RunError, "another run is active in ROS domain 7")
        monkeypatch.setenv("ROS_DOMAIN_ID", "8")
        with reserve_domain():
            pass
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with reserve_domain():
        pass
    assert [path.name for path in sorted(place.iterdir())] == [
        "cam_rig-domain-7.lock",
        "cam_rig-domain-8.lock",
    ]
    assert place.stat().st_mode & 0o777 == 0o700


def test_different_texts_of_a_number_are_the_same_domain(monkeypatch, place):
    """Different texts of one ROS domain number, such as 030 and 24, are one domain."""
    for first, other in (("030", "24"), ("0x10", "16"), ("", "0"), ("+7", "07")):
        monkeypatch.setenv("ROS_DOMAIN_ID", first)
        with reserve_domain():
            monkeypatch.setenv("ROS_DOMAIN_ID", other)
            check_refused(RunError, f"ROS domain {int(other)}; ")


NO_DOMAINS = ("-1", "233", "08", "1e2", "٣", "7abc", "0x", "1" * 5000, "2_0")


@given(
    st.from_regex(r"[ \t]?\+?0?[xX]?[0-9a-fA-F]{0,4}[a-z ]?", fullmatch=True)
    | st.sampled_from(NO_DOMAINS)
)
@settings(derandomize=True, max_examples=3 * settings.default.max_examples)
def test_domain_number_is_parsed_like_strtoul(text):
    """ROS_DOMAIN_ID is parsed like by C's strtoul with base 0, as ROS does.

    Trailing characters and too large numbers raise a short error.
    """
    library, end = ctypes.CDLL(None), ctypes.c_char_p()
    library.strtoul.restype = ctypes.c_ulong
    wanted = library.strtoul(text.encode(), ctypes.byref(end), 0)
    if text and (wanted > resources.MAX_DOMAIN or end.value or not text.strip()):
        words = f"ROS_DOMAIN_ID must be between 0 and {resources.MAX_DOMAIN}, got "
        with pytest.raises(ConfigError, match=words) as refused:
            domain_number(text)
        assert len(str(refused.value)) < 100
    else:
        assert text not in NO_DOMAINS and domain_number(text) == wanted


@pytest.mark.ros
def test_domain_number_agrees_with_rclpy(monkeypatch):
    """`domain_number` returns the ROS domain that rclpy uses."""
    import rclpy

    for text in ("030", "0x10"):
        monkeypatch.setenv("ROS_DOMAIN_ID", text)
        context = rclpy.Context()
        rclpy.init(args=[], context=context)
        assert context.get_domain_id() == domain_number(text)
        context.shutdown()


def link(path):
    path.symlink_to(path.with_name("other"))


def open_to_all(folder):
    folder.mkdir()
    folder.chmod(0o777)


@pytest.mark.parametrize("make_obstacle", [link, os.mkfifo, os.mkdir])
def test_lock_that_is_not_a_regular_file_is_refused(monkeypatch, place, make_obstacle):
    """A lock that is a link, a pipe or a folder is refused and remains.

    The link is not followed, and the pipe does not block.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", "9")
    with reserve_domain():
        pass
    lock = place / "cam_rig-domain-9.lock"
    lock.unlink()
    make_obstacle(lock)
    check_refused(OutputError, r"domain-9\.lock: is not a regular file owned by you; remove")
    assert not lock.with_name("other").exists()


@pytest.mark.parametrize("make_obstacle", [link, open_to_all, Path.touch])
def test_folder_that_is_not_private_is_refused(temporary, make_obstacle):
    """A folder of locks that is not private to the user is refused.

    Another user may have created it.
    """
    (temporary / "other").mkdir(mode=0o700)
    make_obstacle(temporary / f"cam_rig-{os.getuid()}")
    check_refused(OutputError, "is not private to you; remove it")
    assert list((temporary / "other").iterdir()) == []


@pytest.mark.parametrize("folder", ["run", "/nowhere/at/all", "{open}", "\0"])
def test_unusable_runtime_folder_is_replaced_by_the_temporary_one(monkeypatch, temporary, folder):
    """A runtime folder that is unusable is replaced by one in the temporary folder.

    It is relative, missing, writable for all users, or not a path.
    """
    open_to_all(temporary / "open")
    environment = {"XDG_RUNTIME_DIR": folder.format(open=temporary / "open")}
    monkeypatch.setattr("cam_rig.runner.resources.os.environ", environment)
    with reserve_domain():
        assert (temporary / f"cam_rig-{os.getuid()}" / "cam_rig-domain-0.lock").is_file()


def test_lock_that_cannot_be_written_gives_the_remedy(monkeypatch, temporary):
    """A lock file that cannot be written raises OutputError that suggests TMPDIR."""
    (temporary / "file").touch()
    monkeypatch.setattr("tempfile.tempdir", str(temporary / "file"))
    check_refused(OutputError, "name a folder with room in TMPDIR")


def test_namespace_is_reserved_by_one_run(monkeypatch, place):
    """Two runs in different namespaces share a ROS domain.

    A second run in a namespace is refused.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with reserve_domain(), reserve_domain("/rig1"), reserve_domain("/lab/rig1"):
        check_refused(RunError, r"domain 7, namespace /rig1; .*--namespace", "/rig1")


def test_namespace_with_or_without_its_slash():
    """A ROS namespace gets exactly one leading slash, or is refused with the rule."""
    valid = {"": "", "/": "", "rig1": "/rig1", "/lab/rig_1/": "/lab/rig_1"}
    assert {text: resources.parse_namespace(text) for text in valid} == valid
    for text in ("9x", "a b", "a__b", "a//b", "é", "a" * 255, "~x", "a-b", "__a"):
        words = f"namespace must have at most {resources.MAX_NAMESPACE} letters"
        with pytest.raises(ConfigError, match=words):
            resources.parse_namespace(text)


# /dev/shm: only the segments and ports of killed nodes are removed.

DEAD, LIVE, OLD = "fastdds_0123456789abcdef", "fastdds_port7411", "fastdds_fedcba9876543210"
NEW = "fastdds_00112233445566aa"
#: Fast DDS port files that do not belong to ROS domain 0: a port that all domains share, and the
#: first port of domain 1.
OTHERS = "fastdds_port7001", "fastdds_port7650"


def make(folder, name, age=5.0):
    path = folder / name
    path.write_bytes(b"x")
    os.utime(path, 2 * (time.time() - age,))
    return path


def test_only_unlocked_files_of_this_user_and_run_are_removed(tmp_path):
    """Only unlocked Fast DDS files of this run and domain are removed.

    Locked files, files of another time or name, and ports of other domains remain.
    """
    since = time.time() - 60.0
    removable = [DEAD, DEAD + "_el", "fastdds_port7499", "sem.fastdds_port7499_mutex"]
    for name in (*OTHERS, *removable, "other"):
        make(tmp_path, name)
    for name in (OLD, OLD + "_el"):
        make(tmp_path, name, age=3600.0)
    make(tmp_path, NEW, age=-60.0)  # a future time, so that a slow test does not make it old
    make(tmp_path, LIVE)
    with make(tmp_path, LIVE + "_el").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        removed = remove_segments(since, tmp_path, domain=0)
    assert sorted(removed) == sorted(removable)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"other", *OTHERS, OLD, OLD + "_el", NEW, LIVE, LIVE + "_el"}


def test_open_port_is_kept(tmp_path):
    """The file of a port that a process has open is not removed.

    The last process to close a port removes its file name, even if the file is a new one.
    """
    port = make(tmp_path, "fastdds_port7500")
    with port.open("rb") as file, mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ):
        assert remove_segments(0.0, tmp_path, domain=0) == []
    make(tmp_path, DEAD)
    assert remove_segments(0.0, tmp_path) == [DEAD]
    assert remove_segments(0.0, tmp_path, domain=0) == [port.name]


def leave(monkeypatch, free):
    """Simulate a file system with `free` bytes left."""
    monkeypatch.setattr(
        os, "statvfs", lambda _: SimpleNamespace(f_bavail=free // 512, f_frsize=512)
    )


def test_full_shared_memory_is_detected_before_a_run(monkeypatch, tmp_path):
    """A run with too little shared memory is refused with limit and remedy."""
    leave(monkeypatch, resources.MIN_FREE_BYTES)
    require_shared_memory(tmp_path)
    leave(monkeypatch, resources.MIN_FREE_BYTES - 512)
    with pytest.raises(OutputError, match=r"at least 1024 KiB free, got 10\d\d KiB; remove"):
        require_shared_memory(tmp_path)


def test_only_a_bus_error_is_explained(monkeypatch, tmp_path):
    """An exit by SIGBUS is explained by full shared memory.

    For other exit codes the explanation is empty.
    """
    leave(monkeypatch, 4096)
    assert explain_signal(-signal.SIGBUS, tmp_path).startswith(
        f" (SIGBUS: {tmp_path} was full, 4 KiB"
    )
    assert [explain_signal(code, tmp_path) for code in (0, 1, -signal.SIGKILL)] == ["", "", ""]


def test_missing_shared_memory_folder_is_ignored(tmp_path):
    """On systems without /dev/shm a run is allowed, and no file is removed."""
    assert remove_segments(0.0, tmp_path / "none") == []
    require_shared_memory(tmp_path / "none")
    assert explain_signal(-signal.SIGBUS, tmp_path / "none") == ""


#: Shell commands that replace /dev/shm by a full file system of one page, before a command is run.
FULL = "mount -t tmpfs -o size=4k tmpfs /dev/shm && head -c 4096 /dev/zero > /dev/shm/fill && exec "


def run_in_full_memory(*command):
    """Run a command with a full /dev/shm in a separate mount namespace."""
    unshare = shutil.which("unshare")
    if unshare is None or ended(unshare, "-m", "true").returncode:
        pytest.skip("mount namespaces are not allowed on this system")
    done = ended(unshare, "-m", "sh", "-c", FULL + shlex.join(command))
    if "mount:" in done.stderr:
        pytest.skip("mounting a file system is not allowed on this system")
    return done


def test_run_with_full_shared_memory_is_refused(tmp_path):
    """With full shared memory a run ends with one line before a node is started.

    No bag is written.
    """
    bag = str(tmp_path / "bag")
    done = run_in_full_memory(
        sys.executable, "-m", "cam_rig.cli.main", "run", "quick", "--bag", bag
    )
    words = "cam-rig: /dev/shm: must have at least 1024 KiB free, got 0 KiB; remove files from it"
    assert done.returncode == 1 and done.stderr.splitlines()[-1].startswith(words)
    assert not (tmp_path / "bag").exists()


NODE = """
from cam_rig.runner.node_process import NodeProcess
node = NodeProcess("follower", {}, False, lambda _line: None)
node.process.wait(60)
print(node.exit_summary())
"""


@pytest.mark.ros
def test_exit_summary_of_a_node_with_full_shared_memory():
    """The summary of a node that SIGBUS ended names full shared memory as the cause."""
    done = run_in_full_memory(sys.executable, "-c", NODE)
    words = "follower was ended by signal 7 (SIGBUS: /dev/shm was full, 0 KiB are free now; remove "
    assert done.stdout.startswith(words), done.stderr
