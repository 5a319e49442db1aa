"""Programs in the rig's domain that do it no harm: other types, and readers that never read."""

import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from cam_rig.messages import topics
from cam_rig.nodes.convert import message_class

pytestmark = pytest.mark.ros

#: What holds up a publisher that waits for its readers: reliable, and nothing is ever dropped.
KEEPS_ALL = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    history=HistoryPolicy.KEEP_ALL,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
ROUNDS = 50
#: What some node publishes; transforms are robot_state_publisher's.
PUBLISHED = [topic for topic in topics.RECORDING if topic.package != "tf2_msgs"]


def test_another_type_on_a_topic_changes_nothing(user, rig, short_scene, undisturbed, tmp_path):
    """DDS matches no endpoints of different types: the bag is the undisturbed one."""
    published = [
        user.node.create_publisher(String, topic.name, KEEPS_ALL)
        for topic in PUBLISHED
        if topic.type != "std_msgs/msg/String"
    ]

    def talk(_graph, tick):
        if tick < ROUNDS:
            for publisher in published:
                publisher.publish(String(data="nonsense"))

    rig.run(short_scene, tmp_path / "bag", talk)
    assert rig.payloads(tmp_path / "bag") == undisturbed


def test_a_reader_that_never_reads_holds_nobody_up(user, rig, short_scene, undisturbed, tmp_path):
    """Histories keep the newest: the drive waits for its own consumers, not for any reader."""
    for topic in PUBLISHED:
        user.node.create_subscription(message_class(topic), topic.name, print, KEEPS_ALL)
    rig.run(short_scene, tmp_path / "bag")  # the node of these is not spun
    assert rig.payloads(tmp_path / "bag") == undisturbed
