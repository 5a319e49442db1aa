"""The scene in one process: every tick heard, and the same levels whatever the ticks."""

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
from cam_rig.simulation.simulate import settled_turns, step_levels, turned_ticks
from cam_rig.units import RPM, TURN

from ..conftest import GOLDEN


def levels_of(loaded):
    return step_levels(simulation.simulate(loaded), loaded.scene.program.settle_turns.si)


def test_every_tick_is_heard(make_loaded_scene):
    """One pressure a tick, in order, each above the background."""
    loaded = make_loaded_scene(ticks_per_turn=3)
    heard = list(simulation.simulate(loaded))
    assert len(heard) == tick_count(loaded.scene)
    states = list(cam_states(loaded.scene))
    assert [tick.start for tick in heard] == states[:-1]
    assert [tick.stop_ns for tick in heard] == [state.time_ns for state in states[1:]]
    for tick in heard:
        assert tick.pressure**2 >= loaded.radiation.background_power(tick.start.speed)


def test_no_impulse_is_lost(make_loaded_scene):
    """Over a scene, impulses in the blocks are those of the events: each landing is heard."""
    # A change of cam puts the follower down on the new one; an impulse that fell after the last
    # sample on the old one waits for the next block. At 670 rpm and 100 Hz there is one.
    loaded = make_loaded_scene(speeds=[670], sample_rate=100)
    bench = simulation.FollowerSimulator(MODELS["one_mass"], loaded.follower, 100, loaded.laws)
    due = shown = pending = 0.0
    states = cam_states(loaded.scene)
    assert bench.turn_to(next(states)) is None  # one state is no tick
    for state in states:
        turned = bench.turn_to(state)
        if turned is not None:
            due += sum(event.impulse for event in turned[1].events)
            shown += float(turned[1].rows[5].sum())
            pending = turned[0].pending_impulse
    assert due > 1.0
    assert shown + pending == pytest.approx(due, rel=1e-12)


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "elastic_stem"])
def test_levels_along_ramps_are_left_out(make_loaded_scene, model):
    """A scene with ramps has levels of the held speeds alone, and they are the steady ones."""
    loaded = make_loaded_scene(speeds=[200, 300], ramp=0.4, model=model, sample_rate=24_000)
    heard = list(simulation.simulate(loaded))
    assert len(heard) == tick_count(loaded.scene)
    assert sum(not tick.steady for tick in heard) == tick_count(loaded.scene) - 2 * 2 * 3
    levels = step_levels(heard, 1.0)
    held = [float(speed) for speed in loaded.scene.program.speeds.si_list]
    assert {cam: list(steps) for cam, steps in levels.items()} == dict.fromkeys(
        ("poly345", "bezier15"), held
    )
    for cam, steps in levels.items():
        for speed, level in steps.items():
            power = steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, speed)
            close = 2e-2 if model != "elastic_stem" else 0.1  # there the stem rings
            assert level == pytest.approx(float(level_db(np.sqrt(power))), abs=close)


STEADY_RPM = np.array([200.0, 300.0, 400.0])
SPEEDS = STEADY_RPM * np.pi / 30.0


@pytest.mark.parametrize("cam", ["poly345", "bezier15"])
def test_steady_levels(make_loaded_scene, cam):
    """Of a cam that keeps contact: those of the exact steady response, to 2e-3 dB."""
    loaded = make_loaded_scene()
    turns = settled_turns(loaded.laws[cam], "one_mass", loaded.follower, SPEEDS)
    acoustics = simulation.Acoustics(loaded.radiation)
    np.testing.assert_array_equal(acoustics.levels(turns.every(2)), acoustics.levels(turns)[::2])
    power = [
        steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, float(s)) for s in SPEEDS
    ]
    exact = level_db(np.sqrt(np.array(power)))
    np.testing.assert_allclose(acoustics.levels(turns), exact, atol=2e-3)
    np.testing.assert_allclose(turns.rpm, STEADY_RPM, rtol=1e-14)


def test_levels_with_landings(make_loaded_scene):
    """Of a cam that jumps: those of the whole simulated run, to 0.02 dB."""
    loaded = make_loaded_scene(
        cams=["tm21"], speeds=[350, 400], turns=6, settle_turns=2, sample_rate=12000
    )
    run = step_levels(simulation.simulate(loaded), 2.0)["tm21"]
    turns = settled_turns(loaded.laws["tm21"], "one_mass", loaded.follower, sorted(run))
    assert all(impulse.sum() > 0.0 for impulse in turns.impulses)
    levels = simulation.Acoustics(loaded.radiation).levels(turns)
    np.testing.assert_allclose(levels, [run[s] for s in sorted(run)], atol=0.02)


