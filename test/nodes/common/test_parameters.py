"""Every node's parameters as `ros2 param describe` shows them."""

import json
from importlib import import_module

import pytest
import rclpy

from cam_rig.nodes.common.parameters import PARAMETERS

pytestmark = pytest.mark.ros
CLASSES = {
    "law_server": "LawServer",
    "cam_drive": "CamDrive",
    "follower": "Follower",
    "microphone": "Microphone",
    "recorder": "Recorder",
}


@pytest.fixture
def make(ros_domain, short_scene, tmp_path):
    """Make a node in this process."""
    given = {"scene": str(short_scene), "recorder:bag": str(tmp_path / "bag")}
    pairs = (("-p", f"{key}:={json.dumps(value)}") for key, value in given.items())
    made = []
    rclpy.init(args=["--ros-args", *(part for pair in pairs for part in pair)])

    def make(name):
        made.append(getattr(import_module(f"cam_rig.nodes.{name}"), CLASSES[name])())
        return made[-1]

    yield make
    for node in made:
        node.close()
        node.destroy_node()
    rclpy.shutdown()


@pytest.mark.parametrize("name", CLASSES)
def test_every_parameter_is_described(make, name):
    """Type, unit and range are given; what is not live is read-only."""
    node = make(name)
    for spec in PARAMETERS[name]:
        about = node.describe_parameter(spec.name)
        assert about.description == spec.description
        assert about.read_only == (not spec.live)
        if spec.most is not None:
            assert about.floating_point_range[0].to_value == spec.most
        if spec.choices:
            assert all(choice in about.additional_constraints for choice in spec.choices)
