"""Counting of whole turns and wrong angles of an encoder, for random runs.

The true angle of each run is known.
"""

import numpy as np
import pytest

from cam_rig.bag.foreign.turns import Counter, count_turns
from cam_rig.errors import BagError
from cam_rig.simulation.instruments import Signal
from cam_rig.units import TURN

RATE = 500.0


def run(rng, seconds=6.0, rate=RATE):
    """Return time stamps (s) and true angle (rad) of a cam with two speeds and a ramp.

    The speeds are random. The speed varies slightly within a turn, and the stamps may have jitter.
    """
    time = np.arange(0.0, seconds, 1.0 / rate)
    speeds = TURN * rng.uniform(0.5, 4.0, 2)
    ramp = np.clip((time - seconds / 2.0) / rng.uniform(0.05, 1.0), 0.0, 1.0)
    speed = speeds[0] + (speeds[1] - speeds[0]) * ramp
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))])
    angle += rng.uniform(0.0, TURN)
    angle += 0.02 * np.sin(angle)
    jitter = rng.choice([0.0, 0.1]) / rate
    return time + jitter * rng.uniform(-1.0, 1.0, time.size), angle


def as_read(angle, way):
    """Return the angles (rad) that an encoder of kind `way` reports, and its counter.

    `way` is for example "one turn" (wraps at 360°) or "int16" (integer counter). The counter is
    None for an encoder that is not an integer counter.
    """
    if way == "one turn":
        return np.remainder(angle, TURN), None
    if way == "half turns":
        return np.remainder(angle + TURN / 2.0, TURN) - TURN / 2.0, None
    if way == "two turns":
        return np.remainder(angle, 2.0 * TURN), None
    if way == "all turns":
        return angle, None
    bits, counts = {"int16": (16, 4096), "uint8": (8, 64), "uint16": (16, 65536)}[way]
    count, half = TURN / counts, 2 ** (bits - 1) * (not way.startswith("u"))
    number = np.floor(angle / count)
    return (np.remainder(number + half, 2**bits) - half) * count, Counter(count, 2**bits)


def spoiled(rng, value, kind):
    """Return the readings with up to eight groups of wrong values, and their indices.

    `kind` is "zeros", "random" (single values) or "runs" (up to five equal values in a row).
    """
    value, wrong = value.copy(), []
    for _ in range(rng.integers(1, 9)):
        first = int(rng.integers(value.size))
        length = 1 if kind != "runs" else int(rng.integers(1, 6))
        length = min(length, value.size - first)
        if wrong and min(abs(first - index) for index in wrong) < 30:
            continue
        wrong += range(first, first + length)
        level = {"zeros": 0.0, "runs": rng.uniform(-9.0, 9.0), "random": rng.uniform(-9.0, 9.0)}
        value[first : first + length] = level[kind]
    return value, np.array(sorted(wrong))


WAYS = ["one turn", "half turns", "two turns", "all turns", "int16", "uint8", "uint16"]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("seed", range(12))
def test_the_turns_are_those_of_the_cam(way, seed):
    """The counted angle of a correct encoder is the true angle plus a constant.

    This applies to each kind of encoder and to both senses of rotation. No reading is dropped.
    """
    rng = np.random.default_rng(seed)
    time, angle = run(rng)
    sign = rng.choice([-1.0, 1.0])
    value, counter = as_read(sign * angle, way)
    found = count_turns(Signal(time, value), "bag", counter)
    off = found.signal.value - angle
    assert not found.wrong.size
    assert np.ptp(off) < (1e-9 if counter is None else counter.count + 1e-9)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", ["zeros", "random", "runs"])
@pytest.mark.parametrize("seed", range(8))
def test_wrong_angles_are_dropped_and_the_others_kept(way, kind, seed):
    """Encoder angles that are wrong by more than 30° are dropped.

    Correct angles are never dropped. The remaining angles are the true angles plus a constant.
    """
    rng = np.random.default_rng(100 + seed)
    time, angle = run(rng, seconds=rng.choice([2.0, 20.0]))
    value, counter = as_read(angle, way)
    period = {"two turns": np.inf, "all turns": np.inf}.get(way, TURN)
    period = period if counter is None else counter.span
    value, wrong = spoiled(rng, value, kind)
    found = count_turns(Signal(time, value), "bag", counter)
    true, _ = as_read(angle, way)
    off = value - true
    if np.isfinite(period):
        off = np.remainder(off + period / 2.0, period) - period / 2.0
    surely = wrong[np.abs(off[wrong]) > TURN / 12.0]
    assert set(surely) <= set(found.wrong.tolist()) <= set(wrong.tolist())
    kept = np.setdiff1d(np.arange(time.size), np.union1d(found.wrong, wrong))
    places = np.searchsorted(found.signal.time, time[kept])
    residual = found.signal.value[places] - angle[kept]
    assert np.ptp(residual) < (1e-9 if counter is None else counter.count + 1e-9)
    if found.wrong.size:
        assert f"{found.wrong.size} wrong angles, at {time[found.wrong[0]]:.6g}" in " ".join(
            found.notes
        )


