"""The law server without ROS: which cams may be mounted, why another may not, what it publishes."""

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


def test_the_scenes_first_cam_is_mounted_at_the_start(cams):
    """Unless another one is named."""
    assert (cams.cam, cams.law.name) == (LOADED.scene.cams[0],) * 2
    assert CamMounting(LOADED, "cycloidal").cam == "cycloidal"
    with pytest.raises(CamRigError, match="nonsense"):
        CamMounting(LOADED, "nonsense")


def test_a_cam_of_the_library_is_mounted_on_request(cams):
    """A second request finds it there, and changes nothing."""
    assert [cams.request("cycloidal") for _ in range(2)] == [True, False]
    assert cams.law.name == "cycloidal"


@pytest.mark.parametrize(
    ("cam", "words"),
    [
        ("nonsense", "nonsense"),
        ("../rigs/tm21", "allowed"),
        ("conjugate", "allowed on a rig: a follower that only a closing spring keeps"),
    ],
)
def test_a_refused_request_leaves_the_mounted_cam(cams, cam, words):
    """The reply names what is wrong: no such file, a path, a follower that is moved both ways."""
    with pytest.raises(CamRigError, match=words):
        cams.request(cam)
    assert cams.cam == LOADED.scene.cams[0]


def test_a_cam_that_was_refused_is_read_again(tmp_path, make_loaded_scene):
    """An operator mends its file; the same request then mounts it."""
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
    """Once; not for the state in which a cam stands."""
    found = []
    for state in STATES:
        cams.validator.validate(state)
        if (law := cams.follow(state)) is not None:
            found.append((law.name, state.speed))
    turned = [(state.cam, state.speed) for state in STATES if state.speed > 0.0]
    assert found == list(dict.fromkeys(turned))


def test_a_state_of_an_unknown_cam_is_refused(cams):
    """Its file is not in the library; the next state is taken."""
    with pytest.raises(RefusedError, match=r"cam state: .*unknown"):
        cams.follow(CamState(0, 0.0, 20.0, "unknown"))
    assert cams.follow(STATES[0]) is not None


def test_a_law_and_a_contour_are_those_of_the_cams_file():
    """To rounding; of another cam, shape or value the file, the difference and the limit are said.
    A second law server cannot publish another one of the same name."""
    law, points = LOADED.laws["tm21"], contour_of(LOADED.cams["tm21"], LOADED.laws["tm21"])
    require_own_law(LOADED, Law("tm21", law.breaks, law.ordinates * (1.0 + 1e-12)))
    require_own_contour(LOADED, "tm21", points.astype(np.float32))
    words = (
        r"law 'tm21': its ordinates differ by .* of .*tm21\.yaml; allowed: .*a second law server"
    )
    with pytest.raises(RefusedError, match=words):
        require_own_law(LOADED, Law("tm21", law.breaks, law.ordinates * 1.01))
    with pytest.raises(RefusedError, match=r"law 'tm21': its breaks are .* has"):
        other = LOADED.laws["bezier15"]
        require_own_law(LOADED, Law("tm21", other.breaks, other.ordinates))
    with pytest.raises(RefusedError, match=r"cam 'nothing': not in the scene's library"):
        require_own_law(LOADED, Law("nothing", law.breaks, law.ordinates))
    with pytest.raises(RefusedError, match="contour of 'tm21': its points differ"):
        require_own_contour(LOADED, "tm21", 1.01 * points)
