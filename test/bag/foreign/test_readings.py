"""Readings of bags of other programs: messages without a reading are skipped.

Each irregularity is counted and noted.
"""

import json
import shutil
import sqlite3

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from cam_rig.bag.foreign.readings import read_signals
from cam_rig.bag.foreign.topic_line import parse_topics
from cam_rig.bag.measured_run import read_measured
from cam_rig.errors import BagError
from cam_rig.units import NS, TURN

from ... import foreign_bags
from ...foreign_bags import BEGIN, TYPES, header, joint, number, wrench, write_bag

TIME = np.arange(500) / 250.0
ANGLE = TURN * 2.0 * TIME
LIFT = 5e-3 * (1.0 - np.cos(ANGLE))
LINE = "angle=/joints.position[cam] lift=/joints.position[follower]"


def joints(stamp, values):
    """Return a ROS JointState whose joint names and positions are those of a dict."""
    kind = TYPES.types["sensor_msgs/msg/JointState"]
    none = np.array([])
    return kind(header(stamp), list(values), np.array(list(values.values()), float), none, none)


def both(angle=ANGLE, lift=LIFT):
    return [{"cam": a, "follower": s} for a, s in zip(angle, lift, strict=True)]


def read(path, line=LINE, **topics):
    """Write a bag with these topics and return its signals, message counts and notes.

    `topics` has the arguments of `write_bag`. `line` assigns quantities to topics, as in --topics.
    The counts are by quantity.
    """
    bag = write_bag(path / "bench", {f"/{name}": topic for name, topic in topics.items()})
    return counted(read_signals(bag, parse_topics(line)))


def counted(found):
    counts = {one.quantity: (one.readings, one.skipped) for one in found.counts}
    signals = {quantity: getattr(found, quantity) for quantity in counts}
    return signals, counts, " ".join(found.notes)


@pytest.mark.parametrize("seed", range(6))
def test_a_message_without_the_joint_or_the_number_is_skipped(tmp_path, seed):
    """A message without the required joint or its position is skipped and counted.

    A note reports the number. The other messages are read, whatever the order of the joints in a
    message.
    """
    rng = np.random.default_rng(seed)
    rows, kept = [], {"cam": [], "follower": []}
    for k, row in enumerate(both()):
        names = [name for name in ("follower", "cam", "other") if rng.random() > 0.3 or k < 2]
        rows.append({name: row.get(name, 9.0) for name in rng.permutation(names)})
        for name in kept.keys() & rows[-1].keys():
            kept[name].append(k)
    signals, counts, notes = read(tmp_path, joints=(joints, TIME, rows))
    for quantity, name, value in (("angle", "cam", ANGLE), ("lift", "follower", LIFT)):
        indices = kept[name]
        assert counts[quantity] == (len(indices), 500 - len(indices))
        np.testing.assert_array_equal(signals[quantity].value, value[indices])
        skipped = 500 - len(indices)
        assert (
            f"{quantity}: {skipped} of 500 messages are skipped: they have no position[{name}]."
            in notes
        )


def test_it_is_an_error_if_all_messages_lack_the_joint(tmp_path):
    """If no message contains the required joint, BagError lists the existing joints."""
    line = LINE.replace("[cam]", "[cm]")
    with pytest.raises(BagError, match=r"from 0 or one of cam, follower, got 'cm'"):
        read(tmp_path, line, joints=(joints, TIME, both()))


def test_a_truncated_message_is_named_with_its_time(tmp_path):
    """A truncated message raises BagError with its topic and time."""
    kind, data = "std_msgs/msg/Float64", TYPES.serialize_cdr(number(0, 1.0), "std_msgs/msg/Float64")
    with RosbagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = [writer.add_connection(name, kind, typestore=TYPES) for name in ("/enc", "/lift")]
        for i in range(20):
            for topic in topics:
                is_cut = i == 7 and topic is topics[1]
                writer.write(topic, BEGIN + i * NS, data[:7] if is_cut else data)
    with pytest.raises(BagError, match=r"message of /lift at 7 s is damaged or truncated \("):
        read_signals(tmp_path / "bag", parse_topics("angle=/enc lift=/lift"))


