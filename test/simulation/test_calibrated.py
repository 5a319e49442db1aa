"""A level is called calibrated only where the rig's constants were fitted with its own follower."""

from dataclasses import replace

import pytest

import cam_rig
from cam_rig.schema import RigConfig
from cam_rig.simulation.scene import RELATIVE, is_calibrated


def changed(rig, part, **numbers):
    """A rig file with other numbers, of whatever origin and unit, as a person copies and edits."""
    data = rig.model_dump(exclude_none=True)
    for key, number in numbers.items():
        data[part][key] = {"source": "own", **number}
    return RigConfig.model_validate(data)


@pytest.fixture(scope="module")
def tm21():
    return cam_rig.load_rig("tm21")


@pytest.mark.parametrize(
    "numbers",
    [
        {"mass": {"given": 0.8, "unit": "kg"}},
        {"spring_stiffness": {"given": 9.0, "unit": "N/mm"}},
        {"preload": {"given": 40.0, "unit": "N"}},
        {"restitution": {"assumed": 0.3, "unit": "1"}},
        {"roller_share": {"assumed": 0.4, "unit": "1"}},
    ],
)
def test_a_copy_with_another_follower_is_not_calibrated(tm21, numbers):
    """The constants stand in its file as identified, but with another follower."""
    assert is_calibrated(tm21, "one_mass")
    assert not is_calibrated(changed(tm21, "follower", **numbers), "one_mass")


def test_the_same_follower_in_other_words(tm21):
    """Units and origins change nothing: what counts is the number."""
    same = changed(tm21, "follower", mass={"assumed": 1300.0, "unit": "g"})
    assert is_calibrated(same, "one_mass")


def test_constants_of_its_own(tm21):
    """Fitted anew they count; assumed they do not."""
    rig = changed(tm21, "follower", mass={"given": 0.8, "unit": "kg"})
    fitted = changed(rig, "radiation", gain={"identified": 2e-4, "unit": "Pa*s/N"})
    assumed = changed(rig, "radiation", gain={"assumed": 2e-4, "unit": "Pa*s/N"})
    assert is_calibrated(fitted, "two_mass")
    assert not is_calibrated(assumed, "one_mass")


def test_another_model_was_not_fitted(tm21):
    """The constants take the model's error too."""
    assert not is_calibrated(tm21, "elastic_stem")
    assert not is_calibrated(cam_rig.load_rig("paper_table2"), "two_mass")


def test_no_cam_of_an_uncalibrated_scene_has_a_role(tm21):
    """Neither calibrated, nor predicted, nor identified: all of its levels are relative."""
    scene = cam_rig.load_scene("tm21_sweep")
    assert {scene.role(cam) for cam in scene.cams} == {"calibrated", "predicted", "identified"}
    rig = changed(tm21, "follower", mass={"given": 0.8, "unit": "kg"})
    own = replace(scene, rig=rig)
    assert {own.role(cam) for cam in own.cams} == {RELATIVE}
    assert own.part("poly345") == "calibrated"  # what a study that calibrates anew starts from


def test_another_cam_of_the_calibrated_name_is_a_prediction():
    """The constants were fitted to the shipped cam, not to whatever has its name."""
    scene = cam_rig.load_scene("tm21_sweep")
    lower = scene.cams["poly345"].model_copy(update={"lift": scene.cams["tm21"].lift})
    own = replace(scene, cams=scene.cams | {"poly345": lower})
    assert own.role("poly345") == "predicted"
    assert own.role("tm21") == "identified"
