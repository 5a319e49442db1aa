"""Nodes made in the process of the tests."""

import json
from importlib import import_module

import pytest
import rclpy

from cam_rig.nodes.__main__ import NODES


@pytest.fixture
def make(ros_domain, short_scene, tmp_path):
    """Make a node in this process."""
    given = {"scene": str(short_scene), "recorder:bag": str(tmp_path / "bag")}
    pairs = (("-p", f"{key}:={json.dumps(value)}") for key, value in given.items())
    made = []
    rclpy.init(args=["--ros-args", *(part for pair in pairs for part in pair)])

    def make(name):
        made.append(getattr(import_module(f"cam_rig.nodes.{name}"), NODES[name])())
        return made[-1]

    yield make
    for node in made:
        node.close()
        node.destroy_node()
    rclpy.shutdown()