@pytest.mark.parametrize("sentinel", [-999.0, 9.99])
def test_numbers_that_are_no_lift_are_dropped(tmp_path, sentinel):
    """Values by which a gauge reports an error instead of a lift are dropped.

    A note states their number and times.
    """
    lift = LIFT.copy()
    lift[[50, 51, 300]] = sentinel
    signals, _, notes = read(tmp_path, joints=(joints, TIME, both(lift=lift)))
    np.testing.assert_array_equal(signals["lift"].value, np.delete(LIFT, [50, 51, 300]))
    assert "lift: 3 wrong readings, at 0.2, 0.204, 1.2 s, were dropped" in notes


@pytest.mark.parametrize("zero", [[0], [499], [0, 1, 250], range(1, 500, 2)])
def test_a_reading_with_stamp_0_among_others_is_dropped(tmp_path, zero):
    """A reading with the stamp 0 among readings with stamps is dropped and counted.

    The other readings have the time of their headers, even if the simulated time starts at 1 s.
    """

    def simulated(stamp, row):
        k, values = row
        return joints(0 if k in zero else stamp - BEGIN + NS, values)

    signals, counts, notes = read(tmp_path, joints=(simulated, TIME, list(enumerate(both()))))
    kept = np.setdiff1d(np.arange(500), zero)
    assert counts == dict.fromkeys(("angle", "lift"), (kept.size, 500 - kept.size))
    np.testing.assert_allclose(signals["lift"].time, TIME[kept] - TIME[kept[0]], atol=1e-9)
    assert f"angle: {500 - kept.size} of 500 readings are dropped: their stamp is 0" in notes
    assert f"{kept.size} readings, the time is that of the message's header." in notes


def test_the_time_is_that_of_the_bag_if_all_stamps_are_0(tmp_path):
    """If all stamps are 0, all readings are kept with the receive time of the bag.

    A driver without a clock writes such stamps.
    """
    signals, counts, notes = read(tmp_path, joints=(lambda _, row: joints(0, row), TIME, both()))
    assert counts["angle"] == (500, 0) and "the time is that of the bag" in notes
    np.testing.assert_allclose(signals["angle"].time, TIME, atol=1e-9)


def test_readings_of_a_message_with_a_wrong_angle_are_dropped(tmp_path):
    """A message with a wrong angle is dropped with all its readings.

    A note states the times. Here a second publisher sends zeros. Readings of other topics are kept.
    """
    wrong = [100, 200, 201, 400]
    angle, lift = ANGLE.copy(), LIFT.copy()
    angle[wrong] = lift[wrong] = 0.0
    force = (wrench, TIME, 40.0 + LIFT)
    line = f"{LINE} force=/cell.wrench.force.z"
    signals, counts, notes = read(
        tmp_path, line, joints=(joints, TIME, both(angle, lift)), cell=force
    )
    assert counts == {"angle": (496, 4), "lift": (496, 4), "force": (500, 0)}
    kept = np.delete(np.arange(500), wrong)
    np.testing.assert_array_equal(signals["lift"].value, LIFT[kept])
    np.testing.assert_allclose(signals["angle"].value, ANGLE[kept], rtol=0, atol=1e-12)
    assert "4 wrong angles, at 0.4, 0.8, 0.804, 1.6 s, were dropped" in notes


@pytest.mark.parametrize("kind", ["Int16", "UInt8", "UInt16", "Int8"])
def test_a_counter_wraps_at_the_span_of_its_type(tmp_path, kind):
    """The angle of an integer encoder continues when its integer type wraps.

    This applies to counting upwards and downwards.
    """
    message = TYPES.types[f"std_msgs/msg/{kind}"]
    bits, counts = int(kind.strip("UInt")), 4096 if "16" in kind else 64
    low = 0 if kind.startswith("U") else -(2 ** (bits - 1))
    for sign in (1, -1):
        count = sign * np.floor(10.0 * ANGLE / TURN * counts).astype(int)
        values = np.remainder(count - low, 2**bits) + low
        signals, _, notes = read(
            tmp_path / str(sign),
            f"angle=/enc:turn/{counts} lift=/gauge",
            enc=(lambda _, value: message(int(value)), TIME, values),
            gauge=(number, TIME, LIFT),
        )
        turned = signals["angle"].value - signals["angle"].value[0]
        np.testing.assert_allclose(turned, np.abs(count) * TURN / counts, atol=1e-9)
        assert f"wraps after {2**bits} counts" in notes


