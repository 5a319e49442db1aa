"""A scene may lie in any folder: its bag holds it all the same."""

import shutil
from pathlib import Path

import pytest

from cam_rig.bag.reader import read_scene
from cam_rig.bag.recorder import BagRecorder
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

QUICK = config_root() / "scenes" / "quick.yaml"


@pytest.mark.parametrize("place", ["", "mine", "cams", "scenes", "lab/rigs"])
def test_a_bag_is_read_wherever_its_scene_was(tmp_path, monkeypatch, place):
    """Named by its path from here, or from the root: cams and rig come from the shipped ones."""
    (tmp_path / place).mkdir(parents=True, exist_ok=True)
    shutil.copy(QUICK, tmp_path / place / "own.yaml")
    monkeypatch.chdir(tmp_path)
    for number, scene in enumerate((Path(place) / "own.yaml", tmp_path / place / "own.yaml")):
        bag = tmp_path / f"bag{number}"
        BagRecorder(bag, open_scene(scene)).close()
        read = read_scene(bag)
        assert read.scene == open_scene(QUICK).scene
        assert read.scene_file.name == "own.yaml"
