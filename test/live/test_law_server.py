"""Tests of the law server without ROS: mounted cams, published and checked laws."""

import numpy as np
import pytest

from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.law_server import (
    CamMounting,
    contour_of,
    require_own_contour,
    require_own_law,
)
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState, cam_states

LOADED = open_scene(config_root() / "scenes" / "quick.yaml")
STATES = list(cam_states(LOADED.scene))


@pytest.fixture
def cams():
    return CamMounting(LOADED)


def test_the_first_cam_of_the_scene_is_mounted_by_default(cams):
    """The first cam of the scene is mounted, or the cam that the constructor names.

    An unknown cam is an error.
    """
    assert (cams.cam, cams.law.name) == (LOADED.scene.cams[0],) * 2
    assert CamMounting(LOADED, "cycloidal").cam == "cycloidal"
    with pytest.raises(CamRigError, match="nonsense"):
        CamMounting(LOADED, "nonsense")


def test_a_cam_of_the_library_is_mounted_on_request(cams):
    """A request of a cam mounts it and returns True. A repeated request returns False."""
    assert [cams.request("cycloidal") for _ in range(2)] == [True, False]
    assert cams.law.name == "cycloidal"


@pytest.mark.parametrize(
    ("cam", "text"),
    [
        ("nonsense", "nonsense"),
        ("../rigs/tm21", "allowed"),
        ("conjugate", "allowed on a rig: a follower that only a closing spring keeps"),
    ],
)
def test_a_rejected_request_does_not_change_the_mounted_cam(cams, cam, text):
    """A request of an impossible cam is an error, and the mounted cam remains.

    The cam has no file, is named by a path, or needs a second follower.
    """
    with pytest.raises(CamRigError, match=text):
        cams.request(cam)
    assert cams.cam == LOADED.scene.cams[0]


def test_the_file_of_a_rejected_cam_is_read_again(tmp_path, make_loaded_scene):
    """A cam that was rejected is mounted on request after its file is corrected."""
    (tmp_path / "cams").mkdir()
    own, shipped = tmp_path / "cams" / "own.yaml", config_root() / "cams" / "poly345.yaml"
    text = shipped.read_text(encoding="utf-8").replace("name: poly345", "name: own")
    own.write_text(text.replace("law: poly345", "law: constant_velocity"), encoding="utf-8")
    cams = CamMounting(make_loaded_scene(rig="paper_table2", model="torsional"))
    with pytest.raises(CamRigError, match="velocity"):
        cams.request("own")
    own.write_text(text, encoding="utf-8")
    assert cams.request("own")
    assert cams.law.name == "own"


def test_a_law_is_published_for_each_new_cam_or_speed(cams):
    """The law of the turning cam is published once for each new cam or speed."""
    published = []
    for state in STATES:
        cams.validator.validate(state)
        if (law := cams.follow(state)) is not None:
            published.append((law.name, state.speed))
    turned = [(state.cam, state.speed) for state in STATES if state.speed > 0.0]
    assert published == list(dict.fromkeys(turned))


def test_a_state_of_an_unknown_cam_is_rejected(cams):
    """The cam state of an unknown cam is refused, and the next valid one accepted."""
    with pytest.raises(RefusedError, match=r"cam state: .*unknown"):
        cams.follow(CamState(0, 0.0, 20.0, "unknown"))
    assert cams.follow(STATES[0]) is not None


def test_laws_and_contours_must_be_those_of_the_cams_file():
    """A law or contour that differs from the cam's file is refused.

    The error names file, difference and limit. A second law server therefore cannot publish
    another law of the same name. Differences by rounding are accepted.
    """
    law, points = LOADED.laws["tm21"], contour_of(LOADED.cams["tm21"], LOADED.laws["tm21"])
    require_own_law(LOADED, Law("tm21", law.breaks, law.ordinates * (1.0 + 1e-12)))
    require_own_contour(LOADED, "tm21", points.astype(np.float32))
    text = (
        r"law 'tm21': its ordinates differ by .* of .*tm21\.yaml, more than .*a second law server"
    )
    with pytest.raises(RefusedError, match=text):
        require_own_law(LOADED, Law("tm21", law.breaks, law.ordinates * 1.01))
    with pytest.raises(RefusedError, match=r"law 'tm21': its breaks must be .* got"):
        other = LOADED.laws["bezier15"]
        require_own_law(LOADED, Law("tm21", other.breaks, other.ordinates))
    with pytest.raises(RefusedError, match=r"cam 'nothing': not in the scene's library"):
        require_own_law(LOADED, Law("nothing", law.breaks, law.ordinates))
    with pytest.raises(RefusedError, match="contour of 'tm21': its points differ"):
        require_own_contour(LOADED, "tm21", 1.01 * points)
