"""Runs of the live graph, and what is left of them."""

import subprocess
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from mcap.reader import make_reader
from rcl_interfaces.srv import DescribeParameters
from std_msgs.msg import Float64

from cam_rig.bag.files import mcap_files
from cam_rig.errors import RunError
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import live
from cam_rig.testing.client import RigClient
from cam_rig.testing.running_rig import isolated_domain

#: Wall time (s) after which something that has not come true never will, however busy the machine.
WAIT = 300.0
SCENE = """
name: short
title: A short sweep of two cams
cams: [tm21, bezier15]
rig: tm21
model: one_mass
sample_rate: {assumed: 2, unit: kHz, source: "keeps the test short"}
program:
  speeds: {assumed: [250, 300, 350, 400], unit: rpm, source: "a test"}
  turns: {assumed: 10, unit: turns, source: "a test"}
  settle_turns: {assumed: 1, unit: turns, source: "a test"}
  ticks_per_turn: 2
published: tm21_noise
"""
TICKS = 160


def payloads(bag):
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
    for process in [Path(f"/proc/{pid}") for pid in pids] or Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            used |= {line.split("/")[-1] for line in (process / "maps").read_text().splitlines()}
            used |= {path.readlink().name for path in (process / "fd").iterdir()}
    return {name for name in used if "fastdds" in name}


def node_processes(path):
    """Processes of a run, found by a path that they were started with."""
    found = subprocess.run(
        ["pgrep", "-f", str(path)], capture_output=True, text=True, check=False, timeout=100
    )
    return found.stdout.split()


def wait_until(condition):
    """Poll until something is true, and give it back."""
    end = time.monotonic() + WAIT
    while not (found := condition()):
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.02)
    return found


def size(bag):
    """Bytes that a bag has on disk, 0 where there is none yet."""
    return sum(file.stat().st_size for file in bag.glob("*.mcap")) if bag.is_dir() else 0


def unused():
    """The files of Fast DDS in /dev/shm that no process uses.

    Ports below 7400 are of no domain: other runs on this machine share them.
    """
    names = {path.name for path in Path("/dev/shm").glob("*fastdds*")} - mapped()
    return {name for name in names if "port7" not in name}


def patient(scene, bag, screen=None, **drive):
    """The nodes of a run whose drive waits for its nodes however busy the machine is."""
    return live(scene, bag, screen, **{"patience": WAIT, **drive})


def run_graph(scene, bag, on_tick=None, respawn=False, logged=None, **drive):
    """Run to the end, calling ``on_tick(graph, tick)`` for each; the lines that were logged."""
    logged = [] if logged is None else logged
    with Graph(patient(scene, bag, **drive), respawn=respawn, log=logged.append) as graph:
        for report in graph.progress():
            if on_tick is not None:
                on_tick(graph, report["tick"])
    return logged


@pytest.fixture(scope="session")
def short_scene(tmp_path_factory):
    """160 ticks: two cams, four speeds."""
    folder = tmp_path_factory.mktemp("short") / "scenes"
    folder.mkdir()
    path = folder / "short.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def undisturbed_bag(short_scene, tmp_path_factory):
    """An undisturbed run of the short scene; its users are in one of `GROUPS`."""
    bag = tmp_path_factory.mktemp("undisturbed") / "bag"
    with isolated_domain():
        run_graph(short_scene, bag)
    return bag


@pytest.fixture(scope="session")
def undisturbed(undisturbed_bag):
    """The payloads of that run."""
    return payloads(undisturbed_bag)


@pytest.fixture(scope="session")
def wait_for():
    """Poll until something is true, however busy the machine is."""
    return wait_until


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

    def describe(self, node, name):
        request = DescribeParameters.Request(names=[name])
        return self.ask(DescribeParameters, f"/{node}/describe_parameters", request).descriptors[0]

    def say_rpm(self, rpm):
        """The command topic."""
        self.publish("/cam/rpm", Float64(data=rpm))


@pytest.fixture
def user(ros_domain):
    """Somebody at a terminal, in the rig's domain."""
    with User(ros_domain, name="user") as made:
        yield made


@pytest.fixture(scope="session")
def rig():
    """What the tests of the live graph do again and again."""
    return SimpleNamespace(
        live=patient,
        run=run_graph,
        payloads=payloads,
        processes=node_processes,
        mapped=mapped,
        unused=unused,
        size=size,
        ticks=TICKS,
    )