OWN = f"""std_msgs/Header header
bench_msgs/Axis[] axes
float32 force
{"=" * 80}
MSG: bench_msgs/Axis
string name
int32 counts
float64 gauge
{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
OWN_LINE = "angle=/state.axes[0].counts:turn/4096 lift=/state.axes[0].gauge force=/state.force"


def own_bag(path, plugin, monkeypatch):
    """Write a bag with a message type that ROS does not have."""
    types = get_typestore(Stores.ROS2_KILTED)
    types.register(get_types_from_msg(OWN, "bench_msgs/msg/State"))
    axis, state = types.types["bench_msgs/msg/Axis"], types.types["bench_msgs/msg/State"]
    monkeypatch.setattr(foreign_bags, "TYPES", types)

    def make(stamp, row):
        return state(header(stamp), [axis("cam", int(row[0]), row[1])], 40.0)

    rows = list(zip(np.floor(ANGLE / TURN * 4096), LIFT, strict=True))
    return write_bag(path / "own", {"/state": (make, TIME, rows)}, plugin)


@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda plugin: plugin.name)
def test_a_type_of_the_user_is_read_by_its_definition_in_the_file(tmp_path, plugin, monkeypatch):
    """A user-defined message type is read by the definition in an MCAP or SQLite bag."""
    bag = own_bag(tmp_path, plugin, monkeypatch)
    signals, counts, _ = counted(read_signals(bag, parse_topics(OWN_LINE)))
    assert set(counts.values()) == {(500, 0)}
    np.testing.assert_array_equal(signals["lift"].value, LIFT)
    assert np.abs(signals["angle"].value - ANGLE).max() < TURN / 4096


def test_a_type_without_a_definition_is_refused_by_name(tmp_path, monkeypatch):
    """A user-defined type without a definition in the bag is refused by its name.

    ROS 2 Humble records SQLite bags without definitions.
    """
    bag = own_bag(tmp_path, StoragePlugin.SQLITE3, monkeypatch)
    with sqlite3.connect(bag / "own.db3") as database:
        database.execute("DELETE FROM message_definitions")
    with pytest.raises(BagError, match=r"/state is of type bench_msgs/msg/State, which .*no def"):
        read_signals(bag, parse_topics(OWN_LINE))


def test_a_standard_type_of_another_distribution_is_read_by_its_definition(tmp_path):
    """A standard message type is read by the definition in the bag.

    The installed definition may differ. The two may be of different ROS distributions. Here the
    type Range has no field `variance`, which later distributions have.
    """
    text = "std_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range"
    text += "\nfloat32 max_range\nfloat32 range"
    types = get_typestore(Stores.EMPTY)
    standard = {name: TYPES.fielddefs[name] for name in TYPES.fielddefs if "Range" not in name}
    types.register({**standard, **get_types_from_msg(text, "sensor_msgs/msg/Range")})
    kind = types.types["sensor_msgs/msg/Range"]
    with (tmp_path / "range.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("sensor_msgs/msg/Range", "ros2msg", text.encode())
        channel = writer.register_channel("/gauge", "cdr", schema)
        for time, angle in zip(TIME, ANGLE, strict=True):
            stamp = BEGIN + round(time * NS)
            stamped = types.types["std_msgs/msg/Header"](header(stamp).stamp, "")
            data = types.serialize_cdr(kind(stamped, 0, 0.0, 0.0, 0.0, angle), kind.__msgtype__)
            writer.add_message(channel, stamp, bytes(data), stamp)
        writer.finish()
    found = read_signals(tmp_path / "range.mcap", parse_topics("angle=/gauge.range lift=/gauge"))
    np.testing.assert_allclose(found.lift.value, ANGLE, rtol=1e-6)


def add_json(path):
    """Write an MCAP file with a JointState and a JSON topic, and return its path."""
    with (path / "two.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        text, _ = TYPES.generate_msgdef("sensor_msgs/msg/JointState", ros_version=2)
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", text.encode())
        note = writer.register_schema("Note", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/joints", "cdr", schema)
        other = writer.register_channel("/note", "json", note)
        for time, row in zip(TIME, both(), strict=True):
            stamp = BEGIN + round(time * NS)
            message = joints(stamp, row)
            data = bytes(TYPES.serialize_cdr(message, message.__msgtype__))
            writer.add_message(channel, stamp, data, stamp)
            writer.add_message(other, stamp, json.dumps({"x": 1.0}).encode(), stamp)
        writer.finish()
    return path / "two.mcap"


def test_topics_of_another_encoding_are_ignored_unless_requested(tmp_path):
    """A JSON topic in a bag is ignored unless it is requested.

    A request is an error with the name and encoding of the topic.
    """
    file = add_json(tmp_path)
    _, counts, _ = counted(read_signals(file, parse_topics(LINE)))
    assert counts == {"angle": (500, 0), "lift": (500, 0)}
    with pytest.raises(BagError, match=r"lift: the encoding of /note must be cdr, .*got json"):
        read_signals(file, parse_topics("angle=/joints.position[cam] lift=/note.x"))
    with pytest.raises(BagError, match=r"no topic /nte; allowed: .*/note \[Note, json\].*did you"):
        read_signals(file, parse_topics("angle=/joints.position[cam] lift=/nte.x"))


def test_an_hour_without_readings_is_a_pause(tmp_path):
    """Ninety minutes without readings are noted as a pause with its duration."""
    time = np.where(TIME < 1.0, TIME, TIME + 5400.0)
    bag = write_bag(tmp_path / "bench", {"/joints": (joints, time, both())})
    notes = read_measured(bag, parse_topics(LINE)).notes
    assert "lift: the readings pause for 90 min from 0.996 s on, not filled" in " ".join(notes)


def test_times_of_two_clocks_are_printed_as_dates(tmp_path):
    """A bag whose topics have stamps of two clocks raises BagError.

    In the error times since 1970 are printed as dates.
    """

    def simulated(stamp, value):
        return joint(stamp - BEGIN + NS, value)

    topics = {"/enc": (simulated, TIME, ANGLE), "/gauge": (number, TIME, LIFT)}
    bag = write_bag(tmp_path / "bench", topics)
    with pytest.raises(BagError) as raised:
        read_measured(bag, parse_topics("angle=/enc.position[0] lift=/gauge"))
    words = "got /gauge from 2026-01-01 00:00:00 UTC to 2026-01-01 00:00:01 UTC and the angle"
    assert f"{words} from 0 s to 1.996 s; if their stamps" in str(raised.value)
    assert "e+" not in str(raised.value)


@pytest.mark.parametrize("part", [0.0, 0.001, 0.3, 0.7, 0.98])
@pytest.mark.parametrize("as_file", [False, True])
def test_an_sqlite_bag_that_was_cut_off_is_refused_with_a_remedy(tmp_path, part, as_file):
    """A truncated SQLite bag raises BagError with an sqlite3 command to save its data.

    The error does not suggest `cam-rig recover`, which reads only MCAP. For an empty file there is
    no remedy.
    """
    topics = {"/joints": (joints, TIME, both())}
    bag = write_bag(tmp_path / "bench", topics, StoragePlugin.SQLITE3)
    file = bag / "bench.db3"
    data = file.read_bytes()
    file.write_bytes(data[: int(part * len(data))])
    path = file if as_file else bag
    with pytest.raises(BagError) as raised:
        read_signals(path, parse_topics(LINE))
    if part or not as_file:
        assert f"sqlite3 {file} .dump" in str(raised.value)
        assert "cam-rig recover" not in str(raised.value)


def test_a_single_sqlite_file_is_a_bag(tmp_path):
    """An SQLite file is read without the folder of its bag."""
    topics = {"/joints": (joints, TIME, both())}
    bag = write_bag(tmp_path / "bench", topics, StoragePlugin.SQLITE3)
    shutil.copy(bag / "bench.db3", tmp_path / "alone.db3")
    _, counts, _ = counted(read_signals(tmp_path / "alone.db3", parse_topics(LINE)))
    assert counts == {"angle": (500, 0), "lift": (500, 0)}
