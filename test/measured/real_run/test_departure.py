"""Noise is told from a departure: by what differs from turn to turn."""

import numpy as np
import pytest

from cam_rig.laws import Law
from cam_rig.measured.real_run.deviation import PairedSignal, PairedStep, departure, lost_contact
from cam_rig.units import TURN

RATE, RPM, TURNS = 2000.0, 300.0, 20
TIME = np.arange(int(TURNS * 60.0 / RPM * RATE)) / RATE
ANGLE = TIME * RPM * TURN / 60.0 + 0.3


def pair(difference, model=None):
    model = 50.0 + 40.0 * np.cos(ANGLE) if model is None else model
    return PairedSignal(TIME, ANGLE, model + difference, model)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ["even", "in proportion"])
def test_noise_is_found_beside_a_departure(seed, kind):
    """Even noise and noise in proportion to the force, beside a wave of as much: both are told."""
    rng = np.random.default_rng(seed)
    size = 1.0 if kind == "even" else np.abs(np.cos(ANGLE))
    noise = size * rng.normal(size=TIME.size)
    alone, both = departure(pair(noise), False), departure(pair(noise + np.sin(3.0 * ANGLE)), False)
    true = float(np.sqrt(np.mean(noise**2)))
    assert alone.noise == pytest.approx(true, rel=0.1) and alone.within
    assert both.noise == pytest.approx(true, rel=0.1) and not both.within
    assert both.systematic == pytest.approx(np.sqrt(0.5), rel=0.15)


def test_the_largest_difference_is_of_the_mean_over_the_turns():
    """A bump of 3 N at 200° under noise of 1 N: its place to a part of the turn, its sign too."""
    rng = np.random.default_rng(7)
    away = np.remainder(np.degrees(ANGLE) - 200.0 + 180.0, 360.0) - 180.0
    found = departure(pair(rng.normal(size=TIME.size) - 3.0 * np.exp(-((away / 8.0) ** 2))), False)
    assert found.degrees == pytest.approx(200.0, abs=5.0)
    assert found.largest == pytest.approx(-3.0, abs=0.7)


def test_a_model_whose_turns_differ_is_told_from_one_that_jumps_alike_in_each():
    """A force that is lost at one angle in each turn, and one that is lost within a quarter."""
    rng = np.random.default_rng(5)
    noise = rng.normal(size=TIME.size)
    inside, turn = np.remainder(np.degrees(ANGLE), 360.0), np.floor(ANGLE / TURN).astype(int)
    places = np.full(TURNS + 2, 200.0)
    alike = np.where(np.abs(inside - places[turn]) < 20.0, 0.0, 50.0)
    places += rng.uniform(-45.0, 45.0, places.size)
    differing = np.where(np.abs(inside - places[turn]) < 20.0, 0.0, 50.0)
    assert not departure(pair(noise, alike), False).restless
    assert departure(pair(noise, differing), False).restless


def test_exactly_driven_there_is_no_noise():
    """The largest difference is that of one sample, and rounding is told from more."""
    difference = np.zeros_like(TIME)
    difference[777] = 1e-6
    found = departure(pair(difference), True)
    assert (found.noise, found.largest) == (0.0, pytest.approx(1e-6))
    assert found.degrees == pytest.approx(np.degrees(ANGLE[777]) % 360.0) and not found.within
    assert departure(pair(difference * 1e-6), True).within


def law_of_dwell():
    return Law("dwell", np.array([0.0, TURN]), np.zeros((1, 1)) + np.array([[1e-3]]))


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_events_are_found_where_the_force_is_lost(noise):
    """From 100° to 150° of each turn; measured 2° later: counts, shift in ms and in degrees."""
    rng = np.random.default_rng(3)
    inside = np.remainder(np.degrees(ANGLE), 360.0)

    def force(late):
        off = (inside > 100.0 + late) & (inside < 150.0 + late)
        return np.where(off, 0.0, 30.0 + 10.0 * np.cos(ANGLE))

    model = force(0.0)
    both = PairedSignal(TIME, ANGLE, force(2.0) + noise * rng.normal(size=TIME.size), model)
    found = lost_contact(PairedStep("dwell", RPM, TURNS, None, both), law_of_dwell())
    assert found.measured == found.model == 1.0
    assert found.degrees == pytest.approx(2.0, abs=0.6)  # readings are 0.9° apart
    assert found.shift * 360.0 * RPM / 60.0 == pytest.approx(found.degrees)


def test_a_small_force_on_a_dwell_is_no_flight_for_its_noise():
    """12 N of preload under noise of 3 N falls below 4 standard deviations every other reading."""
    rng = np.random.default_rng(3)
    model = 12.0 + 90.0 * np.clip(np.sin(ANGLE), 0.0, None)
    both = PairedSignal(TIME, ANGLE, model + 3.0 * rng.normal(size=TIME.size), model)
    found = lost_contact(PairedStep("dwell", RPM, TURNS, None, both), law_of_dwell())
    assert found.model == 0.0 and found.measured < 0.5
