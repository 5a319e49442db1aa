"""The run's end without a runner: the drive says so, the bag is closed, the nodes end or stay."""

import re
import threading
from itertools import cycle
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import FluidPressure

from cam_rig.bag.files import bag_files, is_unclosed
from cam_rig.errors import RunError
from cam_rig.nodes.base import rig_node
from cam_rig.nodes.base.rig_node import MAX_DRAIN_S, RigNode
from cam_rig.nodes.base.run_end import DRIVE_LOST_S, POLL_S, FinishedRun, LostDriveMonitor
from cam_rig.runner.node_process import NodeProcess, stop_all
from cam_rig.runner.node_table import DRIVE, RECORDER
from cam_rig.studies.simulate.recorded import read_recording

from .conftest import SLOW, TICKS, OneProcess, node_of, patient, payloads_of, wait_until

pytestmark = pytest.mark.ros
NODES = (RECORDER, "microphone", "follower", "law_server", DRIVE)
LATCHED = QoSProfile(depth=32, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def given(short_scene, tmp_path):
    """The parameters of nodes, each as of somebody who starts it alone."""

    def given(*names, **more):
        own = {RECORDER: {"bag": str(tmp_path / "bag")}, DRIVE: {"patience": 300.0}}
        return {name: {"scene": str(short_scene)} | own.get(name, {}) | more for name in names}

    return given


@pytest.fixture
def start(given, domain):
    """Start nodes as `ros2 run` does, each alone; they are ended with the test."""
    started = []

    def start(*names, **more):
        for name, arguments in given(*names, **more).items():
            started.append(NodeProcess(name, arguments, False, lambda _line: None))
        return started

    yield start
    stop_all(started)


def listen(user, kind, topic):
    """What is published on a topic from now on, and what is latched."""
    heard = []
    user.node.create_subscription(kind, topic, heard.append, LATCHED)
    return heard


def test_nodes_alone_end_with_the_run_and_leave_a_closed_bag(
    user, given, undisturbed, tmp_path, capfd
):
    """Code 0 each; the bag holds what one of `cam-rig run` does; each says what it does, once."""
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    with OneProcess(given(*NODES)) as here:
        wait_until(lambda: user.spin(0.1) or not any(map(here.is_running, NODES)))
    assert here.codes == dict.fromkeys(NODES, 0)
    run = FinishedRun.from_message(finished[0])
    assert (run.level, run.text, run.ticks) == (DiagnosticStatus.OK, "done", TICKS)
    assert not is_unclosed(tmp_path / "bag")
    assert payloads_of(tmp_path / "bag") == undisturbed
    logged = capfd.readouterr().err
    for name in ("microphone", "follower", DRIVE):
        assert f"[{name}]: done with {TICKS} ticks" in logged
    assert f"[law_server]: done with {TICKS + 1} states" in logged
    turning = re.findall(r"\[cam_drive\]: turning (\w+) at (\d+) rpm", logged)
    assert turning == [(cam, rpm) for cam in ("tm21", "bezier15") for rpm in ("250", "400")]


@pytest.mark.long
@pytest.mark.parametrize("drive", ["that stays", "started anew"])
def test_nodes_that_stay_do_another_run_into_another_bag(user, start, undisturbed, tmp_path, drive):
    """The same run again, and bit for bit: nothing of the first one is left in a node."""
    nodes = list(start(*NODES[:-1], at_end="stay"))
    first = start(DRIVE, at_end="stay" if drive == "that stays" else "end")[-1]
    if drive == "that stays":
        wait_until(lambda: any("ready for another" in line for line in first.stderr_lines))
        user.call("/cam_drive/start")
        nodes.append(first)
    else:
        wait_until(lambda: first.has_ended)
        start(DRIVE)
    second = tmp_path / "bag_2"
    wait_until(lambda: bag_files(second) and not is_unclosed(second))
    for bag in (tmp_path / "bag", second):
        assert payloads_of(bag) == undisturbed
    assert not any(node.has_ended for node in nodes)
    stop_all(nodes)
    assert {node.code for node in nodes} == {0}
    assert not (tmp_path / "bag_3").exists()  # nothing was recorded in it


def test_nodes_that_wait_say_so_on_diagnostics(user, given):
    """Once a second of wall time, for whom, though rig time stands."""
    heard = listen(user, DiagnosticArray, "/diagnostics")

    def beats(name, whom):
        """Stamps of the heartbeats, s."""
        now = {"state": "waiting", "waits_for": whom}
        return [
            message.header.stamp.sec
            for message in heard
            for status in message.status
            if status.name == f"{name}: heartbeat"
            and {pair.key: pair.value for pair in status.values} == now
        ]

    with OneProcess(given(DRIVE, "follower")):
        for name, whom in {
            "follower": "cam_drive, law_server",
            DRIVE: "law_server, microphone, recorder",
        }.items():
            wait_until(lambda name=name, whom=whom: user.spin(0.1) or len(beats(name, whom)) > 2)
            first, *_, last = beats(name, whom)
            assert first == last == 0  # rig time, as of all diagnostics: no state has come yet


@pytest.mark.parametrize("how", ["stopped", "no answer"])
def test_a_drive_that_ends_early_says_why_and_the_bag_is_closed(user, given, tmp_path, how, capfd):
    """By a signal, or for want of an answer: the other nodes end in order all the same."""
    pressures = listen(user, FluidPressure, "/microphone/pressure")
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    nodes = given(*NODES)
    nodes[DRIVE] |= {"pacing": "real_time", "patience": 300.0 if how == "stopped" else 5.0}
    go_on = threading.Event()
    with OneProcess(nodes) as here:
        wait_until(lambda: user.spin(0.1) or len(pressures) > 2)
        if how == "stopped":
            here.nodes[DRIVE].interrupt()
        else:
            here.nodes["microphone"]._source.listen = lambda *_: go_on.wait(200.0) and 1.0
        wait_until(lambda: user.spin(0.1) or finished)
        go_on.set()
        wait_until(lambda: not any(map(here.is_running, NODES)))
    run = FinishedRun.from_message(finished[0])
    assert how in run.text
    held = "from: microphone, and behind it recorder; is it running?"  # which waits for its level
    assert (held in run.text) == (how == "no answer")
    codes = dict.fromkeys(NODES, 0) | {DRIVE: 0 if how == "stopped" else 1}
    assert here.codes == codes
    logged = capfd.readouterr().err
    assert f"[follower]: stopped after {here.nodes['follower'].ticks} of {TICKS} ticks" in logged
    of_drive = f"[cam_drive]: stopped after {run.ticks} of {TICKS} ticks"
    assert (of_drive in logged) == (how == "stopped") and "done with" not in logged
    assert read_recording(tmp_path / "bag").ticks


# The recorder's end: it takes what is in transit, and does not wait for an endless publisher.


@pytest.mark.parametrize(
    ("writes", "written", "seconds"),
    [
        pytest.param([1, 1, 0, 0, 0, 1, 0, 1], 4, 0.02 * (8 + 5), id="with gaps, then none"),
        pytest.param(cycle([0, 1]), 75, MAX_DRAIN_S, id="for ever, one every 40 ms"),
    ],
)
def test_the_rest_is_taken_until_nothing_comes(monkeypatch, writes, written, seconds):
    """An endless publisher is not waited for: the recorder ends before it is killed."""
    time, writes = SimpleNamespace(s=0.0, monotonic=lambda: time.s), iter(writes)
    node = SimpleNamespace(received=0)
    monkeypatch.setattr(rig_node, "time", time)

    def spin_once(timeout_sec):
        time.s += timeout_sec
        node.received += next(writes, 0)

    RigNode.drain(node, spin_once)
    assert (node.received, time.s) == (written, pytest.approx(seconds))


def test_a_second_recorder_is_refused_and_disturbs_nothing(
    domain, short_scene, undisturbed, tmp_path
):
    """It names the other one; the bag of that is that of an undisturbed run."""
    words = "this rig has a recorder already, in ROS domain"
    with OneProcess(patient(short_scene, tmp_path / "bag", pacing=SLOW)) as here:
        reports = here.progress()
        next(report for report in reports if report["tick"] == 2)
        with pytest.raises(RunError, match=words):
            node_of(RECORDER)
        here.nodes[DRIVE].set_pacing("free")
        for _ in reports:
            pass
    assert payloads_of(tmp_path / "bag") == undisturbed


# Nodes whose drive leaves without saying that the run is over.

LONG = int(DRIVE_LOST_S / POLL_S) + 1


@pytest.fixture
def poll(make, monkeypatch):
    """Let a node look so many times whether the drive is there; the node."""

    def poll(name, *looks):
        node = make(name)
        absence = LostDriveMonitor(node)
        for drives, times in looks:
            monkeypatch.setattr(node, "count_publishers", lambda _topic, drives=drives: drives)
            for _ in range(times):
                absence.poll()
        return node

    return poll


def test_a_node_ends_when_the_drive_has_left_without_a_word(poll, capfd):
    """It was killed, or the node was suspended while it gave up; not one that was never there, nor
    one that is discovered again."""
    here = [(0, 2 * LONG), *[(1, 1), (0, LONG - 2)] * 3]
    assert not poll("microphone", *here).done.done()
    node = poll(RECORDER, *here, (0, 2))
    assert node.done.done() and node.failure is None
    assert "the drive has left without publishing /rig/finished" in capfd.readouterr().err
