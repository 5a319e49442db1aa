"""Commands `cam-rig laws` and `cam-rig law`, and cams and scenes as arguments."""

import csv
import io
import json
from shutil import copy, copytree

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.laws.catalogue import list_parametric_laws
from cam_rig.laws.segments import RISES
from cam_rig.schema.load import find_scene
from cam_rig.simulation.inputs import resolve_cams, resolve_rig, resolve_scene, scene_speeds
from cam_rig.simulation.scene import load_cam
from cam_rig.studies.simulate.study import run_scene

from ..conftest import scene_data
from .conftest import call, data_of, done, shipped, written


def test_laws_as_json():
    """`laws` lists all laws as JSON, with peaks, continuity class and other names.

    Laws with free parameters have null for these.
    """
    data = data_of("laws")
    laws = {row.pop("law"): row for row in data["laws"]}
    assert set(laws) == {*RISES, *list_parametric_laws()}
    keys = ("peak_velocity", "peak_acceleration", "peak_jerk", "continuity")
    assert all(laws[name][key] is None for name in list_parametric_laws() for key in keys)
    names = {row["law"]: row for row in data["names"]}
    assert names["cycloidal"]["codesys"] == "InclinedSine" and set(names) <= set(laws)
    figures = (1.7596, 5.5280, 69.466, 2)
    assert [laws["modified_sine"][key] for key in keys] == pytest.approx(figures, rel=2e-5)


def test_law_as_csv(laws):
    """`law --csv -` prints lift and three derivatives in SI units every half degree."""
    result = done("law", "poly4567", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert len(rows) == 720
    angle = np.array([float(row["angle"]) for row in rows])
    np.testing.assert_allclose(np.degrees(angle), np.arange(720) / 2.0, rtol=1e-14)
    for order, key in enumerate(("lift", "velocity", "acceleration", "jerk")):
        values = [float(row[key]) for row in rows]
        expected = laws["poly4567"](angle, order)
        np.testing.assert_allclose(values, expected, rtol=1e-14, atol=0)
    assert "plot" not in result.stderr


def rows_of(*names):
    """Return the rows of the CSV output of `law` for these names."""
    return list(csv.DictReader(io.StringIO(done("law", *names, "--csv", "-").stdout)))


def test_names_of_cams_and_rises_are_cams():
    """A name that is both a cam and a rise is taken as the cam.

    It is the rise if another name is only a rise, or with --rises.
    """
    cams = rows_of("poly345", "cycloidal")
    assert {row["cam"] for row in cams} == {"poly345", "cycloidal"}
    assert max(float(row["lift"]) for row in cams) == pytest.approx(0.05)
    for argument in ("bezier9", "--rises"):
        rises = rows_of("poly345", "cycloidal", argument)
        assert max(float(row["lift"]) for row in rises) == pytest.approx(1.0)


def test_csv_of_several_cams_is_the_sum_of_each(config_dir):
    """The CSV of several cams contains the rows of each cam with its name.

    Paths and names can be mixed.
    """
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
def test_plot_of_laws(tmp_path, arguments, words):
    """`law --out` draws the laws into a new folder, and prints path and numbers."""
    target = tmp_path / "new" / "a.svg"
    result = done(*arguments, target)
    assert target.read_text(encoding="utf-8").startswith("<?xml")
    assert all(word in result.stderr for word in (*words.split(" … "), "a.svg"))


def test_extremes_of_cams_as_json(laws):
    """`law` gives extremes and their angles in SI units as JSON.

    They do not depend on the displayed unit.
    """
    data = data_of("law", "worked_example_quintic", "poly345")
    extremes = {(row["cam"], row["quantity"]): row for row in data["extremes"]}
    row = extremes["worked_example_quintic", "velocity"]
    assert (row["unit"], row["continuity"]) == ("m/rad", 2)
    assert laws["worked_example_quintic"](row["largest_at"], 1) == pytest.approx(row["largest"])
    assert extremes["poly345", "lift"]["largest"] == pytest.approx(0.05)
    assert {joint["cam"] for joint in data["joints"]} == {"worked_example_quintic", "poly345"}


def test_other_names_of_rises_are_accepted():
    """`law` accepts another name of a rise, and suggests one for an unknown name."""
    rows = rows_of("MODSINUSLINIE", "inclined sine", "bezier9")
    assert {row["rise"] for row in rows} == {"modified_sine", "cycloidal", "bezier9"}
    result = call("law", "simple sinus", "--csv", "-")
    assert result.exit_code == 2 and "(did you mean 'simple sine'?)" in result.stderr


def test_laws_of_one_family():
    """`laws --family end` lists the laws of this family only."""
    result = call("laws", "--family", "end", "--json", "-")
    names = [row["law"] for row in json.loads(result.stdout)["laws"]]
    assert names == ["bezier4_end", "bezier6_end", "bezier8_end"]
    assert "cycloidal" not in result.stderr


def test_error_of_an_impossible_cam_names_its_file(tmp_path):
    """The error of an impossible cam has its file, the cam and the value to change.

    No picture is drawn.
    """
    text = shipped("cams", "arcs_convex").replace("assumed: 80", "assumed: 20")
    path = written(tmp_path, {"arcs_convex.yaml": text}) / "arcs_convex.yaml"
    result = call("law", path, "--out", tmp_path / "a.png")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"cam-rig: {path}: cam 'arcs_convex': arcs[1]: radius 20 mm")
    assert not (tmp_path / "a.png").exists()


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """Scene with a custom rig and cam, outside of the shipped folders."""
    rig = shipped("rigs", "tm21")
    scene = scene_data(cams=["lug"], rig="mine", speeds=[200, 300, 350, 400])
    files = {
        "rigs/mine.yaml": rig.replace("name: tm21", "name: mine"),
        "rigs/other.yaml": rig.replace("name: tm21", "name: other"),
        "cams/lug.yaml": shipped("cams", "poly345").replace("name: poly345", "name: lug"),
        "scenes/scene.yaml": json.dumps(scene),
    }
    return written(tmp_path_factory.mktemp("elsewhere"), files) / "scenes" / "scene.yaml"


