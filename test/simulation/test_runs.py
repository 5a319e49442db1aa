"""Tests of runs of scenes in one process: ticks, levels, and result rows.

A tick is the interval between two cam states, one turn by default.
"""

import dataclasses
import itertools
import math

import numpy as np
import pytest

import cam_rig
from cam_rig.acoustics import level_db, steady_power
from cam_rig.dynamics import MODELS
from cam_rig.errors import ConfigError
from cam_rig.live.drive import SetpointSchedule
from cam_rig.live.queues import FollowerQueue, TickMatcher
from cam_rig.simulation import simulate as simulation
from cam_rig.simulation.by_speed import SpeedRows
from cam_rig.simulation.schedule import cam_states, tick_count
from cam_rig.simulation.simulate import simulate_steady_turns, simulate_ticks, step_levels
from cam_rig.units import RPM, TURN

from ..conftest import GOLDEN


def levels_of(loaded):
    return step_levels(simulation.simulate(loaded), loaded.scene.schedule.transient_turns.si)


def test_every_tick_is_measured(make_loaded_scene):
    """A simulation yields one sound pressure for each tick of a scene, in order.

    A tick is the interval between two cam states. No pressure is below the background.
    """
    loaded = make_loaded_scene(ticks_per_turn=3)
    ticks = list(simulation.simulate(loaded))
    assert len(ticks) == tick_count(loaded.scene)
    states = list(cam_states(loaded.scene))
    assert [tick.start for tick in ticks] == states[:-1]
    assert [tick.stop_ns for tick in ticks] == [state.time_ns for state in states[1:]]
    for tick in ticks:
        assert tick.pressure**2 >= loaded.radiation.background_power(tick.start.speed)


def test_the_samples_contain_the_impulse_of_every_landing(make_loaded_scene):
    """The sum of the impulses in the samples of a scene is that of its landings.

    An impulse that is still pending for the next block of samples counts too. The relative
    tolerance is 1e-12.
    """
    # At a change of cam the follower is put on the new cam. An impulse after the last sample on the
    # old cam is added to the next block. At 670 rpm and 100 Hz there is such an impulse.
    loaded = make_loaded_scene(speeds=[670], sample_rate=100)
    simulator = simulation.FollowerSimulator(MODELS["one_mass"], loaded.follower, 100, loaded.laws)
    of_events = of_samples = pending = 0.0
    states = cam_states(loaded.scene)
    assert simulator.turn_to(next(states)) is None  # a tick needs two states
    for state in states:
        result = simulator.turn_to(state)
        if result is not None:
            of_events += sum(event.impulse for event in result[1].events)
            of_samples += float(result[1].rows[5].sum())
            pending = result[0].pending_impulse
    assert of_events > 1.0
    assert of_samples + pending == pytest.approx(of_events, rel=1e-12)


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "elastic_stem"])
def test_levels_along_ramps_are_left_out(make_loaded_scene, model):
    """A scene with speed ramps has sound levels at its constant speeds only.

    They equal those of the exact steady response.
    """
    loaded = make_loaded_scene(speeds=[200, 300], ramp=0.4, model=model, sample_rate=24_000)
    ticks = list(simulation.simulate(loaded))
    assert len(ticks) == tick_count(loaded.scene)
    assert sum(not tick.steady for tick in ticks) == tick_count(loaded.scene) - 2 * 2 * 3
    levels = step_levels(ticks, 1.0)
    speeds = [float(speed) for speed in loaded.scene.schedule.speeds.si_list]
    assert {cam: list(steps) for cam, steps in levels.items()} == dict.fromkeys(
        ("poly345", "bezier15"), speeds
    )
    for cam, steps in levels.items():
        for speed, level in steps.items():
            power = steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, speed)
            tolerance = 2e-2 if model != "elastic_stem" else 0.1  # the elastic stem rings
            assert level == pytest.approx(float(level_db(np.sqrt(power))), abs=tolerance)


STEADY_RPM = np.array([200.0, 300.0, 400.0])
SPEEDS = STEADY_RPM * np.pi / 30.0


@pytest.mark.parametrize("cam", ["poly345", "bezier15"])
def test_levels_in_contact_are_those_of_the_exact_response(make_loaded_scene, cam):
    """Sound levels of sampled steady turns in contact equal exact levels to 2e-3 dB.

    The exact levels follow from the mean square of the force rate.
    """
    loaded = make_loaded_scene()
    turns = simulate_steady_turns(loaded.laws[cam], "one_mass", loaded.follower, SPEEDS)
    acoustics = simulation.Acoustics(loaded.radiation)
    np.testing.assert_array_equal(acoustics.levels(turns.every(2)), acoustics.levels(turns)[::2])
    power = [
        steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, float(s)) for s in SPEEDS
    ]
    exact = level_db(np.sqrt(np.array(power)))
    np.testing.assert_allclose(acoustics.levels(turns), exact, atol=2e-3)
    np.testing.assert_allclose(turns.rpm, STEADY_RPM, rtol=1e-14)


