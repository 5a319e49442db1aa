"""Levels are a property of the motion: the same however the turn is divided into ticks."""

from dataclasses import replace

import numpy as np
import pytest
from ruamel.yaml import YAML

from cam_rig.errors import ConfigError
from cam_rig.live.drive import SetpointSchedule
from cam_rig.live.queues import FollowerQueue, TickMatcher
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.simulate import (
    FollowerSimulator,
    MeasuredTick,
    MicrophoneSimulator,
    simulate,
    step_levels,
)
from cam_rig.units import RPM

DIVISIONS = (2, 3, 5, 7, 36, 72, 100)
#: Laws with steps of the force at joints, with steps of the velocity, and smooth ones.
CAMS = ("tm21", "arcs_convex", "worked_example_harmonic", "poly345", "bezier15", "trigonometric")
#: Speeds (rpm) and rates (Hz) at which samples lie on joints and on borders of ticks.
EVEN_RPM, EVEN_HZ = (100, 200, 240, 300, 320, 400, 600), (2000, 4000, 8000, 12_000, 48_000)
#: One and two masses, an elastic stem and an elastic shaft, and what holds the follower by force.
MODELS = ("kinetostatic", "one_mass", "elastic_stem", "two_mass", "torsional")
#: Above it two masses bounce, which enlarges what is rounded: a test of its own.
TWO_MASS_RPM = 380.0
#: Scenes in which they do: cam, speed (rpm), sample rate (Hz).
BOUNCING = (("tm21", 436.0, 36_334), ("arcs_convex", 507.17, 32_397), ("b_spline", 320.0, 1000))


def drawn(seed):
    """A scene drawn at random, as its file says it, with ramps and without."""
    rng = np.random.default_rng(seed)
    model = MODELS[seed % len(MODELS)]
    even = bool(rng.integers(2))
    rpm = rng.choice(EVEN_RPM, 2) if even else rng.uniform(80.0, 650.0, 2).round(3)
    if model == "two_mass":
        rpm = np.minimum(rpm, TWO_MASS_RPM)
    cam = str(rng.choice(CAMS if model in ("one_mass", "elastic_stem") else CAMS[3:5]))
    rate = int(rng.choice(EVEN_HZ)) if even else int(rng.integers(1000, 48_001))
    program = {
        "speeds": {"assumed": rpm.tolist(), "unit": "rpm"},
        "turns": {"assumed": 3, "unit": "turns"},
        "settle_turns": {"assumed": int(rng.integers(3)), "unit": "turns"},
    }
    if rng.integers(2):
        program["ramp"] = {"assumed": round(float(rng.uniform(0.05, 0.4)), 2), "unit": "s"}
    return {
        "cams": [cam],
        "rig": "paper_table2" if model in ("two_mass", "torsional") else "tm21",
        "model": model,
        "sample_rate": {"assumed": rate, "unit": "Hz"},
        "program": program,
    }


@pytest.fixture
def divided(tmp_path):
    """Open a scene with so many ticks a turn."""

    def make(scene, ticks):
        data = {"name": "drawn", "title": "a drawn scene", **scene}
        data["program"] = data["program"] | {"ticks_per_turn": ticks}
        path = tmp_path / "scenes" / "drawn.yaml"
        path.parent.mkdir(exist_ok=True)
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(data, file)
        return open_scene(path)

    return make


def levels_of(loaded):
    return step_levels(simulate(loaded), loaded.scene.program.settle_turns.si)


def assert_equal(found, levels):
    """The same steps of the same cams, each to 1e-9 dB."""
    assert {cam: list(steps) for cam, steps in found.items()} == {
        cam: list(steps) for cam, steps in levels.items()
    }
    for cam, steps in levels.items():
        assert found[cam] == pytest.approx(steps, rel=0, abs=1e-9)


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(20))
def test_any_division_gives_the_same_levels(divided, seed):
    """Laws, rigs, models, speeds, rates, steps and ramps drawn at random: equal to 1e-9 dB.

    A division whose ticks have too few samples is refused, with the number that is allowed.
    """
    scene = drawn(seed)
    levels = levels_of(divided(scene, 1))
    for ticks in np.random.default_rng(seed).permutation(DIVISIONS)[:3].tolist():
        try:
            loaded = divided(scene, ticks)
        except ConfigError as error:
            assert "samples a tick" in str(error)
            most = int(str(error).rpartition("up to ")[2])
            assert most < ticks
            loaded = divided(scene, most)
        assert_equal(levels_of(loaded), levels)


