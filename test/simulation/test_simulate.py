"""The scene in one process: every tick heard, and the same whatever the ticks."""

import numpy as np
import pytest

from cam_rig.acoustics import level_db, steady_power
from cam_rig.dynamics import MODELS
from cam_rig.simulation.schedule import cam_states, tick_count
from cam_rig.simulation.simulate import FollowerSimulator, simulate, step_levels


def levels_of(loaded):
    return step_levels(simulate(loaded), loaded.scene.program.settle_turns.si)


def test_every_tick_is_heard(make_loaded_scene):
    """One pressure a tick, in order, each above the background."""
    loaded = make_loaded_scene(ticks_per_turn=3)
    heard = list(simulate(loaded))
    assert len(heard) == tick_count(loaded.scene)
    states = list(cam_states(loaded.scene))
    assert [tick.start for tick in heard] == states[:-1]
    assert [tick.stop_ns for tick in heard] == [state.time_ns for state in states[1:]]
    for tick in heard:
        assert tick.pressure**2 >= loaded.radiation.background_power(tick.start.speed)


@pytest.mark.parametrize("sample_rate", [8000, 48_000])
def test_levels_do_not_depend_on_the_ticks(make_loaded_scene, sample_rate):
    """One or seven ticks a turn: the same step levels within 1e-2 dB, with jumps at 600 rpm."""
    one, seven = (
        levels_of(
            make_loaded_scene(
                ticks_per_turn=n, sample_rate=sample_rate, speeds=[200, 300, 400, 600]
            )
        )
        for n in (1, 7)
    )
    assert one.keys() == seven.keys() == {"poly345", "bezier15"}
    for cam, steps in one.items():
        assert len(steps) == 4
        for speed, level in steps.items():
            assert seven[cam][speed] == pytest.approx(level, abs=1e-2)


def test_levels_are_the_steady_ones(make_loaded_scene):
    """Where the follower keeps contact a step's level is the exact steady one, to 1e-2 dB."""
    loaded = make_loaded_scene(sample_rate=48_000, turns=4, settle_turns=2)
    for cam, steps in levels_of(loaded).items():
        for speed, level in steps.items():
            power = steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, speed)
            assert level == pytest.approx(float(level_db(np.sqrt(power))), abs=1e-2)


def test_twice_the_same(make_loaded_scene):
    """A run repeated gives the same bits."""
    loaded = make_loaded_scene(speeds=[600])
    pressures = [[tick.pressure for tick in simulate(loaded)] for _ in range(2)]
    assert pressures[0] == pressures[1]


def test_no_impulse_is_lost(make_loaded_scene):
    """Over a scene, impulses in the blocks are those of the events: each landing is heard.

    A change of cam puts the follower down on the new one; an impulse that fell after the last
    sample on the old one waits for the next block all the same. At 670 rpm and 100 Hz there is one.
    """
    loaded = make_loaded_scene(speeds=[670], sample_rate=100)
    bench = FollowerSimulator(MODELS["one_mass"], loaded.follower, 100, loaded.laws)
    due = shown = pending = 0.0
    for state in cam_states(loaded.scene):
        turned = bench.turn_to(state)
        if turned is not None:
            due += sum(event.impulse for event in turned[1].events)
            shown += float(turned[1].rows[5].sum())
            pending = turned[0].pending_impulse
    assert due > 1.0
    assert shown + pending == pytest.approx(due, rel=1e-12)


def test_first_state_only_begins_a_tick(make_loaded_scene):
    """One state is no tick."""
    loaded = make_loaded_scene()
    bench = FollowerSimulator(MODELS["one_mass"], loaded.follower, 8000, loaded.laws)
    assert bench.turn_to(next(iter(cam_states(loaded.scene)))) is None


def ramped(**changes):
    """A program that reaches every speed in 0.4 s from the one before, from rest at first."""
    return {
        "speeds": {"assumed": [200, 300], "unit": "rpm"},
        "turns": {"assumed": 3, "unit": "turns"},
        "settle_turns": {"assumed": 1, "unit": "turns"},
        "ramp": {"assumed": 0.4, "unit": "s"},
    } | changes


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "elastic_stem"])
def test_levels_along_ramps_are_left_out(make_loaded_scene, model):
    """A scene with ramps has levels of the held speeds alone, and they are the steady ones."""
    loaded = make_loaded_scene(program=ramped(), model=model, sample_rate=24_000)
    heard = list(simulate(loaded))
    assert len(heard) == tick_count(loaded.scene)
    assert sum(not tick.steady for tick in heard) == tick_count(loaded.scene) - 2 * 2 * 3
    levels = step_levels(heard, 1.0)
    held = [float(speed) for speed in loaded.scene.program.speeds.si_list]
    assert {cam: list(steps) for cam, steps in levels.items()} == {
        "poly345": held,
        "bezier15": held,
    }
    for cam, steps in levels.items():
        for speed, level in steps.items():
            power = steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, speed)
            close = 2e-2 if model != "elastic_stem" else 0.1  # there the stem rings
            assert level == pytest.approx(float(level_db(np.sqrt(power))), abs=close)


def test_ramps_do_not_depend_on_the_ticks(make_loaded_scene):
    """One or nine ticks a turn: the samples of the whole run are the same to rounding."""
    rows = []
    for ticks in (1, 9):
        loaded = make_loaded_scene(program=ramped(ticks_per_turn=ticks))
        follower = FollowerSimulator.of(loaded)
        blocks = [follower.turn_to(state) for state in cam_states(loaded.scene)]
        # the ticks of a held speed end at whole nanoseconds, which differ
        first = [block for _, block in filter(None, blocks) if block.interval.stop_ns <= 4 * 10**8]
        rows.append(np.hstack([block.rows for block in first]))
    assert rows[0].shape == rows[1].shape == (6, 3200)
    size = np.abs(rows[0]).max(axis=1)
    assert (np.abs(rows[1] - rows[0]).max(axis=1)[:5] < 1e-10 * size[:5]).all()
