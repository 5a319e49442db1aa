"""Operator commands to a running rig, and rigs in namespaces."""

import math
from itertools import pairwise
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState

from cam_rig.bag.completeness import expected_counts, require_complete
from cam_rig.bag.files import bag_file
from cam_rig.bag.partial_reader import unpack
from cam_rig.bag.reader import messages, read_counts
from cam_rig.bag.recover import recover
from cam_rig.bag.replay import compare
from cam_rig.errors import BagError, RefusedError
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of
from cam_rig.messages.topics import RECORDING
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import replay_nodes
from cam_rig.studies.simulate.recorded import read_recording
from cam_rig.units import RPM

from ..foreign_bags import write_rigs
from .conftest import SLOW, TICKS, OneProcess, patient, payloads_of

pytestmark = pytest.mark.ros
#: Speeds (rpm) of the short scene.
SCENE_RPM = (250.0, 400.0)


def set_speeds(user, reports):
    """Set cam speed and pacing as an operator, and require that they take effect.

    Integers are accepted. A speed of 0 means the speeds of the scene. `reports` are progress
    reports of the drive.
    """

    def turns_at(*rpm, set_point=0.0):
        next(report for report in reports if round(report["rpm"], 3) in rpm)
        assert user.get("cam_drive", "rpm") == set_point

    user.set("cam_drive", "rpm", 222)
    turns_at(222.0, set_point=222.0)
    user.set("cam_drive", "pacing", 1)
    assert user.get("cam_drive", "pacing") == "1x"
    user.set("cam_drive", "rpm", 0)
    turns_at(*SCENE_RPM)  # it continues
    user.publish_rpm(333.0)
    turns_at(333.0, set_point=333.0)


def test_a_controller_turns_and_stops_the_cam(make):
    """The commanded velocity of the joint `cam` is the speed from the next tick on.

    A tick is the interval between two published cam states. A velocity of 0 stops the cam. Messages
    about other joints have no effect. Impossible velocities, and motion during an emergency stop,
    are refused.
    """
    drive = make("cam_drive")
    program = drive.program

    def command(velocity, *others):
        names = [*others, "cam"] if velocity is not None else list(others)
        values = [1.0] * len(others) + ([] if velocity is None else [velocity])
        drive._controls._on_joint_commands(JointState(name=names, velocity=values))

    command(31.4, "elbow")
    assert program.schedule.state.speed == pytest.approx(31.4) and program.running
    command(0.0)
    assert not program.running and program.schedule.state.speed == pytest.approx(31.4)
    command(None, "elbow")
    assert not program.running
    command(20.0)
    assert program.running and program.schedule.state.speed == pytest.approx(20.0)
    program.run(False)
    command(20.0)
    assert not program.running  # a repeated command does not cancel that of an operator
    for velocity in (-1.0, math.nan, math.inf, 1e9, 1e-9):
        with pytest.raises(RefusedError, match="speed must be 0, or between"):
            command(velocity)
    with pytest.raises(RefusedError, match="velocity must have one value per joint"):
        drive._controls._on_joint_commands(JointState(name=["cam"]))
    program.run(True)
    program.take(0.0)
    program.halt()
    with pytest.raises(RefusedError, match="emergency stop"):
        command(21.0)


