"""`cam-rig laws` and `cam-rig law`: figures programs can read, plots that are pictures."""

import csv
import io
import json
from shutil import copy, copytree

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.laws.catalogue import free_laws
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema.load import one_scene
from cam_rig.simulation.asked import asked_cams, asked_scene, scene_speeds

from ..conftest import scene_data
from .conftest import call, data_of, done, shipped, written


def test_laws_as_json():
    """Every law a file may name: peaks and class of a rise, none of what its own numbers shape."""
    data = data_of("laws")
    found = {row.pop("law"): row for row in data["laws"]}
    assert set(found) == {*NAMED_RISES, *free_laws()}
    keys = ("peak_velocity", "peak_acceleration", "peak_jerk", "continuity")
    assert all(found[name][key] is None for name in free_laws() for key in keys)
    figures = (1.7596, 5.5280, 69.466, 2)
    assert [found["modified_sine"][key] for key in keys] == pytest.approx(figures, rel=2e-5)


def test_law_as_csv(laws):
    """Lift and three derivatives every half degree, in SI, on stdout; no plot is written."""
    result = done("law", "poly4567", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert len(rows) == 720
    angle = np.array([float(row["angle"]) for row in rows])
    np.testing.assert_allclose(np.degrees(angle), np.arange(720) / 2.0, rtol=1e-14)
    for order, key in enumerate(("lift", "velocity", "acceleration", "jerk")):
        found = [float(row[key]) for row in rows]
        expected = laws["poly4567"](angle, order)
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=0)
    assert "plot" not in result.stderr


def rows_of(*names):
    """The CSV of laws, row by row."""
    return list(csv.DictReader(io.StringIO(done("law", *names, "--csv", "-").stdout)))


def test_names_that_are_all_cams_are_cams():
    """poly345 and cycloidal are both: the cam is meant, unless a rise stands beside it."""
    cams = rows_of("poly345", "cycloidal")
    assert {row["cam"] for row in cams} == {"poly345", "cycloidal"}
    assert max(float(row["lift"]) for row in cams) == pytest.approx(0.05)
    for told in (["bezier9"], ["--rises"]):
        rises = rows_of("poly345", "cycloidal", *told)
        assert max(float(row["lift"]) for row in rises) == pytest.approx(1.0)


def test_a_csv_of_several_cams_holds_that_of_each(config_dir):
    """The same rows below each other, a cam's name before each; paths and names may be mixed."""
    path = config_dir / "cams" / "bezier15.yaml"
    both = rows_of("poly345", path)
    for name in ("poly345", "bezier15"):
        alone = rows_of(name)
        assert [row for row in both if row["cam"] == name] == alone


@pytest.mark.variants(3)
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["law", "worked_example_quintic", "--out"], "in/rad … 90° C2"),
        (["law", "poly345", "cycloidal", "bezier9", "--out"], "Peaks for unit rise and unit span"),
        (["law", "poly345", "worked_example_quintic", "--out"], "mm/rad"),
        (["law", "bezier6_start", "--out"], "bezier6_start  eq. 3.5"),
    ],
)
def test_laws_over_each_other(tmp_path, arguments, words):
    """A picture in a folder that is made, its numbers beside it, and where it is."""
    target = tmp_path / "new" / "a.svg"
    result = done(*arguments, target)
    assert target.read_text(encoding="utf-8").startswith("<?xml")
    assert all(word in result.stderr for word in (*words.split(" … "), "a.svg"))


def test_extremes_of_cams_as_json(laws):
    """In SI with the angle, whatever the unit that is shown; joints that are not smooth."""
    data = data_of("law", "worked_example_quintic", "poly345")
    found = {(row["cam"], row["quantity"]): row for row in data["extremes"]}
    row = found["worked_example_quintic", "velocity"]
    assert (row["unit"], row["continuity"]) == ("m/rad", 2)
    assert laws["worked_example_quintic"](row["largest_at"], 1) == pytest.approx(row["largest"])
    assert found["poly345", "lift"]["largest"] == pytest.approx(0.05)
    assert {joint["cam"] for joint in data["joints"]} == {"worked_example_quintic", "poly345"}


