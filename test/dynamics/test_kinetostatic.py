"""The follower that never leaves the cam: where an interval ends, where the cam would pull."""

import numpy as np
import pytest

from cam_rig.dynamics import Interval, kinetostatic
from cam_rig.dynamics.kinetostatic import loss_intervals
from cam_rig.units import NS, TURN

RPM = 400.0
SPEED = RPM * np.pi / 30.0


@pytest.mark.variants(3)
def test_state_is_the_next_sample(law, follower):
    """The state at the end is what the next interval's first sample shows."""
    stop = 37 * NS // 1000
    first, second = (
        Interval(a, b, SPEED * a / NS, SPEED) for a, b in ((0, stop), (stop, 2 * stop))
    )
    state, _ = kinetostatic.advance(law, follower, None, first, 1000)
    _, block = kinetostatic.advance(law, follower, state, second, 1000)
    shown = (state.displacement, state.velocity, state.contact_force)
    sizes = np.abs(block.rows[[1, 2, 4]]).max(axis=1)
    assert np.all(np.abs(block.rows[[1, 2, 4], 0] - shown) <= 1e-12 * sizes)
    assert state.in_contact


@pytest.mark.variants(3)
def test_loss_intervals_are_where_the_force_pulls(law, follower):
    """Inside a loss interval F < 0, outside F ≥ 0, at every sampled angle clear of its ends."""
    angle = np.linspace(0.0, TURN, 5001)[1:-1]
    for rpm in (100.0, 400.0, 700.0):
        speed = rpm * np.pi / 30.0
        s, ds, dds = (law(angle, k) for k in range(3))
        p = follower
        force = p.mass * speed**2 * dds + p.damping * speed * ds + p.spring_stiffness * s
        force += p.preload
        lost = np.zeros(angle.size, dtype=bool)
        near = np.zeros(angle.size, dtype=bool)
        for start, stop in loss_intervals(law, p, speed):
            lost |= (angle > start) & (angle < stop)
            near |= np.minimum(np.abs(angle - start), np.abs(angle - stop)) < 1e-9
        np.testing.assert_array_equal(lost[~near], force[~near] < 0.0)