def test_a_session_of_operator_commands(user, short_scene, tmp_path):
    """Operator commands to a running rig take effect without a jump of the cam angle.

    The commands are start, speed, cam, stop, emergency stop and reset. Rejected commands have no
    effect. A replay of the bag gives the same numbers.
    """
    bag = tmp_path / "bag"
    with OneProcess(patient(short_scene, bag, autostart=False, pacing=SLOW)) as here:
        reports = here.progress()
        assert "the cam turns" in user.call("/cam_drive/start")
        next(report for report in reports if report["tick"] == 2)

        assert "rpm" in user.refused("cam_drive", "rpm", 1e-3)  # too many samples per tick
        assert "no such file" in user.refused("law_server", "cam", "no_such_cam")
        assert user.get("cam_drive", "rpm") == 0.0  # the scene's
        assert user.get("law_server", "cam") in ("", "tm21")

        set_speeds(user, reports)
        user.set("microphone", "frequency_weighting", "A")
        user.set("law_server", "cam", "cycloidal")
        next(report for report in reports if report["cam"] == "cycloidal")

        assert "stopped" in user.call("/cam_drive/stop")
        assert "the cam turns" in user.call("/cam_drive/start")
        assert "the cam is stopped" in user.call("/cam_drive/emergency_stop")
        assert "call reset, then start" in user.call("/cam_drive/start", succeeds=False)
        assert "at the beginning" in user.call("/cam_drive/reset")
        assert user.get("cam_drive", "rpm") == 0.0
        user.set("cam_drive", "pacing", "free")
        user.call("/cam_drive/start")
        for _ in reports:
            pass
    states = [cam_state_of(message) for _, _, message in messages(bag, (topics.CAM_STATE,))]
    validator = StateValidator(2000.0)
    for state in states:
        validator.validate(state)
    assert all(a.time_ns < b.time_ns for a, b in pairwise(states))
    stopped, last = (i for i, state in enumerate(states) if state.speed == 0.0)
    assert last == len(states) - 1
    assert states[stopped + 1].angle == states[stopped].angle
    speeds = {round(state.speed / RPM) for state in states[:stopped]}
    assert {222, 333} <= speeds
    assert "cycloidal" in {state.cam for state in states[:stopped]}
    assert len(states) - stopped - 1 == TICKS + 1  # the complete scene after the reset
    counts, expected = read_counts(bag), expected_counts(states)
    for topic in topics.RECORDING:
        if topic.per in expected:
            assert counts[topic.name] == expected[topic.per], topic.name
    assert "cycloidal" in read_recording(bag).loaded.cams  # the bag can be analysed alone
    second_bag = tmp_path / "again"
    scene = unpack(bag, tmp_path / "unpacked")
    with OneProcess(replay_nodes(scene, second_bag, bag)) as here:
        for _ in here.progress():
            pass
    # the weightings change in the same tick as in the first bag
    assert all(comparison.difference == 0.0 for comparison in compare(bag, second_bag))


# Rigs in namespaces: two rigs in one ROS domain, and their bags.

GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


def test_two_rigs_in_one_domain_do_not_affect_each_other(
    forked, domain, short_scene, undisturbed, tmp_path
):
    """Two rigs in namespaces of one domain publish the messages of an undisturbed run.

    The nodes of one rig are processes, those of the other are in this process.
    """
    bags = {name: tmp_path / name for name in ("rig1", "rig2")}
    graph = Graph(patient(short_scene, bags["rig1"]), namespace="/rig1")
    with graph, OneProcess(patient(short_scene, bags["rig2"]), namespace="/rig2") as here:
        runs = [graph.progress(), here.progress()]
        while runs:  # alternately a tick of each rig
            runs = [run for run in runs if next(run, None) is not None]
    for name, bag in bags.items():
        require_complete(bag, read_recording(bag).loaded.scene)
        payloads = payloads_of(bag)
        names = {t.name: t.within(f"/{name}") for t in RECORDING}
        assert payloads == {names[topic]: expected for topic, expected in undisturbed.items()}


def test_a_bag_of_a_namespace_can_be_read_and_recovered(tmp_path):
    """The bag of a rig in a namespace is read like one without.

    A recovered bag keeps the namespace.
    """
    bag = write_rigs(tmp_path / "namespaced", GOLDEN, "/lab/rig1")
    expected = read_counts(GOLDEN)
    assert read_counts(bag) == expected
    with bag_file(bag).open("r+b") as stream:
        stream.truncate(stream.seek(0, 2) - 40)
    recovered = recover(bag, tmp_path / "recovered")
    assert not recovered.loss.gaps
    assert read_counts(tmp_path / "recovered") == expected
    assert all(name.startswith("/lab/rig1/") for name in payloads_of(tmp_path / "recovered"))


def test_a_bag_of_two_rigs_is_rejected(tmp_path):
    """A bag of two rigs is refused, and the error names both.

    `ros2 bag record -a` records such a bag.
    """
    bag = write_rigs(tmp_path / "two", GOLDEN, "", "/rig2")
    with pytest.raises(BagError, match="must contain one rig, got /, /rig2"):
        read_counts(bag)
