"""A writer that a subscriber holds up loses nothing that the rig needs."""

from random import Random

import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message

from cam_rig.errors import RunError
from cam_rig.messages import topics
from cam_rig.nodes import rig_node as rig_publisher
from cam_rig.nodes.convert import message_class
from cam_rig.nodes.rig_node import RigPublisher

pytestmark = pytest.mark.ros


@pytest.fixture
def hold_up(monkeypatch):
    """Let DDS give up at some messages, as beside a reliable subscriber that takes nothing."""

    def hold(topic, is_held):
        published, publish = [], Publisher.publish

        def refuse(self, message):
            if self.topic_name != topic.name:
                return publish(self, message)
            if is_held():
                raise rclpy_implementation.RCLError("cannot publish data")
            published.append(message)
            return None

        monkeypatch.setattr(Publisher, "publish", refuse)
        return published

    return hold


def take(node, topic, payloads):
    """Give a node the messages of a run."""
    for cdr in payloads[topic.name]:
        message = deserialize_message(cdr, message_class(topic))
        (node._on_law if topic is topics.LAW_COEFFICIENTS else node._on_state)(message)


@pytest.mark.variants(2)
@pytest.mark.parametrize("seed", range(3))
def test_no_tick_is_lost(make, hold_up, undisturbed, seed):
    """The follower publishes every tick's samples, though half of the tries fail."""
    random = Random(seed)
    published = hold_up(topics.FOLLOWER_SAMPLES, lambda: random.random() < 0.5)
    follower = make("follower")
    take(follower, topics.LAW_COEFFICIENTS, undisturbed)
    take(follower, topics.CAM_STATE, undisturbed)
    expected = undisturbed[topics.FOLLOWER_SAMPLES.name]
    assert len(published) == len(expected)
    kind = message_class(topics.FOLLOWER_SAMPLES)
    for message, cdr in zip(published, expected, strict=True):
        assert message == deserialize_message(cdr, kind)


def test_motion_that_is_held_up_is_left_out_for_a_tick(
    make, hold_up, undisturbed, monkeypatch, capfd
):
    """The rig does not wait for people's readers, and names those who may be the reason."""
    monkeypatch.setattr(RigPublisher, "get_subscription_count", lambda _self: 1)
    tries = []
    published = hold_up(topics.JOINT_STATES, lambda: tries.append(1) or len(tries) == 5)
    follower = make("follower")
    take(follower, topics.LAW_COEFFICIENTS, undisturbed)
    take(follower, topics.CAM_STATE, undisturbed)
    expected = undisturbed[topics.JOINT_STATES.name]
    left_out = len(expected) - len(published)
    assert 30 < left_out < 37  # the rest of the first half turn
    assert published == expected[:4] + expected[4 + left_out :]
    assert "/joint_states: left out for a tick" in capfd.readouterr().err


def test_a_writer_that_is_never_free_ends_the_run(make, hold_up, undisturbed, monkeypatch):
    """The error names the topic and what to look for."""
    monkeypatch.setattr(rig_publisher, "MAX_HELD_S", 0.05)
    hold_up(topics.CAM_STATE, lambda: True)
    drive = make("cam_drive")
    with pytest.raises(RunError, match=r"/cam/state: cannot be published for 0\.05 s"):
        drive._state_out.publish(message_class(topics.CAM_STATE)())
