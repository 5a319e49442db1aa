"""The messages of the golden bag, as a recorder would take them."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from cam_rig.bag import topics
from cam_rig.bag.reader import recorded_file

GOLDEN = Path(__file__).parents[2] / "bags" / "golden"
BY_NAME = {topic.name: topic for topic in topics.RECORDING}


@pytest.fixture(scope="session")
def golden():
    """(topic, number of the message in its topic, bytes) in the order of the bag."""
    found, numbers = [], dict.fromkeys(BY_NAME, 0)
    with recorded_file(GOLDEN).open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            numbers[channel.topic] += 1
            found.append((BY_NAME[channel.topic], numbers[channel.topic], message.data))
    return found


class Kept:
    """Stands in for the bag: keeps what was written."""

    def __init__(self):
        self.messages = []

    def write(self, topic, log_time, cdr):
        self.messages.append((topic.name, log_time, cdr))


@pytest.fixture
def kept():
    return Kept()
