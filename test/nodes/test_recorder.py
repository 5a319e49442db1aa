"""The recorder's end: it takes what is in transit, and does not wait for an endless publisher."""

from itertools import count

import pytest

from cam_rig.nodes.common.rig_node import MAX_DRAIN_S, take_rest

pytestmark = pytest.mark.ros


class Spinning:
    """Stands in for the executor and the clock: each spin takes its time, and may write one."""

    def __init__(self, writes):
        self.writes, self.written, self.time, self.spins = iter(writes), 0, 0.0, 0

    def spin_once(self, timeout_sec):
        self.time, self.spins = self.time + timeout_sec, self.spins + 1
        self.written += next(self.writes, 0)

    def rest(self):
        take_rest(self.spin_once, lambda: self.written, lambda: self.time)


def test_the_rest_is_taken():
    """Messages with gaps between them, then none: all are written, and the end comes soon."""
    spinning = Spinning([1, 1, 0, 0, 0, 1, 0, 1])
    spinning.rest()
    assert spinning.written == 4 and spinning.spins == 8 + 5


def test_an_endless_publisher_is_not_waited_for():
    """Something to write every 40 ms, for ever: the recorder ends before it is killed."""
    spinning = Spinning(number % 2 for number in count())
    spinning.rest()
    assert MAX_DRAIN_S <= spinning.time < MAX_DRAIN_S + 0.1 < 5.0
