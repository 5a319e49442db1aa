"""Tests of runs without `cam-rig run`, whose nodes are started one by one.

They are started as by `ros2 run`. The drive informs them of the end of the run. They close the bag,
and end or stay for another run.
"""

import re
import threading
from itertools import cycle
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import FluidPressure

from cam_rig.bag.files import bag_files, is_unclosed
from cam_rig.errors import RunError
from cam_rig.nodes.base import rig_node, run_end
from cam_rig.nodes.base.rig_node import MAX_DRAIN_S, RigNode
from cam_rig.nodes.base.run_end import FinishedRun, LostDriveMonitor
from cam_rig.runner.node_process import NodeProcess, stop_all
from cam_rig.runner.node_table import DRIVE, RECORDER
from cam_rig.studies.simulate.recorded import read_recording

from .conftest import SLOW, TICKS, OneProcess, node_of, patient, payloads_of, wait_until

pytestmark = pytest.mark.ros
NODES = (RECORDER, "microphone", "follower", "law_server", DRIVE)
LATCHED = QoSProfile(depth=32, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def parameters(short_scene, tmp_path):
    """Function that returns the parameters of the named nodes, by node."""

    def parameters(*names, **common):
        special = {
            RECORDER: {"output_uri": str(tmp_path / "bag")},
            DRIVE: {"progress_timeout": 300.0},
        }
        scene = {"scene": str(short_scene)}
        return {name: scene | special.get(name, {}) | common for name in names}

    return parameters


@pytest.fixture
def start(parameters, domain):
    """Function that starts the named nodes as processes, as `ros2 run` does.

    The processes end with the test.
    """
    started = []

    def start(*names, **common):
        for name, arguments in parameters(*names, **common).items():
            started.append(NodeProcess(name, arguments, False, lambda _line: None))
        return started

    yield start
    stop_all(started)


def listen(user, kind, topic):
    """Return a list that receives the latched and all future messages of a topic."""
    messages = []
    user.node.create_subscription(kind, topic, messages.append, LATCHED)
    return messages


def test_nodes_end_with_the_run_and_leave_a_closed_bag(
    user, parameters, undisturbed, tmp_path, capfd
):
    """Nodes that are started one by one end with the run and exit code 0.

    The closed bag equals that of `cam-rig run`, and each node logs its progress.
    """
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    states = listen(user, DiagnosticStatus, "/rig/state")
    with OneProcess(parameters(*NODES)) as here:
        wait_until(lambda: user.spin(0.1) or not any(map(here.is_running, NODES)))
    assert here.codes == dict.fromkeys(NODES, 0)
    run = FinishedRun.from_message(finished[0])
    assert (run.level, run.text, run.ticks) == (DiagnosticStatus.OK, "done", TICKS)
    last = {pair.key: pair.value for pair in states[-1].values}
    assert (last["state"], states[-1].message, last["tick"]) == ("finished", "done", str(TICKS))
    assert {pair.value for s in states for pair in s.values if pair.key == "cam"} & {
        "tm21",
        "bezier15",
    }
    assert not is_unclosed(tmp_path / "bag")
    assert payloads_of(tmp_path / "bag") == undisturbed
    logged = capfd.readouterr().err
    for name in ("microphone", "follower", DRIVE):
        assert f"[{name}]: done with {TICKS} ticks" in logged
    assert f"[law_server]: done with {TICKS + 1} states" in logged
    turning = re.findall(r"\[cam_drive\]: turning (\w+) at (\d+) rpm", logged)
    assert turning == [(cam, rpm) for cam in ("tm21", "bezier15") for rpm in ("250", "400")]


@pytest.mark.long
@pytest.mark.parametrize("drive", ["that stays", "restarted"])
def test_nodes_that_stay_make_another_run_with_another_bag(
    user, start, undisturbed, tmp_path, drive
):
    """Nodes that stay make a second run, whose bag equals the first byte by byte.

    No node keeps state of the first run.
    """
    nodes = list(start(*NODES[:-1], on_finish="stay"))
    first = start(DRIVE, on_finish="stay" if drive == "that stays" else "end")[-1]
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
    assert not (tmp_path / "bag_3").exists()  # the bag of a run that was not started


def test_waiting_nodes_publish_heartbeats(user, parameters):
    """A waiting node publishes diagnostics that name the missing nodes.

    They come once per second of wall-clock time, at rig time 0.
    """
    diagnostics = listen(user, DiagnosticArray, "/diagnostics")

    def heartbeats(name, missing):
        """Return the stamps (s) of the heartbeats in which a node waits for `missing`.

        A heartbeat is a diagnostic of a waiting node.
        """
        expected = {"state": "waiting", "waits_for": missing}
        return [
            message.header.stamp.sec
            for message in diagnostics
            for status in message.status
            if status.name == f"{name}: heartbeat"
            and {pair.key: pair.value for pair in status.values} == expected
        ]

    with OneProcess(parameters(DRIVE, "follower")):
        for name, missing in {
            "follower": "cam_drive, law_server",
            DRIVE: "law_server, microphone, recorder",
        }.items():
            wait_until(
                lambda name=name, missing=missing: (
                    user.spin(0.1) or len(heartbeats(name, missing)) > 2
                )
            )
            first, *_, last = heartbeats(name, missing)
            assert first == last == 0  # the rig time before the first state


@pytest.mark.parametrize("reason", ["stopped", "no answer"])
def test_a_drive_that_ends_early_publishes_the_reason(user, parameters, tmp_path, reason, capfd):
    """A drive that is ended by a signal or a timeout publishes the reason.

    The other nodes then end with code 0, and the bag is closed.
    """
    pressures = listen(user, FluidPressure, "/microphone/pressure")
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    nodes = parameters(*NODES)
    nodes[DRIVE] |= {
        "pacing": "real_time",
        "progress_timeout": 300.0 if reason == "stopped" else 5.0,
    }
    resume = threading.Event()
    with OneProcess(nodes) as here:
        wait_until(lambda: user.spin(0.1) or len(pressures) > 2)
        if reason == "stopped":
            here.nodes[DRIVE].interrupt()
        else:
            here.nodes["microphone"]._source.listen = lambda *_: resume.wait(200.0) and 1.0
        wait_until(lambda: user.spin(0.1) or finished)
        resume.set()
        wait_until(lambda: not any(map(here.is_running, NODES)))
    run = FinishedRun.from_message(finished[0])
    assert reason in run.text
    pending = "from: microphone, which blocks recorder; check if"  # it waits for the level
    assert (pending in run.text) == (reason == "no answer")
    codes = dict.fromkeys(NODES, 0) | {DRIVE: 0 if reason == "stopped" else 1}
    assert here.codes == codes
    logged = capfd.readouterr().err
    assert f"[follower]: stopped after {here.nodes['follower'].ticks} of {TICKS} ticks" in logged
    drive_summary = f"[cam_drive]: stopped after {run.ticks} of {TICKS} ticks"
    assert (drive_summary in logged) == (reason == "stopped") and "done with" not in logged
    assert read_recording(tmp_path / "bag").ticks


# Messages in transit at the end of a run.


@pytest.mark.parametrize(
    ("writes", "written", "seconds"),
    [
        pytest.param([1, 1, 0, 0, 0, 1, 0, 1], 4, 0.02 * (8 + 5), id="with gaps, then none"),
        pytest.param(cycle([0, 1]), 75, MAX_DRAIN_S, id="endless, every 40 ms"),
    ],
)
def test_messages_in_transit_are_received_for_a_limited_time(monkeypatch, writes, written, seconds):
    """A node that ends still receives the messages in transit, but for a limited time.

    The cases are messages with gaps and an endless publisher, for which the runner would otherwise
    have to kill the node.
    """
    time, writes = SimpleNamespace(s=0.0, monotonic=lambda: time.s), iter(writes)
    node = SimpleNamespace(received=0)
    monkeypatch.setattr(rig_node, "time", time)

    def spin_once(timeout_sec):
        time.s += timeout_sec
        node.received += next(writes, 0)

    RigNode.drain(node, spin_once)
    assert (node.received, time.s) == (written, pytest.approx(seconds))


def test_a_second_recorder_is_rejected(domain, short_scene, undisturbed, tmp_path):
    """A second recorder in a run is refused.

    The run of the first recorder is undisturbed.
    """
    text = "this rig has a recorder already, in ROS domain"
    with OneProcess(patient(short_scene, tmp_path / "bag", pacing=SLOW)) as here:
        reports = here.progress()
        next(report for report in reports if report["tick"] == 2)
        with pytest.raises(RunError, match=text):
            node_of(RECORDER)
        here.nodes[DRIVE].set_pacing("free")
        for _ in reports:
            pass
    assert payloads_of(tmp_path / "bag") == undisturbed


# Nodes whose drive leaves without publishing the end of the run.


def test_a_drive_that_is_discovered_again_is_not_lost(make):
    """A node counts down to its end only while the drive has been lost.

    The countdown starts if the last known drive leaves, and stops if a drive is discovered again.
    """
    node = make("microphone")
    monitor = LostDriveMonitor(node)
    assert monitor._timer.is_canceled()  # a drive that has never been present
    for count, is_canceled in ((1, True), (0, False), (1, True), (2, True), (1, True), (0, False)):
        monitor.on_drives(count)
        assert monitor._timer.is_canceled() == is_canceled
    monitor._on_lost()
    assert monitor._timer.is_canceled() and node.done.done() and node.failure is None


@pytest.mark.parametrize("name", ["microphone", RECORDER])
def test_a_node_ends_if_the_drive_is_lost(make, user, monkeypatch, capfd, name):
    """A node ends if the drive disappears without publishing the end of the run."""
    monkeypatch.setattr(run_end, "DRIVE_LOST_S", 0.2)
    counts, on_drives = [], LostDriveMonitor.on_drives
    monkeypatch.setattr(
        LostDriveMonitor, "on_drives", lambda self, n: counts.append(n) or on_drives(self, n)
    )
    node = make(name)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    drive = user.node.create_publisher(DiagnosticStatus, "/rig/finished", LATCHED)
    wait_until(lambda: executor.spin_once(timeout_sec=0.02) or 1 in counts)
    user.node.destroy_publisher(drive)
    wait_until(lambda: executor.spin_once(timeout_sec=0.02) or node.done.done())
    assert node.failure is None
    assert "the drive has left without publishing /rig/finished" in capfd.readouterr().err
