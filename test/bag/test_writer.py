"""Bag writer: a bag is a rosbag2 directory that is never overwritten."""

import json
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from rosbags.highlevel import AnyReader

from cam_rig.bag import file_writer
from cam_rig.bag.files import bag_file, is_closed, is_unclosed
from cam_rig.bag.partial_reader import read_partial
from cam_rig.bag.reader import read_counts, read_scene
from cam_rig.bag.recorder import BagRecorder, versions
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError
from cam_rig.messages import topics
from cam_rig.messages.serialization import new, serialize
from cam_rig.simulation.scene import open_scene

from .bags import LOADED, QUICK


def level(value):
    return serialize(new("std_msgs/Float64", value))


def test_a_path_that_cannot_be_written_is_named(tmp_path):
    """An existing bag, or a path below a file, is refused with its path."""
    (tmp_path / "bag").mkdir()
    with pytest.raises(BagError, match="exists already, not overwriting"):
        BagWriter(tmp_path / "bag")
    assert list((tmp_path / "bag").iterdir()) == []
    (tmp_path / "file").write_text("x")
    with pytest.raises(BagError, match="file/bag"):
        BagWriter(tmp_path / "file" / "bag")


def test_a_bag_has_its_metadata_from_the_start(tmp_path):
    """metadata.yaml lists the topics of a bag before the bag is closed.

    rosbags reads the closed bag.
    """
    with BagWriter(tmp_path / "bag") as bag:
        bag.write(topics.LEVEL, 7, level(70.0))
        about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_bytes())
        information = about["rosbag2_bagfile_information"]
        assert information["relative_file_paths"] == ["bag_0.mcap"]
        assert information["message_count"] == 0
        named = {t["topic_metadata"]["name"] for t in information["topics_with_message_count"]}
        assert named == {topic.name for topic in topics.RECORDING}
        assert is_unclosed(tmp_path / "bag")
        with pytest.raises(BagError, match=r"bag_0\.mcap was not closed.*cam-rig recover"):
            read_counts(tmp_path / "bag")
    assert not is_unclosed(tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 1
        ((connection, time, raw),) = reader.messages()
        assert (time, reader.deserialize(raw, connection.msgtype).data) == (7, 70.0)
    assert read_counts(tmp_path / "bag") == {"/microphone/level": 1}


def test_the_end_of_the_file_is_written_last(tmp_path, monkeypatch):
    """A closing writer stores messages, then metadata.yaml, then the end of the file.

    A bag that has its end is therefore complete.
    """
    steps = []
    bag = BagWriter(tmp_path / "bag")
    bag.write(topics.LEVEL, 7, level(70.0))
    real = os.fsync

    def noted(number):
        name = Path(os.readlink(f"/proc/self/fd/{number}")).name
        steps.append((name, is_closed(bag_file(tmp_path / "bag"))))
        real(number)

    monkeypatch.setattr(os, "fsync", noted)
    bag.close()
    assert steps == [("metadata.yaml.part", False), ("bag", False), ("bag_0.mcap", True)]


def test_flushed_messages_are_on_the_disk_within_half_a_second(tmp_path, monkeypatch):
    """Flushed messages reach the disk within half a second.

    The file is synchronised (fsync) at once after a pause, otherwise at the next call of a timer.
    """
    synced, now = [], [100.0]
    monkeypatch.setattr("cam_rig.bag.file_writer.time.monotonic", lambda: now[0])
    bag = BagWriter(tmp_path / "bag")
    monkeypatch.setattr("cam_rig.bag.files.sync", lambda stream: synced.append(stream.name))
    bag.write(topics.LEVEL, 1, level(70.0))
    bag.flush()
    bag.flush_if_due()
    assert synced == []
    now[0] += 0.6
    bag.flush_if_due()
    assert len(synced) == 1
    now[0] += 0.6
    bag.flush_if_due()
    assert len(synced) == 1  # no new message
    bag.write(topics.LEVEL, 2, level(70.0))
    bag.flush()
    assert len(synced) == 2


def test_a_single_message_is_flushed(tmp_path, monkeypatch):
    """A single message, such as a diagnostic of a stopped rig, is flushed after 0.5 s."""
    now = [100.0]
    monkeypatch.setattr("cam_rig.bag.file_writer.time.monotonic", lambda: now[0])
    recorder = BagRecorder(tmp_path / "bag", LOADED)
    recorder._writer.write(topics.DIAGNOSTICS, 1, b"\0\1\0\0" + bytes(20))
    assert b"/diagnostics" not in bag_file(tmp_path / "bag").read_bytes()
    now[0] += 0.6
    recorder.idle()
    records = []
    read_partial(bag_file(tmp_path / "bag"), records.append)
    assert [r.channel.topic for r in records if isinstance(r, tuple)] == ["/diagnostics"]
    recorder.close()


def test_a_bag_is_read_wherever_its_scene_was(tmp_path, monkeypatch):
    """A bag contains the files of its scene, wherever the scene file was."""
    monkeypatch.chdir(tmp_path)
    scene = open_scene(QUICK).scene
    for number, place in enumerate(("", "mine", "cams", "scenes", "lab/rigs")):
        own = Path(place) / "own.yaml"
        (tmp_path / place).mkdir(parents=True, exist_ok=True)
        shutil.copy(QUICK, own)
        bag = tmp_path / f"bag{number}"
        BagRecorder(bag, open_scene(own if number % 2 else tmp_path / own)).close()
        read = read_scene(bag)
        assert read.scene == scene and read.scene_file.name == "own.yaml"


def test_the_distribution_is_that_of_the_environment_else_the_wheels(monkeypatch):
    """metadata.yaml has the ROS distribution of the environment or of the rclpy wheel.

    Without ROS the distribution is unknown, but a bag can be recovered.
    """
    wheels = ["numpy", "ros-jazzy-std-msgs", "ros_jazzy_rclpy"]
    there = [SimpleNamespace(name=name) for name in wheels]
    monkeypatch.setattr(file_writer, "distributions", lambda: there)

    def said():
        """Return the ROS distribution in metadata.yaml, and rclpy's key in versions.json."""
        file_writer._wheel_distribution.cache_clear()
        content = file_writer.FileContent("bag_0.mcap", first=7, last=9)
        about = yaml.safe_load(file_writer.metadata([content]))["rosbag2_bagfile_information"]
        (rclpy,) = (key for key in json.loads(versions()) if key.endswith("-rclpy"))
        return about["ros_distro"], rclpy

    monkeypatch.setenv("ROS_DISTRO", "rolling")
    assert said() == ("rolling", "ros-rolling-rclpy")
    monkeypatch.delenv("ROS_DISTRO")
    assert said() == ("jazzy", "ros-jazzy-rclpy")
    there.pop()
    assert said() == ("unknown", "ros-unknown-rclpy")
    file_writer._wheel_distribution.cache_clear()
