"""Tests of the alignment of a bench's readings with the model.

Each kind of instrument error has a test.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from cam_rig.errors import BagError, ConfigError
from cam_rig.simulation.instruments import Signal
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import simulate, simulate_ticks
from cam_rig.studies.compare.comparison import (
    Origin,
    alignment_numbers,
    common_frequency,
    compare_steps,
    largest_deviations,
    turn_warnings,
    warnings_of,
)
from cam_rig.studies.compare.pairs import RecordedPairs
from cam_rig.studies.compare.study import RunComparison
from cam_rig.units import RPM, TURN

from ..orders.test_orders import random_law
from .bench import COUNTS, OFFSET_DEG, compared, measured, with_follower

#: Mean angle in ° by which an encoder reading is too small: the offset plus half a count, because
#: an encoder rounds down.
BEHIND = OFFSET_DEG + 180.0 / COUNTS


@pytest.fixture
def scene(make_loaded_scene):
    """Function that returns a scene of a cam at given speeds.

    At each speed it has 12 turns, of which the first 2 are for settling.
    """

    def make(cam="poly345", speeds=(200, 300), **changes):
        settings = {"turns": 12, "transient_turns": 2, "sample_rate": 8000, **changes}
        return make_loaded_scene(cams=[cam], speeds=list(speeds), **settings)

    return make


@pytest.mark.parametrize(
    ("cam", "speeds"), [("poly345", (200, 300, 400)), ("tm21", (250, 380, 480))]
)
def test_a_bench_of_the_scene_agrees_within_the_noise(scene, cam, speeds):
    """Readings of a bench that has the scene's rig agree with the model at each speed.

    The comparison finds angle offset, clock drift and noise of the bench. These are 3°, 200 ppm, 1
    % of the force, 10 µm and 1024 counts per turn.
    """
    loaded = scene(cam, speeds)
    pairs, rows = compared(measured(loaded, slow=200e-6), loaded)
    found = pairs.alignment
    assert np.degrees(found.offset) == pytest.approx(BEHIND, abs=0.05)
    assert found.drift == pytest.approx(200e-6, abs=4e-6) and found.delay == 0.0
    assert [row.rpm for row in rows] == pytest.approx(list(speeds), rel=1e-4)
    for row in rows:
        assert row.agrees
        assert row.lift.noise == pytest.approx(10e-6, rel=0.15)
        assert row.lift.rms == pytest.approx(10e-6, rel=0.05)
        assert abs(row.level_difference) < 0.02
        assert row.contact.measured == pytest.approx(row.contact.model, abs=0.5)
        if row.contact.model > 0.5:
            assert abs(row.contact.degrees) < 0.3
    numbers = {one.quantity: one.value for one in alignment_numbers(pairs)}
    assert numbers["sensor_clock_drift"] == found.drift
    assert numbers["encoder_counts"] == pytest.approx(1024.0)
    for largest in largest_deviations(rows)[:2]:
        assert largest.agreeing == largest.speeds == len(speeds)
    assert list(warnings_of(pairs)) == []


def test_turns_that_differ_are_no_noise(scene):
    """Measured turns that differ from each other in a repeated pattern are not noise.

    A warning reports them. The doubled encoder angle makes every other turn contain the other half
    of the lift, which is such a difference. A lift that turns 1 % slower than the angle is reported
    too.
    """
    loaded = scene()
    run = measured(loaded)
    _, rows = compared(replace(run, angle=replace(run.angle, value=2.0 * run.angle.value)), loaded)
    assert rows and not any(row.agrees or row.lift.within for row in rows)
    assert "differ from each other by" in "".join(turn_warnings(rows))
    pairs, rows = compared(run, loaded)
    assert not turn_warnings(rows) and "counts per turn" not in "".join(warnings_of(pairs))
    pairs, _ = compared(
        replace(run, angle=replace(run.angle, value=1.01 * run.angle.value)), loaded
    )
    assert "The lift turns 0.99 % slower than the angle" in "".join(warnings_of(pairs))


def test_a_heavier_follower_differs_by_more_than_the_noise(scene):
    """A heavier follower on the bench is detected by the force difference Δm ω² s''.

    It is compared at its largest value, within 1.5 standard deviations of the noise. The lift still
    agrees, because in contact it does not depend on the mass.
    """
    loaded = scene(speeds=(200, 350))
    heavy = with_follower(loaded, mass=1.25)
    _, rows = compared(measured(heavy, force_noise=0.005), loaded)
    more = heavy.follower.mass - loaded.follower.mass
    row = rows[-1]
    assert row.lift.within and not row.force.within
    # The mean over 2° has a fifth of the noise of a reading.
    near = np.radians(row.force.degrees + np.linspace(-1.0, 1.0, 21))
    expected = more * (row.rpm * RPM) ** 2 * float(loaded.laws["poly345"](near, 2).mean())
    assert row.force.largest == pytest.approx(expected, abs=1.5 * row.force.noise)
    assert abs(expected) > 5.0 * row.force.noise
    lift, force, *_ = largest_deviations(rows)
    assert (lift.agreeing, force.agreeing) == (2, 0) and force.rpm == row.rpm


def test_the_events_of_a_heavier_follower_are_shifted(scene):
    """A heavier follower on the bench lands later, as detected above the jump speed.

    Angle offset and clock are still found, because they follow from the lower speeds, at which the
    follower stays in contact.
    """
    loaded = scene("tm21", (250, 300, 400, 450))
    pairs, rows = compared(measured(with_follower(loaded, mass=1.1), slow=200e-6), loaded)
    assert np.degrees(pairs.alignment.offset) == pytest.approx(BEHIND, abs=0.05)
    assert rows[0].lift.within and not any(row.lift.within for row in rows[2:])
    assert all(row.contact.degrees > 1.0 for row in rows[2:])  # the heavier follower flies farther


def test_backlash_of_the_gauge_is_identified(scene):
    """A backlash of 0.2 mm in the bench's lift gauge is identified within 1 µm.

    The angle offset is unaffected. The lift differs from the model by half the backlash.
    """
    loaded = scene()
    pairs, rows = compared(measured(loaded, backlash=0.2e-3), loaded)
    assert np.degrees(pairs.alignment.offset) == pytest.approx(BEHIND, abs=0.05)
    assert all(abs(row.lift.largest) == pytest.approx(1e-4, rel=0.15) for row in rows)
    assert all(row.force.within and not row.lift.within for row in rows)
    numbers = {one.quantity: one.value for one in alignment_numbers(pairs)}
    assert numbers["lift_hysteresis"] == pytest.approx(-0.2e-3, abs=1e-6)


def test_the_frequency_of_a_ringing_load_cell_is_identified(scene):
    """The natural frequency of a load cell (150 Hz) is found from the difference.

    It is the same at all speeds. A wrong mass gives a difference whose frequency rises with the
    speed, so that no common frequency is reported.
    """
    loaded = scene(speeds=(250, 300, 350))
    w, damping = 2.0 * np.pi * 150.0, 0.03

    def cell(time, force):
        system = TransferFunction([w * w], [1.0, 2.0 * damping * w, w * w])
        return lsim(system, force, time - time[0])[1]

    _, rows = compared(measured(loaded, sense=cell), loaded)
    peaks = [row.peak_hz for row in rows]
    assert peaks[1:] == pytest.approx([150.0] * 2, abs=7.0)  # 7 Hz: the width of an order
    assert common_frequency([row.rpm for row in rows], peaks) == pytest.approx(150.0, abs=7.0)
    _, rows = compared(measured(with_follower(loaded, mass=1.3)), loaded)
    peaks = [row.peak_hz for row in rows]
    assert common_frequency([row.rpm for row in rows], peaks) is None


def test_late_stamps_are_distinguished_from_an_offset(scene):
    """Sensor stamps that are 2 ms late are distinguished from an angle offset.

    2 ms are 2.4° at 200 rpm and 4.8° at 400 rpm, while the offset is 3° at each speed.
    """
    loaded = scene(speeds=(200, 300, 400))
    pairs, rows = compared(measured(loaded, late=2e-3), loaded)
    assert pairs.alignment.delay == pytest.approx(-2e-3, abs=2e-5)
    assert np.degrees(pairs.alignment.offset) == pytest.approx(BEHIND, abs=0.05)
    numbers = {one.quantity: one.value for one in alignment_numbers(pairs)}
    assert numbers["sensor_stamp_delay"] == pairs.alignment.delay
    assert all(row.agrees for row in rows)


@pytest.mark.slow
def test_a_coarse_encoder_causes_no_clock_correction(scene):
    """The error of a coarse encoder near a speed ramp is not taken for a clock error.

    With 256 counts per turn the angle is known to half a count. Drift and delay of the clock must
    stay exactly 0.
    """
    loaded = scene("cycloidal", (235.5, 223.7, 135.9), turns=6, transient_turns=0, ramp=0.81)
    for seed in range(3):
        pairs, _ = compared(measured(loaded, seed=seed, counts=256), loaded)
        assert pairs.alignment.drift == pairs.alignment.delay == 0.0


def test_a_given_offset_is_kept_and_an_assumed_offset_is_reported(scene):
    """A given angle offset is used, and one that cannot be found is assumed to be 0.

    Without measured lifts it cannot be found. A warning reports the assumption. The force then
    differs, because the true offset is 3°.
    """
    loaded = scene()
    run = measured(loaded)
    given, _ = compared(run, loaded, np.radians(BEHIND))
    assert given.alignment.offset == np.radians(BEHIND)
    assert alignment_numbers(given)[0].origin is Origin.GIVEN
    blind, (row, _) = compared(replace(run, lift=None), loaded)
    assert blind.alignment.offset == 0.0
    assert alignment_numbers(blind)[0].origin is Origin.ASSUMED
    assert any("The lift was not measured, so" in line for line in warnings_of(blind))
    assert row.lift is None and not row.force.within  # the force shows the 3°


def test_a_wrong_unit_and_a_pulling_force_are_reported(scene):
    """Warnings report a lift in a wrong unit and a force of the wrong sign.

    Here mm are read as m. A contact force is never negative, because a cam only pushes.
    """
    loaded = scene()
    run = measured(loaded)
    odd = {"lift": replace(run.lift, value=1e3 * run.lift.value)}
    odd["force"] = replace(run.force, value=-run.force.value)
    said = list(warnings_of(compared(replace(run, **odd), loaded)[0]))
    whole = 1e3 * loaded.laws["poly345"].lift
    words = f"over {1e3 * whole:.3g} mm, that of cam poly345 over {whole:.3g} mm: check"
    assert any(words in line for line in said)
    assert any("change its sign" in line for line in said)
    assert list(warnings_of(compared(run, loaded)[0])) == []


def thinned(run, kept):
    """Return a measured run with only the lift and force readings that `kept` selects."""
    signals = run.lift, run.force
    lift, force = (replace(one, time=one.time[kept], value=one.value[kept]) for one in signals)
    return replace(run, lift=lift, force=force)


def test_slow_sensors_identify_the_offset(scene):
    """The angle offset is found from sensors with five to seven readings per turn.

    The error is below 0.15°. The readings of all turns are combined.
    """
    loaded = scene("tm21", turns=16)
    pairs, rows = compared(thinned(measured(loaded), slice(None, None, 40)), loaded)
    assert np.degrees(pairs.alignment.offset) == pytest.approx(BEHIND, abs=0.15)
    assert all(row.agrees for row in rows)


def test_readings_without_errors_agree_with_the_model(scene):
    """Bench readings without errors agree with the model within 1e-9 m and 1e-3 N.

    These are the errors of the model's sampling. The angle offset is exact within 1e-6°.
    """
    loaded = scene("tm21", (200, 350))
    pairs, rows = compared(measured(loaded, counts=0, lift_noise=0.0, force_noise=0.0), loaded)
    assert pairs.count == 0.0
    assert np.degrees(pairs.alignment.offset) == pytest.approx(OFFSET_DEG, abs=1e-6)
    for row in rows:
        assert row.agrees and row.lift.rms < 1e-9 and row.force.rms < 1e-3


def test_lost_readings_are_left_out(scene):
    """Times without sensor readings are excluded from the comparison.

    The other samples agree. Lost encoder readings divide the run into two stretches of steady
    speed.
    """
    loaded = scene()
    run = measured(loaded)
    time = run.angle.time
    kept = (time <= 2.0) | (time >= 2.5)
    pairs, rows = compared(thinned(run, kept), loaded)
    assert len(pairs.stretches) == 2
    step = next(pairs.steps())
    assert not ((step.force.time > 2.001) & (step.force.time < 2.499)).any()
    assert all(row.agrees for row in rows)
    angle = Signal(time[kept], run.angle.value[kept], run.angle.source)
    pairs, rows = compared(replace(run, angle=angle), loaded)
    edges = [(one.knots[0], one.knots[-1]) for one in pairs.stretches]
    assert len(edges) in (2, 3) and not any(begin < 2.25 < end for begin, end in edges)
    assert all(row.agrees for row in rows)


@pytest.mark.parametrize("is_still", [False, True])
def test_an_hour_of_pause_is_not_time_left_out(scene, is_still):
    """A pause of an hour in a measured run does not count as excluded time.

    In the pause there are no readings, or the readings of a stopped cam.
    """
    loaded = scene()
    run = measured(loaded)
    before, _ = compared(run, loaded)
    half = run.angle.time.size // 2

    def paused(signal, fill):
        late = signal.time > run.angle.time[half]
        time, value = signal.time + 3600.0 * late, signal.value
        if fill is not None:
            rest = np.arange(signal.time[half] + 0.01, signal.time[half] + 3600.0, 0.1)
            values = np.full(rest.size, value[half] + fill)
            time = np.insert(time, half + 1, rest)
            value = np.insert(value, half + 1, values)
        return replace(signal, time=time, value=value)

    fill = 0.0 if is_still else None
    parts = {name: paused(getattr(run, name), fill) for name in ("angle", "lift", "force")}
    pairs, rows = compared(replace(run, level=None, **parts), loaded)
    assert all(row.lift.within for row in rows)
    assert before.excluded <= pairs.excluded < 0.6


def test_a_cam_that_never_turns_steadily_is_refused(scene):
    """A measured run without a steady cam speed is refused.

    The error states which speeds count as steady.
    """
    loaded = scene()
    time = np.arange(1500) / 1000.0
    run = replace(measured(loaded), angle=Signal(time, 40.0 * time**2, "/encoder"))
    with pytest.raises(BagError, match=r"no 4 successive turns at one speed \(within 2 %\)"):
        compared(run, loaded)


#: Functions that make a measured signal implausible. Their arguments are time, value and a random
#: generator.
FAULTS = (
    lambda t, v, rng: np.stack([t, v])[:, rng.random(t.size) > rng.uniform(0.1, 0.95)],
    lambda t, v, _: (t[:5], v[:5]),
    lambda t, v, rng: (t, v * rng.choice([0.0, -1.0, 1e6])),
    lambda t, v, rng: (t, v + v.std() * rng.normal(size=v.size)),
    lambda t, v, rng: (t + rng.choice([-2.0, 2.0, 100.0]), v),
    lambda t, v, rng: (t, v * np.where(rng.random(v.size) < 0.01, 1e3, 1.0)),
)


@pytest.mark.parametrize("seed", range(len(FAULTS)))
def test_any_readings_are_compared_in_finite_numbers(scene, seed):
    """Implausible readings are compared without an error, in finite numbers.

    They are mostly lost, only five, zero, negated, noisy, shifted in time, or have spikes.
    """
    rng = np.random.default_rng(seed)
    loaded = scene("tm21", (250, 400), turns=6, sample_rate=4000)
    run = measured(loaded, seed)
    lift = Signal(*FAULTS[seed](run.lift.time, run.lift.value, rng))
    force = Signal(*FAULTS[seed - 1](run.force.time, run.force.value, rng))
    run = replace(run, lift=lift, force=force)
    pairs, rows = compared(run, loaded)
    found = RunComparison(
        run.source, loaded, tuple(rows), tuple(warnings_of(pairs)), tuple(alignment_numbers(pairs))
    )
    text = json.dumps(found.data(), allow_nan=False)
    assert len(json.loads(text)["events"]) == len(found.to_display()[0].text_rows) == 2


def test_another_restitution_shifts_the_events(scene):
    """A higher restitution of the bench's follower delays its landings.

    This is detected above the jump speed. The samples next to the landings, less than 10 %, are
    excluded from the force difference.
    """
    loaded = scene(speeds=(300, 450, 470), model="one_mass")
    machine = replace(loaded, rig=loaded.rig.with_follower(restitution=0.4))
    loaded = replace(loaded, rig=loaded.rig.with_follower(restitution=0.0))
    _, rows = compared(measured(machine), loaded)
    (later,) = [one for one in largest_deviations(rows) if one.quantity == "event_delay"]
    assert later.value > 1e-3 and later.rpm > 440.0
    turn = rows[-1].drawn["force"]
    assert 0 < np.count_nonzero(~turn.away_from_jumps) < 0.1 * turn.away_from_jumps.size


# -- a recorded run of the rig against a model that is driven by the recorded cam states --------


def recorded(loaded):
    """Simulate a scene and return its ticks, its cam states and its sound pressures.

    A tick is the interval between two cam states. The pressures are in a dict whose keys are the
    end times (ns) of the ticks.
    """
    pressures = {tick.stop_ns: tick.pressure for tick in simulate(loaded)}
    return list(simulate_ticks(loaded)), list(cam_states(loaded.scene)), pressures


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "elastic_stem", "two_mass"])
def test_a_simulated_run_agrees_with_its_scene(make_loaded_scene, model):
    """A simulated run equals its scene exactly in samples, lift-offs and sound levels."""
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
    assert all(one.value == 0.0 for one in largest_deviations(rows))
    assert [one.agreeing for one in largest_deviations(rows)[:2]] == [len(rows)] * 2


@pytest.mark.parametrize(("seed", "model"), [(0, "kinetostatic"), (1, "one_mass")])
def test_a_heavier_follower_needs_the_inertial_force_in_addition(make_loaded_scene, seed, model):
    """In contact a heavier follower differs by ΔF = Δm ω² s'' at every sample.

    The contact force is F = m ω² s'' + c ω s' + k s + F₀. The tolerance is 1e-9 of the largest ΔF.
    """
    loaded = make_loaded_scene(cams=["poly345"], model=model, speeds=[60, 120], sample_rate=2000)
    law = random_law(seed, "poly345")
    random, names = np.random.default_rng(100 + seed), ("mass", "spring_stiffness", "damping")
    factors = dict(zip(names, random.uniform(0.5, 2.0, 3).tolist(), strict=True))
    # With a high preload the follower is in contact on any random cam.
    loaded = with_follower(replace(loaded, laws={"poly345": law}), preload=80.0, **factors)
    heavy = with_follower(loaded, mass=1.1)
    more = heavy.follower.mass - loaded.follower.mass
    for step in RecordedPairs(loaded).steps(*recorded(heavy)):
        assert step.force.model.min() > 0.0
        expected = more * (step.rpm * RPM) ** 2 * law(np.remainder(step.force.angle, TURN), 2)
        scale = np.abs(expected).max()
        assert scale > 0.1
        np.testing.assert_allclose(step.force.difference, expected, rtol=0, atol=1e-9 * scale)
        np.testing.assert_allclose(step.lift.difference, 0.0, rtol=0, atol=1e-15)


def test_lost_messages_are_left_out_and_the_others_agree(make_loaded_scene):
    """Ticks whose samples or cam states were lost are excluded from the comparison.

    A tick is the interval between two cam states. All other ticks agree. Cam states are lost at one
    speed and at a change of speed.
    """
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
    gone = {state.time_ns for state in states[31:34]}  # including the step from 200 to 300 rpm
    ticks = [t for t in ticks if t.start.time_ns not in gone and t.interval.stop_ns not in gone]
    kept = [state for state in states if state.time_ns not in gone]
    rows = compare_steps(RecordedPairs(loaded).steps(ticks, kept, pressures), loaded.laws)
    assert rows[0].force.largest == 0.0
    # After the loss the model starts again in contact with the cam. It is steady within a turn.
    assert rows[1].turns < 7.0 and abs(rows[1].force.largest) < 1e-6 * rows[1].force.scale


def test_a_cam_that_is_missing_in_the_scene_is_named(make_loaded_scene):
    """A bag with a cam that the scene lacks is refused, and the error lists the cams."""
    other = make_loaded_scene(cams=["cycloidal"])
    run = recorded(other)
    scene = make_loaded_scene(cams=["poly345"])
    with pytest.raises(ConfigError, match=r"must have the cam 'cycloidal' of the bag.*poly345"):
        list(RecordedPairs(scene).steps(*run))
