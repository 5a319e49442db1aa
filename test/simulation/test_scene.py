"""A scene and every file it names, checked before it starts; what its levels are worth."""

import re
from dataclasses import replace
from fractions import Fraction
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import MODELS
from cam_rig.errors import ConfigError, LawError
from cam_rig.schema import RigConfig
from cam_rig.simulation.scene import is_calibrated, open_scene
from cam_rig.simulation.schedule import CamState, cam_states, run_length, tick_count
from cam_rig.units import NS, TURN


def test_shipped_scenes_open(config_dir):
    paths = sorted((config_dir / "scenes").glob("*.yaml"))
    assert paths
    for path in paths:
        loaded = open_scene(path)
        assert list(loaded.laws) == loaded.scene.cams
        assert all(file.is_file() for file in loaded.files)


def own_cam(tmp_path, config_dir, name, old, new):
    """A cam beside the scene, made from the shipped 3-4-5."""
    text = (config_dir / "cams" / "poly345.yaml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "cams" / f"{name}.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


UNSPRUNG = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")
KIND = r"{0}\.yaml: follower\.type is '{0}'; allowed on a rig: one that a closing spr"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cams": ["no_such_cam"]}, r"no_such_cam\.yaml"),
        ({"rig": "no_such_rig"}, r"no_such_rig\.yaml"),
        ({"published": "no_such_paper"}, r"no_such_paper\.yaml"),
        ({"cams": ["mine"]}, r"mine\.yaml: name is 'yours'; allowed: .*'mine'"),
        *(({"cams": [cam]}, KIND.format(cam)) for cam in UNSPRUNG),
    ],
)
def test_what_a_scene_cannot_name(make_loaded_scene, tmp_path, config_dir, changes, words):
    """No file; a cam whose file says another name; one that a second contact closes."""
    own_cam(tmp_path, config_dir, "mine", "name: poly345", "name: yours")
    with pytest.raises(ConfigError, match=words) as caught:
        make_loaded_scene(**changes)
    assert caught.value.exit_code == 2 and "\n" not in str(caught.value)


def test_level_step_names_the_file(make_loaded_scene, tmp_path, config_dir):
    path = own_cam(
        tmp_path,
        config_dir,
        "poly345",
        "{law: poly345, to: 0, span: {identified: 117.5, unit: deg",
        '{law: bezier, ordinates: {assumed: [0.5, 0, 0], unit: "1"}, '
        "span: {identified: 117.5, unit: deg",
    )
    with pytest.raises(LawError) as caught:
        make_loaded_scene(cams=["poly345"])
    assert caught.value.exit_code == 2
    message = str(caught.value)
    for words in (str(path), "segments[3]", "steps by -0.5 of the lift", "allowed: "):
        assert words in message
    assert "\n" not in message


def test_faces_arms_and_eccentric_rollers_are_known(make_loaded_scene):
    """They move against the closing spring like any other."""
    cams = ["flat", "inclined_flat", "eccentric_roller", "oscillating_roller", "oscillating_flat"]
    assert list(make_loaded_scene(cams=cams).laws) == cams


def test_a_table_brings_its_points(make_loaded_scene, tmp_path):
    """The file of points is one of the scene's files: a bag holds it, and can be analysed alone."""
    from cam_rig.bag.reader import read_scene
    from cam_rig.bag.writer import BagWriter

    loaded = make_loaded_scene(cams=["measured"], published=None)
    assert "measured.csv" in [path.name for path in loaded.files]
    writer = BagWriter(tmp_path / "bag")
    for path in loaded.files:
        writer.attach(f"{path.parent.name}/{path.name}", path.read_bytes())
    writer.close()
    again = read_scene(tmp_path / "bag")
    assert again.cams["measured"] == loaded.cams["measured"]


#: Numbers of a follower, SI: four that every model needs, and others.
FOUR = {"mass": 2.0, "spring_stiffness": 5000.0, "damping": 10.0, "preload": 60.0}
OPTIONAL = {"stem_stiffness": 1e6, "restitution": 0.3, "roller_share": 0.4, "stem_damping": 20.0}


