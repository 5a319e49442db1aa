"""What `import cam_rig` is given wrongly is refused in one line, by the argument's name."""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import BagError, ConfigError, DynamicsError, LawError


@pytest.fixture(scope="module")
def law():
    """A shipped law."""
    return cam_rig.build_law(cam_rig.load_cam("poly345"))


@pytest.fixture(scope="module")
def two_mass_rig():
    """A rig with two masses."""
    return cam_rig.load_rig("paper_table2")


@pytest.mark.parametrize("order", [-1, 1.5])
def test_a_derivative_that_does_not_exist(law, order):
    """A negative order gave another derivative."""
    with pytest.raises(LawError, match=rf"order is {order}; allowed: 0, 1"):
        law(1.0, order)


@pytest.mark.parametrize("duration", [1e5, -1, 0])
def test_a_duration_out_of_range(law, two_mass_rig, duration):
    """A run longer than the command's would not end in any useful time."""
    with pytest.raises(DynamicsError, match="allowed: above 0, to 60 s"):
        cam_rig.jump_speed(law, two_mass_rig, duration=duration)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"rpm": -100}, "rpm: is -100 rpm; allowed: at least 0.01 rpm"),
        ({"rpm": "450"}, r"rpm: is '450' \(str\); allowed: a finite number"),
        ({"rpm": 450, "turns": None}, r"turns: is None \(NoneType\); allowed: a whole number"),
        ({"rpm": 450, "turns": 100_000}, "make 6.4e[+]08 samples; allowed: 2e[+]07"),
        (
            {"rpm": 450, "model": "two mass"},
            "model: is 'two mass' .did you mean 'two_mass'.*; allowed: .*'two_mass'",
        ),
    ],
)
def test_a_motion_that_cannot_be(law, two_mass_rig, arguments, words):
    """Whatever number is wrong is named as the caller named it."""
    with pytest.raises(ConfigError, match=words):
        cam_rig.simulate(law, two_mass_rig, **arguments)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda law, rig: cam_rig.build_law("poly345"),
            "cam: is 'poly345' (str); allowed: a cam, of load_cam('poly345')",
        ),
        (
            lambda law, rig: cam_rig.simulate("poly345", rig, rpm=450),
            "law: is 'poly345' (str); allowed: a Law, of build_law",
        ),
        (
            lambda law, rig: cam_rig.jump_speed(rig, law),
            "law: is RigConfig; allowed: a Law, of build_law",
        ),
        (
            lambda law, rig: cam_rig.jump_speed(law, rig, duration=True),
            "duration: is True (bool); allowed: a finite number or None",
        ),
        (
            lambda law, rig: cam_rig.jump_speed(law, rig, duration=math.nan),
            "duration: is nan (float); allowed: a finite number or None",
        ),
        (
            lambda law, rig: cam_rig.sound_level(None),
            "motion: is None (NoneType); allowed: a motion, of simulate",
        ),
        (
            lambda law, rig: cam_rig.load_cam(None),
            "cam: is None (NoneType); allowed: a text without NUL or a path",
        ),
        (
            lambda law, rig: cam_rig.simulate(law, rig, rpm=10**5000),
            "rpm: is int; allowed: a finite number",
        ),
    ],
)
def test_another_type(law, two_mass_rig, call, words):
    """The message names argument, value, type and what is allowed, and where that is had."""
    with pytest.raises(ConfigError) as refused:
        call(law, two_mass_rig)
    assert str(refused.value) == words


def test_a_number_of_numpy(law, two_mass_rig):
    """A speed out of an array of whole numbers is a speed."""
    speed, turns = np.arange(300, 500, 50)[1], np.int64(2)
    assert cam_rig.simulate(law, two_mass_rig, rpm=speed, turns=turns).rpm == 350.0


def test_wrong_names_and_numbers_of_arguments(law, two_mass_rig):
    """They are Python's own TypeError, as of any function."""
    with pytest.raises(TypeError, match="speed"):
        cam_rig.simulate(law, two_mass_rig, speed=450)
    with pytest.raises(TypeError, match="rig"):
        cam_rig.jump_speed(law)


def test_a_level_is_calibrated_only_on_the_rig_that_was(law):
    """Another follower, or a cam that would have to pull, was never measured."""
    rig = cam_rig.load_rig("tm21")
    assert cam_rig.sound_level(cam_rig.simulate(law, rig, rpm=300)).calibrated
    lighter = rig.with_follower(mass=1.0, preload=100.0)
    assert not cam_rig.sound_level(cam_rig.simulate(law, lighter, rpm=300)).calibrated
    pulled = cam_rig.simulate(law, rig, model="kinetostatic", rpm=800)
    assert not cam_rig.sound_level(pulled).calibrated


def test_a_scene_with_other_cams_than_the_bag():
    """It is said at once, not when a level is asked for."""
    with pytest.raises(BagError, match=r"holds .*tm21; allowed: the cams of scene jump_two_mass"):
        cam_rig.read_bag("bags/golden", "jump_two_mass")
