"""Tests of the loading of scenes, origins of sound levels, and the cam's schedule.

The origin of a level is how its constants were obtained, such as "calibrated" or "relative".
"""

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
    """Each shipped scene loads with all its laws and files."""
    paths = sorted((config_dir / "scenes").glob("*.yaml"))
    assert paths
    for path in paths:
        loaded = open_scene(path)
        assert list(loaded.laws) == loaded.scene.cams
        assert all(file.is_file() for file in loaded.files)


def write_cam(tmp_path, config_dir, name, old, new):
    """Write a changed copy of poly345 next to the scene, and return its path."""
    text = (config_dir / "cams" / "poly345.yaml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "cams" / f"{name}.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


UNSPRUNG = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")
KIND = r"{0}\.yaml: follower\.type is '{0}'; allowed on a rig: a follower that only a clos"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cams": ["no_such_cam"]}, r"no_such_cam\.yaml"),
        ({"rig": "no_such_rig"}, r"no_such_rig\.yaml"),
        ({"published": "no_such_paper"}, r"no_such_paper\.yaml"),
        ({"cams": ["mine"]}, r"mine\.yaml: name is 'yours'; allowed: .*'mine'"),
        *(({"cams": [cam]}, KIND.format(cam)) for cam in UNSPRUNG),
    ],
)
def test_a_wrong_name_in_a_scene_is_an_error(
    make_loaded_scene, tmp_path, config_dir, changes, message
):
    """A scene that refers to an unusable cam file is refused with the file's name.

    The file is missing, contains another name, or is of a cam that needs a second follower.
    """
    write_cam(tmp_path, config_dir, "mine", "name: poly345", "name: yours")
    with pytest.raises(ConfigError, match=message) as caught:
        make_loaded_scene(**changes)
    assert caught.value.exit_code == 2 and "\n" not in str(caught.value)


