"""cam-rig calibrate on one's own rig: its levels are calibrated, until the follower is changed."""

from shutil import copytree

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import load_scene


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def roles(scene):
    """What the levels of a scene are worth, by cam."""
    loaded = load_scene(scene)
    return {cam: loaded.role(cam) for cam in loaded.cams}


@pytest.mark.long
def test_a_calibration_holds_for_its_follower(tmp_path):
    """Another mass makes levels relative; a calibration ends that, until the next mass."""
    copytree(config_root(), tmp_path / "own")
    scene, rig = (tmp_path / "own" / f for f in ("scenes/tm21_sweep.yaml", "rigs/tm21.yaml"))
    rig.write_text(rig.read_text(encoding="utf-8").replace("given: 1.3,", "given: 1.2,"))
    assert set(roles(scene).values()) == {"relative"}
    assert call("calibrate", scene).exit_code == 0
    assert "one_mass, mass 1.2 kg, spring_stiffness 4030 N/m" in rig.read_text(encoding="utf-8")
    found = roles(scene)
    assert (found["poly345"], found["bezier15"]) == ("calibrated", "predicted")
    rig.write_text(rig.read_text(encoding="utf-8").replace("given: 1.2,", "given: 1.1,"))
    assert set(roles(scene).values()) == {"relative"}
