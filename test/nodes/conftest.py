"""Runs of the nodes in this process or as processes."""

import json
import time
from contextlib import ExitStack, nullcontext, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from queue import Empty, Queue
from tempfile import NamedTemporaryFile
from threading import Thread
from types import SimpleNamespace

import pytest
import rclpy
from mcap.reader import make_reader
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64

from cam_rig.bag.listing import mcap_files
from cam_rig.bag.partial_reader import RecordedMessage, read_partial
from cam_rig.errors import RunError
from cam_rig.messages.topics import FOLLOWER_SAMPLES, recorded_topic
from cam_rig.nodes import process
from cam_rig.nodes.__main__ import NODES
from cam_rig.runner.node_process import live_nodes
from cam_rig.runner.node_table import RECORDER
from cam_rig.testing.client import RigClient
from cam_rig.testing.running_rig import isolated_domain

from ..conftest import scene_data
from ..processes import ended, until

#: Time (s, wall clock) after which a wait for a condition fails, also on a busy machine.
WAIT = 300.0
#: Number of ticks of the short scene. A tick is the interval between two published cam states, here
#: half a turn.
TICKS = 64
#: Pacing (real-time factor) at which the short scene takes 15 s, so that it does not end before a
#: test has acted.
SLOW = "0.4x"


class OneProcess:
    """All nodes of a run in this process, each spun by a thread.

    They share one ROS context, and the start, end and signals of processes are left out. `nodes`
    are the parameters of each node by name, and `late` the nodes that do not receive messages
    before `start` is called.
    """

    def __init__(self, nodes, late=(), namespace=""):
        self._parameters, self._late = nodes, late
        self._source = list(nodes)[-1]  # the drive, or the player
        self._remapping = ["-r", f"__ns:={namespace}"] if namespace else []
        self.nodes, self.codes, self._threads = {}, {}, {}
        self._reports = Queue()

    def __enter__(self):
        with ExitStack() as stack:
            file = stack.enter_context(NamedTemporaryFile("w", suffix=".yaml"))
            content = {f"/**/{n}": {"ros__parameters": p} for n, p in self._parameters.items()}
            json.dump(content, file)  # JSON is valid YAML
            file.flush()
            arguments = ["--ros-args", "--params-file", file.name, *self._remapping]
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            stack.callback(rclpy.shutdown)
            for name in self._parameters:
                self.nodes[name] = node_of(name)
            self.nodes[self._source]._report_progress = lambda **report: self._reports.put(report)
            stack.callback(self.end)
            for name in self._parameters:
                if name not in self._late:
                    self.start(name)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_error):
        self._stack.close()

    def start(self, name):
        """Spin the node of this name in a thread until it ends."""
        self._threads[name] = Thread(target=self._spin, args=[name])
        self._threads[name].start()

    def _spin(self, name):
        request = SimpleNamespace(received=False, act=lambda: None)
        self.codes[name] = process._spin(self.nodes[name], request)

    def is_running(self, name):
        return self._threads[name].is_alive()

    def progress(self):
        """Yield the progress reports of the drive until it is done.

        The error of a failed node is raised.
        """
        is_over = False
        while not is_over:
            is_over = not self.is_running(self._source) and self._reports.empty()
            for node in self.nodes.values():
                if node.failure is not None:
                    raise node.failure
            with suppress(Empty):
                report = self._reports.get(timeout=0.05)
                if "done" not in report:
                    yield report

    def end(self):
        """End the nodes that still run, the recorder last because it writes the bag."""
        for name in sorted(self._threads, key=lambda name: name == RECORDER):
            if name == RECORDER:
                self._join()
            self.nodes[name].interrupt()
        self._join(RECORDER)
        for name in set(self.nodes) - set(self._threads):
            self.nodes[name].close()
            self.nodes[name].destroy_node()

    def _join(self, *last):
        for name, thread in self._threads.items():
            if name != RECORDER or last:
                thread.join(WAIT)


def node_of(name):
    """Create the node of this name, with the arguments of this process's ROS context."""
    return getattr(import_module(f"cam_rig.nodes.{name}"), NODES[name])()


def payloads_of(bag):
    """Return the serialized messages of a bag by topic, in the order of rig time."""
    payloads = {}
    for file in mcap_files(bag):
        with file.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages():
                payloads.setdefault(channel.topic, []).append(message.data)
    return payloads


def mapped(*pids):
    """Return the names of the Fast DDS files in /dev/shm that processes have open.

    `pids` are the process ids (default: all processes).
    """
    used = set()
    for folder in [Path(f"/proc/{pid}") for pid in pids] or Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            used |= {line.split("/")[-1] for line in (folder / "maps").read_text().splitlines()}
            used |= {path.readlink().name for path in (folder / "fd").iterdir()}
    return {name for name in used if "fastdds" in name}