def test_the_speed_response_acts_on_the_contact_alone(make_loaded_scene):
    """A response of +3 dB at 400 rpm raises the contact's share alone."""
    loaded = make_loaded_scene()
    plain = simulation.Acoustics(loaded.radiation)
    raised = simulation.Acoustics(loaded.radiation, (3.0, 0.0, 0.0))
    turns = settled_turns(loaded.laws["poly345"], "one_mass", loaded.follower, SPEEDS)
    background = np.array([loaded.radiation.background_power(float(s)) for s in SPEEDS])
    power = [4e-10 * 10.0 ** (a.levels(turns) / 10.0) - background for a in (plain, raised)]
    np.testing.assert_allclose(10.0 * np.log10(power[1] / power[0]), [-3.0, 0.0, 3.0], atol=1e-9)


DIVISIONS = (2, 3, 5, 7, 36, 72, 100)
#: Laws with steps of the force at joints, with steps of the velocity, and smooth ones.
CAMS = ("tm21", "arcs_convex", "worked_example_harmonic", "poly345", "bezier15", "trigonometric")
#: Speeds (rpm) and rates (Hz) at which samples lie on joints and on borders of ticks.
EVEN_RPM, EVEN_HZ = (100, 200, 240, 300, 320, 400, 600), (2000, 4000, 8000, 12_000, 48_000)
#: One and two masses, an elastic stem and an elastic shaft, and what holds the follower by force.
DRAWN_MODELS = ("kinetostatic", "one_mass", "elastic_stem", "two_mass", "torsional")
#: Above it two masses bounce, which enlarges what is rounded.
TWO_MASS_RPM = 380.0


def drawn(seed):
    """A scene drawn at random, as its file says it, with ramps and without."""
    rng = np.random.default_rng(seed)
    model = DRAWN_MODELS[seed % len(DRAWN_MODELS)]
    even = bool(rng.integers(2))
    rpm = rng.choice(EVEN_RPM, 2) if even else rng.uniform(80.0, 650.0, 2).round(3)
    if model == "two_mass":
        rpm = np.minimum(rpm, TWO_MASS_RPM)
    cam = str(rng.choice(CAMS if model in ("one_mass", "elastic_stem") else CAMS[3:5]))
    rate = int(rng.choice(EVEN_HZ)) if even else int(rng.integers(1000, 48_001))
    scene = {"speeds": rpm.tolist(), "settle_turns": int(rng.integers(3))}
    if rng.integers(2):
        scene["ramp"] = round(float(rng.uniform(0.05, 0.4)), 2)
    rig = "paper_table2" if model in ("two_mass", "torsional") else "tm21"
    return scene | {"cams": [cam], "rig": rig, "model": model, "sample_rate": rate}


@pytest.fixture
def divided(make_loaded_scene):
    return lambda scene, ticks: make_loaded_scene(**scene, ticks_per_turn=ticks)


def assert_equal(found, levels):
    assert {cam: list(steps) for cam, steps in found.items()} == {
        cam: list(steps) for cam, steps in levels.items()
    }
    for cam, steps in levels.items():
        assert found[cam] == pytest.approx(steps, rel=0, abs=1e-9)


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(20))
def test_any_division_gives_the_same_levels(divided, seed):
    """Laws, rigs, models, speeds, rates, steps and ramps drawn at random: equal to 1e-9 dB."""
    # A division whose ticks have too few samples is refused, with the number that is allowed.
    scene = drawn(seed)
    levels = levels_of(divided(scene, 1))
    for ticks in np.random.default_rng(seed).permutation(DIVISIONS)[:3].tolist():
        try:
            loaded = divided(scene, ticks)
        except ConfigError as error:
            assert "samples per tick" in str(error)
            most = int(str(error).rpartition("up to ")[2])
            assert most < ticks
            loaded = divided(scene, most)
        assert_equal(levels_of(loaded), levels)


def run_of_the_nodes(loaded):
    """The ticks as drive, follower and microphone make them, message by message, without ROS."""
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
def test_the_nodes_give_the_same_levels(divided, seed):
    """What the nodes compute, and a bag holds, is what the scene gives without them."""
    scene = drawn(seed)
    settle = scene["settle_turns"]
    levels = levels_of(divided(scene, 1))
    for ticks in (1, 5):
        assert_equal(step_levels(run_of_the_nodes(divided(scene, ticks)), settle), levels)


def rows_of(loaded):
    found = SpeedRows.of(loaded)
    for tick in turned_ticks(loaded):
        found.take(tick)
    return found.rows({})


def assert_rows(rows, others, rel):
    for one, other in zip(rows, others, strict=True):
        for name, value in vars(one).items():
            wanted = value if isinstance(value, str | None) else pytest.approx(value, rel=rel)
            assert getattr(other, name) == wanted, name


def on_rig(loaded, **numbers):
    return dataclasses.replace(loaded, rig=loaded.rig.with_follower(**numbers))


