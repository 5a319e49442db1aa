"""An interval of even speed or of a ramp: θ = θ₀ + ω t + α t²/2, and what is refused."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cam_rig
from cam_rig.dynamics import COLUMNS, MODELS, Block, Interval, Samples
from cam_rig.units import NS, RPM

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


def test_rest_by_rounding_is_rest():
    """A ramp down to rest may end a rounding error below zero."""
    length = 300_000_001
    stop = Interval(0, length, 0.0, 41.9, -41.9 * NS / length)
    assert abs(stop.speed_at(stop.duration)) < 1e-13


# The grid of samples that all intervals share.

times_ns = st.integers(0, 4000 * NS)
rates = st.integers(100, 1_000_000)


@given(st.lists(times_ns, min_size=2, max_size=8, unique=True), rates)
def test_consecutive_intervals_share_no_sample_and_miss_none(cuts, rate):
    """Each interval's first sample is the one after the last of the interval before."""
    cuts = sorted(cuts)
    pairs = itertools.pairwise(cuts)
    grids = [Interval(a, b, 0.0, 1.0).grid(rate) for a, b in pairs]
    for before, after in itertools.pairwise(grids):
        assert after.first == before.first + before.count
    whole = Interval(cuts[0], cuts[-1], 0.0, 1.0).grid(rate)
    assert whole.first == grids[0].first
    assert whole.count == sum(grid.count for grid in grids)


@given(times_ns, st.integers(1, NS), rates)
def test_samples_lie_inside(start, length, rate):
    """All instants k / rate in [start, stop) belong to the interval, and no other does."""
    grid = Interval(start, start + length, 0.0, 1.0).grid(rate)
    low, high = Fraction(start, NS), Fraction(start + length, NS)
    assert grid.count >= 0
    assert Fraction(grid.first - 1, rate) < low <= Fraction(grid.first, rate)
    end = grid.first + grid.count
    assert Fraction(end - 1, rate) < high <= Fraction(end, rate)


@given(times_ns, st.integers(1, NS), rates)
def test_offset_is_exact(start, length, rate):
    """The first sample's distance from the start is the exact fraction, rounded once."""
    grid = Interval(start, start + length, 0.0, 1.0).grid(rate)
    assert grid.offset == float(Fraction(grid.first, rate) - Fraction(start, NS))


def test_index_after():
    """The first sample at or after a time; never before the first."""
    grid = Interval(0, NS, 0.0, 1.0).grid(1000)
    assert [grid.index_after(t) for t in (-1.0, 0.0, 0.25, 0.2501)] == [0, 0, 250, 251]
    np.testing.assert_allclose(grid.since_start()[[0, 999]], [0.0, 0.999], rtol=1e-15)


# Rows of a block by their names.


@pytest.mark.parametrize("model", ["one_mass", "two_mass", "elastic_stem"])
@pytest.mark.parametrize("rpm", [250, 500])
def test_a_sample_at_the_very_end_is_as_any_other(model, rpm):
    """One that is nearer the end than rounding tells apart, in contact and in flight.

    The end is moved to a part of a nanosecond behind the last sample: 48 kHz has such ends.
    """
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    parameters = MODELS[model].parameters(cam_rig.load_rig("paper_table2"))
    speed, rate = rpm * RPM, 2580
    ends = [k for k in range(200, 600) if 0 < -k * NS % rate < rate and -k * NS % rate < 1000]
    assert len(ends) > 100
    for k in ends[::10]:
        stop = -(-k * NS // rate)
        short, long = (
            MODELS[model].advance(law, parameters, None, Interval(0, end, 0.0, speed), rate)[1]
            for end in (stop, stop + NS // 100)
        )
        assert short.rows.shape[1] == k + 1
        assert short.rows[:5] == pytest.approx(long.rows[:5, : k + 1], rel=1e-9, abs=1e-9)


def test_names_are_the_columns_in_order():
    """Each name gives the row whose heading begins with it, or ends with it before the unit."""
    samples = Samples(np.arange(12.0).reshape(6, 2))
    for row, (name, column) in enumerate(zip(NAMES, COLUMNS, strict=True)):
        assert column.partition(" [")[0] in (name, f"contact_{name}", name[0])
        np.testing.assert_array_equal(getattr(samples, name), samples.rows[row])
    np.testing.assert_array_equal(samples.motion, samples.rows[1:4])


def test_names_are_views():
    """What is written by name is in the array, of a block too."""
    block = Block(Interval(0, NS, 0.0, 1.0), np.zeros((6, 3)))
    block.force[1] = 7.0
    assert block.rows[4].tolist() == [0.0, 7.0, 0.0]


NAMES = ("time", "lift", "velocity", "acceleration", "force", "impulse")
