"""What runs share on a machine: domains, namespaces, /dev/shm, folders; a second is refused."""

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
from cam_rig.runner.resources import clean, domain_number, own_domain, require_room, why_killed

from ..processes import ended

# A domain, and a namespace of it.


@pytest.fixture
def temporary(monkeypatch, tmp_path):
    """A temporary place of the test's own, of a user without a runtime folder."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    return tmp_path


@pytest.fixture(params=["runtime", "temporary"])
def place(request, monkeypatch, temporary):
    """Where the lock is: in the user's runtime folder, or in a folder in the temporary place."""
    if request.param == "temporary":
        return temporary / f"cam_rig-{os.getuid()}"
    folder = temporary / "run"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    return folder


def check_refused(error, words, namespace=""):
    """Check that no run can begin now in the domain of the environment."""
    with pytest.raises(error, match=words), own_domain(namespace):
        pass


def test_a_domain_is_held_once(monkeypatch, place):
    """The second run names the domain that is taken; another domain, or a later run, is free."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with own_domain():
        check_refused(RunError, "another run is active in ROS domain 7")
        monkeypatch.setenv("ROS_DOMAIN_ID", "8")
        with own_domain():
            pass
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with own_domain():
        pass
    assert [path.name for path in sorted(place.iterdir())] == [
        "cam_rig-domain-7.lock",
        "cam_rig-domain-8.lock",
    ]
    assert place.stat().st_mode & 0o777 == 0o700


def test_the_same_number_is_the_same_domain(monkeypatch, place):
    """ROS reads 030 as 24: whatever it is written like, there is one run in it."""
    for one, other in (("030", "24"), ("0x10", "16"), ("", "0"), ("+7", "07")):
        monkeypatch.setenv("ROS_DOMAIN_ID", one)
        with own_domain():
            monkeypatch.setenv("ROS_DOMAIN_ID", other)
            check_refused(RunError, f"ROS domain {int(other)}; ")


NO_DOMAINS = ("-1", "233", "08", "1e2", "٣", "7abc", "0x", "1" * 5000, "2_0")


@given(
    st.from_regex(r"[ \t]?\+?0?[xX]?[0-9a-fA-F]{0,4}[a-z ]?", fullmatch=True)
    | st.sampled_from(NO_DOMAINS)
)
@settings(derandomize=True, max_examples=3 * settings.default.max_examples)
def test_numbers_are_read_as_ros_reads_them(text):
    """C's strtoul with base 0; what follows a number, or is too large, is refused in a line."""
    library, end = ctypes.CDLL(None), ctypes.c_char_p()
    library.strtoul.restype = ctypes.c_ulong
    wanted = library.strtoul(text.encode(), ctypes.byref(end), 0)
    if text and (wanted > resources.MAX_DOMAIN or end.value or not text.strip()):
        words = f"ROS_DOMAIN_ID: is .*; allowed: 0 to {resources.MAX_DOMAIN}"
        with pytest.raises(ConfigError, match=words) as refused:
            domain_number(text)
        assert len(str(refused.value)) < 100
    else:
        assert text not in NO_DOMAINS and domain_number(text) == wanted


@pytest.mark.ros
def test_ros_itself_reads_them_so(monkeypatch):
    """How rclpy reads the environment's number."""
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


@pytest.mark.parametrize("lay", [link, os.mkfifo, os.mkdir])
def test_a_lock_that_somebody_else_has_laid_there(monkeypatch, place, lay):
    """Neither followed nor waited for, and left as it is."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "9")
    with own_domain():
        pass
    lock = place / "cam_rig-domain-9.lock"
    lock.unlink()
    lay(lock)
    check_refused(OutputError, r"domain-9\.lock: is not a file of yours; remove")
    assert not lock.with_name("other").exists()


@pytest.mark.parametrize("lay", [link, open_to_all, Path.touch])
def test_a_folder_that_others_can_write_to_is_not_used(temporary, lay):
    """Another user may have been there first."""
    (temporary / "other").mkdir(mode=0o700)
    lay(temporary / f"cam_rig-{os.getuid()}")
    check_refused(OutputError, "is not a folder of yours alone; remove it")
    assert list((temporary / "other").iterdir()) == []


@pytest.mark.parametrize("given", ["run", "/nowhere/at/all", "{open}", "\0"])
def test_a_runtime_folder_that_is_none(monkeypatch, temporary, given):
    """A relative one, one that is not there, one that all can write to: the temporary place."""
    open_to_all(temporary / "open")
    environment = {"XDG_RUNTIME_DIR": given.format(open=temporary / "open")}
    monkeypatch.setattr("cam_rig.runner.resources.os.environ", environment)
    with own_domain():
        assert (temporary / f"cam_rig-{os.getuid()}" / "cam_rig-domain-0.lock").is_file()


def test_without_room_for_a_lock_the_way_out_is_named(monkeypatch, temporary):
    """A disk that is full: one line, no traceback."""
    (temporary / "file").touch()
    monkeypatch.setattr("tempfile.tempdir", str(temporary / "file"))
    check_refused(OutputError, "name a folder with room in TMPDIR")


def test_each_namespace_of_a_domain_is_held_once(monkeypatch, place):
    """Two rigs in one domain, each in its namespace; a third in one of them is refused by name."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with own_domain(), own_domain("/rig1"), own_domain("/lab/rig1"):
        check_refused(RunError, r"domain 7, namespace /rig1; .*--namespace", "/rig1")


