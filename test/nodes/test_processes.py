"""Nodes as processes: network, errors at the start, signals, imports."""

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


# Run of all nodes.


def addresses(pid):
    """Return the local IP addresses of the UDP and TCP sockets of a process."""
    rows = sockets(pid, "udp", "udp6", "tcp", "tcp6")
    return {".".join(map(str, struct.pack("<I", int(row[1][:8], 16)))) for row in rows}


@pytest.mark.long
def test_all_sockets_use_the_loopback_interface(forked, domain, short_scene, tmp_path, monkeypatch):
    """All sockets of a run use the loopback interface, whatever the user's settings.

    No process remains after the run.
    """
    subnet = config_root() / "fastdds_subnet.xml"
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("FASTDDS_DEFAULT_PROFILES_FILE", str(subnet))
    shutil.copy(subnet, tmp_path / "DEFAULT_FASTDDS_PROFILES.xml")
    monkeypatch.chdir(tmp_path)

    def addresses_of_all():
        sets = [addresses(node.process.pid) for node in graph.processes.values()]
        return sets if all("127.0.0.1" in node_addresses for node_addresses in sets) else None

    with Graph(patient(short_scene, tmp_path / "bag", pacing=SLOW)) as graph:
        next(graph.progress())  # all nodes are connected
        sets = wait_until(addresses_of_all)
        assert set(graph.processes) == set(NODES)
    assert set.union(*sets) <= {"127.0.0.1", "239.255.0.1"}
    assert node_processes(tmp_path / "bag") == []


#: Program that waits until the threads of Fast DDS have their names, and prints the names of a
#: node's threads.
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
def test_the_type_lookup_service_is_disabled(profiles):
    """The shipped DDS profiles disable the type lookup service of Fast DDS.

    With it Fast DDS waits for replies, which it may lose, and may crash.
    """
    process = ended(sys.executable, "-c", THREADS, config_root() / profiles)
    assert "dds.ev" in process.stdout, process.stderr
    assert "dds.tls" not in process.stdout


def start_run(scene, bag, pacing):
    """Start `cam-rig run`, and wait for the report of its first tick.

    A tick is the interval between two cam states.
    """
    arguments = ["run", str(scene), "--bag", str(bag), "--pacing", pacing]
    command = [sys.executable, "-m", "cam_rig.cli.main", *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: has_ticks(bag))
    return process


def test_a_run_that_is_reset_ends_in_order(user, short_scene, tmp_path):
    """A run that is stopped, reset and started again ends with a complete bag.

    Its exit code is 0. The bag has more ticks (cam states) than the scene.
    """
    bag = tmp_path / "bag"
    process = start_run(short_scene, bag, "1x")
    for service in ("stop", "reset", "start"):
        user.call(f"/cam_drive/{service}")
    user.set("cam_drive", "pacing", "free")
    _, logged = process.communicate(timeout=100)
    assert process.returncode == 0, logged
    assert len(read_recording(bag).ticks) > TICKS
    assert "none missing" in logged


@pytest.mark.usefixtures("hangup_enabled")
@pytest.mark.parametrize(
    "name", ["SIGINT", *(pytest.param(name, marks=LONG) for name in ("SIGTERM", "SIGHUP"))]
)
def test_a_signal_ends_all_and_closes_the_bag(domain, short_scene, tmp_path, name):
    """A signal ends a run with code 128 + signal, a closed bag and no process.

    The signals are those of Ctrl-C, kill and a closed terminal.
    """
    bag, number = tmp_path / "bag", getattr(signal, name)
    process = start_run(short_scene, bag, SLOW)  # does not end before the signal
    assert len(node_processes(short_scene)) > 5  # the runner and its five nodes
    process.send_signal(number)
    _, logged = process.communicate(timeout=100)
    assert process.returncode == 128 + number
    assert f"interrupted by {name}" in logged
    assert read_recording(bag).ticks
    assert node_processes(short_scene) == []


def test_a_run_that_is_interrupted_before_its_start_has_no_bag(
    forked, domain, short_scene, tmp_path
):
    """A run that is interrupted before its start logs that nothing was recorded.

    All nodes end with code 0.
    """
    logged = []
    graph = Graph(patient(short_scene, tmp_path / "bag"), log=logged.append)
    with pytest.raises(KeyboardInterrupt), graph:
        raise KeyboardInterrupt
    assert logged == ["nothing was recorded"]
    assert all(process.code == 0 for process in graph.processes.values())


# Errors that end a node.


@pytest.fixture
def run_here(monkeypatch, capfd):
    """Function that runs a node in this process and returns its exit code and stderr."""

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, "--ros-args", *arguments])
        with pytest.raises(SystemExit) as exit_request:
            start(name)
        return exit_request.value.code, capfd.readouterr().err

    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


#: Cases: node, arguments, exit code and text of the error. The causes are a parameter, a file, the
#: other nodes, limits of ROS, and remapping.
FAILURES = (
    ("law_server", "-p scene:=5", 2, "scene must be a text, got 5"),
    ("follower", "-p scene:=none.yaml", 2, "none.yaml: no such file"),
    ("cam_drive", "-p progress_timeout:=1.0", 1,
     "not ready after 1 s: follower, law_server, microphone, recorder; check if"),
    ("law_server", f"-r __ns:=/{'a' * 254}", 2, "200 characters"),
    ("follower", "--params-file none.yaml", 2, "Couldn't parse params file"),
    ("follower", "-r __node:=mine", 2, "the node's name must be follower, got mine"),
    ("follower", "-r cam/state:=x -r __ns:=/r", 2, "/r/cam/state cannot be remapped, got /r/x"),
    ("law_server", "-r cam/law:=x", 2, "/cam/law cannot be remapped, got /x"),
    ("law_server", "-r law_server/set_parameters:=x", 2, "below /law_server, got /x"),
)  # fmt: skip


