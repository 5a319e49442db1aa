"""A node that is forked is a process like any: its own pid, output, signals and exit code.

Whatever is killed, nothing stays behind; without the server the node is started by itself.
"""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from cam_rig.runner import fork_server as runner_half
from cam_rig.runner.fork_server import ForkedProcess, ForkServer
from cam_rig.runner.node_process import NodeProcess, environment

from ..processes import ended, is_running, until

pytestmark = [pytest.mark.ros, pytest.mark.starts]
COMMAND = [sys.executable, "-m", "cam_rig.nodes", "follower", "--ros-args"]


@pytest.fixture
def start(ros_domain, fork_server):
    """Fork a node with arguments."""
    return lambda *arguments: fork_server.start([*COMMAND, *arguments], environment(), None)


def command_line(pid):
    """What `ps` shows of a process."""
    return Path(f"/proc/{pid}/cmdline").read_bytes().rstrip(b"\0").split(b"\0")


def test_a_forked_node_is_a_child_like_any(start, tmp_path):
    """Its code is told, and so is what it writes; the file that is missing is its own finding."""
    node = start("-p", f"scene:={tmp_path}/none.yaml")
    assert node.wait(timeout=100) == 2 and "none.yaml: no such file" in node.stderr.read()
    assert node.stdout.read() == ""


def test_each_is_a_process_of_its_own(start):
    """With its own pid and session, under its own command line; its end is waited for in time."""
    one, other = start("-p", "scene:=quick"), start()
    assert len({one.pid, other.pid, os.getpid()}) == 3
    assert [os.getsid(node.pid) for node in (one, other)] == [one.pid, other.pid]
    until(lambda: command_line(one.pid)[-1] == b"scene:=quick")
    assert command_line(one.pid) == [os.fsencode(part) for part in (*COMMAND, "-p", "scene:=quick")]
    assert Path(f"/proc/{one.pid}/comm").read_text(encoding="utf-8") == "follower\n"
    with pytest.raises(subprocess.TimeoutExpired):
        one.wait(0.0)
    for node in (one, other):
        node.kill()
        assert node.wait(timeout=100) == -signal.SIGKILL


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_order_from_its_first_moment(start, number):
    """As one that is started by itself: code 0, no traceback."""
    for pause in (0.0, 0.02, 0.1):
        node = start()
        time.sleep(pause)  # any moment at all is right
        node.send_signal(number)
        assert node.wait(timeout=100) == 0 and "Traceback" not in node.stderr.read()


def test_other_orphans_go_where_they_went_before(start):
    """The runner adopts while the server forks, and no longer; unless it did so before."""
    prctl, adopts = ctypes.CDLL(None).prctl, ctypes.c_int()
    for wanted in (1, 0):
        prctl(runner_half.ADOPT, wanted)
        start().kill()
        prctl(runner_half.ADOPTS, ctypes.byref(adopts))
        assert adopts.value == wanted


def test_an_import_that_fails_is_the_nodes_own_failure(ros_domain, fork_server):
    """Beside its name, in its own words; the server goes on."""
    node = fork_server.start([*COMMAND[:3], "nowhere"], environment(), None)
    assert node.wait(timeout=100) == 1
    assert "No module named 'cam_rig.nodes.nowhere'" in node.stderr.read()
    assert is_running(fork_server._process.pid)


def test_what_the_runner_has_no_time_for_does_not_run(ros_domain, fork_server, monkeypatch):
    """A signal comes between the fork and the note of it: the node, that nobody knows, ends."""
    forked = []

    def interrupted(pid, *_):
        forked.append(pid)
        raise KeyboardInterrupt

    monkeypatch.setattr(runner_half, "ForkedProcess", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fork_server.start(COMMAND, environment(), None)
    assert os.waitpid(forked[0], 0)[1] == 0


def test_a_killed_server_is_done_without(ros_domain):
    """Its nodes stay, and the next is started by itself."""
    with ForkServer() as server:
        node = server.start(COMMAND, environment(), None)
        os.kill(server._process.pid, signal.SIGKILL)
        until(lambda: not is_running(server._process.pid))
        assert node.poll() is None
        other = NodeProcess("follower", {}, False, print, server=server)
        assert isinstance(other.process, subprocess.Popen)
        for process in (node, other.process):
            process.kill()
            process.wait(timeout=100)


def test_where_it_cannot_be_a_node_is_started_by_itself(ros_domain, monkeypatch):
    """As on a system that is not Linux."""
    monkeypatch.setattr(runner_half, "sys", SimpleNamespace(platform="another"))
    server = ForkServer()
    node = NodeProcess("follower", {}, False, print, server=server)
    node.process.kill()
    assert isinstance(node.process, subprocess.Popen)
    assert (node.process.wait(timeout=100), server._process) == (-signal.SIGKILL, None)


RUNNER = """
import os, sys
from cam_rig.runner.fork_server import ForkServer
from cam_rig.runner.node_process import NodeProcess
server = ForkServer()
node = NodeProcess("follower", {}, False, print, server=server)
print(server._process.pid, node.process.pid, type(node.process).__name__, flush=True)
input()
"""


def test_a_killed_runner_leaves_nothing(ros_domain):
    """Neither the server nor a node; the kernel tells both."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", RUNNER], text=True, **pipes) as runner:
        server, node, kind = runner.stdout.readline().split()
        runner.kill()
    assert kind == ForkedProcess.__name__
    until(lambda: not is_running(server) and not is_running(node))


PRELOAD = """
import json, os, sys
from importlib import import_module
from cam_rig.nodes.fork_server import preload
preload()
before, threads = set(sys.modules), len(os.listdir("/proc/self/task"))
for node in ("law_server", "cam_drive", "follower", "microphone", "recorder"):
    import_module(f"cam_rig.nodes.{node}")
import_module("cam_rig.nodes.process")
print(json.dumps([threads, sorted(before), sorted(set(sys.modules) - before)]))
"""


def test_it_has_one_thread_and_all_that_nodes_share():
    """A fork of a process with threads may wait for ever; of rclpy each node makes its own. What is
    left to the nodes is rclpy with what only it needs, and the nodes themselves."""
    given = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = ended(sys.executable, "-c", PRELOAD, env=given)
    threads, loaded, left = json.loads(done.stdout)
    assert threads == 1
    assert not [name for name in loaded if name.partition(".")[0] in ("rclpy", "scipy", "rerun")]
    own = ("cam_rig.nodes", "rclpy", "rpyutils", "ament_index_python", "_msgs", "concurrent")
    others = [name for name in left if not any(part in name for part in own)]
    assert len(others) < 10, others
