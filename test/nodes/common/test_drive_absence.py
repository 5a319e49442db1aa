"""Nodes whose drive leaves without saying that the run is over."""

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile

from cam_rig.nodes.common import run_end
from cam_rig.runner.node_table import RECORDER

pytestmark = pytest.mark.ros
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.parametrize("name", ["microphone", RECORDER])
def test_a_node_ends_when_the_drive_has_left_without_a_word(make, user, monkeypatch, capfd, name):
    """It was killed, or the node was suspended while it gave up; a look that finds none, of a
    node that discovers it again, ends nothing."""
    monkeypatch.setattr(run_end, "ABSENT_S", 2.0)
    node, seen = make(name), user.node.count_publishers
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def spin_until(condition):
        while not condition():
            executor.spin_once(timeout_sec=0.02)

    def drive():
        return user.node.create_publisher(DiagnosticStatus, "/rig/finished", LATCHED)

    for _ in range(2):
        publisher = drive()
        spin_until(lambda: node.count_publishers("/rig/finished") and seen("/rig/finished"))
        executor.spin_once(timeout_sec=0.2)
        user.node.destroy_publisher(publisher)
        spin_until(lambda: not node.count_publishers("/rig/finished"))
    assert not node.done.done()
    spin_until(node.done.done)
    assert node.failure is None
    assert "the drive has left without saying that the run is over" in capfd.readouterr().err