def needs() -> dict[str, list[str]]:
    """What each model needs beside the four numbers, as docs/files.md says it."""
    text = (Path(__file__).parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
    rows = re.findall(r"^- model `(\w+)`: (.*)$", text, re.M)
    return {model: re.findall(r"`(\w+)`", keys) for model, keys in rows}


NEEDS = needs()


def rig_of(keys) -> RigConfig:
    """A rig with the four numbers and these keys alone; sections as a shipped rig has them."""
    shipped = {"shaft": cam_rig.load_rig("paper_flywheel"), "radiation": cam_rig.load_rig("tm21")}
    follower = FOUR | {key: OPTIONAL[key] for key in keys if key in OPTIONAL}
    sections = {key: getattr(shipped[key], key) for key in keys if key not in OPTIONAL}
    return cam_rig.Rig("mine", follower=follower, **sections)


def test_the_table_names_every_model():
    assert set(NEEDS) == set(MODELS)


def turned(model, keys):
    """A turn of a model on a rig with these keys alone."""
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    return cam_rig.simulate(law, rig_of(keys), rpm=200, model=model, turns=3)


@pytest.mark.parametrize("model", MODELS)
def test_a_model_asks_for_what_it_needs_and_no_more(model):
    """It turns with exactly its keys; each one fewer is named in one line, with what needs it."""
    assert turned(model, NEEDS[model]).force.size
    for missing in NEEDS[model]:
        with pytest.raises(ConfigError) as refused:
            turned(model, [key for key in NEEDS[model] if key != missing])
        words = str(refused.value)
        assert re.match(rf"rig mine: (follower\.)?{missing}: is missing; needed by ", words)
        assert "so add it" in words and "\n" not in words


@pytest.mark.parametrize("model", MODELS)
def test_a_level_asks_for_the_sound(model):
    """It needs ``radiation``, and the stem where a landing sounds, whatever the model else asks."""
    own = [*NEEDS[model], "radiation"]
    lands = MODELS[model].lifts_off
    keys = [*own, "stem_stiffness"] if lands and "stem_stiffness" not in own else own
    full = sorted({*own, "stem_stiffness"})
    level = cam_rig.sound_level(turned(model, keys)).level_db
    assert level == cam_rig.sound_level(turned(model, full)).level_db
    for missing in ("radiation", "stem_stiffness") if lands else ("radiation",):
        motion = turned(model, keys)
        left = rig_of([key for key in keys if key != missing])
        motion = type(motion)(**{**vars(motion), "rig": left})
        with pytest.raises(ConfigError, match=f"rig mine: .*{missing}: is missing; needed by the "):
            cam_rig.sound_level(motion)


def changed(rig, part, **numbers):
    """A rig file with other numbers, of whatever origin and unit, as a person copies and edits."""
    data = rig.model_dump(exclude_none=True)
    for key, number in numbers.items():
        data[part][key] = {"source": "own", **number}
    return RigConfig.model_validate(data)


OTHER = {"mass": {"given": 0.8, "unit": "kg"}}


@pytest.mark.parametrize(
    ("follower", "gain", "model", "calibrated"),
    [
        ({}, None, "one_mass", True),
        ({"mass": {"assumed": 1300.0, "unit": "g"}}, None, "one_mass", True),  # the same number
        (OTHER, None, "one_mass", False),
        ({"spring_stiffness": {"given": 9.0, "unit": "N/mm"}}, None, "one_mass", False),
        ({"preload": {"given": 40.0, "unit": "N"}}, None, "one_mass", False),
        ({"restitution": {"assumed": 0.3, "unit": "1"}}, None, "one_mass", False),
        ({"roller_share": {"assumed": 0.4, "unit": "1"}}, None, "one_mass", False),
        ({}, None, "elastic_stem", False),
        (OTHER, "identified", "two_mass", True),
        (OTHER, "assumed", "one_mass", False),
    ],
)
def test_constants_count_for_their_follower(rig, follower, gain, model, calibrated):
    """Another follower or model has no calibration, unless its constants were fitted again."""
    copy = changed(rig, "follower", **follower)
    if gain is not None:
        copy = changed(copy, "radiation", gain={gain: 2e-4, "unit": "Pa*s/N"})
    assert is_calibrated(copy, model) == calibrated


def test_no_cam_of_an_uncalibrated_scene_has_a_role(rig):
    """Neither calibrated, nor predicted, nor identified: all of its levels are relative."""
    scene = cam_rig.load_scene("tm21_sweep")
    assert {scene.level_origin(cam) for cam in scene.cams} == {
        "calibrated",
        "predicted",
        "identified",
    }
    own = replace(scene, rig=changed(rig, "follower", **OTHER))
    assert {own.level_origin(cam) for cam in own.cams} == {"relative"}
    assert (
        own.fitted_origin("poly345") == "calibrated"
    )  # what a study that calibrates anew starts from


def test_another_cam_of_the_calibrated_name_is_a_prediction():
    """The constants were fitted to the shipped cam, not to whatever has its name."""
    scene = cam_rig.load_scene("tm21_sweep")
    lower = scene.cams["poly345"].model_copy(update={"lift": scene.cams["tm21"].lift})
    own = replace(scene, cams=scene.cams | {"poly345": lower})
    assert own.level_origin("poly345") == "predicted" and own.level_origin("tm21") == "identified"


@pytest.fixture(params=[1, 7, 64])
def scene(request, make_scene):
    return make_scene(ticks_per_turn=request.param, speeds=[200, 333, 400, 210])


def test_length_and_longest_tick_are_those_of_the_states(scene, ramped):
    """The last stamp, and to a nanosecond the longest of the gaps; along ramps as well."""
    for program in (scene, ramped):
        times = [state.time_ns for state in cam_states(program)]
        length, longest = run_length(program)
        assert length == times[-1]
        assert 0 <= longest - max(np.diff(times)) <= 1


def test_a_scene_of_any_length_begins_at_once(make_scene):
    """Its first states are those of a short one; a list of all of them would hold 1e7."""
    short = make_scene(ticks_per_turn=64, speeds=[333], turns=5)
    long = make_scene(ticks_per_turn=64, speeds=[333], turns=100_000)
    assert list(islice(cam_states(long), 320)) == list(islice(cam_states(short), 320))
    assert run_length(long)[0] == pytest.approx(2 * 100_000 * 60 / 333 * NS, rel=1e-12)


def test_each_step_is_whole_turns(scene):
    """Every cam turns three times at every speed; half a nanosecond of turning is 3e-8 rad."""
    states = list(cam_states(scene))
    steps = [states[0]]
    for before, after in pairwise(states):
        if (after.cam, after.speed) != (before.cam, before.speed):
            steps.append(after)
    assert len(steps) == 2 * 4 + 1
    turned = np.diff([state.unwrapped for state in steps]) / TURN
    np.testing.assert_allclose(turned, 3.0, rtol=0, atol=1e-8)


def test_the_angle_keeps_its_digits(make_scene):
    """θ of each state of a speed held for a thousand turns is ω t to the last digit, turns and all.

    One number for both would have lost three digits of it.
    """
    scene = make_scene(speeds=[300, 400], turns=1000)
    last = None
    for state in cam_states(scene):
        if last is None or state.speed != last.speed:
            last = state
        ahead = Fraction(last.speed) * (state.time_ns - last.time_ns) / NS
        turned = ahead + Fraction(last.angle) + last.turns * Fraction(TURN)
        away = Fraction(state.angle) + state.turns * Fraction(TURN) - turned
        assert 0.0 <= state.angle < TURN and abs(float(away)) < 2e-15
        if state.speed == 0.0:
            break


def test_order_of_cams_and_speeds(scene):
    """Cam after cam, and for each the speeds in the order given; as many ticks as said."""
    states = list(cam_states(scene))
    assert len(states) == tick_count(scene) + 1 == 2 * 4 * 3 * scene.program.ticks_per_turn + 1
    assert states[0].time_ns == 0
    assert all(a.time_ns < b.time_ns for a, b in pairwise(states))
    assert (states[-1].speed, states[-1].cam) == (0.0, "bezier15")
    played = dict.fromkeys((state.cam, state.speed) for state in states if state.speed)
    rates = [float(speed) for speed in scene.program.speeds.si_list]
    assert list(played) == [(cam, speed) for cam in ("poly345", "bezier15") for speed in rates]


@pytest.fixture(params=[1, 5])
def ramped(request, make_scene):
    """Up, on, down and no change: from rest for each of two cams."""
    speeds = [200, 333, 100, 100]
    return make_scene(speeds=speeds, turns=2, ticks_per_turn=request.param, ramp=0.7)


def intervals(scene):
    return [before.until(after) for before, after in pairwise(cam_states(scene))]


def test_angle_and_speed_go_on(scene, ramped):
    """The angle never jumps; speeds jump only between held ones, and where a cam is put on."""
    for program in (scene, ramped):
        states = list(cam_states(program))
        for part, (before, after) in zip(intervals(program), pairwise(states), strict=True):
            assert part.unwrapped_at(part.duration) == pytest.approx(after.unwrapped, abs=1e-11)
            if program is ramped and after.cam == before.cam and after is not states[-1]:
                assert part.speed_at(part.duration) == pytest.approx(after.speed, rel=1e-9)
    assert states[0].speed == 0.0
    parts = intervals(ramped)
    assert len(parts) == tick_count(ramped)
    ramps = sum(part.duration for part in parts if part.acceleration != 0.0)
    assert ramps == pytest.approx(2 * 3 * 0.7, rel=1e-12)


def test_ticks_of_a_ramp_are_no_longer_than_of_its_faster_end(ramped):
    """So a bag's blocks are not larger along a ramp."""
    turn = TURN / ramped.program.ticks_per_turn
    for part in intervals(ramped):
        if part.acceleration != 0.0:
            fastest = max(part.speed, part.speed_at(part.duration))
            assert part.duration * fastest <= turn * (1.0 + 1e-6) or part.mean_speed < 1.0
    assert max(part.mean_speed * part.duration for part in intervals(ramped)) <= turn * 1.000001


@pytest.mark.parametrize(
    ("first", "second", "turned", "acceleration"),
    [
        (10.0, 20.0, 15.0, 10.0),  # turned at the mean: a ramp
        (10.0, 20.0, 10.0, 0.0),  # turned at the first speed: a step at the end
        (0.0, 20.0, 10.0, 20.0),  # from rest
        (20.0, 0.0, 10.0, -20.0),  # down to rest
        (20.0, 0.0, 20.0, 0.0),  # held, and stands from there on
        (20.0, 20.0, 20.0, 0.0),
    ],
)
def test_what_two_states_tell(first, second, turned, acceleration):
    """A ramp is inferred from the angle turned, nothing else is sent."""
    one = CamState(0, 3.0, first, "poly345")
    part = one.until(CamState(NS, 3.0 + turned, second, "poly345"))
    assert part.acceleration == acceleration
