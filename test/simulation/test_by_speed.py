"""A row each speed says what the follower did: held against exact events, energy and the bag."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

import cam_rig
from cam_rig.schema.load import config_root
from cam_rig.simulation.by_speed import SpeedRows
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import FollowerSimulator, turned_ticks
from cam_rig.units import RPM, TURN

GOLDEN = config_root().parent / "bags" / "golden"


def rows_of(loaded):
    found = SpeedRows.of(loaded)
    for tick in turned_ticks(loaded):
        found.take(tick)
    return found.rows({})


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
    rate, events, follower = 8000, {}, FollowerSimulator.of(loaded)
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
    one = rows_of(make_loaded_scene(speeds=[420], ticks_per_turn=1))
    many = rows_of(make_loaded_scene(speeds=[420], ticks_per_turn=16))
    for a, b in zip(one, many, strict=True):
        for name, value in vars(a).items():
            wanted = value if isinstance(value, str | None) else pytest.approx(value, rel=1e-6)
            assert getattr(b, name) == wanted, name


def test_a_bag_gives_the_rows_of_its_scene():
    """What was recorded is what is computed, number by number; the table has a row each."""
    recorded = cam_rig.read_bag(GOLDEN)
    computed = cam_rig.run_scene(recorded.loaded)
    for one, other in zip(recorded.by_speed, computed.by_speed, strict=True):
        assert one.cam == other.cam
        for name in set(vars(one)) - {"cam"}:
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-9), name
    table, _ = recorded.to_show()
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
