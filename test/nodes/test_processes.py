"""The nodes as processes: the same numbers, one line where one cannot go on, signals, imports."""

import json
import random
import shutil
import signal
import struct
import subprocess
import sys
import time

import pytest
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile

from cam_rig.nodes.__main__ import start
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import NodeProcess
from cam_rig.schema.load import config_root
from cam_rig.studies.simulate.recorded import read_recording

from ..processes import ended, sockets
from .conftest import SLOW, TICKS, has_ticks, node_processes, patient, wait_until

pytestmark = pytest.mark.ros
LONG = pytest.mark.long
NODES = ("recorder", "microphone", "follower", "law_server", "cam_drive")


# A run.


def addresses(pid):
    """Local IPv4 and IPv6 addresses of a process's UDP and TCP sockets."""
    rows = sockets(pid, "udp", "udp6", "tcp", "tcp6")
    return {".".join(map(str, struct.pack("<I", int(row[1][:8], 16)))) for row in rows}


@pytest.mark.long
def test_no_socket_leaves_the_machine(forked, domain, short_scene, tmp_path, monkeypatch):
    """Whatever the user's own settings, every one is on the loopback, and on the multicast group
    joined there; no process is left."""
    subnet = config_root() / "fastdds_subnet.xml"
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("FASTDDS_DEFAULT_PROFILES_FILE", str(subnet))
    shutil.copy(subnet, tmp_path / "DEFAULT_FASTDDS_PROFILES.xml")
    monkeypatch.chdir(tmp_path)

    def addresses_of_all():
        found = [addresses(node.process.pid) for node in graph.processes.values()]
        return found if all("127.0.0.1" in own for own in found) else None

    with Graph(patient(short_scene, tmp_path / "bag", pacing=SLOW)) as graph:
        next(graph.progress())  # they all speak with each other
        found = wait_until(addresses_of_all)
        assert set(graph.processes) == set(NODES)
    assert set.union(*found) <= {"127.0.0.1", "239.255.0.1"}
    assert node_processes(tmp_path / "bag") == []


#: The names of a node's threads, once Fast DDS's have named themselves.
THREADS = """
import os, sys
os.environ["FASTDDS_DEFAULT_PROFILES_FILE"] = sys.argv[1]
import rclpy
with rclpy.init():
    node = rclpy.create_node("alone")
    names = set()
    while not {"dds.ev", "dds.udp", "dds.shm"} <= {name.rpartition(".")[0] for name in names}:
        tasks = os.listdir("/proc/self/task")
        names = {open(f"/proc/self/task/{task}/comm").read().strip() for task in tasks}
    print(*names)
"""


@pytest.mark.parametrize("profiles", ["fastdds_loopback.xml", "fastdds_subnet.xml"])
def test_no_node_asks_another_for_a_type(profiles):
    """Fast DDS connects nobody before the answer, may lose it for good, and may crash by it."""
    done = ended(sys.executable, "-c", THREADS, config_root() / profiles)
    assert "dds.ev" in done.stdout, done.stderr
    assert "dds.tls" not in done.stdout


def begun_run(scene, bag, pacing):
    """Start `cam-rig run`, and wait for its first tick."""
    words = ["run", str(scene), "--bag", str(bag), "--pacing", pacing]
    command = [sys.executable, "-m", "cam_rig.cli.main", *words]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: has_ticks(bag))
    return process


def test_a_run_that_is_reset_ends_in_order(user, short_scene, tmp_path):
    """It turns more ticks than its scene has, and says how many at its end: code 0."""
    bag = tmp_path / "bag"
    process = begun_run(short_scene, bag, "1x")
    for service in ("stop", "reset", "start"):
        user.call(f"/cam_drive/{service}")
    user.set("cam_drive", "pacing", "free")
    _, words = process.communicate(timeout=100)
    assert process.returncode == 0, words
    assert len(read_recording(bag).ticks) > TICKS
    assert "none missing" in words


@pytest.mark.usefixtures("heard_hangup")
@pytest.mark.parametrize(
    "name", ["SIGINT", *(pytest.param(name, marks=LONG) for name in ("SIGTERM", "SIGHUP"))]
)
def test_a_signal_ends_all_and_closes_the_bag(domain, short_scene, tmp_path, name):
    """Ctrl-C, kill, a closed terminal: code 128 + signal, a closed bag, no process left."""
    bag, number = tmp_path / "bag", getattr(signal, name)
    process = begun_run(short_scene, bag, SLOW)  # no end before the test's
    assert len(node_processes(short_scene)) > 5  # the runner and its five nodes
    process.send_signal(number)
    _, words = process.communicate(timeout=100)
    assert process.returncode == 128 + number
    assert f"interrupted by {name}" in words
    assert read_recording(bag).ticks
    assert node_processes(short_scene) == []


def test_a_run_that_is_interrupted_before_it_began_has_recorded_nothing(
    forked, domain, short_scene, tmp_path
):
    """And reports so, not that a bag was closed."""
    logged = []
    graph = Graph(patient(short_scene, tmp_path / "bag"), log=logged.append)
    with pytest.raises(KeyboardInterrupt), graph:
        raise KeyboardInterrupt
    assert logged == ["nothing was recorded"]
    assert all(process.code == 0 for process in graph.processes.values())


