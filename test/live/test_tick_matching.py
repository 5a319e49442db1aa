"""Blocks and states find each other, in whatever order they come."""

import numpy as np
import pytest

from cam_rig.errors import RefusedError
from cam_rig.live.queues import TickMatcher
from cam_rig.simulation.schedule import CamState


def state(time_ns):
    return CamState(time_ns, 0.0, 1.0, "cam")


def block(first_s, last_s):
    rows = np.zeros((6, 5))
    rows[0] = np.linspace(first_s, last_s, 5)
    return rows


def test_a_block_waits_for_the_state_that_closes_its_tick():
    """Neither order loses or repeats a tick."""
    early, late = TickMatcher(), TickMatcher()
    ticks = [block(0.0, 0.9), block(1.0, 1.9)]
    for pairing, order in ((early, "bbsss"), (late, "sssbb")):
        blocks, states, found = iter(ticks), iter([0, 10**9, 2 * 10**9]), []
        for kind in order:
            if kind == "b":
                pairing.add_block(next(blocks))
            else:
                pairing.add_state(state(next(states)))
            found += list(pairing.complete())
        assert [(a.time_ns, b.time_ns) for a, b, _ in found] == [(0, 10**9), (10**9, 2 * 10**9)]
        assert [rows[0, 0] for _, _, rows in found] == [0.0, 1.0]


def test_a_block_from_before_we_listened_is_passed_over():
    """A late listener starts with the first tick whose beginning it knows."""
    pairing = TickMatcher()
    pairing.add_block(block(0.0, 0.9))
    pairing.add_block(block(1.0, 1.9))
    pairing.add_state(state(10**9))
    pairing.add_state(state(2 * 10**9))
    assert [a.time_ns for a, _, _ in pairing.complete()] == [10**9]


def test_a_block_that_comes_again_is_given_once():
    """A follower that was started again sends its last ticks once more."""
    pairing = TickMatcher(sample_rate=5)
    for stamp in (0, 10**9, 2 * 10**9, 3 * 10**9):
        pairing.add_state(state(stamp))
    found = []
    for first in (0.0, 1.0, 0.0, 1.0, 2.0):
        pairing.add_block(block(first, first + 0.8))
        found += [a.time_ns for a, _, _ in pairing.complete()]
    assert found == [0, 10**9, 2 * 10**9]


def test_a_successor_begins_where_its_predecessor_ended():
    """Ticks that were done are not done again."""
    pairing = TickMatcher(sample_rate=5, since=10**9)
    for stamp in (0, 10**9, 2 * 10**9):
        pairing.add_state(state(stamp))
    for first in (0.0, 1.0):
        pairing.add_block(block(first, first + 0.8))
    assert [a.time_ns for a, _, _ in pairing.complete()] == [10**9]


@pytest.mark.parametrize("wrong", [block(0.0, 0.7), block(0.0, 0.8)[:, :3], block(1.2, 1.8)])
def test_a_block_of_other_samples_is_refused(wrong):
    """It is named, and the right one is taken."""
    pairing = TickMatcher(sample_rate=5)
    pairing.add_state(state(0))
    pairing.add_state(state(10**9))
    pairing.add_state(state(2 * 10**9))
    pairing.add_block(block(0.0, 0.8))
    assert len(list(pairing.complete())) == 1
    pairing.add_block(wrong if wrong[0, 0] > 1 else wrong + np.eye(6, 1))
    with pytest.raises(RefusedError, match="allowed: the samples of the tick that begins at 1"):
        list(pairing.complete())
    pairing.add_block(block(1.0, 1.8))
    assert [a.time_ns for a, _, _ in pairing.complete()] == [10**9]


def test_a_standing_cam_has_no_tick():
    """After an emergency stop the next tick begins with the next start."""
    pairing = TickMatcher(sample_rate=5)
    stands = CamState(10**9, 0.0, 0.0, "cam")
    for now in (state(0), stands, state(2 * 10**9), state(3 * 10**9)):
        pairing.add_state(now)
    found = []
    for first in (0.0, 2.0):
        pairing.add_block(block(first, first + 0.8))
        found += [a.time_ns for a, _, _ in pairing.complete()]
    assert found == [0, 2 * 10**9]
