"""What `import cam_rig` is given wrongly is refused in one line, by the argument's name."""

import math

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


@pytest.mark.parametrize("duration", [1e5, -1, 0, math.nan])
def test_a_duration_out_of_range(law, two_mass_rig, duration):
    """A run longer than the command's would not end in any useful time."""
    with pytest.raises(DynamicsError, match="allowed: above 0, to 60 s"):
        cam_rig.jump_speed(law, two_mass_rig, duration=duration)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"rpm": -100}, "rpm: is -100 rpm; allowed: at least 0.01 rpm"),
        ({"rpm": "450"}, "rpm: is '450'; allowed"),
        ({"rpm": 450, "turns": None}, "turns: is None; allowed"),
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


def test_another_type(law, two_mass_rig):
    """The message says where the right one is had."""
    for call in (
        lambda: cam_rig.simulate("poly345", two_mass_rig, rpm=450),
        lambda: cam_rig.jump_speed(two_mass_rig, law),
        lambda: cam_rig.contour("poly345"),
        lambda: cam_rig.sound_level(None),
    ):
        with pytest.raises(ConfigError, match=r"allowed: a .*, of "):
            call()


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
