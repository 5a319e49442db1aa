"""Answers that were swept away come again."""

from cam_rig.nodes.common.resend import ResendBuffer


class Listener:
    """Stands in for a publisher: remembers what went out."""

    def __init__(self):
        self.heard = []

    def publish(self, message):
        self.heard.append(message)


def test_a_tick_is_said_again_in_order():
    """All messages of the tick that is asked for, and of no other."""
    out, repeats = Listener(), ResendBuffer()
    repeats.publish(10, [(out, "a"), (out, "b")])
    repeats.publish(20, [(out, "c")])
    repeats.resend(10)
    assert out.heard == ["a", "b", "c", "a", "b"]


def test_only_ticks_in_flight_are_remembered():
    """Memory is bounded; what everybody has dealt with is not said again."""
    out, repeats = Listener(), ResendBuffer()
    for stamp in range(100):
        repeats.publish(stamp, [(out, stamp)])
    out.heard.clear()
    for stamp in range(100):
        repeats.resend(stamp)
    assert out.heard == [95, 96, 97, 98, 99]
