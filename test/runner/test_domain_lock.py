"""Two runs in one ROS domain would mix: the second is refused."""

import ctypes
import os
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cam_rig.errors import ConfigError, OutputError, RunError
from cam_rig.runner.resources import (
    MAX_DOMAIN,
    MAX_NAMESPACE,
    domain_number,
    namespace_named,
    own_domain,
)


@pytest.fixture(params=["runtime", "temporary"])
def place(request, monkeypatch, tmp_path):
    """Where the lock is: in the user's runtime folder, or in a folder in the temporary place."""
    folder = tmp_path / "run"
    folder.mkdir(mode=0o700)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    if request.param == "runtime":
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
        return folder
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    return tmp_path / f"cam_rig-{os.getuid()}"


def test_a_domain_is_held_once(monkeypatch, place):
    """The second run names the domain that is taken; another domain, or a later run, is free."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with own_domain():
        with pytest.raises(RunError, match="another run is active in ROS domain 7"), own_domain():
            pass
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


@pytest.mark.parametrize(("one", "other"), [("030", "24"), ("0x10", "16"), ("", "0"), ("+7", "07")])
def test_the_same_number_is_the_same_domain(monkeypatch, place, one, other):
    """ROS reads 030 as 24: whatever it is written like, there is one run in it."""
    monkeypatch.setenv("ROS_DOMAIN_ID", one)
    with own_domain():
        monkeypatch.setenv("ROS_DOMAIN_ID", other)
        with pytest.raises(RunError, match=f"ROS domain {int(other)}; "), own_domain():
            pass


@given(st.from_regex(r"[ \t]?\+?0?[xX]?[0-9a-fA-F]{0,4}[a-z ]?", fullmatch=True))
@settings(derandomize=True, max_examples=500)
def test_numbers_are_read_as_ros_reads_them(text):
    """C's strtoul with base 0; what follows a number, or is too large, is refused."""
    library, end = ctypes.CDLL(None), ctypes.c_char_p()
    library.strtoul.restype = ctypes.c_ulong
    wanted = library.strtoul(text.encode(), ctypes.byref(end), 0)
    if text and (wanted > MAX_DOMAIN or end.value or not text.strip()):
        with pytest.raises(ConfigError, match=f"ROS_DOMAIN_ID: is .*; allowed: 0 to {MAX_DOMAIN}"):
            domain_number(text)
    else:
        assert domain_number(text) == wanted


@pytest.mark.parametrize("text", ["-1", "233", "08", "1e2", "٣", "7abc", "0x", "1" * 5000, "2_0"])
def test_what_is_no_domain(text):
    """One line with the beginning of what it is."""
    with pytest.raises(ConfigError, match="ROS_DOMAIN_ID: is ") as caught:
        domain_number(text)
    assert len(str(caught.value)) < 100


@pytest.mark.ros
def test_ros_itself_reads_them_so():
    """How rclpy reads the environment's number."""
    ask = "import rclpy; rclpy.init(); print(rclpy.get_default_context().get_domain_id())"
    for text in ("030", "0x10"):
        command = [sys.executable, "-c", ask]
        environment = os.environ | {"ROS_DOMAIN_ID": text}
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True, timeout=100
        )
        assert int(done.stdout) == domain_number(text)


@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_a_lock_that_somebody_else_has_laid_there(monkeypatch, place, tmp_path, kind):
    """Neither followed nor waited for, and left as it is."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "9")
    with own_domain():
        pass
    lock = place / "cam_rig-domain-9.lock"
    lock.unlink()
    if kind == "link":
        lock.symlink_to(tmp_path / "made")
    elif kind == "pipe":
        os.mkfifo(lock)
    else:
        lock.mkdir()
    with (
        pytest.raises(OutputError, match=r"domain-9\.lock: is not a file of yours; remove"),
        own_domain(),
    ):
        pass
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("kind", ["open", "link", "file"])
def test_a_folder_that_others_can_write_to_is_not_used(monkeypatch, tmp_path, kind):
    """Another user may have been there first."""
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    own, other = tmp_path / f"cam_rig-{os.getuid()}", tmp_path / "other"
    other.mkdir(mode=0o700)
    if kind == "open":
        own.mkdir()
        own.chmod(0o777)
    elif kind == "link":
        own.symlink_to(other)
    else:
        own.touch()
    with (
        pytest.raises(OutputError, match="is not a folder of yours alone; remove it"),
        own_domain(),
    ):
        pass
    assert list(other.iterdir()) == []


@pytest.mark.parametrize("given", ["run", "/nowhere/at/all", "{open}", "\0"])
def test_a_runtime_folder_that_is_none(monkeypatch, tmp_path, given):
    """A relative one, one that is not there, one that all can write to: the temporary place."""
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    value = given.format(open=tmp_path / "open")
    environment = {"XDG_RUNTIME_DIR": value}
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("cam_rig.runner.resources.os.environ", environment)
    with own_domain():
        assert (tmp_path / f"cam_rig-{os.getuid()}" / "cam_rig-domain-0.lock").is_file()


def test_without_room_for_a_lock_the_way_out_is_named(monkeypatch, tmp_path):
    """A disk that is full: one line, no traceback."""
    (tmp_path / "file").touch()
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "file"))
    with pytest.raises(OutputError, match="name a folder with room in TMPDIR"), own_domain():
        pass


def test_each_namespace_of_a_domain_is_held_once(monkeypatch, place):
    """Two rigs in one domain, each in its namespace; a third in one of them is refused by name."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    taken = pytest.raises(RunError, match=r"domain 7, namespace /rig1; .*--namespace")
    with own_domain(), own_domain("/rig1"), own_domain("/lab/rig1"), taken, own_domain("/rig1"):
        pass


@pytest.mark.parametrize(
    ("text", "namespace"),
    [("", ""), ("/", ""), ("rig1", "/rig1"), ("/lab/rig_1/", "/lab/rig_1")],
)
def test_a_namespace_is_written_with_or_without_its_slash(text, namespace):
    """As `ros2 run -r __ns:=/rig1` wants it."""
    assert namespace_named(text) == namespace


@pytest.mark.parametrize("text", ["9x", "a b", "a__b", "a//b", "é", "a" * 255, "~x", "a-b", "__a"])
def test_what_ros_does_not_take_as_a_namespace_is_refused(text):
    """With the limit, before any node is started."""
    with pytest.raises(ConfigError, match=f"namespace: is .*{MAX_NAMESPACE} characters at most"):
        namespace_named(text)
