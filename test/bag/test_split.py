"""Recordings in several files: readable file by file, and as one bag."""

from collections import Counter
from itertools import pairwise

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.metadata import parse_qos

from cam_rig.bag.file_writer import NEVER
from cam_rig.bag.files import is_unclosed
from cam_rig.bag.listing import mcap_files
from cam_rig.bag.partial_reader import Condition, attachments
from cam_rig.bag.reader import read_counts
from cam_rig.bag.recover import recover
from cam_rig.bag.replay import compare, replay_steps
from cam_rig.bag.split import Split
from cam_rig.errors import BagError, ConfigError
from cam_rig.messages.topics import CAM_STATE, DIAGNOSTICS
from cam_rig.studies.simulate.recorded import read_recording

from .bags import payloads, record

FAST = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def summary(file):
    with file.open("rb") as stream:
        return make_reader(stream).get_summary()


def test_a_split_bag_reads_like_one_file(whole, split):
    """Analysis, replay and comparison of a split bag give the results of one file."""
    names = [file.name for file in mcap_files(split)]
    assert names == [f"bag_{number}.mcap" for number in range(len(names))]
    assert not is_unclosed(split)
    assert payloads(split) == payloads(whole)
    assert read_counts(split) == read_counts(whole)
    one, other = read_recording(whole), read_recording(split)
    assert other.ticks == one.ticks and len(one.ticks) == 16
    assert all(entry.difference == 0.0 for entry in compare(whole, split))
    assert list(replay_steps(split)) == list(replay_steps(whole))


def listed(bag):
    return yaml.load((bag / "metadata.yaml").read_bytes(), FAST)["rosbag2_bagfile_information"]


def test_metadata_lists_times_and_counts_of_every_file(split):
    """metadata.yaml lists name, start, duration and number of messages of each file.

    rosbags reads the same total.
    """
    about, files = listed(split), mcap_files(split)
    assert about["relative_file_paths"] == [file.name for file in files]
    for entry, file in zip(about["files"], files, strict=True):
        statistics = summary(file).statistics
        begin, end = statistics.message_start_time, statistics.message_end_time
        assert entry == {
            "path": file.name,
            "duration": {"nanoseconds": end - begin},
            "starting_time": {"nanoseconds_since_epoch": begin},
            "message_count": statistics.message_count,
        }
    assert about["message_count"] == sum(entry["message_count"] for entry in about["files"])
    with AnyReader([split]) as reader:
        assert reader.message_count == about["message_count"]
        assert Counter(c.topic for c, _, _ in reader.messages()) == read_counts(split)


#: Keys of the struct BagMetadata in rosbag2_storage/yaml.hpp, in its order. Then follow the keys of
#: one file and of one topic.
KEYS = [
    *("version", "storage_identifier", "duration", "starting_time", "message_count"),
    *("topics_with_message_count", "compression_format", "compression_mode"),
    *("relative_file_paths", "files", "custom_data", "ros_distro"),
]
FILE_KEYS = {"path", "starting_time", "duration", "message_count"}
TOPIC_KEYS = [
    *("name", "type", "serialization_format"),
    *("offered_qos_profiles", "type_description_hash"),
]


def records(bag):
    """Yield each file of a bag with its metadata at the file's start and end.

    The metadata are the two rosbag2 records that an MCAP file contains.
    """
    for file in mcap_files(bag):
        with file.open("rb") as stream:
            found = list(make_reader(stream).iter_metadata())
        assert [record.name for record in found] == ["rosbag2", "rosbag2"]
        assert all(list(record.metadata) == ["serialized_metadata"] for record in found)
        yield file, *(yaml.load(record.metadata["serialized_metadata"], FAST) for record in found)


def test_each_file_describes_the_bag_at_its_start_and_end(split):
    """Each file contains the metadata of the bag at its start and at its end.

    The metadata at the start of the first file are empty, as in rosbag2.
    """
    names, total = [], 0
    for file, begin, about in records(split):
        for found in (begin, about):
            assert list(found) == KEYS
            assert all(set(entry) == FILE_KEYS for entry in found["files"])
            topics = [entry["topic_metadata"] for entry in found["topics_with_message_count"]]
            assert all(list(topic) == TOPIC_KEYS for topic in topics)
            assert found["version"] == 9 and found["storage_identifier"] == "mcap"
            assert found["ros_distro"] == "kilted"
            for topic in topics:
                (qos,) = parse_qos(topic["offered_qos_profiles"])
                assert qos.reliability.name == "RELIABLE"
        assert begin["message_count"] == total
        with Reader(file) as reader:
            total += reader.message_count
        names.append(file.name)
        assert about["relative_file_paths"] == names and about["message_count"] == total
        if len(names) == 1:  # no start time, message or topic yet
            assert begin["starting_time"] == {"nanoseconds_since_epoch": NEVER}
            assert begin["duration"] == {"nanoseconds": 0}
            assert begin["relative_file_paths"] == names
            assert begin["topics_with_message_count"] == []
    assert about == listed(split)
    counted = {
        entry["topic_metadata"]["name"]: entry["message_count"]
        for entry in about["topics_with_message_count"]
    }
    assert counted == read_counts(split)