def test_a_family_by_itself():
    result = call("laws", "--family", "end", "--json", "-")
    names = [row["law"] for row in json.loads(result.stdout)["laws"]]
    assert names == ["bezier4_end", "bezier6_end", "bezier8_end"]
    assert "cycloidal" not in result.stderr


def test_a_cam_that_cannot_be_names_its_file(tmp_path):
    """The line says which file, which cam, and what to change."""
    text = shipped("cams", "arcs_convex").replace("assumed: 80", "assumed: 20")
    path = written(tmp_path, {"arcs_convex.yaml": text}) / "arcs_convex.yaml"
    result = call("law", path, "--out", tmp_path / "a.png")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"cam-rig: {path}: cam 'arcs_convex': arcs[1]: radius 20 mm")
    assert not (tmp_path / "a.png").exists()


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A scene with a rig and a cam of its own, in a folder far from the shipped ones."""
    rig = shipped("rigs", "tm21")
    scene = scene_data(cams=["lug"], rig="mine", speeds=[200, 300, 350, 400])
    files = {
        "rigs/mine.yaml": rig.replace("name: tm21", "name: mine"),
        "rigs/other.yaml": rig.replace("name: tm21", "name: other"),
        "cams/lug.yaml": shipped("cams", "poly345").replace("name: poly345", "name: lug"),
        "scenes/scene.yaml": json.dumps(scene),
    }
    return written(tmp_path_factory.mktemp("elsewhere"), files) / "scenes" / "scene.yaml"


def test_cams_or_a_scene(own):
    """Cams stand on the paper's rig, a scene's on its own, and both on one that is named."""
    assert asked_cams(["poly345"], None).rig.name == "paper_table2"
    assert set(asked_cams(None, None).cams) >= {"poly345", "bezier15"}
    found = asked_cams([str(own)], None)
    assert (set(found.cams), found.rig.name) == ({"lug"}, "mine")
    assert asked_cams(["quick"], "paper_table2").rig.name == "paper_table2"
    assert one_scene(["poly345"]) is None and one_scene(["quick", "poly345"]) is None


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
    assert "other" in " ".join(result.stderr.split()) and "paper_table2" not in result.stderr


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
    assert result.exit_code == 2 and "take cam-rig simulate or report" in result.stderr


def test_the_only_rig_beside_a_cam_is_taken_and_named(own, tmp_path):
    """Several rigs beside a cam are refused, so that a new file never changes the rig silently."""
    copytree(own.parents[1], tmp_path / "mine")
    cam = tmp_path / "mine" / "cams" / "lug.yaml"
    two = call("jump", cam)
    assert two.exit_code == 2
    assert "next to the cam are 2 rigs; allowed: name one of" in two.stderr
    named = done("jump", cam, "--rig", tmp_path / "mine" / "rigs" / "mine.yaml")
    assert "Jump speed on rig mine" in named.stderr
    (tmp_path / "mine" / "rigs" / "other.yaml").unlink()
    one = done("jump", cam)
    assert one.stderr.startswith(f"rig {tmp_path / 'mine' / 'rigs' / 'mine.yaml'}, the only one")
    assert "Jump speed on rig mine" in one.stderr
    assert not call("jump", "poly345").stderr.startswith("rig ")
    for command in (
        ("orders", cam, "--rpm", 300),
        ("bounce", cam, "--rpm", 300, "--restitution", 0.3, "--turns", 20, "--settle", 2),
        ("design", cam, "--minimise", "peak_acceleration", "--pieces", 4),
    ):
        assert call(*command).stderr.startswith(f"rig {tmp_path / 'mine' / 'rigs' / 'mine.yaml'}")
