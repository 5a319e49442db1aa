"""Tests of the warning of a node that is slowed down by a subscriber."""

import pytest
from sensor_msgs.msg import JointState

from cam_rig.messages import topics
from cam_rig.nodes.base.publishing_monitor import MAX_PUBLISHING, PERIOD_S

from .conftest import wait_until

pytestmark = pytest.mark.ros


def test_a_slow_subscriber_is_named_with_its_topic_and_factor(make, user, capfd):
    """A slow subscriber causes a warning with topic, subscriber and slow-down factor.

    The node warns only in a period of which publishing took a large part.
    """
    drive = make("cam_drive")
    monitor, publisher = drive.publishing_monitor, drive._state_publisher
    user.node.create_subscription(JointState, "/cam/state", lambda _: None, 10)
    wait_until(lambda: monitor._find_subscribers(topics.CAM_STATE) == ["/user"])
    start = monitor._checked_at
    publisher.publishing_s += 0.75 * PERIOD_S
    monitor.check(start + PERIOD_S)
    publisher.publishing_s += 0.9 * MAX_PUBLISHING * PERIOD_S
    monitor.check(start + 2.0 * PERIOD_S)
    monitor.check(start + 3.0 * PERIOD_S)
    assert [
        line.split("]: ")[1] for line in capfd.readouterr().err.splitlines() if "WARN" in line
    ] == [
        "publishing took 7.5 s of the last 10.0 s, most of it on /cam/state: this node takes 4.0 "
        "times as long; continue or end the subscriber that takes no messages (subscribers: /user)"
    ]


def test_publishing_is_timed(make):
    """The duration of each attempt to publish is added to the time of its topic."""
    drive = make("cam_drive")
    before = drive._clock_publisher.publishing_s
    drive.publish_time(1)
    assert drive._clock_publisher.publishing_s > before