@pytest.mark.parametrize("seed", range(4))
def test_flights_are_those_of_the_events(make_loaded_scene, seed):
    """For random followers, some that bounce: lift-offs as many, the longest flight to a sample,
    the hardest landing to the digit where no other shares its sample.
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
    before, first = None, {}
    for state in cam_states(loaded.scene):
        turned = follower.turn_to(state)
        if turned is not None:
            key = before.cam, round(before.speed / RPM)
            first.setdefault(key, before.unwrapped)
            events.setdefault(key, []).extend(turned[1].events)
        before = state
    flown = 0
    for row in rows_of(loaded):
        key = row.cam, round(row.rpm)
        begin = first[key] + TURN
        settled = [event for event in events[key] if event.angle >= begin - 1e-9]
        lift_offs = [event for event in settled if event.kind == "lift-off"]
        landings = [event for event in settled if event.kind == "landing"]
        assert row.turns == pytest.approx(3.0, abs=1e-6)
        assert abs(row.lift_offs * row.turns - len(lift_offs)) < 1.0 + 1e-6
        flown += len(lift_offs)
        flights = [
            b.time - a.time
            for a, b in itertools.pairwise(events[key])
            if b.kind == "landing" and b.angle >= begin
        ]
        if events[key] and events[key][-1].kind == "landing":  # else it still flies
            assert abs(row.flight - max(flights)) <= 1.0 / rate + 1e-9
        alone = np.diff([event.time for event in landings]).min(initial=math.inf) > 1.0 / rate
        if alone and loaded.follower.restitution == 0.0:
            hardest = max((event.impulse for event in landings), default=0.0)
            assert row.landing == pytest.approx(hardest, rel=1e-9)
    assert flown > 5


def test_the_mean_torque_is_what_the_damper_takes(make_loaded_scene):
    """Virtual work: T ω over a turn is c ∮ ṡ² dt; spring and mass give back what they took."""
    loaded = make_loaded_scene(model="kinetostatic", speeds=[200], sample_rate=24_000)
    for row in rows_of(loaded):
        law, damping = loaded.laws[row.cam], loaded.follower.damping
        nodes, weights = np.polynomial.legendre.leggauss(20)
        angles = law.breaks[:-1, None] + law.spans[:, None] * 0.5 * (nodes + 1.0)
        square = float((law(angles, 1) ** 2 @ weights) @ (0.5 * law.spans))
        assert row.torque_mean == pytest.approx(damping * row.rpm * RPM * square / TURN, rel=1e-5)
        assert row.torque_least < 0.0 < row.torque_peak


def test_a_follower_without_preload_rests_on_the_dwell(make_loaded_scene):
    """Its force is zero there, and it has not left the cam."""
    loaded = on_rig(make_loaded_scene(speeds=[60], cams=["poly345"]), preload=0.0)
    (row,) = rows_of(loaded)
    assert row.force_least == 0.0
    assert (row.lift_offs, row.flight, row.landing) == (0.0, 0.0, 0.0)


def test_a_row_does_not_depend_on_the_ticks(make_loaded_scene):
    """However the turn is divided, samples and flights are the same."""
    one, many = (rows_of(make_loaded_scene(speeds=[420], ticks_per_turn=n)) for n in (1, 16))
    assert_rows(one, many, 1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_a_row_is_of_whole_turns(make_loaded_scene, seed):
    """A speed left in mid-turn: force, torque and lift-offs are those of the turns before."""
    loaded = make_loaded_scene(speeds=[430], turns=4, cams=["tm21"], ticks_per_turn=16)
    states = list(cam_states(loaded.scene))

    def left_after(ticks):
        last = dataclasses.replace(states[ticks], speed=0.0)
        found = SpeedRows.of(loaded)
        for tick in turned_ticks(loaded, states=[*states[:ticks], last]):
            found.take(tick)
        return found.rows({})

    turns = 2 + seed % 2
    (row,), whole = left_after(16 * turns + 1 + 4 * seed), left_after(16 * turns)
    assert_rows([row], whole, 1e-12)
    assert row.turns == pytest.approx(turns - 1, abs=1e-6)
    assert row.lift_offs == pytest.approx(1.0, rel=1e-6)
    assert left_after(31) == ()


def test_a_bag_gives_the_rows_of_its_scene():
    """What was recorded is what is computed, number by number; the table has a row each."""
    recorded = cam_rig.read_bag(GOLDEN)
    computed = cam_rig.run_scene(recorded.loaded)
    assert_rows(recorded.by_speed, computed.by_speed, 1e-9)
    table, _ = recorded.to_display()
    assert len(table.rows) == 8
    assert {"level [dB]", "hardest landing [N·s]"} <= {column.title for column in table.columns}
    assert recorded.data()["levels"] == [
        {key: row[key] for key in ("cam", "rpm", "level")} for row in recorded.data()["speeds"]
    ]


def test_a_run_takes_its_rows_as_it_goes():
    """Computed once: the rows are those of the samples gone through again."""
    run = cam_rig.run_scene("quick")
    found = [dataclasses.replace(row, level_db=None) for row in run.by_speed]
    assert tuple(found) == rows_of(run.loaded)
    assert all(row.level_db is not None for row in run.by_speed)
