"""The run's end without a runner: the drive says so, the bag is closed, the nodes end or stay."""

import threading
from itertools import count

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import FluidPressure

from cam_rig.bag.files import bag_files, is_unclosed
from cam_rig.bag.reader import read_recording
from cam_rig.errors import ConfigError, RunError
from cam_rig.nodes.convert import MAX_DRAIN_S, take_rest
from cam_rig.nodes.run_end import ABSENT_S, POLL_S, DriveAbsence, FinishedRun
from cam_rig.runner.node_process import NodeProcess, stop_all
from cam_rig.runner.node_table import DRIVE, RECORDER

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


def said(name, logged):
    """What a node has said at INFO."""
    begin = f"[{name}]: "
    return [line.split(begin, 1)[1] for line in logged.splitlines() if begin in line]


def test_nodes_alone_end_with_the_run_and_leave_a_closed_bag(
    user, given, rig, wait_for, undisturbed, tmp_path, capfd
):
    """Code 0 each; the bag holds what one of `cam-rig run` does; each says what it does, once."""
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    with rig.here(given(*NODES)) as here:
        wait_for(lambda: user.spin(0.1) or not any(map(here.is_running, NODES)))
    assert here.codes == dict.fromkeys(NODES, 0)
    run = FinishedRun.of(finished[0])
    assert (run.level, run.words, run.ticks) == (DiagnosticStatus.OK, "done", rig.ticks)
    assert not is_unclosed(tmp_path / "bag")
    assert rig.payloads(tmp_path / "bag") == undisturbed
    logged = capfd.readouterr().err
    turning = [line for line in said(DRIVE, logged) if line.startswith("turning")]
    assert turning == [
        f"turning {cam} at {rpm} rpm" for cam in ("tm21", "bezier15") for rpm in (250, 400)
    ]
    first, last = said("follower", logged)
    assert (first, last) == ("waiting for cam_drive and law_server", f"done with {rig.ticks} ticks")
    first, *_, last = said(RECORDER, logged)
    assert first.startswith(f"recording into {tmp_path / 'bag'}")
    assert last.startswith(f"closed {tmp_path / 'bag'}: {rig.ticks + 1} states")


@pytest.mark.long
@pytest.mark.parametrize("drive", ["that stays", "started anew"])
def test_nodes_that_stay_do_another_run_into_another_bag(
    user, start, rig, wait_for, undisturbed, tmp_path, drive
):
    """The same run again, and bit for bit: nothing of the first one is left in a node."""
    nodes = list(start(*NODES[:-1], at_end="stay"))
    if drive == "that stays":
        first = start(DRIVE, at_end="stay")[-1]
        wait_for(lambda: any("stays for" in line for line in first.stderr_lines))
        user.call("/cam_drive/start")
        nodes.append(first)
    else:
        first = start(DRIVE)[-1]
        wait_for(lambda: first.has_ended)
        start(DRIVE)
    second = tmp_path / "bag_2"
    wait_for(lambda: bag_files(second) and not is_unclosed(second))
    for bag in (tmp_path / "bag", second):
        assert rig.payloads(bag) == undisturbed
    assert not any(node.has_ended for node in nodes)
    stop_all(nodes)
    assert {node.code for node in nodes} == {0}
    assert not (tmp_path / "bag_3").exists()  # nothing was recorded in it


def test_nodes_that_wait_say_so_on_diagnostics(user, given, rig, wait_for):
    """Once a second of wall time, for whom, though rig time stands."""
    heard = listen(user, DiagnosticArray, "/diagnostics")

    def beats(name, whom):
        """Stamps of the wall clock, s."""
        now = {"state": "waiting", "waits_for": whom}
        return [
            message.header.stamp.sec
            for message in heard
            for status in message.status
            if status.name == f"{name}: heartbeat"
            and {pair.key: pair.value for pair in status.values} == now
        ]

    with rig.here(given(DRIVE, "follower")):
        for name, whom in {
            "follower": "cam_drive, law_server",
            DRIVE: "law_server, microphone, recorder",
        }.items():
            wait_for(lambda name=name, whom=whom: user.spin(0.1) or len(beats(name, whom)) > 2)
            first, *_, last = beats(name, whom)
            assert last > first > 1e9


@pytest.mark.parametrize("how", ["stopped", "no answer"])
def test_a_drive_that_ends_early_says_why_and_the_bag_is_closed(
    user, given, rig, wait_for, tmp_path, how
):
    """By a signal, or for want of an answer: the other nodes end in order all the same."""
    pressures = listen(user, FluidPressure, "/microphone/pressure")
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    nodes = given(*NODES)
    nodes[DRIVE] |= {"pacing": "real_time", "patience": 300.0 if how == "stopped" else 2.0}
    go_on = threading.Event()
    with rig.here(nodes) as here:
        wait_for(lambda: user.spin(0.1) or len(pressures) > 2)
        if how == "stopped":
            here.nodes[DRIVE].interrupt()
        else:
            here.nodes["microphone"]._source.listen = lambda *_: go_on.wait(200.0) and 1.0
        wait_for(lambda: user.spin(0.1) or finished)
        go_on.set()
        wait_for(lambda: not any(map(here.is_running, NODES)))
    run = FinishedRun.of(finished[0])
    assert how in run.words
    held = "from: microphone, and behind it recorder; is it running?"  # which waits for its level
    assert (held in run.words) == (how == "no answer")
    codes = dict.fromkeys(NODES, 0) | {DRIVE: 0 if how == "stopped" else 1}
    assert here.codes == codes
    assert read_recording(tmp_path / "bag").ticks


