"""One convention: a scene is an argument and brings its rig; --rig is a name or a file."""

import json
from pathlib import Path
from shutil import copy, copytree

import pytest
from ruamel.yaml import YAML

from cam_rig.errors import ConfigError
from cam_rig.schema.load import config_root, one_scene
from cam_rig.simulation.asked import asked_cams, asked_scene, scene_speeds

from .conftest import call, data_of, done


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A scene with a rig and a cam of its own, in a folder far from the shipped ones."""
    config = tmp_path_factory.mktemp("elsewhere")
    for folder in ("cams", "rigs", "scenes"):
        (config / folder).mkdir()
    root = config_root()
    rig = (root / "rigs" / "tm21.yaml").read_text(encoding="utf-8")
    for name in ("mine", "other"):
        text = rig.replace("name: tm21", f"name: {name}")
        (config / "rigs" / f"{name}.yaml").write_text(text, encoding="utf-8")
    cam = (root / "cams" / "poly345.yaml").read_text(encoding="utf-8")
    (config / "cams" / "lug.yaml").write_text(cam.replace("name: poly345", "name: lug"))
    yaml = YAML(typ="safe")
    scene = yaml.load((root / "scenes" / "quick.yaml").read_text(encoding="utf-8"))
    scene |= {"name": "scene", "cams": ["lug"], "rig": "mine"}
    del scene["published"]
    with (config / "scenes" / "scene.yaml").open("w", encoding="utf-8") as file:
        yaml.dump(scene, file)
    return config / "scenes" / "scene.yaml"


def test_cams_or_a_scene(own):
    """Cams stand on the paper's rig, a scene's on its own, and both on one that is named."""
    assert asked_cams(["poly345"], None).rig.name == "paper_table2"
    assert set(asked_cams(None, None).cams) >= {"poly345", "bezier15"}
    found = asked_cams([str(own)], None)
    assert (set(found.cams), found.rig.name) == ({"lug"}, "mine")
    assert asked_cams(["quick"], "paper_table2").rig.name == "paper_table2"
    assert one_scene(["poly345"]) is None
    assert one_scene(["quick", "poly345"]) is None


def test_a_rig_by_name_or_by_file(own, tmp_path):
    """A name is looked up beside the scene, then among the shipped ones; a file is a file."""
    assert asked_scene(str(own), "other").rig.name == "other"
    assert asked_scene(str(own), "paper_table2").rig.name == "paper_table2"
    file = tmp_path / "a_rig.yaml"
    copy(own.parents[1] / "rigs" / "other.yaml", file)
    loaded = asked_scene(str(own), str(file))
    assert (loaded.rig.name, loaded.rig_file) == ("other", file)
    with pytest.raises(ConfigError, match="no such file"):
        asked_scene("quick", "other")  # that scene's folder has none of this name


def test_speeds_of_a_scene(own):
    """All where there are few; else the slowest, the fastest, and some between."""
    assert scene_speeds(str(own), 4) == [200.0, 300.0, 350.0, 400.0]
    assert scene_speeds("tm21_sweep", 3) == [200.0, 300.0, 400.0]


@pytest.mark.parametrize("command", ["jump", "vibration", "contact"])
def test_the_studies_take_a_scene(own, command):
    """Each is of the scene's cam, on its rig or on the one that is named."""
    result = done(command, own, "--rig", "other", "--json", "-")
    assert "lug" in json.dumps(json.loads(result.stdout))
    assert "other" in " ".join(result.stderr.split())
    assert "paper_table2" not in result.stderr


def test_profile_and_listen_take_it_too(own, tmp_path):
    """The scene's cam is checked; its sound is that of the named rig, and called relative."""
    assert [row["cam"] for row in data_of("profile", own)["cams"]] == ["lug"]
    turns = ("--rpm", 300, "--seconds", 0.2, "--out", tmp_path / "a.wav", "--json", "-")
    heard = [done("listen", own, *rig, *turns) for rig in ((), ("--rig", "paper_table2"))]
    found = [json.loads(result.stdout) for result in heard]
    assert [row["sound"]["calibrated"] for row in found] == [True, False]
    assert "only differences between levels" in " ".join(heard[1].stderr.split())


def test_a_noise_study_of_another_scene_says_what_to_take(own):
    """It needs three published cams; the remedy is named."""
    result = call("noise", own)
    assert result.exit_code == 2
    assert "take cam-rig simulate or report" in result.stderr


def test_the_only_rig_beside_a_cam_is_taken_and_named(own, tmp_path):
    """Two rigs beside it: the paper's, and that is said; one: that one. Without a word, neither."""
    folder = next(parent for parent in Path(str(own)).parents if (parent / "cams").is_dir())
    copytree(folder, tmp_path / "mine")
    cam = tmp_path / "mine" / "cams" / "lug.yaml"
    two = done("jump", cam)
    assert two.stderr.startswith("rig paper_table2, the paper's: beside the cam there is ")
    (tmp_path / "mine" / "rigs" / "other.yaml").unlink()
    one = done("jump", cam)
    assert one.stderr.startswith(f"rig {tmp_path / 'mine' / 'rigs' / 'mine.yaml'}, the only one")
    assert "Jump speed on rig mine" in one.stderr
    assert not call("jump", "poly345").stderr.startswith("rig ")
