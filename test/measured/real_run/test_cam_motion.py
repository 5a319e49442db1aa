"""The cam's motion through an encoder's counts is smooth, and within a count of each reading."""

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.measured.real_run.model_run import steady_stretches
from cam_rig.simulation.instruments import Signal
from cam_rig.units import RPM, TURN

COUNT = TURN / 1024


def counts(angle):
    return np.floor(angle / COUNT) * COUNT


def test_an_even_speed_is_one_number_for_all_turns():
    """Through counts at three speeds: each to a hundredth of a count, as thousands are averaged."""
    time = np.arange(20_000) / 2000.0
    speeds = np.repeat([200.0, 317.0, 450.0], [8000, 6000, 6000]) * RPM
    angle = np.cumsum(speeds) / 2000.0
    found = steady_stretches(Signal(time, counts(angle)), 3.0)
    assert [one.rpm for one in found] == pytest.approx([200.0, 317.0, 450.0], rel=2e-5)
    for stretch in found:
        assert stretch.line and stretch.largest < COUNT
        inside = (time >= stretch.knots[0]) & (time <= stretch.knots[-1])
        off = stretch.at(time[inside]) - angle[inside]
        assert np.abs(off + 0.5 * COUNT).max() < 0.05 * COUNT


def test_a_speed_that_wavers_within_the_turn_is_followed():
    """3 % twice a turn: the motion is within half a count, and its speed within 1 %.

    The difference of two counts at 2 kHz would be off by 15 %.
    """
    time = np.arange(12_000) / 2000.0
    mean = 300.0 * RPM
    angle = mean * time + 0.015 * np.sin(2.0 * mean * time)
    (stretch,) = steady_stretches(Signal(time, counts(angle)), 3.0)
    assert not stretch.line
    inside = (time > stretch.knots[1]) & (time < stretch.knots[-2])
    off = stretch.at(time[inside]) - angle[inside] + 0.5 * COUNT
    assert np.sqrt(np.mean(off**2)) < 0.15 * COUNT and np.abs(off).max() < 0.5 * COUNT
    speed = mean * (1.0 + 0.03 * np.cos(2.0 * mean * stretch.knots[1:-1]))
    wrong = np.abs(stretch.speed[1:-1] / speed - 1.0)
    assert np.sqrt(np.mean(wrong**2)) < 0.01
    states = list(stretch.states("cam", 0.25))
    for state, end in pairwise(states):
        interval = state.until(end)
        turned = interval.angle_at(interval.duration) - interval.angle
        assert turned == pytest.approx(end.since(state), abs=1e-9)
    assert states[0].unwrapped == pytest.approx(stretch.angle[0] + 0.25, abs=1e-6)


def test_half_of_the_readings_lost_here_and_there_leave_the_motion_as_it_is():
    """Gaps of a few readings turn the cam by a small part of a turn; half a second is a gap."""
    time = np.arange(12_000) / 2000.0
    angle = 300.0 * RPM * time
    kept = np.random.default_rng(4).random(time.size) > 0.5
    (stretch,) = steady_stretches(Signal(time[kept], counts(angle[kept])), 3.0)
    assert stretch.rpm == pytest.approx(300.0, rel=2e-5) and stretch.turns > 28.0
    kept &= (time < 3.0) | (time > 3.5)
    first, second = steady_stretches(Signal(time[kept], counts(angle[kept])), 3.0)
    assert first.knots[-1] <= 3.0 and second.knots[0] >= 3.5


def test_a_ramp_is_no_steady_speed():
    """Only the held parts before and after it are."""
    time = np.arange(16_000) / 2000.0
    speed = np.interp(time, [0.0, 3.0, 5.0, 8.0], np.array([200.0, 200.0, 400.0, 400.0]) * RPM)
    found = steady_stretches(Signal(time, counts(np.cumsum(speed) / 2000.0)), 4.0)
    assert [one.rpm for one in found] == pytest.approx([200.0, 400.0], rel=5e-3)
    assert found[0].knots[-1] < 3.4 and found[1].knots[0] > 4.7
