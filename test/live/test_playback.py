"""What people see of a paced run: a tick behind the drive, evenly, and never back."""

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.live.playback import MARGIN_S, Playback, Tick
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, RPM

RATE = 12_000


def ticks(speeds, ticks_per_turn):
    """A tick at each speed (rpm), of the same angle each; row 1 has each sample's number."""
    found, states = [], [CamState(0, 0.0, speeds[0] * RPM, "tm21")]
    for now, then in pairwise([*speeds, speeds[-1]]):
        start = states[-1]
        time_ns = start.time_ns + round(60.0 * NS / now / ticks_per_turn)
        turned = now * RPM * (time_ns - start.time_ns) / NS
        states.append(CamState(time_ns, start.angle + turned, then * RPM, "tm21", start.turns))
        grid = start.until(states[-1]).grid(RATE)
        rows = grid.open_rows()
        rows[1:5] = grid.first + np.arange(grid.count, dtype=float)
        found.append(Tick(start, states[-1], rows))
    return found


def at(playback, wall):
    """Tick and sample that are shown at a wall time (s); None where there is nothing new."""
    found = playback.ahead(np.array([wall]))
    if found is None:
        return None
    playback.note_shown(found, 0)
    return found.tick, int(found.samples[0])


def shown(ticks, factor, rate, late=lambda: 0.0, settled=0):
    """Wall time, rig time (s) and how far behind the drive (s of wall time), of all that is shown.
    ``late`` tells how long each state takes to the follower."""
    playback, found, due = Playback(RATE), [], 0.0
    for n, tick in enumerate(ticks):
        came = tick.end.time_ns / NS / factor + late()
        while due < came:
            if (one := at(playback, due)) is not None:
                time, number = one[0].rows[:2, one[1]]
                assert number == round(time * RATE)
                if n > settled:
                    found.append((due, time, due - time / factor))
            due += 1.0 / rate
        playback.add(tick, factor, came, came)
    return np.array(found).T


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(16))
def test_a_speed_is_shown_evenly_a_tick_behind(seed):
    """Any speed, division, factor and rate, ticks up to 15 ms late: a message every period, whose
    stamps advance by what the speed says, at most a tick and 50 ms behind the drive."""
    chance = np.random.default_rng(seed)
    rpm, ticks_per_turn = 20.0 * 100.0 ** chance.uniform(), int(chance.choice([1, 2, 12, 72]))
    factor, rate = float(chance.choice([0.2, 0.5, 1.0, 2.0, 20.0])), float(chance.uniform(20, 200))
    tick = 60.0 / rpm / ticks_per_turn / factor
    count = max(6, round(2.0 / tick))
    made = ticks([rpm] * count, ticks_per_turn)
    jitter = lambda: chance.uniform(0.0, 0.5 * MARGIN_S)  # noqa: E731
    wall, rig, behind = shown(made, factor, rate, jitter, settled=count // 2)
    assert len(wall) > 10
    np.testing.assert_allclose(np.diff(wall), 1.0 / rate, rtol=0, atol=1e-9)
    assert behind.min() > 0.0 and behind.max() <= tick + 0.05
    over = max(1, round(0.05 * rate))  # a frame of 20 Hz
    advance = (rig[over:] - rig[:-over]) / (wall[over:] - wall[:-over]) / factor
    sample = 1.0 / RATE / (wall[over] - wall[0]) / factor
    assert np.abs(advance - 1.0).max() <= 0.05 + sample


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(15))
def test_another_speed_makes_no_pause(seed):
    """From tick to tick ten times as fast or as slow: a message every period all the same, and the
    cam is seen to turn as fast as the drive turns it."""
    chance, factor = np.random.default_rng(seed // 3), (0.5, 1.0, 3.0)[seed % 3]
    made = ticks(np.repeat(chance.uniform(60.0, 600.0, 6), 2), 1)
    wall, rig, behind = shown(made, factor, 100.0, settled=1)
    np.testing.assert_allclose(np.diff(wall), 0.01, rtol=0, atol=1e-9)
    assert (np.diff(rig) > 0.0).all()
    longest = max(t.end.time_ns - t.start.time_ns for t in made) / NS / factor
    assert behind.max() <= longest + 0.05


def test_a_drive_that_stops_leaves_its_last_sample_and_goes_on_from_it():
    """What is shown stands where the last tick ends, and no sample is shown twice."""
    made, playback, factor = ticks([240.0] * 6, 1), Playback(RATE), 1.0
    for tick in made[:3]:
        playback.add(tick, factor, tick.end.time_ns / NS, tick.end.time_ns / NS)
    found = [at(playback, wall) for wall in np.arange(0.75, 5.0, 0.01)]
    tick, sample = [one for one in found if one is not None][-1]
    assert tick is made[2] and sample == made[2].rows.shape[1] - 1
    assert found[-1] is None
    playback.add(made[3], factor, 10.0, 10.0)
    tick, sample = at(playback, 10.01)
    assert tick is made[3] and sample < 0.05 * RATE


def test_what_is_looked_up_ahead_is_what_is_shown():
    """Sixteen times at once, as far as they are of one tick: as one by one."""
    made, walls = ticks([100.0, 300.0], 1), 0.9 + 0.01 * np.arange(16)
    playback, single = Playback(RATE), Playback(RATE)
    for tick, came in zip(made, (0.6, 0.8), strict=True):
        for one in (playback, single):
            one.add(tick, 1.0, came, came)
    found = playback.ahead(walls)
    alone = [at(single, wall) for wall in found.walls]
    assert [tick for tick, _ in alone] == [found.tick] * len(alone)
    np.testing.assert_array_equal(found.samples, [sample for _, sample in alone])


def test_of_several_ticks_at_once_the_newest_is_shown():
    """Eighteen ticks that come at once: all but the last are known already."""
    made, playback = ticks([220.0] * 18, 1), Playback(RATE)
    for n, tick in enumerate(made):
        playback.add(tick, 1.0, 50.0 + 0.005 * n, 50.0 + 0.005 * n)
    tick, sample = at(playback, 50.2)
    assert tick is made[-1] and sample > 0
