"""Fixtures with the messages of the golden bag, and with recordings of them."""

import pytest
from mcap.reader import make_reader

from cam_rig.bag.files import bag_file
from cam_rig.bag.listing import mcap_files
from cam_rig.bag.split import Split

from .bags import BY_NAME, GOLDEN, Frugal, record


@pytest.fixture(scope="session")
def golden():
    """Messages that a recorder receives in the golden run (the reference recording).

    Each is (topic, number within the topic, bytes). Messages that the recorder computes itself are
    excluded.
    """
    found, numbers = [], dict.fromkeys(BY_NAME, 0)
    with bag_file(GOLDEN).open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            if BY_NAME[channel.topic].derived:
                continue
            numbers[channel.topic] += 1
            found.append((BY_NAME[channel.topic], numbers[channel.topic], message.data))
    return found


@pytest.fixture(scope="session")
def whole(tmp_path_factory, golden):
    """Path of a recording of the golden run in one file.

    Its motion messages are limited to two per turn.
    """
    bag = tmp_path_factory.mktemp("whole") / "bag"
    record(bag, golden, samples_per_turn=2).close()
    return bag


@pytest.fixture(scope="session")
def split(tmp_path_factory, golden):
    """Path of a recording of the golden run in files of 0.5 s. The run takes 2.5 s."""
    bag = tmp_path_factory.mktemp("split") / "bag"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DISTRO", "kilted")
        record(bag, golden, split=Split(duration=0.5), samples_per_turn=2).close()
    assert len(mcap_files(bag)) > 2
    return bag


class Kept:
    """Replacement of a bag writer that keeps the written messages in memory."""

    def __init__(self):
        self.messages = []

    def write(self, topic, log_time, cdr):
        self.messages.append((topic.name, log_time, cdr))

    def begin_state(self, stamp):
        pass


@pytest.fixture
def kept():
    """Replacement of a bag writer that keeps the written messages in memory."""
    return Kept()


@pytest.fixture
def frugal():
    """Fail the test if it needs over 500 MB of memory or 10 s of processor time."""
    with Frugal():
        yield
