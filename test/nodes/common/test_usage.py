"""What --help prints is what the nodes have."""

import re
import subprocess
import sys

import pytest

from cam_rig.nodes.__main__ import NODES
from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.nodes.usage import ABOUT, published, usage

#: Topics and services that rclpy gives every node.
OF_RCLPY = {"/rosout", "/parameter_events"}
LIVE = ("law_server", "cam_drive", "follower", "microphone", "recorder")


@pytest.mark.ros
@pytest.mark.parametrize("name", LIVE)
def test_topics_and_services_are_those_of_the_node(make, name):
    """Neither one more nor one less."""
    node, about = make(name), ABOUT[name]
    assert {one.topic_name for one in node.subscriptions} == {one.name for one in about.takes}
    out = {one.topic_name for one in node.publishers} - OF_RCLPY
    assert out == {one.name for one in published(name)}
    services = {one.service_name.removeprefix(f"/{name}/") for one in node.services}
    assert {one for one in services if not re.search("parameter|type_desc", one)} == set(
        about.services
    )


@pytest.mark.parametrize("name", NODES)
def test_every_parameter_and_topic_is_named(name):
    """With defaults and limits, and an example."""
    text = usage(name)
    for spec in PARAMETERS[name]:
        assert f"  {spec.name}" in text and spec.description in text
    for topic in (*ABOUT[name].takes, *published(name)):
        assert topic.name in text and topic.type in text
    assert f"ros2 run cam_rig {name} --ros-args" in text


def test_help_starts_nothing():
    """Code 0, on stdout, in a Python that has no rclpy."""
    code = (
        "import sys; sys.modules['rclpy'] = None; sys.argv[1:] = ['--help'];"
        "from cam_rig.nodes.__main__ import follower; follower()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100
    )
    assert done.stdout == usage("follower") + "\n"
    command = [sys.executable, "-m", "cam_rig.nodes"]
    named = subprocess.run(
        [*command, "--help"], capture_output=True, text=True, check=True, timeout=100
    )
    assert all(name in named.stdout for name in NODES)
    assert (
        subprocess.run(
            [*command, "folower"], capture_output=True, check=False, timeout=100
        ).returncode
        == 1
    )