def test_the_error_of_a_step_of_lift_names_the_file(make_loaded_scene, tmp_path, config_dir):
    """A cam whose lift has a step raises LawError with file, segment and height."""
    path = write_cam(
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
    for text in (str(path), "segments[3]", "steps by -0.5 of the lift", "allowed: "):
        assert text in message
    assert "\n" not in message


def test_a_scene_accepts_all_followers_with_a_closing_spring(make_loaded_scene):
    """A scene accepts cams with flat, oscillating and eccentric followers.

    A spring presses these followers on the cam.
    """
    cams = ["flat", "inclined_flat", "eccentric_roller", "oscillating_roller", "oscillating_flat"]
    assert list(make_loaded_scene(cams=cams).laws) == cams


def test_the_points_of_a_table_are_a_file_of_the_scene(make_loaded_scene, tmp_path):
    """The file of points of a measured cam belongs to the files of a scene.

    A bag contains it, so that the bag can be analysed without other files.
    """
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


#: Parameters of a follower that every model needs, in SI units.
REQUIRED = {"mass": 2.0, "spring_stiffness": 5000.0, "damping": 10.0, "preload": 60.0}
#: Parameters of a follower that some models need, in SI units.
OPTIONAL = {"stem_stiffness": 1e6, "restitution": 0.3, "roller_share": 0.4, "stem_damping": 20.0}


def needs() -> dict[str, list[str]]:
    """Return the additional rig keys that each model needs, as in docs/files.md."""
    text = (Path(__file__).parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
    rows = re.findall(r"^- model `(\w+)`: (.*)$", text, re.M)
    return {model: re.findall(r"`(\w+)`", keys) for model, keys in rows}


NEEDS = needs()


def rig_of(keys) -> RigConfig:
    """Return a rig with the required numbers and these keys.

    Sections such as the shaft are those of shipped rigs.
    """
    shipped = {"shaft": cam_rig.load_rig("paper_flywheel"), "radiation": cam_rig.load_rig("tm21")}
    follower = REQUIRED | {key: OPTIONAL[key] for key in keys if key in OPTIONAL}
    sections = {key: getattr(shipped[key], key) for key in keys if key not in OPTIONAL}
    return cam_rig.Rig("mine", follower=follower, **sections)


def test_the_list_of_docs_names_every_model():
    """docs/files.md lists the required rig keys of every model."""
    assert set(NEEDS) == set(MODELS)


def simulate(model, keys):
    """Simulate three turns of the 3-4-5 cam with a model on a rig with these keys."""
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    return cam_rig.simulate(law, rig_of(keys), rpm=200, model=model, turns=3)


@pytest.mark.parametrize("model", MODELS)
def test_a_model_needs_exactly_its_documented_keys(model):
    """A model runs with its documented keys, and each missing key is an error.

    The error is one line that states the key.
    """
    assert simulate(model, NEEDS[model]).force.size
    for missing in NEEDS[model]:
        with pytest.raises(ConfigError) as caught:
            simulate(model, [key for key in NEEDS[model] if key != missing])
        message = str(caught.value)
        assert re.match(rf"rig mine: (follower\.)?{missing}: is missing; needed by ", message)
        assert "so add it" in message and "\n" not in message


def test_all_missing_keys_are_named_at_once():
    """The error of a rig without several keys lists them all, also in its remedy."""
    with pytest.raises(ConfigError) as caught:
        simulate("two_mass", [])
    keys = ["restitution", "roller_share", "stem_stiffness", "stem_damping"]
    message = str(caught.value)
    assert message.startswith(f"rig mine: {', '.join(f'follower.{key}' for key in keys)}: are ")
    assert f"rig.replace({', '.join(f'{key}=...' for key in keys)})" in message


@pytest.mark.parametrize("model", MODELS)
def test_a_level_needs_the_numbers_of_the_sound(model):
    """A sound level needs the rig section `radiation`.

    For a model with landings it also needs the stem's stiffness. Each missing key is an error.
    """
    base = [*NEEDS[model], "radiation"]
    lands = MODELS[model].lifts_off
    keys = [*base, "stem_stiffness"] if lands and "stem_stiffness" not in base else base
    all_keys = sorted({*base, "stem_stiffness"})
    level = cam_rig.sound_level(simulate(model, keys)).level_db
    assert level == cam_rig.sound_level(simulate(model, all_keys)).level_db
    for missing in ("radiation", "stem_stiffness") if lands else ("radiation",):
        motion = simulate(model, keys)
        incomplete = rig_of([key for key in keys if key != missing])
        motion = type(motion)(**{**vars(motion), "rig": incomplete})
        with pytest.raises(ConfigError, match=f"rig mine: .*{missing}: is missing; needed by the "):
            cam_rig.sound_level(motion)


def edit_rig(rig, section, **numbers):
    """Return a rig with other numbers in a section.

    Each number has its origin (given, assumed or identified) and unit.
    """
    data = rig.model_dump(exclude_none=True)
    for key, number in numbers.items():
        data[section][key] = {"source": "own", **number}
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
def test_a_calibration_is_valid_for_its_follower(rig, follower, gain, model, calibrated):
    """A rig whose follower or model is changed does not count as calibrated.

    It counts as calibrated again if its radiation constants are identified (fitted). The same
    number in another unit is not a change.
    """
    copy = edit_rig(rig, "follower", **follower)
    if gain is not None:
        copy = edit_rig(copy, "radiation", gain={gain: 2e-4, "unit": "Pa*s/N"})
    assert is_calibrated(copy, model) == calibrated


def test_all_levels_of_an_uncalibrated_scene_are_relative(rig):
    """The sound levels of a scene on an uncalibrated rig are all relative.

    On a calibrated rig their origins are calibrated, predicted or identified.
    """
    scene = cam_rig.load_scene("tm21_sweep")
    assert {scene.level_origin(cam) for cam in scene.cams} == {
        "calibrated",
        "predicted",
        "identified",
    }
    uncalibrated = replace(scene, rig=edit_rig(rig, "follower", **OTHER))
    assert {uncalibrated.level_origin(cam) for cam in uncalibrated.cams} == {"relative"}
    # A study that calibrates the rig again starts from the origins in the files.
    assert uncalibrated.fitted_origin("poly345") == "calibrated"


def test_another_cam_with_the_calibrated_name_is_predicted():
    """The level of a changed cam that has the name of the calibrated cam is predicted.

    The radiation constants were fitted to the shipped cam of this name.
    """
    scene = cam_rig.load_scene("tm21_sweep")
    lower = scene.cams["poly345"].model_copy(update={"lift": scene.cams["tm21"].lift})
    other = replace(scene, cams=scene.cams | {"poly345": lower})
    assert other.level_origin("poly345") == "predicted"
    assert other.level_origin("tm21") == "identified"


@pytest.fixture(params=[1, 7, 64])
def scene(request, make_scene):
    """Scene with four speeds, not in order.

    The test runs for 1, 7 and 64 ticks per turn. A tick is the interval between two cam states.
    """
    return make_scene(ticks_per_turn=request.param, speeds=[200, 333, 400, 210])


def test_run_length_is_that_of_the_states(scene, ramped):
    """`run_length` returns the end of the last tick and the longest tick, to 1 ns.

    A tick is the interval between two cam states.
    """
    for program in (scene, ramped):
        times = [state.time_ns for state in cam_states(program)]
        length, longest = run_length(program)
        assert length == times[-1]
        assert 0 <= longest - max(np.diff(times)) <= 1


def test_a_long_scene_starts_without_computing_all_states(make_scene):
    """The first cam states of a scene of 100 000 turns are available at once.

    They equal those of a short scene.
    """
    short = make_scene(ticks_per_turn=64, speeds=[333], turns=5)
    long = make_scene(ticks_per_turn=64, speeds=[333], turns=100_000)
    assert list(islice(cam_states(long), 320)) == list(islice(cam_states(short), 320))
    assert run_length(long)[0] == pytest.approx(2 * 100_000 * 60 / 333 * NS, rel=1e-12)


def test_the_angle_is_exact_after_many_turns(make_scene):
    """Angle and turns of each cam state are ω t within 2e-15 rad.

    A thousand turns are checked. A single float for both would lose three digits.
    """
    scene = make_scene(speeds=[300, 400], turns=1000)
    last = None
    for state in cam_states(scene):
        if last is None or state.speed != last.speed:
            last = state
        turned = Fraction(last.speed) * (state.time_ns - last.time_ns) / NS
        expected = turned + Fraction(last.angle) + last.turns * Fraction(TURN)
        error = Fraction(state.angle) + state.turns * Fraction(TURN) - expected
        assert 0.0 <= state.angle < TURN and abs(float(error)) < 2e-15
        if state.speed == 0.0:
            break


def test_order_of_cams_and_speeds(scene):
    """The cam states have cams and speeds in the order of the scene, and rising times.

    Their number is `tick_count` + 1, because a tick is the interval between two states.
    """
    states = list(cam_states(scene))
    assert len(states) == tick_count(scene) + 1 == 2 * 4 * 3 * scene.schedule.ticks_per_turn + 1
    assert states[0].time_ns == 0
    assert all(a.time_ns < b.time_ns for a, b in pairwise(states))
    assert (states[-1].speed, states[-1].cam) == (0.0, "bezier15")
    steps = dict.fromkeys((state.cam, state.speed) for state in states if state.speed)
    speeds = [float(speed) for speed in scene.schedule.speeds.si_list]
    assert list(steps) == [(cam, speed) for cam in ("poly345", "bezier15") for speed in speeds]


@pytest.fixture(params=[1, 5])
def ramped(request, make_scene):
    """Scene with speed ramps up and down and a repeated speed.

    The test runs for one and five ticks per turn.
    """
    speeds = [200, 333, 100, 100]
    return make_scene(speeds=speeds, turns=2, ticks_per_turn=request.param, ramp=0.7)


def intervals(scene):
    return [state.until(following) for state, following in pairwise(cam_states(scene))]


def test_angle_and_speed_are_continuous(scene, ramped):
    """The cam angle is continuous from each cam state of a scene to the next.

    With ramps the speed jumps only at a change of cam.
    """
    for program in (scene, ramped):
        states = list(cam_states(program))
        for part, (state, following) in zip(intervals(program), pairwise(states), strict=True):
            end_angle = part.unwrapped_at(part.duration)
            assert end_angle == pytest.approx(following.unwrapped, abs=1e-11)
            if program is ramped and following.cam == state.cam and following is not states[-1]:
                assert part.speed_at(part.duration) == pytest.approx(following.speed, rel=1e-9)
    assert states[0].speed == 0.0
    parts = intervals(ramped)
    assert len(parts) == tick_count(ramped)
    ramps = sum(part.duration for part in parts if part.acceleration != 0.0)
    assert ramps == pytest.approx(2 * 3 * 0.7, rel=1e-12)


def test_ticks_of_a_ramp_are_not_longer_than_at_its_higher_speed(ramped):
    """A tick on a ramp is not longer than a tick at the ramp's higher speed.

    A tick is the interval between two cam states. The blocks of samples in a bag are therefore not
    larger on a ramp.
    """
    turn = TURN / ramped.schedule.ticks_per_turn
    for part in intervals(ramped):
        if part.acceleration != 0.0:
            fastest = max(part.speed, part.speed_at(part.duration))
            assert part.duration * fastest <= turn * (1.0 + 1e-6) or part.mean_speed < 1.0
    assert max(part.mean_speed * part.duration for part in intervals(ramped)) <= turn * 1.000001


@pytest.mark.parametrize(
    ("first", "second", "turned", "acceleration"),
    [
        (10.0, 20.0, 15.0, 10.0),  # mean speed: a ramp
        (10.0, 20.0, 10.0, 0.0),  # first speed: a step at the end
        (0.0, 20.0, 10.0, 20.0),  # from rest
        (20.0, 0.0, 10.0, -20.0),  # down to rest
        (20.0, 0.0, 20.0, 0.0),  # constant speed up to a stop
        (20.0, 20.0, 20.0, 0.0),
    ],
)
def test_a_ramp_is_inferred_from_two_states(first, second, turned, acceleration):
    """The motion between two cam states is a ramp if the cam turned by the mean speed.

    Otherwise the speed steps at the second state.
    """
    state = CamState(0, 3.0, first, "poly345")
    part = state.until(CamState(NS, 3.0 + turned, second, "poly345"))
    assert part.acceleration == acceleration
