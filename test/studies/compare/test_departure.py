"""Tests of the difference between a measured and a model signal.

The scatter between turns at the same angle is noise. The mean over the turns is a systematic
deviation.
"""

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.laws import Law
from cam_rig.simulation.instruments import Signal
from cam_rig.studies.compare.deviation import PairedSignal, PairedStep, departure, lost_contact
from cam_rig.studies.compare.model_run import steady_stretches
from cam_rig.units import RPM, TURN

RATE, HELD, TURNS = 2000.0, 300.0, 20
TIME = np.arange(int(TURNS * 60.0 / HELD * RATE)) / RATE
ANGLE = TIME * HELD * TURN / 60.0 + 0.3


def pair(difference, model=None):
    model = 50.0 + 40.0 * np.cos(ANGLE) if model is None else model
    return PairedSignal(TIME, ANGLE, model + difference, model)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ["even", "in proportion"])
def test_noise_and_deviation_are_measured_together(seed, kind):
    """Noise and systematic deviation of a measured signal are separated.

    The deviation is that from the model. The noise is constant or proportional to the force, and is
    found within 10 %. The deviation is a sine, whose RMS is found within 15 %. Noise alone counts
    as agreement.
    """
    rng = np.random.default_rng(seed)
    size = 1.0 if kind == "even" else np.abs(np.cos(ANGLE))
    noise = size * rng.normal(size=TIME.size)
    alone, both = departure(pair(noise), False), departure(pair(noise + np.sin(3.0 * ANGLE)), False)
    true = float(np.sqrt(np.mean(noise**2)))
    assert alone.noise == pytest.approx(true, rel=0.1) and alone.within
    assert both.noise == pytest.approx(true, rel=0.1) and not both.within
    assert both.systematic == pytest.approx(np.sqrt(0.5), rel=0.15)


def test_the_largest_difference_is_of_the_mean_over_the_turns():
    """The reported largest difference is that of the mean over the turns.

    It has sign and angle. A bump of −3 N at 200° is found under noise of 1 N.
    """
    rng = np.random.default_rng(7)
    away = np.remainder(np.degrees(ANGLE) - 200.0 + 180.0, 360.0) - 180.0
    found = departure(pair(rng.normal(size=TIME.size) - 3.0 * np.exp(-((away / 8.0) ** 2))), False)
    assert found.degrees == pytest.approx(200.0, abs=5.0)
    assert found.largest == pytest.approx(-3.0, abs=0.7)


def test_only_a_model_whose_turns_differ_is_marked():
    """A model signal is marked `varies_by_turn` only if its turns differ.

    Here the force is lost at a different angle in each turn. It is not marked if the angle is
    always the same.
    """
    rng = np.random.default_rng(5)
    noise = rng.normal(size=TIME.size)
    inside, turn = np.remainder(np.degrees(ANGLE), 360.0), np.floor(ANGLE / TURN).astype(int)
    places = np.full(TURNS + 2, 200.0)
    alike = np.where(np.abs(inside - places[turn]) < 20.0, 0.0, 50.0)
    places += rng.uniform(-45.0, 45.0, places.size)
    differing = np.where(np.abs(inside - places[turn]) < 20.0, 0.0, 50.0)
    assert not departure(pair(noise, alike), False).varies_by_turn
    assert departure(pair(noise, differing), False).varies_by_turn


def test_an_exactly_driven_model_has_no_noise():
    """If the recorded exact angle drives the model, a difference is never noise.

    A single differing sample of 1e-6 is reported with its angle. One of 1e-12 is rounding and
    accepted.
    """
    difference = np.zeros_like(TIME)
    difference[777] = 1e-6
    found = departure(pair(difference), True)
    assert (found.noise, found.largest) == (0.0, pytest.approx(1e-6))
    assert found.degrees == pytest.approx(np.degrees(ANGLE[777]) % 360.0) and not found.within
    assert departure(pair(difference * 1e-6), True).within


def law_of_dwell():
    return Law("dwell", np.array([0.0, TURN]), np.zeros((1, 1)) + np.array([[1e-3]]))


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_events_are_found_at_the_loss_of_force(noise):
    """Lift-offs in a measured signal are found where the force falls to zero.

    The measured lift-off is 2° after that of the model. It is found within 0.6°, because readings
    are 0.9° apart. The cases are without and with noise.
    """
    rng = np.random.default_rng(3)
    inside = np.remainder(np.degrees(ANGLE), 360.0)

    def force(late):
        off = (inside > 100.0 + late) & (inside < 150.0 + late)
        return np.where(off, 0.0, 30.0 + 10.0 * np.cos(ANGLE))

    model = force(0.0)
    both = PairedSignal(TIME, ANGLE, force(2.0) + noise * rng.normal(size=TIME.size), model)
    found = lost_contact(PairedStep("dwell", HELD, TURNS, None, both), law_of_dwell())
    assert found.measured == found.model == 1.0
    assert found.degrees == pytest.approx(2.0, abs=0.6)  # readings are 0.9° apart
    assert found.shift * 360.0 * HELD / 60.0 == pytest.approx(found.degrees)


