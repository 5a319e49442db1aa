"""Answers that were lost to queue overflow are resent."""

from cam_rig.nodes.convert import ResendBuffer


class Listener:
    """Stands in for a publisher: remembers what went out."""

    def __init__(self):
        self.published = []

    def publish(self, message):
        self.published.append(message)


def test_a_tick_is_resent_in_order():
    """All messages of the tick that is asked for, and of no other."""
    out, repeats = Listener(), ResendBuffer()
    repeats.publish(10, [(out, "a"), (out, "b")])
    repeats.publish(20, [(out, "c")])
    repeats.resend(10)
    assert out.published == ["a", "b", "c", "a", "b"]


def test_only_ticks_in_flight_are_remembered():
    """Memory is bounded; what every consumer has acknowledged is not resent."""
    out, repeats = Listener(), ResendBuffer()
    for stamp in range(100):
        repeats.publish(stamp, [(out, stamp)])
    out.published.clear()
    for stamp in range(100):
        repeats.resend(stamp)
    assert out.published == [95, 96, 97, 98, 99]