@pytest.mark.long
def test_a_recorder_that_comes_back_takes_up_the_run_and_its_end(
    user, start, rig, wait_for, undisturbed, tmp_path
):
    """As a launch file starts it again; the drive stays until the successor has closed the bag."""
    pressures = listen(user, FluidPressure, "/microphone/pressure")
    (tmp_path / "checkpoints").mkdir()
    kept = {"checkpoint": str(tmp_path / "checkpoints")}
    first = start(*NODES[:-1], **kept)[0]
    start(DRIVE, pacing="2x", **kept)
    wait_for(lambda: user.spin(0.1) or len(pressures) > 20)
    first.process.kill()
    nodes = start(RECORDER, **kept)[1:]
    wait_for(lambda: all(node.has_ended for node in nodes))
    assert {node.code for node in nodes} == {0}
    assert rig.payloads(tmp_path / "bag") == undisturbed


def test_a_node_of_one_run_does_not_stay(domain, given, rig, tmp_path):
    """A checkpoint folder is of one run: the node says so."""
    nodes = given("follower", at_end="stay", checkpoint=str(tmp_path))
    words = "at_end: is stay with a checkpoint folder"
    with pytest.raises(ConfigError, match=words), rig.here(nodes):
        pass


# The recorder's end: it takes what is in transit, and does not wait for an endless publisher.


class Spinning:
    """Stands in for the executor and the clock: each spin takes its time, and may write one."""

    def __init__(self, writes):
        self.writes, self.written, self.time, self.spins = iter(writes), 0, 0.0, 0

    def spin_once(self, timeout_sec):
        self.time, self.spins = self.time + timeout_sec, self.spins + 1
        self.written += next(self.writes, 0)

    def rest(self):
        take_rest(self.spin_once, lambda: self.written, lambda: self.time)


def test_the_rest_is_taken():
    """Messages with gaps between them, then none: all are written, and the end comes soon."""
    spinning = Spinning([1, 1, 0, 0, 0, 1, 0, 1])
    spinning.rest()
    assert spinning.written == 4 and spinning.spins == 8 + 5


def test_an_endless_publisher_is_not_waited_for():
    """Something to write every 40 ms, for ever: the recorder ends before it is killed."""
    spinning = Spinning(number % 2 for number in count())
    spinning.rest()
    assert MAX_DRAIN_S <= spinning.time < MAX_DRAIN_S + 0.1 < 5.0


def test_a_second_recorder_is_refused_and_disturbs_nothing(
    domain, rig, short_scene, undisturbed, tmp_path
):
    """It names the other one; the bag of that is that of an undisturbed run."""
    words = "this rig has a recorder already, in ROS domain"
    with rig.here(rig.live(short_scene, tmp_path / "bag", pacing="5x")) as here:
        reports = here.progress()
        next(report for report in reports if report["tick"] == 4)
        with pytest.raises(RunError, match=words):
            rig.node(RECORDER)
        for _ in reports:
            pass
    assert rig.payloads(tmp_path / "bag") == undisturbed


# Nodes whose drive leaves without saying that the run is over.

LONG = int(ABSENT_S / POLL_S) + 1


@pytest.mark.parametrize("name", ["microphone", RECORDER])
def test_a_node_ends_when_the_drive_has_left_without_a_word(make, monkeypatch, capfd, name):
    """It was killed, or the node was suspended while it gave up; not one that was never there,
    nor one that is discovered again."""
    node = make(name)
    absence = DriveAbsence(node)

    def poll(drives, times):
        monkeypatch.setattr(node, "count_publishers", lambda _topic: drives)
        for _ in range(times):
            absence.poll()

    poll(0, 2 * LONG)
    for _ in range(3):
        poll(1, 1)
        poll(0, LONG - 2)
    assert not node.done.done()
    poll(0, 2)
    assert node.done.done()
    assert node.failure is None
    assert "the drive has left without saying that the run is over" in capfd.readouterr().err


def test_a_node_of_which_the_drive_comes_back_waits(make, monkeypatch, tmp_path):
    """With a checkpoint folder it is started again."""
    node = make("microphone")
    node.given["checkpoint"] = str(tmp_path)
    absence = DriveAbsence(node)
    for drives in (1, 0):
        monkeypatch.setattr(node, "count_publishers", lambda _topic, drives=drives: drives)
        for _ in range(3 * LONG):
            absence.poll()
    assert not node.done.done()
