"""Readings of any bag are returned in SI units, with a note on each irregularity."""

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from cam_rig.bag.foreign.topic_line import parse_topics
from cam_rig.bag.measured_run import read_measured
from cam_rig.bag.reader import read_ticks
from cam_rig.errors import BagError, ConfigError
from cam_rig.units import TURN

from ..foreign_bags import BEGIN, joint, number, wrench, write_bag, write_rigs
from .bags import GOLDEN

TIME = np.arange(400) / 200.0
ANGLE = TURN * 3.0 * TIME  # 180 rpm
LIFT = 5.0 * (1.0 - np.cos(ANGLE))  # mm
FORCE = 40.0 + np.sin(ANGLE)
LINE = "angle=/encoder.position[0] lift=/lvdt.data:mm force=-/cell.wrench.force.z"


def bench(path, plugin=StoragePlugin.MCAP, **changes):
    """Write a bag of an encoder, an inductive lift gauge in mm and a load cell.

    The load cell measures tension as positive. The path is returned. `changes` adds or replaces
    topics by name.
    """
    topics = {
        "/encoder": (joint, TIME, np.remainder(ANGLE, TURN)),
        "/lvdt": (number, TIME, LIFT),
        "/cell": (wrench, TIME, -FORCE),
        **{f"/{name}": topic for name, topic in changes.items()},
    }
    return write_bag(path / "bench", topics, plugin)


@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda p: p.name)
def test_a_bag_of_standard_messages_is_read_in_si(tmp_path, plugin):
    """Readings of MCAP and SQLite bags are returned in SI with continuous angles.

    Notes report the source of each time and the counted turns.
    """
    run = read_measured(bench(tmp_path, plugin), parse_topics(LINE), cam="own")
    np.testing.assert_allclose(run.angle.value, ANGLE, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.lift.value, 1e-3 * LIFT, rtol=1e-15)
    np.testing.assert_array_equal(run.force.value, FORCE)
    assert (run.cam, run.level, run.begin_ns) == ("own", None, BEGIN)
    np.testing.assert_allclose(run.angle.time, TIME, rtol=0, atol=1e-9)
    # A Float64 message has no header. Its time is the log time, half a millisecond later.
    np.testing.assert_allclose(run.lift.time, TIME + 5e-4, rtol=0, atol=1e-9)
    said = " ".join(run.notes)
    assert "lift: /lvdt.data, 400 readings, the time is that of the bag." in said
    assert "angle: /encoder.position[0], 400 readings, the time is that of the message's" in said
    assert "turns were counted" in said and "gap" not in said


def test_a_field_may_be_omitted_or_named_by_joint_or_use_the_bag_clock(tmp_path):
    """In --topics a field may be omitted, or selected by joint name or index.

    With @bag the time is the receive time of the bag. All spellings give the same readings.
    """
    bag = bench(tmp_path)
    for line in (
        "angle=/encoder.position[encoder]@bag lift=/lvdt:mm",
        "angle=/encoder.position[0]@bag lift=/lvdt/data:mm",
    ):
        run = read_measured(bag, parse_topics(line))
        np.testing.assert_array_equal(
            run.lift.value, read_measured(bag, parse_topics(LINE)).lift.value
        )
        np.testing.assert_array_equal(run.angle.time, run.lift.time)


@pytest.mark.parametrize("whole", [True, False], ids=["all turns", "within a turn"])
def test_a_falling_angle_is_reversed_and_reported(tmp_path, whole):
    """A cam angle that falls is returned with the opposite sign.

    A note reports this.
    """
    angle = -ANGLE if whole else np.remainder(-ANGLE, TURN)
    bag = bench(tmp_path, encoder=(joint, TIME, np.degrees(angle)))
    run = read_measured(bag, parse_topics(LINE.replace("[0]", "[0]:deg")))
    np.testing.assert_allclose(run.angle.value - run.angle.value[0], ANGLE, rtol=0, atol=1e-9)
    assert any("sign was reversed" in note for note in run.notes)