def test_a_namespace_is_written_with_or_without_its_slash():
    """As `ros2 run -r __ns:=/rig1` wants it; what ROS does not take is refused with the limit,
    before any node is started."""
    taken = {"": "", "/": "", "rig1": "/rig1", "/lab/rig_1/": "/lab/rig_1"}
    assert {text: resources.namespace_named(text) for text in taken} == taken
    for text in ("9x", "a b", "a__b", "a//b", "é", "a" * 255, "~x", "a-b", "__a"):
        words = f"namespace: is .*{resources.MAX_NAMESPACE} characters at most"
        with pytest.raises(ConfigError, match=words):
            resources.namespace_named(text)


# /dev/shm: what a killed node leaves there is taken away, and nothing else.

DEAD, LIVE, OLD = "fastdds_0123456789abcdef", "fastdds_port7411", "fastdds_fedcba9876543210"
NEW = "fastdds_00112233445566aa"
#: Ports that are not domain 0's own: one that all share, the next domain's first.
OTHERS = "fastdds_port7001", "fastdds_port7650"


def make(folder, name, age=5.0):
    path = folder / name
    path.write_bytes(b"x")
    os.utime(path, 2 * (time.time() - age,))
    return path


def test_only_unlocked_files_of_this_user_and_run_are_removed(tmp_path):
    """A held lock, another time, another name, a port that others may take: each stays."""
    since = time.time() - 60.0
    removable = [DEAD, DEAD + "_el", "fastdds_port7499", "sem.fastdds_port7499_mutex"]
    for name in (*OTHERS, *removable, "other"):
        make(tmp_path, name)
    for name in (OLD, OLD + "_el"):
        make(tmp_path, name, age=3600.0)
    make(tmp_path, NEW, age=-60.0)  # may just be in the making, however long this takes
    make(tmp_path, LIVE)
    with make(tmp_path, LIVE + "_el").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        removed = clean(since, tmp_path, domain=0)
    assert sorted(removed) == sorted(removable)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"other", *OTHERS, OLD, OLD + "_el", NEW, LIVE, LIVE + "_el"}


def test_a_port_that_a_process_has_open_stays(tmp_path):
    """Fast DDS removes a port's name when it is closed last: even of one made anew."""
    port = make(tmp_path, "fastdds_port7500")
    with port.open("rb") as file, mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ):
        assert clean(0.0, tmp_path, domain=0) == []
    make(tmp_path, DEAD)
    assert clean(0.0, tmp_path) == [DEAD]
    assert clean(0.0, tmp_path, domain=0) == [port.name]


def leave(monkeypatch, free):
    """As if so many bytes were free."""
    monkeypatch.setattr(
        os, "statvfs", lambda _: SimpleNamespace(f_bavail=free // 512, f_frsize=512)
    )


def test_a_full_shared_memory_is_seen_before_a_run(monkeypatch, tmp_path):
    """One line that names the place, the room, the limit and the remedy."""
    leave(monkeypatch, resources.MIN_FREE)
    require_room(tmp_path)
    leave(monkeypatch, resources.MIN_FREE - 512)
    with pytest.raises(OutputError, match=r"has 10\d\d KiB free; allowed: at least 1024 KiB, so "):
        require_room(tmp_path)


def test_a_bus_error_is_explained(monkeypatch, tmp_path):
    """And no other signal or code is."""
    leave(monkeypatch, 4096)
    assert why_killed(-signal.SIGBUS, tmp_path).startswith(f" (SIGBUS: {tmp_path} was full, 4 KiB")
    assert [why_killed(code, tmp_path) for code in (0, 1, -signal.SIGKILL)] == ["", "", ""]


def test_where_there_is_no_such_folder_nothing_is_asked(tmp_path):
    """Other systems keep shared memory elsewhere."""
    assert clean(0.0, tmp_path / "none") == []
    require_room(tmp_path / "none")
    assert why_killed(-signal.SIGBUS, tmp_path / "none") == ""


#: Runs a command where /dev/shm is another, of one page, which is full.
FULL = "mount -t tmpfs -o size=4k tmpfs /dev/shm && head -c 4096 /dev/zero > /dev/shm/fill && exec "


def in_a_full_one(*command):
    """What the command gives in a mount namespace of its own."""
    unshare = shutil.which("unshare")
    if unshare is None or ended(unshare, "-m", "true").returncode:
        pytest.skip("no mount namespace can be made here")
    done = ended(unshare, "-m", "sh", "-c", FULL + shlex.join(command))
    if "mount:" in done.stderr:
        pytest.skip("no file system can be mounted here")
    return done


def test_a_run_in_a_full_shared_memory_is_refused(tmp_path):
    """Before a node is started; nothing is recorded."""
    bag = str(tmp_path / "bag")
    done = in_a_full_one(sys.executable, "-m", "cam_rig.cli.main", "run", "quick", "--bag", bag)
    words = "cam-rig: /dev/shm: has 0 KiB free; allowed: at least 1024 KiB, so remove what fills it"
    assert done.returncode == 1 and done.stderr.splitlines()[-1].startswith(words)
    assert not (tmp_path / "bag").exists()


NODE = """
from cam_rig.runner.node_process import NodeProcess
node = NodeProcess("follower", {}, False, lambda _line: None)
node.process.wait(60)
print(node.exit_summary())
"""


@pytest.mark.ros
def test_a_node_in_a_full_shared_memory():
    """It is ended by SIGBUS, and the exit summary names the cause."""
    done = in_a_full_one(sys.executable, "-c", NODE)
    words = "follower was ended by signal 7 (SIGBUS: /dev/shm was full, 0 KiB are free now; remove "
    assert done.stdout.startswith(words), done.stderr
