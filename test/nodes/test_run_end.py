"""The run's end without a runner: the drive says so, the bag is closed, the nodes end or stay."""

import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import FluidPressure

from cam_rig.bag.files import bag_files, is_unclosed
from cam_rig.bag.reader import read_recording
from cam_rig.nodes.run_end import FinishedRun
from cam_rig.runner.node_process import NodeProcess, stop_all
from cam_rig.runner.node_table import DRIVE, RECORDER

pytestmark = pytest.mark.ros
NODES = (RECORDER, "microphone", "follower", "law_server", DRIVE)
LATCHED = QoSProfile(depth=32, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def start(short_scene, tmp_path):
    """Start nodes as `ros2 run` does, each alone; they are ended with the test."""
    started = []

    def start(*names, **given):
        for name in names:
            own = {RECORDER: {"bag": str(tmp_path / "bag")}, DRIVE: {"patience": 300.0}}
            arguments = {"scene": str(short_scene)} | own.get(name, {}) | given
            started.append(NodeProcess(name, arguments, False, lambda _line: None))
        return started

    yield start
    stop_all(started)


def listen(user, kind, topic):
    """What is published on a topic from now on, and what is latched."""
    heard = []
    user.node.create_subscription(kind, topic, heard.append, LATCHED)
    return heard


def lines(node):
    """What a node has said at INFO."""
    return [line.split("]: ", 1)[1].strip() for line in node.stderr_lines if "[INFO]" in line]


def test_five_nodes_alone_end_with_the_run_and_leave_a_closed_bag(
    user, start, rig, wait_for, undisturbed, tmp_path
):
    """Code 0 each; the bag holds what one of `cam-rig run` does; each says what it does, once."""
    nodes = {node.name: node for node in start(*NODES)}
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    wait_for(lambda: user.spin(0.1) or all(node.has_ended for node in nodes.values()))
    assert {name: node.code for name, node in nodes.items()} == dict.fromkeys(NODES, 0)
    run = FinishedRun.of(finished[0])
    assert (run.level, run.words, run.ticks) == (DiagnosticStatus.OK, "done", rig.ticks)
    assert not is_unclosed(tmp_path / "bag")
    assert rig.payloads(tmp_path / "bag") == undisturbed
    for node in nodes.values():
        node.settle()
    turning = [line for line in lines(nodes[DRIVE]) if line.startswith("turning")]
    assert turning == [
        f"turning {cam} at {rpm} rpm"
        for cam in ("tm21", "bezier15")
        for rpm in (250, 300, 350, 400)
    ]
    assert lines(nodes["follower"]) == [
        "waiting for cam_drive and law_server",
        f"done with {rig.ticks} ticks",
    ]
    assert lines(nodes[RECORDER])[0].startswith(f"recording into {tmp_path / 'bag'}")
    assert lines(nodes[RECORDER])[-1].startswith(f"closed {tmp_path / 'bag'}: {rig.ticks + 1} sta")


@pytest.mark.long
@pytest.mark.parametrize("drive", ["that stays", "started anew"])
def test_nodes_that_stay_do_another_run_into_another_bag(
    user, start, rig, wait_for, undisturbed, tmp_path, drive
):
    """The same run again, and bit for bit: nothing of the first one is left in a node."""
    nodes = list(start(*NODES[:-1], at_end="stay"))
    if drive == "that stays":
        first = start(DRIVE, at_end="stay")[-1]
        wait_for(lambda: any("stays for" in line for line in lines(first)))
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


def test_nodes_that_wait_say_so_on_diagnostics(user, start, wait_for):
    """Once a second of wall time, for whom, though rig time stands."""
    heard = listen(user, DiagnosticArray, "/diagnostics")
    start(DRIVE, "follower")

    def beats(name, words):
        """Stamps of the wall clock, s."""
        return [
            message.header.stamp.sec
            for message in heard
            for status in message.status
            if (status.name, status.message) == (f"{name}: heartbeat", words)
        ]

    for name, words in {
        "follower": "waiting for cam_drive and law_server",
        DRIVE: "waiting for law_server, microphone, recorder",
    }.items():
        wait_for(lambda name=name, words=words: user.spin(0.1) or len(beats(name, words)) > 2)
        first, *_, last = beats(name, words)
        assert last > first > 1e9


@pytest.mark.variants(1)
@pytest.mark.parametrize("how", ["stopped", "no answer"])
def test_a_drive_that_ends_early_says_why_and_the_bag_is_closed(
    user, start, wait_for, tmp_path, how
):
    """By a signal, or for want of an answer: the other nodes end in order all the same."""
    pressures = listen(user, FluidPressure, "/microphone/pressure")
    nodes = {node.name: node for node in start(*NODES[:-1])}
    wait_for(lambda: all(lines(node) for node in nodes.values()))
    patience = 300.0 if how == "stopped" else 10.0
    drive = start(DRIVE, pacing="real_time", patience=patience)[-1]
    finished = listen(user, DiagnosticStatus, "/rig/finished")
    wait_for(lambda: user.spin(0.1) or len(pressures) > 2)
    if how == "stopped":
        drive.process.send_signal(signal.SIGINT)
    else:
        nodes["microphone"].process.send_signal(signal.SIGSTOP)
    wait_for(lambda: user.spin(0.1) or finished)
    nodes["microphone"].process.send_signal(signal.SIGCONT)
    wait_for(lambda: drive.has_ended and all(node.has_ended for node in nodes.values()))
    run = FinishedRun.of(finished[0])
    assert how in run.words
    held = "from: microphone, and behind it recorder; is it running?"  # which waits for its level
    assert (held in run.words) == (how == "no answer")
    assert drive.code == (0 if how == "stopped" else 1)
    assert {node.code for node in nodes.values()} == {0}
    assert read_recording(tmp_path / "bag").ticks


def test_a_recorder_that_comes_back_takes_up_the_run_and_its_end(
    user, start, rig, wait_for, undisturbed, tmp_path
):
    """As a launch file starts it again; the drive stays until the successor has closed the bag."""
    pressures = listen(user, FluidPressure, "/microphone/pressure")
    (tmp_path / "checkpoints").mkdir()
    given = {"checkpoint": str(tmp_path / "checkpoints")}
    first = start(*NODES[:-1], **given)[0]
    start(DRIVE, pacing="20x", **given)
    wait_for(lambda: user.spin(0.1) or len(pressures) > 20)
    first.process.kill()
    nodes = start(RECORDER, **given)[1:]
    wait_for(lambda: all(node.has_ended for node in nodes))
    assert {node.code for node in nodes} == {0}
    assert rig.payloads(tmp_path / "bag") == undisturbed


def test_a_node_of_one_run_does_not_stay(ros_domain, start, wait_for, tmp_path):
    """A checkpoint folder is of one run: the node says so, with code 2."""
    (node,) = start("follower", at_end="stay", checkpoint=str(tmp_path))
    wait_for(lambda: node.has_ended)
    node.settle()
    assert node.code == 2
    assert "at_end: is stay with a checkpoint folder" in node.last_stderr_line()
