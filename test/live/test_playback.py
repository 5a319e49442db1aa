"""Tests of the playback of a paced run for displays.

Samples are released at a constant wall-clock rate, one tick behind the drive. A tick is the
interval between two cam states.
"""

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.live.playback import MARGIN_S, Playback, Tick
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, RPM

RATE = 12_000


def ticks(speeds, ticks_per_turn):
    """Return ticks of equal angle, one for each speed (rpm).

    A tick is the interval between two cam states, with its samples. Rows 1 to 4 of the samples
    contain the number of each sample since the start.
    """
    result, states = [], [CamState(0, 0.0, speeds[0] * RPM, "tm21")]
    for now, then in pairwise([*speeds, speeds[-1]]):
        start = states[-1]
        time_ns = start.time_ns + round(60.0 * NS / now / ticks_per_turn)
        turned = now * RPM * (time_ns - start.time_ns) / NS
        states.append(CamState(time_ns, start.angle + turned, then * RPM, "tm21", start.turns))
        grid = start.until(states[-1]).grid(RATE)
        rows = grid.new_rows()
        rows[1:5] = grid.first + np.arange(grid.count, dtype=float)
        result.append(Tick(start, states[-1], rows))
    return result


def show(playback, wall_time):
    """Return the tick and sample number that is newly shown at a wall-clock time (s).

    None is returned if no sample is due.
    """
    samples = playback.samples_at(np.array([wall_time]))
    if samples is None:
        return None
    playback.record_shown(samples, 0)
    return samples.tick, int(samples.indices[0])


def play(ticks, factor, rate, latency=lambda: 0.0, settling_ticks=0):
    """Play ticks back, and return three arrays for the samples that are shown.

    They are wall-clock time, rig time and delay (s). `factor` is the real-time factor and `rate`
    the rate of the display in 1/s. `latency` returns the time (s) that a state takes to the
    follower. The samples shown before the end of `settling_ticks` are left out.
    """
    playback, rows, due = Playback(RATE), [], 0.0
    for n, tick in enumerate(ticks):
        received_at = tick.end.time_ns / NS / factor + latency()
        while due < received_at:
            if (shown := show(playback, due)) is not None:
                shown_tick, sample = shown
                time, number = shown_tick.rows[:2, sample]
                assert number == round(time * RATE)
                if n > settling_ticks:
                    rows.append((due, time, due - time / factor))
            due += 1.0 / rate
        playback.add(tick, factor, received_at, received_at)
    return np.array(rows).T


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(16))
def test_a_constant_speed_is_shown_at_a_constant_rate_one_tick_late(seed):
    """At a constant cam speed samples are shown at a constant rate.

    There is a sample in every period of the display, at most one tick (interval between two cam
    states) and 50 ms behind the drive. Rig time advances in proportion to wall-clock time. This
    applies to any speed, number of ticks per turn, real-time factor and rate, if ticks are up to 15
    ms late.
    """
    chance = np.random.default_rng(seed)
    rpm, ticks_per_turn = 20.0 * 100.0 ** chance.uniform(), int(chance.choice([1, 2, 12, 72]))
    factor, rate = float(chance.choice([0.2, 0.5, 1.0, 2.0, 20.0])), float(chance.uniform(20, 200))
    tick = 60.0 / rpm / ticks_per_turn / factor
    count = max(6, round(2.0 / tick))
    made = ticks([rpm] * count, ticks_per_turn)
    jitter = lambda: chance.uniform(0.0, 0.5 * MARGIN_S)  # noqa: E731
    wall, rig, delay = play(made, factor, rate, jitter, settling_ticks=count // 2)
    assert len(wall) > 10
    np.testing.assert_allclose(np.diff(wall), 1.0 / rate, rtol=0, atol=1e-9)
    assert delay.min() > 0.0 and delay.max() <= tick + 0.05
    frame = max(1, round(0.05 * rate))  # number of samples in a frame at 20 Hz
    advance = (rig[frame:] - rig[:-frame]) / (wall[frame:] - wall[:-frame]) / factor
    sample = 1.0 / RATE / (wall[frame] - wall[0]) / factor
    assert np.abs(advance - 1.0).max() <= 0.05 + sample


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(15))
def test_a_change_of_speed_makes_no_pause(seed):
    """If the cam speed changes up to tenfold, each display period has a sample.

    The delay is at most the longest tick (interval between two cam states) and 50 ms.
    """
    chance, factor = np.random.default_rng(seed // 3), (0.5, 1.0, 3.0)[seed % 3]
    made = ticks(np.repeat(chance.uniform(60.0, 600.0, 6), 2), 1)
    wall, rig, delay = play(made, factor, 100.0, settling_ticks=1)
    np.testing.assert_allclose(np.diff(wall), 0.01, rtol=0, atol=1e-9)
    assert (np.diff(rig) > 0.0).all()
    longest = max(t.end.time_ns - t.start.time_ns for t in made) / NS / factor
    assert delay.max() <= longest + 0.05


def test_the_playback_stops_and_continues_with_the_drive():
    """The playback stops at the last sample of the last tick, and later continues.

    A tick is the interval between two cam states. No sample is shown twice.
    """
    made, playback, factor = ticks([240.0] * 6, 1), Playback(RATE), 1.0
    for tick in made[:3]:
        playback.add(tick, factor, tick.end.time_ns / NS, tick.end.time_ns / NS)
    results = [show(playback, wall_time) for wall_time in np.arange(0.75, 5.0, 0.01)]
    tick, sample = [result for result in results if result is not None][-1]
    assert tick is made[2] and sample == made[2].rows.shape[1] - 1
    assert results[-1] is None
    playback.add(made[3], factor, 10.0, 10.0)
    tick, sample = show(playback, 10.01)
    assert tick is made[3] and sample < 0.05 * RATE


def test_a_query_of_several_times_gives_the_samples_of_single_queries():
    """A query of several times in a tick gives the same samples as single queries.

    A tick is the interval between two cam states.
    """
    made, wall_times = ticks([100.0, 300.0], 1), 0.9 + 0.01 * np.arange(16)
    playback, single = Playback(RATE), Playback(RATE)
    for tick, received_at in zip(made, (0.6, 0.8), strict=True):
        for target in (playback, single):
            target.add(tick, 1.0, received_at, received_at)
    samples = playback.samples_at(wall_times)
    expected = [show(single, wall_time) for wall_time in samples.wall_times]
    assert [tick for tick, _ in expected] == [samples.tick] * len(expected)
    np.testing.assert_array_equal(samples.indices, [sample for _, sample in expected])


def test_the_newest_of_several_ticks_at_once_is_shown():
    """If several ticks arrive together, only the newest is shown.

    A tick is the interval between two cam states, with its samples.
    """
    made, playback = ticks([220.0] * 18, 1), Playback(RATE)
    for n, tick in enumerate(made):
        playback.add(tick, 1.0, 50.0 + 0.005 * n, 50.0 + 0.005 * n)
    tick, sample = show(playback, 50.2)
    assert tick is made[-1] and sample > 0
