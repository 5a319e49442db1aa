"""Runs of the nodes: all in this process, a thread each, or as processes; and what they leave."""

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
from cam_rig.bag.recorder import recorded
from cam_rig.errors import RunError
from cam_rig.messages.topics import FOLLOWER_SAMPLES
from cam_rig.nodes import process
from cam_rig.nodes.__main__ import NODES
from cam_rig.runner.node_process import live
from cam_rig.runner.node_table import RECORDER
from cam_rig.testing.client import RigClient
from cam_rig.testing.running_rig import isolated_domain

from ..conftest import scene_data
from ..processes import ended, until

#: Wall time (s) after which something that has not come true never will, however busy the machine.
WAIT = 300.0
TICKS = 64
#: A pacing at which it lasts a quarter of a minute: no busy machine holds a test up for so long.
SLOW = "0.4x"


class OneProcess:
    """The nodes of a run in this process and on one context, each spun by a thread as by its own.
    What a process adds is left out: its start, its end, signals. ``late`` are the nodes that do not
    take messages before they are started."""

    def __init__(self, nodes, late=(), namespace=""):
        self._given, self._late = nodes, late
        self._source = list(nodes)[-1]  # the drive, or the player
        self._place = ["-r", f"__ns:={namespace}"] if namespace else []
        self.nodes, self.codes, self._threads = {}, {}, {}
        self._reports = Queue()

    def __enter__(self):
        with ExitStack() as stack:
            file = stack.enter_context(NamedTemporaryFile("w", suffix=".yaml"))
            about = {f"/**/{n}": {"ros__parameters": own} for n, own in self._given.items()}
            json.dump(about, file)  # which is YAML too
            file.flush()
            arguments = ["--ros-args", "--params-file", file.name, *self._place]
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            stack.callback(rclpy.shutdown)
            for name in self._given:
                self.nodes[name] = node_of(name)
            self.nodes[self._source]._report_progress = lambda **report: self._reports.put(report)
            stack.callback(self.end)
            for name in self._given:
                if name not in self._late:
                    self.start(name)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_error):
        self._stack.close()

    def start(self, name):
        """Let a node take messages until it ends."""
        self._threads[name] = Thread(target=self._spin, args=[name])
        self._threads[name].start()

    def _spin(self, name):
        request = SimpleNamespace(received=False, act=lambda: None)
        self.codes[name] = process._spin(self.nodes[name], request)

    def is_running(self, name):
        return self._threads[name].is_alive()

    def progress(self):
        """What the drive reports, until it is done; raises what has ended a node."""
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
        """End the nodes that still run, the recorder last."""
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
    """A node, made with the arguments of this process's context."""
    return getattr(import_module(f"cam_rig.nodes.{name}"), NODES[name])()


def payloads_of(bag):
    """Every message's bytes by topic, in the order of rig time."""
    found = {}
    for file in mcap_files(bag):
        with file.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages():
                found.setdefault(channel.topic, []).append(message.data)
    return found


def mapped(*pids):
    """The files of /dev/shm that living processes have mapped or open; of all by default."""
    used = set()
    for place in [Path(f"/proc/{pid}") for pid in pids] or Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            used |= {line.split("/")[-1] for line in (place / "maps").read_text().splitlines()}
            used |= {path.readlink().name for path in (place / "fd").iterdir()}
    return {name for name in used if "fastdds" in name}


def unused():
    """The files of Fast DDS in /dev/shm that no process uses. Ports below 7400 are of no domain:
    all runs on this machine share them."""
    names = {path.name for path in Path("/dev/shm").glob("*fastdds*")} - mapped()
    return {name for name in names if "port7" not in name}


def node_processes(path):
    """Processes of a run, found by a path that they were started with."""
    return ended("pgrep", "-f", path).stdout.split()


#: Poll until a condition holds, and return its value.
wait_until = partial(until, step=lambda: time.sleep(0.02), wait=WAIT)


def has_ticks(bag):
    """Whether a tick is in a bag that may still be written, or begun."""
    topics = (topic for file in bag.glob("*.mcap") for topic, _ in recorded(file))
    return any(topic is FOLLOWER_SAMPLES for topic in topics)


def patient(scene, bag, screen=None, **drive):
    """The nodes of a run whose drive waits for its nodes however busy the machine is."""
    return live(scene, bag, screen, **{"patience": WAIT, **drive})


def run_to_end(scene, bag, on_tick=lambda _tick: None, **how):
    """Run to the end in this process; every node ends in order."""
    with OneProcess(patient(scene, bag, **how)) as here:
        for report in here.progress():
            on_tick(report["tick"])
    assert set(here.codes.values()) == {0}


@pytest.fixture(scope="session", autouse=True)
def unbounded():
    """A process ends where DDS does not come back; that of the tests is none to end."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process, "bounded", lambda failed=False: nullcontext())
        yield


@pytest.fixture(scope="session")
def short_scene(tmp_path_factory):
    """64 ticks: two cams, two speeds."""
    path = tmp_path_factory.mktemp("short") / "scenes" / "short.yaml"
    path.parent.mkdir()
    changes = {"cams": ["tm21", "bezier15"], "points_per_turn": 24, "published": "tm21_noise"}
    program = {"speeds": [250, 400], "turns": 8, "ticks_per_turn": 2, "sample_rate": 2000}
    path.write_text(json.dumps(scene_data(name="short", **changes, **program)), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def undisturbed_bag(short_scene, tmp_path_factory):
    """An undisturbed run of the short scene in one process."""
    bag = tmp_path_factory.mktemp("undisturbed") / "bag"
    with isolated_domain():
        run_to_end(short_scene, bag)
    return bag


@pytest.fixture(scope="session")
def undisturbed(undisturbed_bag):
    """The payloads of that run."""
    return payloads_of(undisturbed_bag)


@pytest.fixture
def domain():
    """A ROS domain of its own for a test, on this machine only."""
    with isolated_domain() as number:
        yield number


@pytest.fixture
def make(domain, short_scene, tmp_path):
    """Make nodes in this process, which nobody spins."""
    given = {"scene": str(short_scene), "recorder:bag": str(tmp_path / "bag")}
    pairs = (("-p", f"{key}:={json.dumps(value)}") for key, value in given.items())
    made = []
    rclpy.init(args=["--ros-args", *(part for pair in pairs for part in pair)])

    def make(name):
        made.append(node_of(name))
        return made[-1]

    yield make
    for node in made:
        node.close()
        node.destroy_node()
    rclpy.shutdown()


class User(RigClient):
    """Somebody at a terminal."""

    get, set = RigClient.get_parameter, RigClient.set_parameter

    def call(self, service, succeeds=True):
        """The words of a std_srvs/Trigger."""
        if succeeds:
            return super().call(service)
        with pytest.raises(RunError) as refused:
            super().call(service)
        return str(refused.value)

    def refused(self, node, name, value):
        """The reason why a value is refused."""
        with pytest.raises(RunError) as refused:
            self.set(node, name, value)
        return str(refused.value)

    def say_rpm(self, rpm):
        """The command topic."""
        self.publish("/cam/rpm", Float64(data=rpm))


@pytest.fixture
def user(domain):
    """Somebody at a terminal, in the rig's domain."""
    with User(domain, name="user") as made:
        yield made