def unused():
    """Return the Fast DDS files in /dev/shm that no process uses.

    Files of ports below 7400 are left out, because all domains of this machine share them.
    """
    names = {path.name for path in Path("/dev/shm").glob("*fastdds*")} - mapped()
    return {name for name in names if "port7" not in name}


def node_processes(path):
    """Return the processes that have this path in their command lines: those of a run."""
    return ended("pgrep", "-f", path).stdout.split()


#: Wait until a condition of the run is true, and return its value.
wait_until = partial(until, step=lambda: time.sleep(0.02), wait=WAIT)


def has_ticks(bag):
    """Return True if a bag, which may be incomplete, contains the samples of a tick.

    A tick is the interval between two published cam states.
    """
    records = []
    for file in bag.glob("*.mcap"):
        read_partial(file, records.append)
    topics = {record.channel.topic for record in records if isinstance(record, RecordedMessage)}
    return any(recorded_topic(topic) is FOLLOWER_SAMPLES for topic in topics)


def patient(scene, bag, screen=None, **drive):
    """Return the parameters of a run's nodes, with a timeout for a busy machine.

    The parameters are by node. `drive` are further parameters of the run.
    """
    return live_nodes(scene, bag, screen, **{"progress_timeout": WAIT, **drive})


def run_to_end(scene, bag, on_tick=lambda _tick: None, **how):
    """Run a scene to its end in this process.

    Every node must end with code 0. `on_tick` is called with the number of each tick, and `how` are
    parameters of the run.
    """
    with OneProcess(patient(scene, bag, **how)) as here:
        for report in here.progress():
            on_tick(report["tick"])
    assert set(here.codes.values()) == {0}


@pytest.fixture(scope="session", autouse=True)
def unbounded():
    """Disable the time limit of a node's shutdown, which would end the test process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process, "bounded", lambda failed=False: nullcontext())
        yield


@pytest.fixture(scope="session")
def short_scene(tmp_path_factory):
    """Path of a scene of 64 ticks with two cams at two speeds, eight turns each.

    A tick is the interval between two published cam states, here half a turn.
    """
    path = tmp_path_factory.mktemp("short") / "scenes" / "short.yaml"
    path.parent.mkdir()
    changes = {"cams": ["tm21", "bezier15"], "samples_per_turn": 24, "published": "tm21_noise"}
    program = {"speeds": [250, 400], "turns": 8, "ticks_per_turn": 2, "sample_rate": 2000}
    path.write_text(json.dumps(scene_data(name="short", **changes, **program)), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def undisturbed_bag(short_scene, tmp_path_factory):
    """Bag of a run of the short scene in one process, without any disturbance."""
    bag = tmp_path_factory.mktemp("undisturbed") / "bag"
    with isolated_domain():
        run_to_end(short_scene, bag)
    return bag


@pytest.fixture(scope="session")
def undisturbed(undisturbed_bag):
    """Serialized messages of the undisturbed run of the short scene, by topic."""
    return payloads_of(undisturbed_bag)


@pytest.fixture
def domain():
    """Separate ROS domain of a test, on this machine only."""
    with isolated_domain() as number:
        yield number


@pytest.fixture
def make(domain, short_scene, tmp_path):
    """Function that creates a node of the short scene by name, without spinning it."""
    parameters = {"scene": str(short_scene), "recorder:output_uri": str(tmp_path / "bag")}
    pairs = (("-p", f"{key}:={json.dumps(value)}") for key, value in parameters.items())
    nodes = []
    rclpy.init(args=["--ros-args", *(part for pair in pairs for part in pair)])

    def make(name):
        nodes.append(node_of(name))
        return nodes[-1]

    yield make
    for node in nodes:
        node.close()
        node.destroy_node()
    rclpy.shutdown()


class User(RigClient):
    """Operator of a rig, as at a terminal: calls services, sets parameters, publishes."""

    get, set = RigClient.get_parameter, RigClient.set_parameter

    def call(self, service, succeeds=True):
        """Call a std_srvs/Trigger service and return its reply.

        If `succeeds` is False the call must fail, and the text of the error is returned.
        """
        if succeeds:
            return super().call(service)
        with pytest.raises(RunError) as refused:
            super().call(service)
        return str(refused.value)

    def refused(self, node, name, value):
        """Set a parameter of a node, which must be rejected, and return the reason."""
        with pytest.raises(RunError) as refused:
            self.set(node, name, value)
        return str(refused.value)

    def publish_rpm(self, rpm):
        """Publish a speed (rpm) on the rig's topic of speed commands."""
        self.publish("/cam/rpm", Float64(data=rpm))


@pytest.fixture
def user(domain):
    """Client of an operator, as at a terminal, in the ROS domain of the rig."""
    with User(domain, name="user") as operator:
        yield operator
