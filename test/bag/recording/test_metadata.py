"""What a bag says of the ROS distribution that wrote it."""

import json
from types import SimpleNamespace

import pytest
import yaml

from cam_rig.bag import file_writer as metadata
from cam_rig.bag.recorder import versions


@pytest.fixture
def wheels(monkeypatch):
    """Names of installed packages that look like it; the environment names no distribution."""
    names = ["numpy", "ros-jazzy-std-msgs", "ros_jazzy_rclpy"]
    monkeypatch.setattr(metadata, "distributions", lambda: [SimpleNamespace(name=n) for n in names])
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    metadata._of_wheels.cache_clear()
    yield names
    metadata._of_wheels.cache_clear()


def said():
    """The distribution in metadata.yaml, and the key of rclpy in versions.json."""
    about = yaml.safe_load(metadata.metadata([metadata.FileContent("bag_0.mcap", first=7, last=9)]))
    (rclpy,) = (key for key in json.loads(versions()) if key.endswith("-rclpy"))
    return about["rosbag2_bagfile_information"]["ros_distro"], rclpy


def test_the_sourced_distribution_comes_first(wheels, monkeypatch):
    """ROS_DISTRO is what `source /opt/ros/rolling/setup.bash` sets."""
    monkeypatch.setenv("ROS_DISTRO", "rolling")
    assert said() == ("rolling", "ros-rolling-rclpy")


def test_without_one_the_wheels_tell(wheels):
    """Their names have it."""
    assert said() == ("jazzy", "ros-jazzy-rclpy")


def test_without_any_it_is_unknown(wheels):
    """A bag can be recovered where no ROS is."""
    wheels.remove("ros_jazzy_rclpy")
    assert said() == ("unknown", "ros-unknown-rclpy")
