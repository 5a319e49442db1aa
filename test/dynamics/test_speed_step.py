"""A change of speed from one interval to the next: the cam's velocity jumps, the follower's not."""

import numpy as np
import pytest

from cam_rig.dynamics import Interval, one_mass
from cam_rig.units import NS

RISING, FALLING = np.radians(90.0), np.radians(270.0)  # middles of the 3-4-5 rise and fall
TEN_MS = NS // 100


def slow_and_fast():
    return 50.0 * np.pi / 30.0, 150.0 * np.pi / 30.0


@pytest.fixture
def step(laws, follower):
    """Ride to an angle at one speed, then go on from there at another."""

    def go(angle, before, after):
        law = laws["poly345"]
        ride = Interval(0, TEN_MS, angle - before * 0.01, before)
        state, block = one_mass.advance(law, follower, None, ride, 8000)
        assert block.events == ()
        go_on = Interval(TEN_MS, 2 * TEN_MS, angle, after)
        jump = float(law(angle, 1)) * (after - before)  # of the cam's surface, m/s
        return jump, state, *one_mass.advance(law, follower, state, go_on, 8000)

    return go


@pytest.mark.parametrize(("angle", "faster"), [(RISING, False), (FALLING, True)])
def test_thrown_off(step, angle, faster):
    """Braking on the rise, or speeding up on the fall, leaves the follower in the air."""
    slow, fast = slow_and_fast()
    before, after = (slow, fast) if faster else (fast, slow)
    jump, state, _, block = step(angle, before, after)
    assert jump < 0.0
    first = block.events[0]
    assert (first.kind, first.time) == ("lift-off", pytest.approx(0.01, abs=1e-15))
    assert first.angle == pytest.approx(angle, abs=1e-15)
    # it flies on with the velocity it had
    assert block.rows[2, 0] == pytest.approx(state.velocity, rel=1e-9)
    assert block.rows[4, 0] == 0.0


@pytest.mark.parametrize(("angle", "faster"), [(RISING, True), (FALLING, False)])
def test_struck(step, follower, angle, faster):
    """Speeding up on the rise, or braking on the fall, strikes the follower: J = m Δv."""
    slow, fast = slow_and_fast()
    before, after = (slow, fast) if faster else (fast, slow)
    jump, _, _, block = step(angle, before, after)
    assert jump > 0.0
    first = block.events[0]
    assert (first.kind, first.time) == ("landing", pytest.approx(0.01, abs=1e-15))
    assert first.impulse == pytest.approx(follower.mass * jump, rel=1e-9)
    assert first.energy_lost == pytest.approx(0.5 * follower.mass * jump**2, rel=1e-9)
    assert block.rows[5, 0] == first.impulse
    assert block.rows[4, 0] > 0.0


def test_in_the_dwell_nothing_happens(step):
    """The cam's surface stands still in the dwell at any speed."""
    slow, fast = slow_and_fast()
    jump, _, end, block = step(np.radians(180.0), slow, fast)
    assert jump == pytest.approx(0.0, abs=1e-15)
    assert block.events == ()
    assert end.in_contact


def test_same_speed_is_no_step(step):
    """A border between two intervals of one speed is no event."""
    slow, _ = slow_and_fast()
    assert step(RISING, slow, slow)[3].events == ()


def test_flight_goes_on_over_a_step(laws, follower):
    """A change of speed does not touch a follower in the air."""
    law, fast, faster = laws["poly345"], 20.0 * np.pi, 25.0 * np.pi
    stop = 40 * NS // 1000
    angle = fast * 0.04  # 144°: high above the cam since the lift-off at 101.5°
    state, _ = one_mass.advance(law, follower, None, Interval(0, stop, 0.0, fast), 8000)
    assert not state.in_contact
    go_on = Interval(stop, stop + NS // 1000, angle, faster)
    _, block = one_mass.advance(law, follower, state, go_on, 8000)
    assert block.events == ()
    assert block.rows[1, 0] == pytest.approx(state.displacement, rel=1e-14)
    assert block.rows[2, 0] == pytest.approx(state.velocity, rel=1e-14)
