"""The metadata record of an MCAP file, by which rosbag2 describes a file without its folder."""

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.metadata import parse_qos

from cam_rig.bag.file_writer import NEVER
from cam_rig.bag.files import mcap_files
from cam_rig.bag.reader import read_counts
from cam_rig.bag.recorder import BagRecorder
from cam_rig.bag.split import Split
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

#: The keys of BagMetadata in rosbag2_storage/yaml.hpp, in its order, and of each of its files.
KEYS = [
    "version",
    "storage_identifier",
    "duration",
    "starting_time",
    "message_count",
    "topics_with_message_count",
    "compression_format",
    "compression_mode",
    "relative_file_paths",
    "files",
    "custom_data",
    "ros_distro",
]
FILE_KEYS = ["path", "starting_time", "duration", "message_count"]
TOPIC_KEYS = [
    "name",
    "type",
    "serialization_format",
    "offered_qos_profiles",
    "type_description_hash",
]


@pytest.fixture(scope="module", params=[Split(), Split(duration=0.7)], ids=["one", "split"])
def bag(tmp_path_factory, golden, request):
    path = tmp_path_factory.mktemp("record") / "bag"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DISTRO", "kilted")
        loaded = open_scene(config_root() / "scenes" / "quick.yaml")
        recorder = BagRecorder(path, loaded, split=request.param)
        for topic, number, cdr in golden:
            recorder.take(topic, cdr, b"live", number)
        recorder.close()
    return path


def records(file):
    """The metadata records of a file in order."""
    with file.open("rb") as stream:
        return list(make_reader(stream).iter_metadata())


def test_each_file_has_the_record_at_its_begin_and_at_its_end(bag):
    """Name and key are those of rosbag2's storage plugin; the YAML has its keys, in its order."""
    for file in mcap_files(bag):
        found = records(file)
        assert [record.name for record in found] == ["rosbag2", "rosbag2"]
        for record in found:
            assert list(record.metadata) == ["serialized_metadata"]
            about = yaml.safe_load(record.metadata["serialized_metadata"])
            assert list(about) == KEYS
            assert all(set(entry) == set(FILE_KEYS) for entry in about["files"])
            assert all(
                list(entry["topic_metadata"]) == TOPIC_KEYS
                for entry in about["topics_with_message_count"]
            )
            assert about["version"] == 9 and about["storage_identifier"] == "mcap"
            assert about["ros_distro"] == "kilted"


def test_the_first_says_that_nothing_is_written_yet(bag):
    """A time that never comes, no message, no topic: what `ros2 bag record` begins a file with."""
    file = mcap_files(bag)[0]
    about = yaml.safe_load(records(file)[0].metadata["serialized_metadata"])
    assert about["starting_time"] == {"nanoseconds_since_epoch": NEVER}
    assert about["duration"] == {"nanoseconds": 0} and about["message_count"] == 0
    assert about["relative_file_paths"] == [file.name]
    assert about["topics_with_message_count"] == []


def test_the_last_is_the_bags_metadata(bag):
    """The last file's last record says what metadata.yaml says, an earlier one's the bag so far."""
    whole = yaml.safe_load((bag / "metadata.yaml").read_bytes())["rosbag2_bagfile_information"]
    names, total = [], 0
    for file in mcap_files(bag):
        with Reader(file) as reader:
            total += reader.message_count
        names.append(file.name)
        about = yaml.safe_load(records(file)[-1].metadata["serialized_metadata"])
        assert about["relative_file_paths"] == names and about["message_count"] == total
    assert about == whole
    counted = {
        entry["topic_metadata"]["name"]: entry["message_count"]
        for entry in about["topics_with_message_count"]
    }
    assert counted == read_counts(bag)


def test_rosbags_understands_the_quality_of_service_in_it(bag):
    """As in metadata.yaml, in the form of version 9."""
    about = yaml.safe_load(records(mcap_files(bag)[-1])[-1].metadata["serialized_metadata"])
    for entry in about["topics_with_message_count"]:
        (qos,) = parse_qos(entry["topic_metadata"]["offered_qos_profiles"])
        assert qos.reliability.name == "RELIABLE"
