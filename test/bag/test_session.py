"""The recorder's bookkeeping: rig time for every message, and how far the bag is."""

import random
from itertools import pairwise

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import topics
from cam_rig.bag.session import RecordingSession, stamp_of

TYPES = get_typestore(Stores.ROS2_KILTED)
STAMPS = [0, 300_000_000, 1_500_000_001]
#: The first tick at one speed, the second at another; then the cam stands.
STAMPED_SPEED = dict(zip(STAMPS, (20.0, 30.0, 0.0), strict=True))


class Kept:
    """Stands in for the bag: keeps what was written."""

    def __init__(self):
        self.messages = []

    def write(self, topic, log_time, cdr):
        self.messages.append((topic, log_time, cdr))


def header(stamp):
    time = TYPES.types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    return TYPES.types["std_msgs/msg/Header"](time, "x")


def cdr(topic, stamp):
    kind = TYPES.types[topic.type]
    if topic.type == "sensor_msgs/msg/FluidPressure":
        message = kind(header(stamp), 0.1, 0.0)
    elif topic is topics.CAM_STATE:
        one = np.array([1.0])
        message = kind(header(stamp), ["cam"], one, np.array([STAMPED_SPEED[stamp]]), one)
    elif topic.type == "std_msgs/msg/Float64":
        message = kind(80.0)
    else:
        return bytes(TYPES.serialize_cdr(header(stamp), "std_msgs/msg/Header"))
    return bytes(TYPES.serialize_cdr(message, topic.type))


def run_in_order(order):
    kept = Kept()
    session = RecordingSession(kept)
    told = [session.take(topic, cdr(topic, stamp)) for topic, stamp in order]
    return kept.messages, [stamp for stamp in told if stamp is not None]


def all_messages():
    for topic in (topics.CLOCK, topics.CAM_STATE):
        yield from ((topic, stamp) for stamp in STAMPS)
    yield from ((topics.LAW, stamp) for stamp in STAMPS[:2])
    for topic in topics.RECORDING:
        if topic.per == "tick":
            yield from ((topic, stamp) for stamp in STAMPS[1:])


def test_a_stamp_is_read_from_the_serialized_message():
    """Rig time is taken from the bytes; nothing is deserialized to record it."""
    assert stamp_of(cdr(topics.PRESSURE, 1_500_000_001)) == 1_500_000_001


@pytest.mark.parametrize("seed", range(20))
def test_any_order_of_topics_gives_the_same_bag_times(seed):
    """Topics keep their own order only; unstamped messages still get their tick's end."""
    queues = {}
    for topic, stamp in all_messages():
        queues.setdefault(topic, []).append((topic, stamp))
    chance = random.Random(seed)
    order = []
    while queues:
        topic = chance.choice(list(queues))
        order.append(queues[topic].pop(0))
        if not queues[topic]:
            del queues[topic]
    written, told = run_in_order(order)
    assert len(written) == len(order)
    for topic in (topics.LEVEL, topics.FOLLOWER_SAMPLES, topics.PRESSURE):
        assert [time for t, time, _ in written if t is topic] == STAMPS[1:]
    assert told[-1] == STAMPS[-1]
    assert all(a < b for a, b in pairwise(told))


def test_a_tick_is_complete_only_with_its_last_message():
    """The drive is not told of a tick while one of its messages is missing."""
    order = [m for m in all_messages() if m[0] is not topics.LEVEL]
    assert run_in_order(order)[1] == []
    assert run_in_order([*order, (topics.LEVEL, 0)])[1] == [STAMPS[1]]


def test_a_tick_waits_for_the_law_at_its_speed():
    """The sampled law of each step is in the bag before the step's ticks count as recorded."""
    order = [m for m in all_messages() if m[0] is not topics.LAW]
    assert run_in_order(order)[1] == []
    assert run_in_order([*order, (topics.LAW, STAMPS[0])])[1] == [STAMPS[1]]
    assert run_in_order([*order, *((topics.LAW, s) for s in STAMPS[:2])])[1] == STAMPS[1:]