@pytest.mark.parametrize("way", ["one turn", "half turns"])
@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize("seed", range(6))
def test_angles_averaged_across_the_wrap_are_wrong(way, count, seed):
    """Averages of angles on both sides of an encoder's wrap are dropped as wrong.

    The mean of 359° and 1°, for example, is 180°. At least 90 % of such means are found, and no
    other reading is dropped.
    """
    rng = np.random.default_rng(seed)
    rate = rng.choice([150.0, 500.0, 1000.0])
    time, angle = run(rng, 10.0, rate)
    value, _ = as_read(angle, way)
    windows = np.lib.stride_tricks.sliding_window_view(value, count)
    mean, time = windows.mean(axis=1), time[count - 1 :]
    true = np.lib.stride_tricks.sliding_window_view(angle, count).mean(axis=1)
    crossed = np.flatnonzero(np.ptp(windows, axis=1) > TURN / 2.0)
    found = count_turns(Signal(time, mean), "bag")
    assert set(found.wrong.tolist()) <= set(crossed.tolist())
    assert found.wrong.size > 0.9 * crossed.size
    kept = np.setdiff1d(np.arange(time.size), np.union1d(found.wrong, crossed))
    residual = found.signal.value[np.searchsorted(found.signal.time, time[kept])] - true[kept]
    assert np.ptp(residual) < 1e-9


@pytest.mark.parametrize(("modulo", "turns"), [(16.0, 16.0), (10_000 / 4096, 10_000 / 4096)])
def test_a_counter_may_wrap_at_another_number_than_its_type(modulo, turns):
    """A counter may wrap at another value than the limit of its integer type.

    The angle continues there, within five counts. A note states the jump back in turns and the time
    of the first jump.
    """
    time = np.arange(4000) / 500.0
    count = TURN / 4096
    angle = TURN * 3.0 * time
    value = np.floor(np.remainder(angle, modulo * TURN) / count) * count
    found = count_turns(Signal(time, value), "bag", Counter(count, 2**32))
    assert np.ptp(found.signal.value - angle) < 5.0 * count
    first = time[np.flatnonzero(np.diff(value) < 0.0)[0] + 1]
    assert f"jumps back by {turns:.6g} turns, first at {first:.6g} s" in " ".join(found.notes)


@pytest.mark.parametrize(("counts", "modulo"), [(36_000, 36_000), (3600, 36_000), (1024, 60_000)])
@pytest.mark.parametrize("seed", range(3))
def test_a_counter_that_wraps_below_its_type_is_not_taken_as_full(counts, modulo, seed):
    """A uint16 counter may wrap below 65 536 without an error of whole turns.

    Hundredths of a degree, for example, wrap at 36 000. Each wrap may cost 5 counts.
    """
    time, true = run(np.random.default_rng(seed), 60.0)
    true = true * 5.0 if counts == 1024 else true
    count = TURN / counts
    value = np.remainder(np.floor(true / count), modulo) * count
    found = count_turns(Signal(time, value), "bag", Counter(count, 2**16))
    wraps = 1 + np.count_nonzero(np.diff(value) < 0.0) * (modulo == 60_000)
    error = found.signal.value - np.delete(true, found.wrong)
    assert np.ptp(error) < 5.0 * count * wraps


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("start", [0.0, 180.0])
def test_an_angle_in_degrees_is_not_taken_as_radians(sign, start):
    """An angle in degrees without its unit raises BagError that suggests :deg."""
    time, true = run(np.random.default_rng(4))
    degrees = sign * (np.remainder(np.degrees(true) + start, 360.0) - start)
    with pytest.raises(BagError, match=r"jumps by 360 rad at .*add :deg for an angle"):
        count_turns(Signal(time, degrees), "bag")


def test_a_cam_that_starts_and_stops_has_no_wrong_angle():
    """No reading is dropped if a cam starts suddenly, stops, or pauses for an hour.

    The readings are those of an encoder.
    """
    parts = [np.zeros(200), 0.3 * np.ones(300), np.zeros(200), 0.3 * np.ones(300), np.zeros(50)]
    angle = np.cumsum(np.concatenate(parts))
    time = np.arange(angle.size) / 100.0
    time[600:] += 3600.0
    for value in (angle, np.remainder(angle, TURN)):
        found = count_turns(Signal(time, value), "bag")
        assert not found.wrong.size and np.ptp(found.signal.value - angle) < 1e-9


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_counter_that_restarts_at_zero_after_a_pause_continues_forwards(sign):
    """The angle continues forwards if an encoder restarts at zero after a pause.

    At most one turn is added, because the true motion in the pause is unknown. A note states the
    jump and its time.
    """
    time = np.arange(2000) / 500.0
    angle = sign * TURN * 3.0 * time
    angle[1000:] -= angle[1000]
    time[1000:] += 3600.0
    found = count_turns(Signal(time, angle), "bag")
    value = found.signal.value
    assert not found.wrong.size and value.size == 2000
    np.testing.assert_allclose(np.delete(np.diff(value), 999), 0.006 * TURN, rtol=1e-9)
    assert 0.0 <= value[1000] - value[999] <= TURN
    assert np.isclose(np.remainder(value[-1] - sign * angle[-1] + 0.1, TURN), 0.1)
    assert "1 jumps back by 6 turns, first at 3602 s" in " ".join(found.notes)


@pytest.mark.parametrize(
    ("value", "error"),
    [
        (
            np.where(np.arange(400) % 5, np.arange(400) * 0.1, 0.0),
            r"wrong angles, at .*of 400; record",
        ),
        (np.sin(np.arange(400) / 30.0), "in one direction, got .* first reversal at 47 s"),
        (np.remainder(3.0 * np.arange(400), TURN), r"2\.1 readings per turn .*more than 3 are"),
        (np.remainder(TURN / 1.5 * np.arange(400), TURN), r"3 readings per turn .*more than 3"),
    ],
)
def test_an_impossible_motion_is_refused_with_its_time(value, error):
    """Angles of an impossible motion raise BagError.

    The motions have too many wrong angles, a reversal, or too few readings per turn. The error has
    the time of the fault, or the rate of the readings.
    """
    with pytest.raises(BagError, match=error):
        count_turns(Signal(np.arange(400.0), value), "bag")
