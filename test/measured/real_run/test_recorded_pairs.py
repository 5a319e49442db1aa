"""A recording against a model that was driven with its own states: what theory says, exactly."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.measured.real_run.comparison import compare_steps
from cam_rig.measured.real_run.pairs import RecordedPairs
from cam_rig.measured.real_run.sentences import sentences
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import simulate, turned_ticks
from cam_rig.units import RPM, TURN

from .bench import with_follower


def random_law(seed):
    """A smooth law of three pieces, C3 at each joint as half the ordinates are the neighbour's."""
    random = np.random.default_rng(seed)
    breaks = np.array([0.0, *np.sort(random.uniform(0.8, TURN - 0.8, 2)), TURN])
    places = random.uniform(0.0, 0.02, 3)
    ordinates = np.array([[places[i]] * 4 + [places[(i + 1) % 3]] * 4 for i in range(3)]).T
    return Law("poly345", breaks, ordinates)


def random_rig(loaded, seed):
    """Another mass, damping and spring, and a preload that holds the follower on any cam."""
    random = np.random.default_rng(100 + seed)
    names = ("mass", "spring_stiffness", "damping")
    factors = dict(zip(names, random.uniform(0.5, 2.0, 3).tolist(), strict=True))
    return with_follower(loaded, preload=80.0, **factors)


def recorded(loaded):
    """What a bag of a scene's run has: ticks, states, pressures by the end of the tick."""
    pressures = {tick.stop_ns: tick.pressure for tick in simulate(loaded)}
    return list(turned_ticks(loaded)), list(cam_states(loaded.scene)), pressures


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "elastic_stem", "two_mass"])
def test_a_run_is_its_own_scene_s(make_loaded_scene, model):
    """Driven with the same states, each sample, event and level is the same number."""
    cams = ["poly345", "cycloidal"]
    loaded = make_loaded_scene(cams=cams, model=model, rig="paper_table2", speeds=[200, 450])
    pairs = RecordedPairs(loaded)
    rows = compare_steps(pairs.steps(*recorded(loaded)), loaded.laws)
    assert [(row.cam, row.rpm) for row in rows] == [(c, r) for c in cams for r in (200.0, 450.0)]
    for row in rows:
        assert row.turns == pytest.approx(2.0, abs=1e-3)
        assert row.lift.rms == row.force.rms == row.lift.largest == row.force.largest == 0.0
        assert row.contact.measured == row.contact.model and row.contact.shift in (None, 0.0)
        assert row.level_difference == 0.0 and row.agrees
    assert pairs.lost == 0
    assert sentences(rows)[:2] == [
        f"The {name} is that of the model, to rounding, at every speed."
        for name in ("lift", "force")
    ]


@pytest.mark.parametrize(("seed", "model"), [(0, "kinetostatic"), (1, "one_mass")])
def test_a_heavier_follower_takes_its_mass_times_its_acceleration_more(
    make_loaded_scene, seed, model
):
    """In contact F = m ω² s'' + c ω s' + k s + F₀, so ΔF = Δm ω² s'' at every sample."""
    loaded = make_loaded_scene(cams=["poly345"], model=model, speeds=[60, 120], sample_rate=2000)
    law = random_law(seed)
    loaded = random_rig(replace(loaded, laws={"poly345": law}), seed)
    heavy = with_follower(loaded, mass=1.1)
    more = heavy.follower.mass - loaded.follower.mass
    for step in RecordedPairs(loaded).steps(*recorded(heavy)):
        assert step.force.model.min() > 0.0
        expected = more * (step.rpm * RPM) ** 2 * law(np.remainder(step.force.angle, TURN), 2)
        scale = np.abs(expected).max()
        assert scale > 0.1
        np.testing.assert_allclose(step.force.difference, expected, rtol=0, atol=1e-9 * scale)
        np.testing.assert_allclose(step.lift.difference, 0.0, rtol=0, atol=1e-15)


def test_the_largest_departure_is_named_with_its_place(make_loaded_scene):
    """Speed and angle at which the heavier follower's inertia is largest."""
    loaded = make_loaded_scene(cams=["poly345"], speeds=[150, 260], sample_rate=8000)
    loaded = random_rig(loaded, 3)
    heavy, law = with_follower(loaded, mass=1.1), loaded.laws["poly345"]
    rows = compare_steps(RecordedPairs(loaded).steps(*recorded(heavy)), loaded.laws)
    most = np.abs(law(np.linspace(0.0, TURN, 100_000), 2)).max()
    force, more = rows[-1].force, heavy.follower.mass - loaded.follower.mass
    assert abs(force.largest) == pytest.approx(more * (260.0 * RPM) ** 2 * most, rel=1e-3)
    assert abs(float(law(np.radians(force.degrees), 2))) == pytest.approx(most, rel=1e-3)
    words = f"The largest departure is of the force: {force.largest:+.3g} N at 260 rpm"
    assert sentences(rows)[0].startswith(f"{words}, θ = {force.degrees:.0f}°")


def test_lost_messages_are_left_out_and_what_is_left_is_the_same(make_loaded_scene):
    """Ticks without samples; states lost at one speed, and where the speed changes."""
    loaded = make_loaded_scene(
        cams=["poly345"], speeds=[200, 300], turns=8, ticks_per_turn=4, rig="paper_table2"
    )
    ticks, states, pressures = recorded(loaded)
    del ticks[20:23]
    pairs = RecordedPairs(loaded)
    rows = compare_steps(pairs.steps(ticks, states, pressures), loaded.laws)
    assert pairs.lost == 3
    assert [row.turns for row in rows] == [pytest.approx(7 - 3 / 4, abs=0.01), pytest.approx(7)]
    assert all(row.force.largest == row.lift.largest == 0.0 for row in rows)
    gone = {state.time_ns for state in states[31:34]}  # the step from 200 to 300 rpm among them
    ticks = [t for t in ticks if t.start.time_ns not in gone and t.interval.stop_ns not in gone]
    kept = [state for state in states if state.time_ns not in gone]
    rows = compare_steps(RecordedPairs(loaded).steps(ticks, kept, pressures), loaded.laws)
    assert rows[0].force.largest == 0.0
    # Put down anew after the loss, it settles within the scene's turn.
    assert rows[1].turns < 7.0 and abs(rows[1].force.largest) < 1e-6 * rows[1].force.scale


def test_a_cam_that_the_scene_has_not_is_named(make_loaded_scene):
    """With what the scene has."""
    other = make_loaded_scene(cams=["cycloidal"])
    run = recorded(other)
    scene = make_loaded_scene(cams=["poly345"])
    with pytest.raises(ConfigError, match=r"no cam 'cycloidal', which the bag holds.*poly345"):
        list(RecordedPairs(scene).steps(*run))