def test_default_rig_of_cams_and_of_a_scene(own):
    """Without --rig a cam is on the paper's rig, and a scene on the rig it names."""
    assert resolve_cams(["poly345"], None).rig.name == "paper_table2"
    assert set(resolve_cams(None, None).cams) >= {"poly345", "bezier15"}
    cam_set = resolve_cams([str(own)], None)
    assert (set(cam_set.cams), cam_set.rig.name) == ({"lug"}, "mine")
    assert resolve_cams(["quick"], "paper_table2").rig.name == "paper_table2"
    assert find_scene(["poly345"]) is None and find_scene(["quick", "poly345"]) is None


def test_rig_by_name_or_by_file(own, tmp_path):
    """A rig is found by its file, or by name next to the scene and then as shipped."""
    assert resolve_scene(str(own), "other").rig.name == "other"
    assert resolve_scene(str(own), "paper_table2").rig.name == "paper_table2"
    file = tmp_path / "a_rig.yaml"
    copy(own.parents[1] / "rigs" / "other.yaml", file)
    loaded = resolve_scene(str(own), str(file))
    assert (loaded.rig.name, loaded.rig_file) == ("other", file)
    with pytest.raises(ConfigError, match="no such file"):
        resolve_scene("quick", "other")  # not next to this scene


def test_speeds_of_a_scene(own):
    """`scene_speeds` returns all speeds (rpm) of a scene, or a limited number of them.

    The limited number includes the lowest and the highest speed.
    """
    assert scene_speeds(str(own), 4) == [200.0, 300.0, 350.0, 400.0]
    assert scene_speeds("tm21_sweep", 3) == [200.0, 300.0, 400.0]


@pytest.mark.parametrize("command", ["jump", "vibration", "contact"])
def test_studies_accept_a_scene(own, command):
    """A study of a scene computes its cam on the rig of --rig."""
    result = done(command, own, "--rig", "other", "--json", "-")
    assert "lug" in json.dumps(json.loads(result.stdout))
    assert "other" in " ".join(result.stderr.split()) and "paper_table2" not in result.stderr


def test_profile_and_listen_accept_a_scene(own, tmp_path):
    """`profile` and `listen` accept a scene and use its cam.

    The sound on another rig is reported as relative.
    """
    assert [row["cam"] for row in data_of("profile", own)["cams"]] == ["lug"]
    turns = ("--rpm", 300, "--seconds", 0.2, "--out", tmp_path / "a.wav", "--json", "-")
    results = [done("listen", own, *rig, *turns) for rig in ((), ("--rig", "paper_table2"))]
    sounds = [json.loads(result.stdout)["sound"] for result in results]
    assert [sound["calibrated"] for sound in sounds] == [True, False]
    assert "only differences between levels" in " ".join(results[1].stderr.split())