def test_noise_of_a_small_force_on_a_dwell_is_no_flight():
    """A small force with noise on a dwell is not taken for a loss of contact.

    The force is 12 N with noise of 3 N, so that every other reading is below 4 standard deviations.
    """
    rng = np.random.default_rng(3)
    model = 12.0 + 90.0 * np.clip(np.sin(ANGLE), 0.0, None)
    both = PairedSignal(TIME, ANGLE, model + 3.0 * rng.normal(size=TIME.size), model)
    found = lost_contact(PairedStep("dwell", HELD, TURNS, None, both), law_of_dwell())
    assert found.model == 0.0 and found.measured < 0.5


# -- motion of the cam from encoder counts: smooth, and within one count of each reading


COUNT = TURN / 1024


def counts(angle):
    return np.floor(angle / COUNT) * COUNT


def test_a_constant_speed_is_measured_over_all_turns():
    """A constant cam speed is found from encoder counts within a relative 2e-5.

    The angle error within a turn is below 0.05 counts, after subtracting the mean of half a count.
    """
    time = np.arange(20_000) / 2000.0
    speeds = np.repeat([200.0, 317.0, 450.0], [8000, 6000, 6000]) * RPM
    angle = np.cumsum(speeds) / 2000.0
    found = steady_stretches(Signal(time, counts(angle)), 3.0)
    assert [one.rpm for one in found] == pytest.approx([200.0, 317.0, 450.0], rel=2e-5)
    for stretch in found:
        assert stretch.is_uniform and stretch.largest < COUNT
        inside = (time >= stretch.knots[0]) & (time <= stretch.knots[-1])
        off = stretch.angle_at(time[inside]) - angle[inside]
        assert np.abs(off + 0.5 * COUNT).max() < 0.05 * COUNT


def test_a_speed_that_varies_within_the_turn_is_followed():
    """A speed that varies within the turn is found within 1 % RMS from encoder counts.

    It varies by 3 % twice per turn. Dividing the difference of two counts by the time would have an
    error of 15 %. The angle error is below half a count.
    """
    time = np.arange(12_000) / 2000.0
    mean = 300.0 * RPM
    angle = mean * time + 0.015 * np.sin(2.0 * mean * time)
    (stretch,) = steady_stretches(Signal(time, counts(angle)), 3.0)
    assert not stretch.is_uniform
    inside = (time > stretch.knots[1]) & (time < stretch.knots[-2])
    off = stretch.angle_at(time[inside]) - angle[inside] + 0.5 * COUNT
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


def test_short_gaps_do_not_change_the_motion():
    """Randomly lost encoder readings do not change the speed that is found.

    A gap of half a second ends the stretch of constant speed and starts another.
    """
    time = np.arange(12_000) / 2000.0
    angle = 300.0 * RPM * time
    kept = np.random.default_rng(4).random(time.size) > 0.5
    (stretch,) = steady_stretches(Signal(time[kept], counts(angle[kept])), 3.0)
    assert stretch.rpm == pytest.approx(300.0, rel=2e-5) and stretch.turns > 28.0
    kept &= (time < 3.0) | (time > 3.5)
    first, second = steady_stretches(Signal(time[kept], counts(angle[kept])), 3.0)
    assert first.knots[-1] <= 3.0 and second.knots[0] >= 3.5


def test_a_ramp_is_no_steady_speed():
    """A speed ramp of a measured run is excluded from the comparison.

    The constant speeds before and after it are found.
    """
    time = np.arange(16_000) / 2000.0
    speed = np.interp(time, [0.0, 3.0, 5.0, 8.0], np.array([200.0, 200.0, 400.0, 400.0]) * RPM)
    found = steady_stretches(Signal(time, counts(np.cumsum(speed) / 2000.0)), 4.0)
    assert [one.rpm for one in found] == pytest.approx([200.0, 400.0], rel=5e-3)
    assert found[0].knots[-1] < 3.4 and found[1].knots[0] > 4.7
