"""Blocks and states find each other, in whatever order they come."""

import numpy as np

from cam_rig.experiment.pairing import TickPairing
from cam_rig.experiment.program import CamState


def state(time_ns):
    return CamState(time_ns, 0.0, 1.0, "cam")


def block(first_s, last_s):
    rows = np.zeros((6, 5))
    rows[0] = np.linspace(first_s, last_s, 5)
    return rows


def test_a_block_waits_for_the_state_that_closes_its_tick():
    """Neither order loses or repeats a tick."""
    early, late = TickPairing(), TickPairing()
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
    pairing = TickPairing()
    pairing.add_block(block(0.0, 0.9))
    pairing.add_block(block(1.0, 1.9))
    pairing.add_state(state(10**9))
    pairing.add_state(state(2 * 10**9))
    assert [a.time_ns for a, _, _ in pairing.complete()] == [10**9]
