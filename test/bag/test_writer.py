"""A bag is a rosbag2 directory that others can read, and never overwrites."""

import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import topics
from cam_rig.bag.reader import messages, read_counts, read_stage, recorded_file
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError

TYPES = get_typestore(Stores.ROS2_KILTED)


def level(value):
    return bytes(
        TYPES.serialize_cdr(TYPES.types["std_msgs/msg/Float64"](value), "std_msgs/msg/Float64")
    )


def test_a_bag_reads_back_with_another_reader(tmp_path):
    """rosbags needs no knowledge of ours: schemas and types are in the bag."""
    with BagWriter(tmp_path / "bag") as bag:
        for i in range(5):
            bag.write(topics.LEVEL, 100 * i, level(70.0 + i))
    with AnyReader([tmp_path / "bag"]) as reader:
        found = [
            (time, reader.deserialize(raw, connection.msgtype).data)
            for connection, time, raw in reader.messages()
        ]
    assert found == [(100 * i, 70.0 + i) for i in range(5)]
    assert read_counts(tmp_path / "bag") == {"/microphone/level": 5}


def test_an_existing_folder_is_not_overwritten(tmp_path):
    """A recording is never replaced by another."""
    (tmp_path / "bag").mkdir()
    with pytest.raises(BagError, match="exists already, not overwriting"):
        BagWriter(tmp_path / "bag")
    assert list((tmp_path / "bag").iterdir()) == []


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    """A bag under a file is no place for a bag."""
    (tmp_path / "file").write_text("x")
    with pytest.raises(BagError, match="file/bag"):
        BagWriter(tmp_path / "file" / "bag")


def test_a_bag_of_somebody_else_is_refused(tmp_path):
    """Without an attached scene there is nothing to compare with."""
    with BagWriter(tmp_path / "bag") as bag:
        bag.write(topics.LEVEL, 0, level(70.0))
    with pytest.raises(BagError, match="no scene attached"):
        read_stage(tmp_path / "bag")


def test_an_attachment_cannot_leave_its_folder(tmp_path):
    """A hostile bag must not write outside the folder it is unpacked in."""
    with BagWriter(tmp_path / "bag") as bag:
        bag.attach("../../evil.yaml", b"x: 1")
        bag.write(topics.LEVEL, 0, level(70.0))
    with pytest.raises(BagError, match="points elsewhere"):
        read_stage(tmp_path / "bag")
    assert not (tmp_path / "evil.yaml").exists()


def test_missing_and_truncated_bags_are_named(tmp_path):
    """No bag, an empty folder, half a file: one line each, no traceback."""
    with pytest.raises(BagError, match="no such bag"):
        recorded_file(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match=r"has no \.mcap file in it"):
        recorded_file(tmp_path / "empty")
    with BagWriter(tmp_path / "bag") as bag:
        for i in range(50):
            bag.write(topics.LEVEL, i, level(70.0))
    whole = recorded_file(tmp_path / "bag")
    whole.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(BagError, match="bag"):
        read_counts(tmp_path / "bag")
    with pytest.raises(BagError, match="bag"):
        list(messages(tmp_path / "bag", (topics.LEVEL,)))
