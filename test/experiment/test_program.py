"""The drive's program: whole turns, ticks that meet, an angle that never jumps."""

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.dynamics import NS
from cam_rig.experiment.program import cam_states, tick_count

TURN = 2.0 * np.pi


@pytest.fixture(params=[1, 7, 64])
def scene(request, make_scene):
    return make_scene(ticks_per_turn=request.param, speeds=[200, 333, 400, 210])


def test_tick_count(scene):
    """There are as many ticks as said, and one state more to close the last."""
    states = list(cam_states(scene))
    assert len(states) == tick_count(scene) + 1
    assert tick_count(scene) == 2 * 4 * 3 * scene.program.ticks_per_turn


def test_each_step_is_whole_turns(scene):
    """Every cam turns three times at every speed; half a nanosecond of turning is 3e-8 rad."""
    states = list(cam_states(scene))
    steps = [states[0]]
    for before, after in pairwise(states):
        if (after.cam, after.speed) != (before.cam, before.speed):
            steps.append(after)
    assert len(steps) == 2 * 4 + 1
    turned = np.diff([state.angle for state in steps]) / TURN
    np.testing.assert_allclose(turned, 3.0, rtol=0, atol=1e-8)


def test_stamps_rise_and_start_at_zero(scene):
    """Time begins at 0 and each state is later than the one before."""
    times = [state.time_ns for state in cam_states(scene)]
    assert times[0] == 0
    assert all(a < b for a, b in pairwise(times))


def test_angle_is_continuous(scene):
    """θ at a state is where the state before it has turned to, over speeds and cams."""
    for before, after in pairwise(cam_states(scene)):
        reached = before.angle + before.speed * (after.time_ns - before.time_ns) / NS
        assert after.angle == pytest.approx(reached, abs=1e-12)


def test_order_of_cams_and_speeds(scene):
    """Cam after cam, and for each the speeds in the order given."""
    played = dict.fromkeys((state.cam, state.speed) for state in cam_states(scene) if state.speed)
    rates = [float(speed) for speed in scene.program.speeds.si_list]
    assert list(played) == [(cam, speed) for cam in ("poly345", "bezier15") for speed in rates]


def test_last_state_stands_still(scene):
    """The last state closes the last tick and turns no more."""
    last = list(cam_states(scene))[-1]
    assert last.speed == 0.0
    assert last.cam == "bezier15"


def test_ticks_are_even(make_scene):
    """A tick is the turn's share to half a nanosecond: rounding does not add up."""
    scene = make_scene(ticks_per_turn=7, speeds=[333], turns=50)
    states = [state for state in cam_states(scene) if state.cam == "poly345"]
    ideal = np.arange(len(states)) * 60.0 / 333.0 / 7.0
    times = np.array([state.time_ns for state in states]) / NS
    np.testing.assert_allclose(times, ideal, rtol=0, atol=0.51e-9)


def test_interval_until_the_next(scene):
    """The interval of a tick has both stamps, the first angle and the first speed."""
    first, second = list(cam_states(scene))[:2]
    interval = first.until(second)
    assert (interval.start_ns, interval.stop_ns) == (first.time_ns, second.time_ns)
    assert (interval.angle, interval.speed) == (first.angle, first.speed)