def test_a_node_reports_why_it_ends(domain, run_here):
    """A node that cannot run logs its error on stderr and ends with the error's code.

    There is no traceback.
    """
    for node, arguments, expected_code, text in FAILURES:
        code, logged = run_here(node, *arguments.split())
        assert code == expected_code, arguments
        assert text in logged and "Traceback" not in logged


def test_an_error_at_the_start_is_published_on_rosout(user):
    """An error at the start of a node is published on /rosout as fatal.

    It has the name of the node, also if the node cannot be created. On a busy machine the discovery
    can take longer than the node waits, so it starts up to 5 times.
    """
    received = []
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    user.node.create_subscription(Log, "/rosout", received.append, latched)  # as ros2 topic echo
    for arguments in ("-p scene:=none.yaml", "--params-file none.yaml"):
        received.clear()
        command = [sys.executable, "-m", "cam_rig.nodes", "follower", "--ros-args"]
        for _ in range(5):
            node = subprocess.Popen(
                [*command, *arguments.split()], stderr=subprocess.PIPE, text=True
            )
            user.wait_for(lambda node=node: received or node.poll() is not None, "an error")
            _, logged = node.communicate(timeout=100)
            assert node.returncode == 2
            user.spin(1.0)
            if received:
                break
        assert (received[0].level, received[0].name) == (50, "follower")
        assert received[0].msg in logged and "none.yaml" in received[0].msg


@pytest.mark.parametrize(("failed", "code"), [(False, -signal.SIGALRM), (True, 1)])
def test_a_process_ends_if_the_middleware_does_not_return(failed, code):
    """A node process ends in bounded time although the middleware blocks its shutdown.

    The time limit applies even if the middleware keeps the Python interpreter locked. After a
    regular shutdown no alarm remains that could end a later run in the same process.
    """
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
    process = ended(sys.executable, "-c", "\n".join(lines))
    assert (process.stdout, process.returncode) == ("left\n", code)


# Signals during the start of a node.


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("nodes", [2, pytest.param(15, marks=LONG)])
def test_an_early_signal_ends_a_node_in_order(domain, short_scene, tmp_path, number, nodes):
    """A signal at any time while a node starts ends it with code 0 and no traceback."""
    chance = random.Random(int(number))
    for i in range(nodes):
        name = NODES[i % len(NODES)]
        more = {"output_uri": str(tmp_path / f"bag_{i}")} if name == "recorder" else {}
        node = NodeProcess(name, {"scene": str(short_scene), **more}, False, lambda _line: None)
        time.sleep(chance.choice([0.0, 2.0]) * chance.random())  # any moment is possible
        node.process.send_signal(number)
        assert node.process.wait(timeout=100) == 0, (name, node.stderr_lines)
        assert "Traceback" not in "".join(node.stderr_lines)


def test_sigint_ends_a_node_that_was_started_with_sigint_ignored(domain, short_scene):
    """SIGINT ends a node with code 0 although it was started with SIGINT ignored.

    A shell starts the background processes of a script in this way.
    """
    command = [sys.executable, "-m", "cam_rig.nodes", "follower", "--ros-args"]
    command += ["-p", f"scene:={short_scene}"]
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        node = subprocess.Popen(command)
    finally:
        signal.signal(signal.SIGINT, before)
    while True:  # signals are ignored until the node has installed its handler
        node.send_signal(signal.SIGINT)
        try:
            assert node.wait(0.2) == 0
            break
        except subprocess.TimeoutExpired:
            continue


# Imports of the nodes: only the necessary libraries, because five nodes import them at the start.

#: Libraries of commands, figures and viewer, and scipy, which few scenes need.
NEVER = {"scipy", "matplotlib", "typer", "rich", "jinja2", "rerun", "pyarrow", "shapely", "ezdxf"}
#: Libraries of bags and of serialized messages, which few nodes need.
OF_BAGS = {"mcap", "rosbags", "zstandard"}
#: Program that prints, as JSON, the packages that are imported after three groups of nodes.
IMPORTS = """
import json, sys
from importlib import import_module
for names in (("process", "cam_drive", "microphone"), ("follower", "law_server"), ("recorder",)):
    for name in names:
        import_module("cam_rig.nodes." + name)
    print(json.dumps(sorted(set(module.partition(".")[0] for module in sys.modules))))
"""


def test_a_node_imports_only_the_libraries_that_it_needs():
    """A node imports no library of commands, figures or viewer.

    Only some nodes import those of bags. Other imports would delay the start.
    """
    lines = map(json.loads, ended(sys.executable, "-c", IMPORTS).stdout.splitlines())
    for loaded, excluded in zip(lines, (NEVER | OF_BAGS, NEVER | {"mcap"}, NEVER), strict=True):
        assert set(loaded) & excluded == set()