def test_noise_study_of_another_scene_is_refused(own):
    """`noise` of a scene without the three published cams is refused with a remedy."""
    result = call("noise", own)
    assert result.exit_code == 2 and "take cam-rig simulate or report" in result.stderr


def test_only_rig_next_to_a_cam_is_used_and_named(own, tmp_path):
    """The only rig file next to a cam is used, and a line states this.

    Several rigs next to a cam are an error, so that a new file never changes the rig.
    """
    copytree(own.parents[1], tmp_path / "mine")
    cam = tmp_path / "mine" / "cams" / "lug.yaml"
    refused = call("jump", cam)
    assert refused.exit_code == 2
    assert "next to the cam are 2 rigs; allowed: name one of" in refused.stderr
    named = done("jump", cam, "--rig", tmp_path / "mine" / "rigs" / "mine.yaml")
    assert "Jump speed on rig mine" in named.stderr
    assert resolve_rig("mine", cam).name == "mine"
    assert resolve_rig("tm21", cam).name == "tm21"
    (tmp_path / "mine" / "rigs" / "other.yaml").unlink()
    result = done("jump", cam)
    assert result.stderr.startswith(f"rig {tmp_path / 'mine' / 'rigs' / 'mine.yaml'}, the only one")
    assert "Jump speed on rig mine" in result.stderr
    assert not call("jump", "poly345").stderr.startswith("rig ")
    for command in (
        ("orders", cam, "--rpm", 300),
        ("bounce", cam, "--rpm", 300, "--restitution", 0.3, "--turns", 20, "--transient-turns", 2),
        ("design", cam, "--minimise", "peak_acceleration", "--pieces", 4),
    ):
        assert call(*command).stderr.startswith(f"rig {tmp_path / 'mine' / 'rigs' / 'mine.yaml'}")


def test_rig_of_the_name_of_the_cam(own, tmp_path):
    """Among several rigs next to a cam, the rig of the cam's name is used, and a line names it."""
    copytree(own.parents[1], tmp_path / "mine")
    cam, rigs = tmp_path / "mine" / "cams" / "lug.yaml", tmp_path / "mine" / "rigs"
    text = (rigs / "mine.yaml").read_text(encoding="utf-8").replace("name: mine", "name: lug")
    (rigs / "lug.yaml").write_text(text, encoding="utf-8")
    result = done("jump", cam)
    assert result.stderr.startswith(f"rig {rigs / 'lug.yaml'}, with the name of the cam")
    assert "\ncam lug; rig lug; model one_mass\n" in result.stderr


def test_rig_is_never_guessed(own, tmp_path, capsys):
    """A cam without a rig next to it is refused, as a file or an object, with names of rigs."""
    cam = tmp_path / "alone" / "lug.yaml"
    cam.parent.mkdir()
    copy(own.parents[1] / "cams" / "lug.yaml", cam)
    for cams in ([cam], ["poly345", cam], [load_cam(cam)]):
        with pytest.raises(ConfigError, match=r"no rig is next to the cam; .* paper_table2, tm21"):
            resolve_cams(cams)
    copy(own.parents[1] / "rigs" / "mine.yaml", cam.parent)
    assert resolve_cams([cam]).rig.name == "mine" and "the only one" in capsys.readouterr().err
    assert resolve_cams([load_cam("poly345")]).rig.name == "paper_table2"


def test_scene_cam_and_rig_in_one_folder(own, tmp_path):
    """Cam and rig are found in the folder of their scene. Another kind of file is not taken."""
    folder = own.parents[1]
    for file in (folder / "cams" / "lug.yaml", folder / "rigs" / "mine.yaml", own):
        copy(file, tmp_path)
    loaded = resolve_scene(tmp_path / "scene.yaml")
    assert loaded.rig_file == tmp_path / "mine.yaml" and set(loaded.laws) == {"lug"}
    copy(tmp_path / "mine.yaml", tmp_path / "lug.yaml")  # a rig in place of the cam
    with pytest.raises(ConfigError, match=r"lug\.yaml: no such file"):
        resolve_scene(tmp_path / "scene.yaml")


def test_simulate_on_another_rig(own):
    """`simulate --rig` runs the scene on another rig. The first line names cam, rig and model."""
    result = done("simulate", own, "--rig", "paper_table2", "--json", "-")
    assert "\ncam lug; rig paper_table2; model one_mass\n" in result.stderr
    loaded = resolve_scene(own, "paper_table2")
    assert json.loads(result.stdout)["speeds"] == run_scene(loaded).data()["speeds"]
