"""A set-up is a scene that every command reads, with the numbers that were chosen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics.jump.any_follower import TWO_MASSES, described, follower_of
from cam_rig.errors import RefusedError
from cam_rig.panel.bench.runner import (
    DRAWN_RPM,
    MAX_RPM,
    MODELS,
    Setup,
    add_cam,
    allowed_models,
    cam_names,
)
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

from ...conftest import CAM_NAMES

RIG_NAMES = sorted(path.stem for path in (config_root() / "rigs").glob("*.yaml"))
RIG = cam_rig.load_rig("paper_table2")
OWN = Setup.of(RIG, "poly345")


@pytest.mark.parametrize("model", allowed_models(RIG))
def test_a_set_up_is_a_scene(model: str, tmp_path: Path) -> None:
    """Its rig has the chosen numbers, and what was not chosen as the file has it."""
    given = {"model": model, "added_mass": 0.5, "preload": 45, "rpm": 321.0}
    setup = OWN.changed(given, RIG)
    add_cam(cam_rig.load_cam("poly345"), tmp_path / "cams")
    loaded = open_scene(setup.write(tmp_path, RIG))
    follower = loaded.rig.follower
    assert follower.mass.si == pytest.approx(RIG.follower.mass.si + 0.5)
    assert follower.preload.si == 45.0
    assert follower.spring_stiffness == RIG.follower.spring_stiffness
    assert loaded.scene.model == model
    rpm = np.array(loaded.scene.program.speeds.si_list) * 30 / np.pi
    np.testing.assert_allclose(rpm, [321.0, DRAWN_RPM])


@pytest.mark.parametrize("name", RIG_NAMES)
def test_the_bench_begins_with_the_follower_of_the_board(name: str) -> None:
    """Two masses where the rig splits its mass, else one: the same that the jump speed is of."""
    rig = cam_rig.load_rig(name)
    model = Setup.of(rig, "poly345").model
    assert model in allowed_models(rig)
    assert (model == "two_mass") == (described(follower_of(rig)) == TWO_MASSES)


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", CAM_NAMES)
def test_every_cam_can_be_put_among_the_benchs_own(name: str, tmp_path: Path) -> None:
    """Its law is the same number by number, one of a table too."""
    cam = cam_rig.load_cam(name)
    add_cam(cam, tmp_path)
    own = cam_rig.build_law(cam_rig.load_cam(tmp_path / f"{name}.yaml"))
    law = cam_rig.build_law(cam)
    assert np.array_equal(law.breaks, own.breaks)
    assert np.array_equal(law.ordinates, own.ordinates)
    assert name in cam_names(tmp_path)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"model": "soft"}, "model: is 'soft'; allowed on this rig"),
        ({"added_mass": -1}, "added mass: is -1 kg"),
        ({"added_mass": float("nan")}, "added mass: is nan"),
        ({"preload": -1}, "preload"),
        ({"spring_stiffness": 0}, "spring_stiffness"),
        ({"spring_stiffness": "stiff"}, "spring_stiffness: allowed"),
        ({"preload": [1]}, "preload: allowed"),
        ({"colour": "red"}, "colour: allowed"),
        ({"rpm": 1e5}, f"rpm: is 100000; allowed: 1 to {MAX_RPM:g}"),
    ],
)
def test_a_wrong_set_up_is_refused(given: dict, words: str) -> None:
    """In one line with what is allowed; nothing is written."""
    with pytest.raises(RefusedError) as raised:
        OWN.changed(given, RIG)
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)


def test_models_are_those_the_rig_has_numbers_for() -> None:
    """Two masses need a split of the mass, an elastic shaft its stiffness."""
    assert set(allowed_models(RIG)) == set(MODELS)
    assert not {"two_mass", "torsional"} & set(allowed_models(cam_rig.load_rig("tm21")))