@pytest.mark.parametrize("rate", [1000, 12_000])
def test_the_quick_scene_at_any_division(divided, rate):
    """Its levels, at its own low rate and at 12 kHz, where samples lie on the cam's joints."""
    file = config_root() / "scenes" / "quick.yaml"
    with file.open(encoding="utf-8") as text:
        scene = YAML(typ="safe").load(text)
    scene["sample_rate"] = {"assumed": rate, "unit": "Hz"}
    levels = levels_of(divided(scene, 1))
    for ticks in (3, 7, 72):
        assert_equal(levels_of(divided(scene, ticks)), levels)


def run_of_the_nodes(loaded, nudge=0.0):
    """The ticks as drive, follower and microphone make them, message by message, without ROS.

    ``nudge`` is the part by which the preload is larger.
    """
    scene, simulator = loaded.scene, FollowerSimulator.of(loaded)
    preload = simulator.parameters.preload * (1.0 + nudge)
    simulator.parameters = replace(simulator.parameters, preload=preload)
    schedule, rate = SetpointSchedule(scene), int(scene.sample_rate.si)
    follower = FollowerQueue(simulator, scene)
    matcher, microphone = TickMatcher(rate), MicrophoneSimulator.of(loaded)
    while (state := schedule.next_state) is not None:
        follower.add_state(state)
        matcher.add_state(state)
        for *_, block in follower.complete():
            matcher.add_block(block.rows)
        for start, end, rows in matcher.complete():
            pressure = microphone.listen(rows, start.until(end).mean_speed)
            yield MeasuredTick.between(start, end, pressure, rate)
        schedule.advance()


@pytest.mark.parametrize("seed", [1, 6, 11])
def test_the_nodes_give_the_same_levels(divided, seed):
    """What the nodes compute, and a bag holds, is what the scene gives without them."""
    scene = drawn(seed)
    settle = scene["program"]["settle_turns"]["assumed"]
    levels = levels_of(divided(scene, 1))
    for ticks in (1, 5):
        assert_equal(step_levels(run_of_the_nodes(divided(scene, ticks)), settle), levels)


@pytest.mark.parametrize(("cam", "rpm", "rate"), BOUNCING)
def test_bounces_enlarge_rounding_and_no_more(divided, cam, rpm, rate):
    """Where bounce after bounce enlarges the last digit, the ticks are worth a digit, not more.

    The limit is 1e-9 dB, and ten times what the last digit of the preload does to the level.
    """
    scene = drawn(3) | {"cams": [cam], "sample_rate": {"assumed": rate, "unit": "Hz"}}
    scene["program"] = {
        "speeds": {"assumed": [rpm], "unit": "rpm"},
        "turns": {"assumed": 4, "unit": "turns"},
        "settle_turns": {"assumed": 1, "unit": "turns"},
    }
    speed = rpm * RPM

    def level(ticks, nudge=0.0):
        return step_levels(run_of_the_nodes(divided(scene, ticks), nudge), 1)[cam][speed]

    one = level(1)
    digit = max(abs(level(1, nudge) - one) for nudge in (-1e-15, 1e-15))
    assert digit < 0.01  # else nothing would be shown
    for ticks in (3, 7):
        assert level(ticks) == pytest.approx(one, rel=0, abs=1e-9 + 10.0 * digit)


def test_samples_of_ticks_add_up(divided):
    """Each sample belongs to one tick: their number is the run's, however it is divided."""
    counts = [
        sum(tick.samples for tick in simulate(divided(drawn(0), ticks))) for ticks in (1, 3, 5)
    ]
    assert len(set(counts)) == 1
