"""The motion for people, live: a subscriber gets the bytes that the bag holds."""

from functools import partial

import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from cam_rig.messages import topics
from cam_rig.messages.serialization import read_message
from cam_rig.runner.graph import Graph

pytestmark = pytest.mark.ros
KINDS = {
    topics.JOINT_STATES: JointState,
    topics.FOLLOWER_CONTACT: WrenchStamped,
    topics.FOLLOWER_MARKERS: MarkerArray,
}
#: What the law server says of the mounted cam, latched.
MOUNTED = {topics.ROBOT_DESCRIPTION: String, topics.CAM_MARKERS: MarkerArray}


def test_what_a_subscriber_gets_is_what_the_bag_holds(
    user, rig, short_scene, undisturbed, wait_for, tmp_path
):
    """Byte by byte, each once and in order, from when it has joined; the bag is no other for it."""
    bag, found = tmp_path / "bag", {topic.name: [] for topic in KINDS}
    mounted = {topic.name: [] for topic in MOUNTED}

    def is_known(topic):
        user.spin(0.05)
        return user.node.count_publishers(topic.name) > 0

    def is_received():
        user.spin()
        return all(found.values()) and all(mounted.values())

    with Graph(rig.live(short_scene, bag, autostart=False)) as graph:
        for topic, kind in KINDS.items():
            got = found[topic.name].append
            user.node.create_subscription(kind, topic.name, got, QoSProfile(depth=50_000), raw=True)
            wait_for(partial(is_known, topic))
        for topic, kind in MOUNTED.items():
            got = mounted[topic.name].append
            late = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            user.node.create_subscription(kind, topic.name, got, late, raw=True)
            wait_for(partial(is_known, topic))
        user.call("/cam_drive/start")
        for _ in graph.progress():
            is_received()
    payloads = rig.payloads(bag)

    def is_drained():  # a spin takes one message of those that wait
        is_received()
        known = {t.name: {read_message(t, cdr)[1] for cdr in mounted[t.name]} for t in MOUNTED}
        return all(found.values()) and all(known[n] >= set(payloads[n]) for n in known)

    wait_for(is_drained)
    for topic in (*KINDS, *MOUNTED):  # DDS fills the last four bytes up
        got = (found | mounted)[topic.name]
        got[:] = [read_message(topic, cdr)[1] for cdr in got]
    for name, got in found.items():
        recorded = payloads[name]
        assert recorded == undisturbed[name]
        first = recorded.index(got[0])
        assert got == recorded[first : first + len(got)]
    for name, got in mounted.items():  # one that comes late has the cam that is mounted
        assert list(dict.fromkeys(got)) == payloads[name]