def test_each_file_can_be_read_alone(split):
    """Each file of a split bag can be read without the others.

    It has schemas, channels, versions and the scene. Messages that are published once per cam are
    in the file of their time, as with `ros2 bag record`.
    """
    ticks, topics = 0, {c.topic for c in summary(mcap_files(split)[0]).channels.values()}
    for file in mcap_files(split):
        about = summary(file)
        assert topics <= {channel.topic for channel in about.channels.values()}
        assert all(about.schemas[c.schema_id].data for c in about.channels.values())
        assert "versions.json" in {attached.name for attached in attachments(file)}
        alone = read_recording(file)
        assert alone.loaded.scene.name == "quick"
        ticks += len(alone.ticks)
    borders = len(mcap_files(split)) - 1  # ticks that span two files
    assert 16 - borders <= ticks < 16


def test_no_tick_is_divided(split):
    """All messages of a cam state are in one file, except diagnostics.

    Diagnostics may be in a later file.
    """
    stamps = []
    for file in mcap_files(split):
        with Reader(file) as reader:
            found = [(c.topic, time) for c, time, _ in reader.messages()]
        stamps.append({time for topic, time in found if topic != DIAGNOSTICS.name})
        own = max(time for topic, time in found if topic == CAM_STATE.name)
        assert max(time for _, time in found) < own + 100
    for one, later in pairwise(stamps):
        assert max(one) <= min(later)  # an instant may be at the border


@pytest.mark.parametrize("limit", [Split(duration=0.7), Split(size=60_000)], ids=["s", "bytes"])
def test_the_limits_are_kept(tmp_path, golden, limit):
    """A file ends with the first cam state that reaches the limit of size or duration.

    The limits are 60 000 bytes of messages and 0.7 s.
    """
    record(tmp_path / "bag", golden, split=limit, samples_per_turn=12).close()
    files = mcap_files(tmp_path / "bag")
    assert len(files) > 2
    for file in files:
        with Reader(file) as reader:
            found = [(c.topic, time, len(data)) for c, time, data in reader.messages()]
        times = [time for topic, time, _ in found if topic == CAM_STATE.name]
        if limit.duration:
            assert times[-1] - times[0] <= 0.7e9
        else:  # all ticks except the last
            before = max(times[:-1], default=-1)
            assert sum(size for _, time, size in found if time <= before) < limit.size


def test_a_split_bag_is_recovered_into_one_file(whole, split, tmp_path):
    """A split bag is recovered into one file with all messages and the scene."""
    saved = recover(split, tmp_path / "copy")
    assert not saved.any_file_is(Condition.TRUNCATED) and "nothing lost" in saved.text
    assert len(mcap_files(tmp_path / "copy")) == 1
    assert payloads(tmp_path / "copy") == payloads(whole)
    assert len(read_recording(tmp_path / "copy").ticks) == 16


def test_a_missing_middle_file_is_named(split, tmp_path):
    """A split bag without a middle file is refused, and the error gives its name.

    The other files can be read one by one.
    """
    bag = tmp_path / "bag"
    bag.mkdir()
    for file in mcap_files(split):
        if file.name != "bag_1.mcap":
            (bag / file.name).write_bytes(file.read_bytes())
    with pytest.raises(BagError, match=r"bag_1\.mcap is missing.*restore it"):
        read_counts(bag)
    with pytest.raises(BagError, match=r"bag_1\.mcap is missing"):
        recover(bag, tmp_path / "copy")
    assert read_counts(bag / "bag_2.mcap")


def test_a_limit_is_parsed_or_refused_with_the_allowed_values():
    """Limits of size and duration are parsed with units, and other texts are refused."""
    assert Split.parse("100MB", None) == Split(size=100_000_000)
    assert Split.parse("1.5 GiB", "2 h") == Split(size=1_610_612_736, duration=7200.0)
    assert Split.parse(None, "60s") == Split(duration=60.0)
    assert Split.parse(None, "10min") == Split(duration=600.0)
    assert Split.parse(None, None) == Split()
    for size, duration, words in (
        ("100", None, r"max-bag-size must be a number with a unit \(MB, GB, MiB, GiB\), got '100'"),
        ("60s", None, "max-bag-size must be a number with a unit .* got '60s'"),
        (None, "-5s", r"max-bag-duration must be a number with a unit \(s, min, h\), got '-5s'"),
        (None, "1e9s", "max-bag-duration must be a number with a unit .* got '1e9s'"),
        ("0.5MB", None, r"max-bag-size must be at least 1 MB, .* got 0\.5MB"),
        (None, "0s", r"must be between 1 and 3\.2e\+08 s of rig time, got 0s"),
        ("99999999999GB", None, "must be at least 1 MB, .* got 99999999999GB"),
    ):
        with pytest.raises(ConfigError, match=words):
            Split.parse(size, duration)
