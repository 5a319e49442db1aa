"""`cam-rig laws` and `cam-rig law`: figures programs can read, plots that are pictures."""

import csv
import io
import json

import numpy as np
import pytest

from cam_rig.laws.catalogue import free_laws
from cam_rig.laws.segments import NAMED_RISES

from .conftest import call, data_of, done


def test_laws_as_json():
    """Every law a file may name: peaks and class of a rise, none of what its own numbers shape."""
    data = data_of("laws")
    found = {row.pop("law"): row for row in data["laws"]}
    assert set(found) == {*NAMED_RISES, *free_laws()}
    keys = ("peak_velocity", "peak_acceleration", "peak_jerk", "continuity")
    assert all(found[name][key] is None for name in free_laws() for key in keys)
    figures = (1.7596, 5.5280, 69.466, 2)
    assert [found["modified_sine"][key] for key in keys] == pytest.approx(figures, rel=2e-5)


def test_law_is_drawn(tmp_path):
    """A picture, in a folder that is made, and the peaks from roots beside it."""
    target = tmp_path / "new" / "law.png"
    result = done("law", "worked_example_quintic", "--out", target)
    assert target.read_bytes().startswith(b"\x89PNG")
    assert "in/rad" in result.stderr
    assert "90° C2" in result.stderr


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


def rows_of(result):
    """The CSV on stdout, row by row."""
    assert result.exit_code == 0, result.stderr
    return list(csv.DictReader(io.StringIO(result.stdout)))


def test_names_that_are_all_cams_are_cams():
    """poly345 and cycloidal are both: the cam is meant, unless a rise stands beside it."""
    cams = rows_of(call("law", "poly345", "cycloidal", "--csv", "-"))
    assert {row["cam"] for row in cams} == {"poly345", "cycloidal"}
    assert max(float(row["lift"]) for row in cams) == pytest.approx(0.05)
    for told in (["bezier9"], ["--rises"]):
        rises = rows_of(call("law", "poly345", "cycloidal", *told, "--csv", "-"))
        assert max(float(row["lift"]) for row in rises) == pytest.approx(1.0)


def test_a_csv_of_several_cams_holds_that_of_each(config_dir):
    """The same rows below each other, a cam's name before each; paths and names may be mixed."""
    path = config_dir / "cams" / "bezier15.yaml"
    both = rows_of(call("law", "poly345", path, "--csv", "-"))
    for name in ("poly345", "bezier15"):
        alone = rows_of(call("law", name, "--csv", "-"))
        assert [row for row in both if row["cam"] == name] == alone


@pytest.mark.variants(2)
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["law", "poly345", "cycloidal", "bezier9", "--out"], "Peaks for unit rise and unit span"),
        (["law", "poly345", "worked_example_quintic", "--out"], "mm/rad"),
        (["law", "bezier6_start", "--out"], "bezier6_start  eq. 3.5"),
        (["laws", "--family", "classical", "--plot"], "modified_trapezoid"),
    ],
)
def test_laws_over_each_other(tmp_path, arguments, words):
    """A picture, its numbers beside it, and where it is."""
    target = tmp_path / "a.svg"
    result = done(*arguments, target)
    assert target.read_text(encoding="utf-8").startswith("<?xml")
    assert words in result.stderr
    assert "a.svg" in result.stderr


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
    """Table and JSON have its rises alone."""
    result = call("laws", "--family", "end", "--json", "-")
    names = [row["law"] for row in json.loads(result.stdout)["laws"]]
    assert names == ["bezier4_end", "bezier6_end", "bezier8_end"]
    assert "cycloidal" not in result.stderr


def test_a_cam_that_cannot_be_names_its_file(tmp_path, config_dir):
    """The line says which file, which cam, and what to change."""
    text = (config_dir / "cams" / "arcs_convex.yaml").read_text(encoding="utf-8")
    path = tmp_path / "arcs_convex.yaml"
    path.write_text(text.replace("assumed: 80", "assumed: 20"), encoding="utf-8")
    result = call("law", path, "--out", tmp_path / "a.png")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"cam-rig: {path}: cam 'arcs_convex': arcs[1]: radius 20 mm")
    assert not (tmp_path / "a.png").exists()
