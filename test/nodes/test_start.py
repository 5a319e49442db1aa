"""A node's first moments: signals count from the start, and the drive waits for every node."""

import random
import signal
import subprocess
import sys
import time

import pytest

from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import NodeProcess

pytestmark = [pytest.mark.ros, pytest.mark.starts]
NODES = ("recorder", "microphone", "follower", "law_server", "cam_drive")


@pytest.mark.parametrize("nodes", [3, pytest.param(15, marks=pytest.mark.long)])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_early_ends_a_node_in_order(
    ros_domain, short_scene, tmp_path, number, nodes
):
    """Before the interpreter runs, in the imports, while the node is made: code 0, no traceback."""
    chance = random.Random(int(number))
    for i in range(nodes):
        name = NODES[i % len(NODES)]
        more = {"bag": str(tmp_path / f"bag_{i}")} if name == "recorder" else {}
        node = NodeProcess(name, {"scene": str(short_scene), **more}, False, lambda _line: None)
        time.sleep(chance.choice([0.0, 2.0]) * chance.random())  # any moment at all is right
        node.process.send_signal(number)
        assert node.process.wait(timeout=100) == 0, (name, node.stderr_lines)
        assert "Traceback" not in "".join(node.stderr_lines)


def test_a_node_ends_by_a_signal_that_its_shell_ignores(ros_domain, short_scene):
    """A script's background job inherits SIGINT ignored: the node listens to it all the same."""
    command = [sys.executable, "-m", "cam_rig.nodes", "follower", "--ros-args"]
    command += ["-p", f"scene:={short_scene}"]
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        node = subprocess.Popen(command)
    finally:
        signal.signal(signal.SIGINT, before)
    while True:  # until it is a node that listens, a signal is lost by the parent's will
        node.send_signal(signal.SIGINT)
        try:
            assert node.wait(0.2) == 0
            break
        except subprocess.TimeoutExpired:
            continue


def test_a_run_that_is_interrupted_before_it_began_has_recorded_nothing(
    ros_domain, rig, short_scene, tmp_path
):
    """And reports so, not that a bag was closed."""
    logged = []
    graph = Graph(rig.live(short_scene, tmp_path / "bag"), log=logged.append)
    with pytest.raises(KeyboardInterrupt), graph:
        raise KeyboardInterrupt
    assert logged == ["nothing was recorded"]
    assert all(process.code == 0 for process in graph.processes.values())
