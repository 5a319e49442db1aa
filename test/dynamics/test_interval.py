"""An interval of even speed or of a ramp: θ = θ₀ + ω t + α t²/2, and what is refused."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.dynamics import Interval
from cam_rig.errors import DynamicsError
from cam_rig.units import NS

speeds = st.floats(0.0, 1e3)


@given(speeds, speeds, st.integers(1000, 10 * NS), st.floats(0.0, 1e4))
def test_ends_of_a_ramp(before, after, length, angle):
    """From the first speed to the last one, at the mean of both."""
    ramp = Interval(5, 5 + length, angle, before, (after - before) * NS / length)
    top = max(before, after, 1e-300)
    assert ramp.speed_at(ramp.duration) == pytest.approx(after, abs=1e-12 * top)
    assert ramp.mean_speed == pytest.approx(0.5 * (before + after), abs=1e-12 * top)
    turned = ramp.unwrapped_at(ramp.duration) - angle
    assert turned == pytest.approx(ramp.mean_speed * ramp.duration, abs=1e-11 * (1.0 + angle))


@given(st.floats(1.0, 1e3), st.floats(1.0, 1e3), st.floats(1e-3, 1.0))
def test_time_is_the_inverse_of_the_angle(before, after, part):
    """The cam is at an angle when it has turned to it."""
    ramp = Interval(0, NS, 0.0, before, after - before)
    assert ramp.time_at(ramp.angle_at(part)) == pytest.approx(part, rel=1e-12)


def test_time_from_rest_and_never():
    """From rest θ = α t²/2; an angle behind the point where a ramp comes to rest is never met."""
    start = Interval(0, NS, 0.0, 0.0, 8.0)
    assert start.time_at(4.0) == 1.0
    assert start.time_at(0.0) == 0.0
    assert start.time_at(1e-20) == pytest.approx(5e-11, rel=1e-14)
    stop = Interval(0, NS, 2.0, 10.0, -10.0)
    assert stop.time_at(7.0) == pytest.approx(1.0, rel=1e-12)
    assert stop.time_at(7.0001) == math.inf
    assert Interval(0, NS, 0.0, 0.0).time_at(1.0) == math.inf


@given(speeds, speeds, st.integers(1, NS // 10), st.floats(1.0, 50.0))
def test_parts_of_a_ramp(before, after, length, most):
    """They share their ends, hold to the angle asked for, and are the ramp again."""
    ramp = Interval(7, 7 + length, 3.0, before, (after - before) * NS / length)
    parts = ramp.split(most)
    assert (parts[0].start_ns, parts[-1].stop_ns) == (ramp.start_ns, ramp.stop_ns)
    for one, other in itertools.pairwise(parts):
        assert one.stop_ns == other.start_ns
        assert one.unwrapped_at(one.duration) == pytest.approx(other.unwrapped_at(0.0), rel=1e-12)
        assert one.speed_at(one.duration) == pytest.approx(other.speed, abs=1e-9)
    longest = max(part.duration for part in parts)
    if len(parts) < length:
        assert max(before, after) * longest <= most * (1.0 + 1e-9) + 1e-6
    assert all(part.acceleration == ramp.acceleration for part in parts)


@pytest.mark.parametrize(
    ("speed", "acceleration", "told"),
    [
        (5.0, -6.0, r"a ramp from 5 to -1 rad/s; allowed: from rest or forwards"),
        (-1.0, 6.0, r"a ramp from -1 to 5 rad/s; allowed"),
        (-2.0, -1.0, r"a ramp from -2 to -3 rad/s; allowed"),
        (1.0, math.nan, r"an interval whose acceleration is nan; allowed: finite"),
        (math.inf, 0.0, r"an interval whose speed is inf; allowed: finite"),
    ],
)
def test_a_ramp_backwards_is_refused(speed, acceleration, told):
    """A ramp leads forwards: the message gives both speeds."""
    with pytest.raises(DynamicsError, match=told):
        Interval(0, NS, 0.0, speed, acceleration)


def test_rest_by_rounding_is_rest():
    """A ramp down to rest may end a rounding error below zero."""
    length = 300_000_001
    stop = Interval(0, length, 0.0, 41.9, -41.9 * NS / length)
    assert abs(stop.speed_at(stop.duration)) < 1e-13