def test_levels_with_landings_are_those_of_the_run(make_loaded_scene):
    """Sound levels of a steady turn with landings agree with a simulated run.

    The tolerance is 0.02 dB.
    """
    loaded = make_loaded_scene(
        cams=["tm21"], speeds=[350, 400], turns=6, transient_turns=2, sample_rate=12000
    )
    run = step_levels(simulation.simulate(loaded), 2.0)["tm21"]
    turns = simulate_steady_turns(loaded.laws["tm21"], "one_mass", loaded.follower, sorted(run))
    assert all(impulse.sum() > 0.0 for impulse in turns.impulses)
    levels = simulation.Acoustics(loaded.radiation).levels(turns)
    np.testing.assert_allclose(levels, [run[s] for s in sorted(run)], atol=0.02)


def test_the_speed_response_applies_to_the_contact_only(make_loaded_scene):
    """A speed response of ±3 dB changes only the sound power of the contact.

    The speed response is a function of speed in the radiation constants. The background does not
    change.
    """
    loaded = make_loaded_scene()
    plain = simulation.Acoustics(loaded.radiation)
    raised = simulation.Acoustics(loaded.radiation, (3.0, 0.0, 0.0))
    turns = simulate_steady_turns(loaded.laws["poly345"], "one_mass", loaded.follower, SPEEDS)
    background = np.array([loaded.radiation.background_power(float(s)) for s in SPEEDS])
    power = [4e-10 * 10.0 ** (a.levels(turns) / 10.0) - background for a in (plain, raised)]
    np.testing.assert_allclose(10.0 * np.log10(power[1] / power[0]), [-3.0, 0.0, 3.0], atol=1e-9)


DIVISIONS = (2, 3, 5, 7, 36, 72, 100)
#: Cams of random scenes: their laws have steps of the force at joints (where two pieces of the law
#: meet), steps of the velocity, or neither.
CAMS = ("tm21", "arcs_convex", "worked_example_harmonic", "poly345", "bezier15", "trigonometric")
#: Speeds (rpm) at which samples fall on joints of the law and on borders of ticks, the intervals
#: between cam states.
EVEN_RPM = (100, 200, 240, 300, 320, 400, 600)
EVEN_HZ = (2000, 4000, 8000, 12_000, 48_000)
#: All models of the follower.
ALL_MODELS = ("kinetostatic", "one_mass", "elastic_stem", "two_mass", "torsional")
#: Highest speed (rpm) of two masses. Above it they bounce, which amplifies rounding.
TWO_MASS_RPM = 380.0


def random_scene(seed):
    """Return the entries of a random scene file, with or without ramps."""
    rng = np.random.default_rng(seed)
    model = ALL_MODELS[seed % len(ALL_MODELS)]
    even = bool(rng.integers(2))
    rpm = rng.choice(EVEN_RPM, 2) if even else rng.uniform(80.0, 650.0, 2).round(3)
    if model == "two_mass":
        rpm = np.minimum(rpm, TWO_MASS_RPM)
    cam = str(rng.choice(CAMS if model in ("one_mass", "elastic_stem") else CAMS[3:5]))
    rate = int(rng.choice(EVEN_HZ)) if even else int(rng.integers(1000, 48_001))
    scene = {"speeds": rpm.tolist(), "transient_turns": int(rng.integers(3))}
    if rng.integers(2):
        scene["ramp"] = round(float(rng.uniform(0.05, 0.4)), 2)
    rig = "paper_table2" if model in ("two_mass", "torsional") else "tm21"
    return scene | {"cams": [cam], "rig": rig, "model": model, "sample_rate": rate}


@pytest.fixture
def divided(make_loaded_scene):
    """Function that loads a random scene with a number of ticks (cam states) per turn."""
    return lambda scene, ticks: make_loaded_scene(**scene, ticks_per_turn=ticks)