# A node that cannot go on: its error reaches the user, with a code.


@pytest.fixture
def run_here(monkeypatch, capfd):
    """Run a node's entry point in this process; its code and what it wrote to stderr."""

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, "--ros-args", *arguments])
        with pytest.raises(SystemExit) as stopped:
            start(name)
        return stopped.value.code, capfd.readouterr().err

    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


#: One failure of each kind: a parameter, a file, the other nodes, and ROS's own limit.
FAILURES = (
    ("law_server", "-p scene:=5", 2, "scene: is 5; allowed: a text"),
    ("follower", "-p scene:=none.yaml", 2, "none.yaml: no such file"),
    ("cam_drive", "-p patience:=1.0", 1,
     "not ready after 1 s: follower, law_server, microphone, recorder; is it"),
    ("law_server", f"-r __ns:=/{'a' * 254}", 2, "200 characters"),
    ("follower", "--params-file none.yaml", 2, "Couldn't parse params file"),
    ("follower", "-r __node:=mine", 2, "the node's name must be follower, got mine"),
    ("follower", "-r cam/state:=x -r __ns:=/r", 2, "/r/cam/state cannot be remapped, got /r/x"),
    ("law_server", "-r cam/law:=x", 2, "/cam/law cannot be remapped, got /x"),
    ("law_server", "-r law_server/set_parameters:=x", 2, "below /law_server, got /x"),
)  # fmt: skip


def test_a_node_reports_why_it_ends(domain, run_here):
    """One line on stderr and the error's code, no traceback."""
    for node, arguments, code, words in FAILURES:
        found, logged = run_here(node, *arguments.split())
        assert found == code, arguments
        assert words in logged and "Traceback" not in logged


def test_an_error_of_the_start_is_on_rosout(user):
    """With its level and the node's name, also if the arguments prevent the node's creation."""
    heard = []
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    user.node.create_subscription(Log, "/rosout", heard.append, latched)  # as ros2 topic echo
    for arguments in ("-p scene:=none.yaml", "--params-file none.yaml"):
        heard.clear()
        command = [sys.executable, "-m", "cam_rig.nodes", "follower", "--ros-args"]
        node = subprocess.Popen([*command, *arguments.split()], stderr=subprocess.PIPE, text=True)
        user.wait_for(lambda: heard, "an error on /rosout")
        _, logged = node.communicate(timeout=100)
        assert node.returncode == 2 and (heard[0].level, heard[0].name) == (50, "follower")
        assert heard[0].msg in logged and "none.yaml" in heard[0].msg


@pytest.mark.parametrize(("failed", "code"), [(False, -signal.SIGALRM), (True, 1)])
def test_a_middleware_that_never_returns_is_left(failed, code):
    """It may hold the interpreter too, so that no Python code runs any more; nor is an alarm left
    behind for the next run of a node that stays."""
    lines = (
        "import ctypes, time",
        "from cam_rig.nodes import process",
        "process.MAX_TEARDOWN_S = 1",
        "for failed in (False, True):",
        "    with process.bounded(failed): pass",
        "time.sleep(1.5)",
        f"with process.bounded(failed={failed}): print('left', flush=True) or "
        "ctypes.PyDLL(None).sleep(600)",
    )
    done = ended(sys.executable, "-c", "\n".join(lines))
    assert (done.stdout, done.returncode) == ("left\n", code)


# A node's first moments.


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("nodes", [2, pytest.param(15, marks=LONG)])
def test_a_signal_that_comes_early_ends_a_node_in_order(
    domain, short_scene, tmp_path, number, nodes
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


def test_a_node_ends_by_a_signal_that_its_shell_ignores(domain, short_scene):
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


# What a node imports before it is a node: nothing that it does not need, as five of them wait.

#: Libraries of the commands, the figures and the viewer, and scipy, which few scenes need.
NEVER = {"scipy", "matplotlib", "typer", "rich", "jinja2", "rerun", "pyarrow", "shapely", "ezdxf"}
#: Those of bags and of the messages made by the thousand, for who writes them.
OF_BAGS = {"mcap", "rosbags", "zstandard"}
IMPORTS = """
import json, sys
from importlib import import_module
for names in (("process", "cam_drive", "microphone"), ("follower", "law_server"), ("recorder",)):
    for name in names:
        import_module("cam_rig.nodes." + name)
    print(json.dumps(sorted(set(module.partition(".")[0] for module in sys.modules))))
"""


def test_a_node_imports_what_it_needs():
    """Started by `ros2 run`, a launch file or the runner."""
    lines = map(json.loads, ended(sys.executable, "-c", IMPORTS).stdout.splitlines())
    for loaded, barred in zip(lines, (NEVER | OF_BAGS, NEVER | {"mcap"}, NEVER), strict=True):
        assert set(loaded) & barred == set()
