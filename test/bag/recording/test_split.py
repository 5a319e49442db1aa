"""A recording that is split into files: each can be read alone, and all of them as one bag."""

from collections import Counter
from itertools import pairwise

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from cam_rig.bag.files import is_unclosed, mcap_files
from cam_rig.bag.reader import raw_messages, read_counts, read_recording, read_samples
from cam_rig.bag.recorder import BagRecorder
from cam_rig.bag.recover import recover
from cam_rig.bag.replay import compare, played
from cam_rig.bag.split import Split
from cam_rig.errors import BagError, ConfigError
from cam_rig.messages.topics import CAM_STATE, DIAGNOSTICS, RECORDING
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

NAMES = {topic.name for topic in RECORDING}
#: By rig time, and by bytes: the golden run has 16 ticks in 2.5 s, of about 20 kB each.
SPLITS = [Split(duration=0.5), Split(size=60_000)]


@pytest.fixture(scope="module")
def loaded():
    return open_scene(config_root() / "scenes" / "quick.yaml")


def record(bag, loaded, golden, split=None):
    recorder = BagRecorder(bag, loaded, split=split)
    for topic, number, cdr in golden:
        recorder.take(topic, cdr, b"live", number)
    return recorder


def payloads(bag):
    """Every message by topic, in order."""
    found = {}
    for connection, time, data in raw_messages(bag, NAMES):
        found.setdefault(connection.topic, []).append((time, bytes(data)))
    return found


def summary(file):
    with file.open("rb") as stream:
        return make_reader(stream).get_summary()


@pytest.fixture(scope="module")
def whole(tmp_path_factory, loaded, golden):
    """The recording in one file."""
    bag = tmp_path_factory.mktemp("whole") / "bag"
    record(bag, loaded, golden).close()
    return bag


@pytest.fixture(scope="module", params=SPLITS, ids=["by time", "by size"])
def split(tmp_path_factory, loaded, golden, request):
    """The same recording in several files."""
    bag = tmp_path_factory.mktemp("split") / "bag"
    record(bag, loaded, golden, request.param).close()
    return bag


@pytest.mark.variants(1)
def test_the_files_read_as_one(whole, split):
    """Analysis, samples, replay and comparison find what they find in one file.

    A diagnosis that came after its file had ended is in the next one.
    """
    names = [file.name for file in mcap_files(split)]
    assert len(names) > 2 and names == [f"bag_{number}.mcap" for number in range(len(names))]
    assert not is_unclosed(split)
    one, other = payloads(whole), payloads(split)
    assert sorted(other.pop(DIAGNOSTICS.name)) == sorted(one.pop(DIAGNOSTICS.name))
    assert other == one
    assert read_counts(split) == read_counts(whole)
    one, other = read_recording(whole), read_recording(split)
    assert other.ticks == one.ticks and len(one.ticks) == 16
    assert len(list(read_samples(split))) == 16
    assert all(entry.difference == 0.0 for entry in compare(whole, split))
    assert list(played(split)) == list(played(whole))


def test_metadata_lists_every_file_with_its_own_times_and_counts(split):
    """What rosbag2 reads: names in order, starts, durations, counts; the sums of all of them."""
    about = yaml.safe_load((split / "metadata.yaml").read_bytes())["rosbag2_bagfile_information"]
    files = mcap_files(split)
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


def test_a_file_stands_alone(split):
    """Schemas, channels and the scene are in each; its own ticks can be analysed.

    What is published once for each cam is in the file of its time, as `ros2 bag record` has it.
    """
    ticks, topics = 0, {c.topic for c in summary(mcap_files(split)[0]).channels.values()}
    for file in mcap_files(split):
        about = summary(file)
        assert topics <= {channel.topic for channel in about.channels.values()}
        assert all(about.schemas[c.schema_id].data for c in about.channels.values())
        alone = read_recording(file)
        assert alone.loaded.scene.name == "quick"
        ticks += len(alone.ticks)
    borders = len(mcap_files(split)) - 1  # a tick that ends in the next file begins in this one
    assert 16 - borders <= ticks < 16


def test_no_tick_is_divided(split):
    """All messages of a state are in one file; only diagnoses may come later."""
    stamps = []
    for file in mcap_files(split):
        with Reader(file) as reader:
            found = [(c.topic, time) for c, time, _ in reader.messages()]
        stamps.append({time for topic, time in found if topic != DIAGNOSTICS.name})
        own = max(time for topic, time in found if topic == CAM_STATE.name)
        assert max(time for _, time in found) < own + 100
    for one, later in pairwise(stamps):
        assert max(one) <= min(later)  # where a tick begins, its first instant is


def test_the_limits_are_kept(split, tmp_path, loaded, golden):
    """A file ends with the first tick that comes to a limit."""
    record(tmp_path / "bag", loaded, golden, Split(duration=0.5)).close()
    for file in mcap_files(tmp_path / "bag"):
        with Reader(file) as reader:
            times = [time for c, time, _ in reader.messages() if c.topic == CAM_STATE.name]
        assert times[-1] - times[0] <= 0.5e9


def test_a_split_bag_is_recovered_into_one_file(whole, split, tmp_path):
    """A copy holds everything, with the numbers of the messages as they were."""
    saved = recover(split, tmp_path / "copy")
    assert "nothing lost" in saved.words
    assert len(mcap_files(tmp_path / "copy")) == 1
    one, other = payloads(whole), payloads(tmp_path / "copy")
    assert other == one


def test_a_file_that_is_missing_is_named(split, tmp_path):
    """Between others: nothing is read as if it were whole, and the others are read by name."""
    bag = tmp_path / "bag"
    bag.mkdir()
    for file in mcap_files(split):
        if file.name != "bag_1.mcap":
            (bag / file.name).write_bytes(file.read_bytes())
    with pytest.raises(BagError, match=r"bag_1\.mcap is missing.*put it back"):
        read_counts(bag)
    with pytest.raises(BagError, match=r"bag_1\.mcap is missing"):
        recover(bag, tmp_path / "copy")
    assert read_counts(bag / "bag_2.mcap")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("100MB", Split(size=100_000_000)),
        ("1.5 GiB", Split(size=1_610_612_736)),
        ("60s", Split(duration=60.0)),
        ("10min", Split(duration=600.0)),
        ("2 h", Split(duration=7200.0)),
    ],
)
def test_a_limit_by_words(text, expected):
    """A size or a duration, with its unit."""
    assert Split.parsed(text) == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("100", r"allowed: a number and one of MB, GB, MiB, GiB, s, min, h, as 100MB or 60s"),
        ("60 rpm", "allowed: a number and one of"),
        ("-5s", "allowed: a number and one of"),
        ("1e9s", "allowed: a number and one of"),
        ("0.5MB", r"is 0\.5MB; allowed: a file of 1000000 bytes \(1 MB\) or more"),
        ("0s", r"is 0s; allowed: a file of 1 to 3\.2e\+08 s of rig time"),
        ("999999999999h", "allowed: a file of 1 to"),
        ("99999999999GB", "allowed: a file of 1000000 bytes"),
    ],
)
def test_a_limit_that_is_none_is_refused(text, words):
    """What was given, and what may be."""
    with pytest.raises(ConfigError, match=words):
        Split.parsed(text)