def assert_equal(levels, expected):
    assert {cam: list(steps) for cam, steps in levels.items()} == {
        cam: list(steps) for cam, steps in expected.items()
    }
    for cam, steps in expected.items():
        assert levels[cam] == pytest.approx(steps, rel=0, abs=1e-9)


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(20))
def test_levels_do_not_depend_on_the_ticks_per_turn(divided, seed):
    """Levels of random scenes do not depend on the ticks per turn, to 1e-9 dB.

    A tick is the interval between two cam states.
    """
    # If the ticks had too few samples, the error states the largest number of ticks.
    scene = random_scene(seed)
    levels = levels_of(divided(scene, 1))
    for ticks in np.random.default_rng(seed).permutation(DIVISIONS)[:3].tolist():
        try:
            loaded = divided(scene, ticks)
        except ConfigError as error:
            assert "samples per tick" in str(error)
            max_ticks = int(str(error).rpartition("up to ")[2])
            assert max_ticks < ticks
            loaded = divided(scene, max_ticks)
        assert_equal(levels_of(loaded), levels)


def run_of_the_nodes(loaded):
    """Yield the ticks of a scene as the nodes compute them, message by message.

    A tick is the interval between two cam states, with its sound pressure. ROS is not used.
    """
    scene, simulator = loaded.scene, simulation.FollowerSimulator.of(loaded)
    schedule, rate = SetpointSchedule(scene), int(scene.sample_rate.si)
    follower = FollowerQueue(simulator, scene)
    matcher, microphone = TickMatcher(rate), simulation.MicrophoneSimulator.of(loaded)
    while (state := schedule.next_state) is not None:
        follower.add_state(state)
        matcher.add_state(state)
        for *_, block in follower.complete():
            matcher.add_block(block.rows)
        for start, end, rows in matcher.complete():
            pressure = microphone.listen(rows, start.until(end).mean_speed)
            yield simulation.MeasuredTick.between(start, end, pressure, rate)
        schedule.advance()


@pytest.mark.parametrize("seed", [1, 6, 11])
def test_the_nodes_compute_the_levels_of_the_scene(divided, seed):
    """The classes of the nodes compute the sound levels of the simulation.

    Scenes are random, with 1 and 5 ticks (cam states) per turn.
    """
    scene = random_scene(seed)
    settle = scene["transient_turns"]
    levels = levels_of(divided(scene, 1))
    for ticks in (1, 5):
        assert_equal(step_levels(run_of_the_nodes(divided(scene, ticks)), settle), levels)


def rows_of(loaded):
    """Return the result rows of a simulated scene, one per cam and speed."""
    speed_rows = SpeedRows.of(loaded)
    for tick in simulate_ticks(loaded):
        speed_rows.take(tick)
    return speed_rows.rows({})


def assert_rows(rows, others, rel):
    """Assert that result rows agree in each number to a relative tolerance."""
    for row, other in zip(rows, others, strict=True):
        for name, value in vars(row).items():
            expected = value if isinstance(value, str | None) else pytest.approx(value, rel=rel)
            assert getattr(other, name) == expected, name


def on_rig(loaded, **numbers):
    return dataclasses.replace(loaded, rig=loaded.rig.with_follower(**numbers))


@pytest.mark.parametrize("seed", range(4))
def test_flights_in_the_samples_are_those_of_the_events(make_loaded_scene, seed):
    """Lift-offs, flights and landings in result rows are those of the model.

    There is one row per cam and speed. The longest flight agrees to one sample. The fastest landing
    agrees to 1e-9 if each sample contains at most one landing.
    """
    random = np.random.default_rng(seed)
    loaded = make_loaded_scene(speeds=[340, 390, 440], turns=4, cams=["tm21", "poly345"])
    loaded = on_rig(
        loaded,
        mass=loaded.follower.mass * float(random.uniform(0.9, 1.5)),
        preload=float(random.uniform(0.0, 40.0)),
        restitution=float(random.choice([0.0, 0.4])),
    )
    rate, events, follower = 8000, {}, simulation.FollowerSimulator.of(loaded)
    previous, first = None, {}
    for state in cam_states(loaded.scene):
        result = follower.turn_to(state)
        if result is not None:
            key = previous.cam, round(previous.speed / RPM)
            first.setdefault(key, previous.unwrapped)
            events.setdefault(key, []).extend(result[1].events)
        previous = state
    flights_checked = 0
    for row in rows_of(loaded):
        key = row.cam, round(row.rpm)
        start = first[key] + TURN
        settled = [event for event in events[key] if event.angle >= start - 1e-9]
        lift_offs = [event for event in settled if event.kind == "lift-off"]
        landings = [event for event in settled if event.kind == "landing"]
        assert row.turns == pytest.approx(3.0, abs=1e-6)
        assert abs(row.lift_offs * row.turns - len(lift_offs)) < 1.0 + 1e-6
        flights_checked += len(lift_offs)
        flights = [
            b.time - a.time
            for a, b in itertools.pairwise(events[key])
            if b.kind == "landing" and b.angle >= start
        ]
        if events[key] and events[key][-1].kind == "landing":  # else the last flight continues
            assert abs(row.flight - max(flights)) <= 1.0 / rate + 1e-9
        alone = np.diff([event.time for event in landings]).min(initial=math.inf) > 1.0 / rate
        if alone and loaded.follower.restitution == 0.0:
            hardest = max((event.impulse for event in landings), default=0.0)
            assert row.landing == pytest.approx(hardest, rel=1e-9)
    assert flights_checked > 5


