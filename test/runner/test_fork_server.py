"""Tests of nodes that are forked by a server: pid, output, signals, exit code.

Killing a node, the server or the runner leaves no process. Without the server a node is started in
a new interpreter.
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

from cam_rig.runner import fork_server as client
from cam_rig.runner.fork_server import ForkedProcess, ForkServer
from cam_rig.runner.node_process import NodeProcess, environment

from ..processes import ended, is_running, until

pytestmark = [pytest.mark.ros, pytest.mark.starts]
COMMAND = [sys.executable, "-m", "cam_rig.nodes", "follower", "--ros-args"]


@pytest.fixture
def start(ros_domain, fork_server):
    """Function that forks a node of the test's command with further arguments."""
    return lambda *arguments: fork_server.start([*COMMAND, *arguments], environment(), None)


def command_line(pid):
    """Return the command line of a process, as displayed by `ps`."""
    return Path(f"/proc/{pid}/cmdline").read_bytes().rstrip(b"\0").split(b"\0")


def test_exit_code_and_output_of_a_forked_node(start, tmp_path):
    """The runner receives exit code and stderr of a node that the server has forked."""
    node = start("-p", f"scene:={tmp_path}/none.yaml")
    assert node.wait(timeout=100) == 2 and "none.yaml: no such file" in node.stderr.read()
    assert node.stdout.read() == ""


def test_each_forked_node_is_a_separate_process(start):
    """A forked node has its pid, session, name and command line.

    wait() raises after its timeout.
    """
    node, other = start("-p", "scene:=quick"), start()
    assert len({node.pid, other.pid, os.getpid()}) == 3
    assert [os.getsid(process.pid) for process in (node, other)] == [node.pid, other.pid]
    until(lambda: command_line(node.pid)[-1] == b"scene:=quick")
    words = [*COMMAND, "-p", "scene:=quick"]
    assert command_line(node.pid) == [os.fsencode(word) for word in words]
    assert Path(f"/proc/{node.pid}/comm").read_text(encoding="utf-8") == "follower\n"
    with pytest.raises(subprocess.TimeoutExpired):
        node.wait(0.0)
    for process in (node, other):
        process.kill()
        assert process.wait(timeout=100) == -signal.SIGKILL


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_a_forked_node_in_order_at_any_time(start, number):
    """A signal ends a forked node with code 0 and no traceback, at any time."""
    for pause in (0.0, 0.02, 0.1):
        node = start()
        time.sleep(pause)  # the node must end in order at every time
        node.send_signal(number)
        assert node.wait(timeout=100) == 0 and "Traceback" not in node.stderr.read()


def test_adoption_of_orphans_is_restored(start):
    """A fork does not change whether the runner adopts orphaned processes.

    The runner adopts orphans (PR_SET_CHILD_SUBREAPER) only while the server forks.
    """
    prctl, adopts = ctypes.CDLL(None).prctl, ctypes.c_int()
    for wanted in (1, 0):
        prctl(client.PR_SET_CHILD_SUBREAPER, wanted)
        start().kill()
        prctl(client.PR_GET_CHILD_SUBREAPER, ctypes.byref(adopts))
        assert adopts.value == wanted


def test_failed_import_ends_only_the_node(ros_domain, fork_server):
    """A forked node whose import fails reports it, and the server continues."""
    node = fork_server.start([*COMMAND[:3], "nowhere"], environment(), None)
    assert node.wait(timeout=100) == 1
    assert "No module named 'cam_rig.nodes.nowhere'" in node.stderr.read()
    assert is_running(fork_server._process.pid)


def test_node_ends_if_its_start_is_interrupted(ros_domain, fork_server, monkeypatch):
    """A forked node ends if a signal arrives before the runner has stored its process."""
    forked = []

    def interrupted(pid, *_):
        forked.append(pid)
        raise KeyboardInterrupt

    monkeypatch.setattr(client, "ForkedProcess", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fork_server.start(COMMAND, environment(), None)
    assert os.waitpid(forked[0], 0)[1] == 0


def test_nodes_start_without_a_killed_server(ros_domain):
    """After the server is killed, forked nodes continue.

    The next node is started in a new interpreter.
    """
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


def test_nodes_start_without_a_server_on_other_systems(ros_domain, monkeypatch):
    """On a system other than Linux a node is started in a new interpreter."""
    monkeypatch.setattr(client, "sys", SimpleNamespace(platform="another"))
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


def test_server_and_nodes_end_with_a_killed_runner(ros_domain):
    """Server and nodes end if the runner is killed."""
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


def test_server_has_one_thread_and_the_shared_imports():
    """The server has one thread, and nodes import few modules after the fork.

    A fork of a process with several threads can block, so rclpy is imported in each node.
    """
    given = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = ended(sys.executable, "-c", PRELOAD, env=given)
    threads, loaded, left = json.loads(done.stdout)
    assert threads == 1
    assert not [name for name in loaded if name.partition(".")[0] in ("rclpy", "scipy", "rerun")]
    own = ("cam_rig.nodes", "rclpy", "rpyutils", "ament_index_python", "_msgs", "concurrent")
    own += ("_interpreters", "_queue")  # of concurrent, from Python 3.14 on
    others = [name for name in left if not any(part in name for part in own)]
    assert len(others) < 10, others
