"""Where a run is cut into intervals leaves no trace in it."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cam_rig.units import NS

RPM = 600.0
TURN_NS = 60 * NS // 600
END = 4 * TURN_NS


def cuts(length):
    return [*range(0, END, length), END]


@pytest.fixture(scope="module")
def whole(laws, follower, run):
    """Four turns of the jumping 3-4-5 cam in one interval."""
    return run(laws["poly345"], follower, RPM, [0, END])


@pytest.mark.parametrize("length", [NS // 1000, NS // 5, TURN_NS, 7_654_321])
def test_samples_do_not_depend_on_the_interval(laws, follower, run, whole, length):
    """1 ms, 200 ms or one turn a time: samples equal to 1e-10 of each row's size."""
    cut = run(laws["poly345"], follower, RPM, cuts(length))
    sizes = np.abs(whole.rows).max(axis=1, keepdims=True)
    assert cut.rows.shape == whole.rows.shape
    assert np.all(np.abs(cut.rows - whole.rows) <= 1e-10 * sizes)


@pytest.mark.parametrize("length", [NS // 1000, 7_654_321])
def test_events_do_not_depend_on_the_interval(laws, follower, run, whole, length):
    """The same events at the same angles, with the same impulses."""
    cut = run(laws["poly345"], follower, RPM, cuts(length))
    assert [e.kind for e in cut.events] == [e.kind for e in whole.events]
    for one, other in zip(cut.events, whole.events, strict=True):
        assert one.angle == pytest.approx(other.angle, abs=1e-10)
        assert one.time == pytest.approx(other.time, abs=1e-12)
        assert one.impulse == pytest.approx(other.impulse, rel=1e-9)


def test_intervals_shorter_than_a_sample(laws, follower, run, whole):
    """Intervals of 40 µs at 125 µs a sample: most have no sample, and nothing is lost."""
    cut = run(laws["poly345"], follower, RPM, cuts(40_000))
    sizes = np.abs(whole.rows).max(axis=1, keepdims=True)
    assert cut.rows.shape == whole.rows.shape
    assert np.all(np.abs(cut.rows - whole.rows) <= 1e-9 * sizes)


@settings(max_examples=settings.default.max_examples // 2)
@given(
    inner=st.lists(st.integers(1, 2 * TURN_NS - 1), unique=True, max_size=12),
    restitution=st.sampled_from([0.0, 0.5]),
)
def test_each_impulse_shows_once(laws, follower, run, inner, restitution):
    """All impulses of the events stand in the blocks, or wait for the next block."""
    p = dataclasses.replace(follower, restitution=restitution)
    result = run(laws["poly345"], p, RPM, [0, *sorted(inner), 2 * TURN_NS], sample_rate=1000)
    total = sum(event.impulse for event in result.events)
    assert total > 1.0
    shown = result.rows[5].sum() + result.state.pending_impulse
    assert shown == pytest.approx(total, rel=1e-12)


def test_impulse_shows_at_the_sample_after_its_landing(whole):
    """Each landing stands at the first sample at or after its time."""
    expected = np.zeros(whole.rows.shape[1])
    for event in whole.events:
        expected[int(np.ceil(event.time * 8000))] += event.impulse
    np.testing.assert_allclose(whole.rows[5], expected, rtol=1e-14)


def test_events_are_in_order(whole):
    """Lift-off and landing take turns, in time and in angle."""
    kinds = [event.kind for event in whole.events]
    assert kinds[0] == "lift-off"
    assert all(a != b for a, b in pairwise(kinds))
    assert all(a.time <= b.time for a, b in pairwise(whole.events))


def test_a_day_on_the_clock(laws, follower, run):
    """After 50 000 turns the follower still leaves and lands at the angles of the first turn."""
    first = run(laws["poly345"], follower, RPM, [0, TURN_NS]).events
    late = run(laws["poly345"], follower, RPM, [50_000 * TURN_NS, 50_001 * TURN_NS]).events
    turned = 50_000 * 2.0 * np.pi
    assert [e.kind for e in late] == [e.kind for e in first]
    for one, other in zip(late, first, strict=True):
        assert one.angle - turned == pytest.approx(other.angle, abs=1e-8)  # eps of 3e5 rad, x 100
        assert one.impulse == pytest.approx(other.impulse, rel=1e-6)