def test_the_mean_torque_is_the_work_of_the_damper(make_loaded_scene):
    """The mean torque in a result row is the work of the damper per turn, over 2π.

    The work is c ∮ ṡ² dt. Spring and mass are conservative. The relative tolerance is 1e-5.
    """
    loaded = make_loaded_scene(model="kinetostatic", speeds=[200], sample_rate=24_000)
    for row in rows_of(loaded):
        law, damping = loaded.laws[row.cam], loaded.follower.damping
        nodes, weights = np.polynomial.legendre.leggauss(20)
        angles = law.breaks[:-1, None] + law.spans[:, None] * 0.5 * (nodes + 1.0)
        square = float((law(angles, 1) ** 2 @ weights) @ (0.5 * law.spans))
        assert row.torque_mean == pytest.approx(damping * row.rpm * RPM * square / TURN, rel=1e-5)
        assert row.min_torque < 0.0 < row.peak_torque


def test_a_follower_at_rest_without_preload_is_not_in_flight(make_loaded_scene):
    """A follower without preload on a dwell counts as in contact.

    Its contact force is 0.
    """
    loaded = on_rig(make_loaded_scene(speeds=[60], cams=["poly345"]), preload=0.0)
    (row,) = rows_of(loaded)
    assert row.min_force == 0.0
    assert (row.lift_offs, row.flight, row.landing) == (0.0, 0.0, 0.0)


def test_a_row_does_not_depend_on_the_ticks_per_turn(make_loaded_scene):
    """The result row of a speed is the same with 1 and 16 ticks per turn, to 1e-6.

    A tick is the interval between two cam states.
    """
    one, many = (rows_of(make_loaded_scene(speeds=[420], ticks_per_turn=n)) for n in (1, 16))
    assert_rows(one, many, 1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_a_row_contains_whole_turns_only(make_loaded_scene, seed):
    """If a speed ends within a turn, its result row covers the whole turns before."""
    loaded = make_loaded_scene(speeds=[430], turns=4, cams=["tm21"], ticks_per_turn=16)
    states = list(cam_states(loaded.scene))

    def rows_after(ticks):
        last = dataclasses.replace(states[ticks], speed=0.0)
        speed_rows = SpeedRows.of(loaded)
        for tick in simulate_ticks(loaded, states=[*states[:ticks], last]):
            speed_rows.take(tick)
        return speed_rows.rows({})

    turns = 2 + seed % 2
    (row,), whole = rows_after(16 * turns + 1 + 4 * seed), rows_after(16 * turns)
    assert_rows([row], whole, 1e-12)
    assert row.turns == pytest.approx(turns - 1, abs=1e-6)
    assert row.lift_offs == pytest.approx(1.0, rel=1e-6)
    assert rows_after(31) == ()


def test_a_bag_has_the_rows_of_its_scene():
    """The result rows of a recording equal those of the simulated scene to 1e-9.

    There is one row per cam and speed.
    """
    recorded = cam_rig.read_bag(GOLDEN)
    computed = cam_rig.run_scene(recorded.loaded)
    assert_rows(recorded.by_speed, computed.by_speed, 1e-9)
    table, _ = recorded.to_display()
    assert len(table.rows) == 8
    assert {"level [dB]", "fastest landing [N·s]"} <= {column.title for column in table.columns}
    assert recorded.data()["levels"] == [
        {key: row[key] for key in ("cam", "rpm", "level")} for row in recorded.data()["speeds"]
    ]


def test_the_rows_of_a_run_are_those_of_a_second_pass():
    """Result rows computed during a run equal those from its stored samples.

    There is one row per cam and speed. Only the run itself adds the sound level.
    """
    run = cam_rig.run_scene("quick")
    rows = [dataclasses.replace(row, level_db=None) for row in run.by_speed]
    assert tuple(rows) == rows_of(run.loaded)
    assert all(row.level_db is not None for row in run.by_speed)