def test_readings_are_sorted_and_invalid_numbers_are_dropped(tmp_path):
    """Readings are sorted by time, and NaN values and repeated stamps are dropped.

    A note reports each irregularity with its number.
    """
    time, lift = TIME.copy(), np.radians(LIFT)
    time[[10, 11]], time[50] = time[[11, 10]], time[49]
    lift[[10, 11]], lift[70] = lift[[11, 10]], np.nan
    bag = bench(tmp_path, lvdt=(joint, time, lift))
    run = read_measured(bag, parse_topics(LINE.replace("lvdt.data:mm", "lvdt.position[0]")))
    kept = np.delete(np.arange(400), [50, 70])
    np.testing.assert_allclose(run.lift.time, TIME[kept], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(run.lift.value, np.radians(LIFT)[kept])
    said = " ".join(run.notes)
    assert "1 of 400 readings are dropped: they are not numbers" in said
    assert "1 stamps are before the previous one" in said
    assert "1 readings are dropped: their stamp occurs before" in said


def test_lost_messages_are_a_gap_that_is_not_filled(tmp_path):
    """Lost messages are reported as gaps, and their readings are not interpolated.

    A single lost message is a gap. The usual jitter of the stamps is not.
    """
    jitter = TIME + 2e-5 * np.random.default_rng(5).normal(size=TIME.size)
    kept = np.delete(np.arange(400), [20, *range(100, 140)])
    bag = bench(tmp_path, cell=(wrench, jitter[kept], FORCE[kept]))
    run = read_measured(bag, parse_topics(LINE))
    begin = min(jitter.min(), 0.0)
    np.testing.assert_allclose(run.force.gaps(), jitter[[[19, 21], [99, 140]]] - begin, atol=1e-8)
    assert run.force.time.size == 359 and len(run.angle.gaps()) == 0
    assert any(
        note.startswith("force: 2 gaps in the readings, the longest of 0.205 s")
        for note in run.notes
    )


def test_a_bag_of_the_rig_needs_no_mapping():
    """A bag recorded by the rig is read without --topics: samples and levels of a cam.

    A missing or unknown name of the cam is an error with the existing names.
    """
    run = read_measured(GOLDEN, cam="tm21")
    ticks = [tick for tick in read_ticks(GOLDEN) if tick.cam == "tm21"]
    np.testing.assert_array_equal(run.angle.value, np.hstack([tick.angle for tick in ticks]))
    np.testing.assert_array_equal(run.lift.value, np.hstack([tick.lift for tick in ticks]))
    np.testing.assert_array_equal(run.force.value, np.hstack([tick.force for tick in ticks]))
    assert run.level.value.size == len(ticks) == 8 and run.notes == ()
    assert run.angle.value.size == 1643 and run.force.source == "/follower/samples"
    with pytest.raises(BagError, match=r"contains cams tm21, .*choose one with --cam tm21"):
        read_measured(GOLDEN)
    with pytest.raises(BagError, match=r"no samples of cam 'tm12'.*did you mean 'tm21'"):
        read_measured(GOLDEN, cam="tm12")


def test_of_two_rigs_one_is_chosen_by_its_namespace(tmp_path):
    """In a bag of two rigs the namespace selects a rig.

    The readings equal those of a bag with one rig. An unknown namespace is an error with the
    allowed namespaces.
    """
    bag = write_rigs(tmp_path / "two", GOLDEN, "", "/rig2")
    expected = read_measured(GOLDEN, cam="tm21")
    for namespace in ("/", "rig2"):
        run = read_measured(bag, cam="tm21", namespace=namespace)
        np.testing.assert_array_equal(run.force.value, expected.force.value)
        np.testing.assert_array_equal(run.level.value, expected.level.value)
    with pytest.raises(BagError, match="contains no rig /rig3; allowed: /, /rig2"):
        read_measured(bag, cam="tm21", namespace="/rig3")


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("angle=/encodr.position[0] lift=/lvdt", "no topic /encodr; .*did you mean '/encoder'"),
        ("angle=/encoder.positon[0] lift=/lvdt", r"angle: /encoder .*did you mean 'position\[0\]'"),
        ("angle=/encoder.position[3] lift=/lvdt", "index of 'position' must be less than 1, got 3"),
        ("angle=/encoder.position[cam] lift=/lvdt", "a number from 0 or one of encoder, got 'cam'"),
        (
            "angle=/encoder.position lift=/lvdt",
            r"an array of 1; name one element, as position\[0\]",
        ),
        (
            "angle=/lvdt lift=/cell",
            "lift: /cell .*the field must be named; the message has wrench.force.x",
        ),
        ("angle=/lvdt lift=/encoder.name[0]", "no number 'name"),
        ("angle=/lvdt lift=/cell.wrench", "no number 'wrench'; allowed: wrench.force.x"),
        ("angle=/still lift=/lvdt", "/still: the angle must change in one direction, got -0° to"),
        ("angle=/few.data lift=/lvdt", "angle: /few must have at least two readings .*got 1"),
        (
            "angle=/encoder.position[0] lift=/late.data",
            "lift and angle must overlap in time, got /late.data from 50",
        ),
    ],
)
def test_an_error_names_the_missing_and_the_existing_names(tmp_path, line, error):
    """An invalid mapping raises BagError with the wrong name and the existing names.

    It contains the path of the bag, and a suggestion if a name is similar.
    """
    bag = bench(
        tmp_path,
        still=(number, TIME, np.sin(ANGLE)),
        few=(number, TIME[:1], ANGLE[:1]),
        late=(number, TIME + 50.0, LIFT),
    )
    with pytest.raises(BagError, match=error) as raised:
        read_measured(bag, parse_topics(line))
    assert str(bag) in str(raised.value)


def test_a_foreign_bag_without_a_mapping_is_refused_with_its_topics(tmp_path):
    """A bag of another program without --topics is refused with its topics."""
    with pytest.raises(BagError, match=r"--topics .*/cell \[geometry_msgs/msg/WrenchStamped\]"):
        read_measured(bench(tmp_path))


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("angle=/a lft=/b", "unknown quantity 'lft'; .*did you mean 'lift'"),
        ("angle=/a:turn/0 lift=/b", r"angle has unit 'turn/0'; allowed: rad, deg, turn, turn/1024"),
        ("angle=/a lift=/b:furlong", "lift has unit 'furlong'; allowed: m, cm, mm"),
        ("lift=/b", "must name the angle and at least one of lift, force, level.*got lift"),
        ("angle=/a", "got angle"),
        ("angle=/a angle=/b", "angle must occur once"),
        ("angle=encoder lift=/b", "must be QUANTITY=/TOPIC.FIELD:UNIT, .*got 'angle=encoder'"),
    ],
)
def test_an_invalid_topics_line_is_refused(line, error):
    """An invalid text of --topics raises ConfigError with the wrong item and the rule."""
    with pytest.raises(ConfigError, match=error):
        parse_topics(line)
