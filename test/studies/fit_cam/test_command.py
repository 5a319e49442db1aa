"""Tests of `cam-rig fit cam` and `cam-rig new`: from a table of lifts to a scene."""

import json
import math

import numpy as np
import pytest

from cam_rig.laws import build_law
from cam_rig.profile.cam_checks import check_cam
from cam_rig.schema import load_cam, load_rig, load_scene
from cam_rig.schema.load import config_root
from cam_rig.studies.fit_cam.arcs.cam_file import arcs_cam
from cam_rig.studies.fit_cam.arcs.contour import Arcs
from cam_rig.studies.fit_cam.arcs.selection import fit_arcs
from cam_rig.studies.fit_cam.cam_files import spline_cam
from cam_rig.studies.fit_cam.new_files import default_rig, default_scene
from cam_rig.studies.fit_cam.spline_fit import fit_spline

from ...cli.conftest import call, data_of, done
from .conftest import ANGLES, FLAT, ROLLER, all_around, readings_of

GL110 = config_root() / "cams" / "gunt_gl110_convex.csv"
FINE = all_around(1000)


def test_a_table_becomes_a_scene_that_runs(lift_table, tmp_path, monkeypatch):
    """The scene that `cam-rig new` writes from a table runs in simulate and profile.

    Assumptions and outliers are printed, and existing files are not overwritten.
    """
    monkeypatch.chdir(tmp_path)
    made = done("new", "mine", "--from-csv", lift_table)
    for words in ("separator semicolon, decimal comma", "assumed: follower roller", "mine.csv"):
        assert words in made.output
    assert "outliers: line 102 by " in made.output
    rows = data_of("simulate", "mine/scenes/mine.yaml")["levels"]
    assert rows and all(math.isfinite(row["level"]) for row in rows)
    done("profile", "mine/cams/mine.yaml")
    again = call("new", "mine", "--from-csv", lift_table)
    assert again.exit_code == 1
    assert "mine/cams/mine.yaml: exists already, not overwriting" in again.output


def test_new_needs_no_answers(tmp_path, monkeypatch):
    """Without options `cam-rig new` uses the first of two lift columns.

    It reports this. A gap in the readings is taken for a dwell and reported.
    """
    monkeypatch.chdir(tmp_path)
    made = done("new", "gl110", "--from-csv", GL110)
    assert "first column of lifts taken, not 'lift_b_mm': --column" in made.output
    assert "no readings for 200 deg after 80 deg: the cam is assumed to rest there" in made.output
    text = (tmp_path / "gl110" / "cams" / "gl110.yaml").read_text()
    assert "# gunt_gl110_convex.csv: first column of lifts taken" in text


def test_fit_prints_the_answer_and_writes_it(lift_table, tmp_path):
    """`cam-rig fit cam` prints and writes the result of a fit.

    It reports residuals, outliers, dwells and a tolerance that was not followed.
    """
    out, plot, csv = tmp_path / "own.yaml", tmp_path / "fit.png", tmp_path / "fit.csv"
    files = "--out", out, "--plot", plot, "--csv", csv, "--json", tmp_path / "fit.json"
    result = done("fit", "cam", lift_table, "--tolerance", 0.0005, *files)
    assert (
        "Not followed: the requested tolerance is 0.0005 mm, the readings scatter" in result.output
    )
    data = json.loads((tmp_path / "fit.json").read_text())
    spline = data["spline"]
    assert spline["scatter"] == pytest.approx(2e-6, rel=0.3)
    assert spline["zero"] == pytest.approx(3.2e-3, abs=2e-6)
    assert [outlier["line"] for outlier in data["outliers"]] == [102]
    spans = [math.degrees(dwell["span"]) for dwell in data["dwells"]]
    assert spans == pytest.approx([60, 100], abs=2)
    peak = 0.0057735 * 10 / math.radians(100) ** 2
    assert spline["peak_acceleration"] == pytest.approx(peak, rel=0.02)
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert csv.read_text().startswith("count,excluded,scatter,")
    assert (tmp_path / "fit.dwells.csv").read_text().startswith("start,span,level,")
    assert {"own.yaml", "own.csv"} <= {path.name for path in tmp_path.iterdir()}


def test_one_column_under_a_named_follower():
    """`fit cam` fits one column of a table under a given type of follower.

    A flat follower alone does not identify the base radius, which is then assumed.
    """
    one = "--column", "lift_b_mm", "--follower", "flat"
    data = data_of("fit", "cam", GL110, "--shape", "arcs", *one)
    assert data["numbers"][0]["number"] == "base radius + roller radius"
    assert data["numbers"][0]["identifiable"] == "assumed"
    assert data["arcs"]["rms"] < 0.05e-3
    assert data["residuals"][0]["follower"] == "flat"


@pytest.mark.long
def test_new_reads_every_file(tmp_path, monkeypatch):
    """Two files of one lift column each give the cam of one file with both columns.

    The command is `cam-rig new`.
    """
    monkeypatch.chdir(tmp_path)
    rows = [line.split(",") for line in GL110.read_text().splitlines() if line[0] != "#"]
    for name, column in (("a", 1), ("b", 2)):
        (tmp_path / f"{name}.csv").write_text("\n".join(f"{r[0]},{r[column]}" for r in rows))
    made = done("new", "both", "--from-csv", "a.csv", "--from-csv", "b.csv", "--shape", "arcs")
    assert "5 numbers of tangent arcs: 0.0532 mm r.m.s. from 66 readings." in made.output
    title = (tmp_path / "both" / "scenes" / "both.yaml").read_text().splitlines()[1]
    assert title == 'title: "both, from readings"'


def test_the_assumption_for_an_open_table_is_reported(tmp_path):
    """For a table that stops before the fall, arcs mirror the rise and report this.

    A fit of a spline raises an error instead.
    """
    lines = [line for line in GL110.read_text().splitlines() if line[0] != "#"]
    open_end = tmp_path / "open.csv"
    open_end.write_text("\n".join(lines[: lines.index("25,7.65,11.65") + 1]))
    result = done("fit", "cam", open_end, "--shape", "arcs")
    assert "the fall is not in the table; the mirror image of the rise is assumed" in result.output
    error = call("fit", "cam", open_end, "--column", "lift_a_mm")
    assert error.exit_code == 2
    assert "no reading for" in error.stderr


# -- files that a fit writes


def written(files, folder):
    """Write the files of a fit to a folder and return the cam that they contain."""
    for name, text in files.texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return load_cam(folder / next(iter(files.texts)))


@pytest.mark.parametrize(
    ("name", "kind"), [("poly345", "roller"), ("bezier15", "flat"), ("arcs_convex", "point")]
)
def test_the_file_of_a_spline_is_the_spline(measured, tmp_path, kind, name):
    """The cam file of a spline fit has its law within 20 nm, and passes all checks.

    It has the dwells of the fit and lists the excluded readings.
    """
    fit = fit_spline(measured(name, 180, zero=0.002, outliers={50: 4e-4}))
    files = spline_cam("mine", fit, kind)
    cam = written(files, tmp_path)
    law = build_law(cam)
    assert law(FINE) == pytest.approx(fit.law(FINE), abs=2e-8)
    assert law(FINE) == pytest.approx(files.law(FINE), abs=1e-12)
    assert len(cam.segments[0].dwells) == len(fit.dwells)
    assert all(check.passed for check in check_cam(cam, law))
    assert "excluded as an outlier: line 52" in files.texts["mine.csv"]
    assert any(f"follower {kind}" in words for words in files.assumed)


def test_a_base_radius_that_fails_the_checks_is_reported_with_one_that_passes(measured):
    """If a given base radius fails the contour checks, a valid one is reported."""
    fit = fit_spline(measured("poly345"))
    files = spline_cam("mine", fit, "roller", 1e-3)
    (words,) = (one for one in files.assumed if "checks" in one)
    assert words.startswith("the given base radius of 1 mm does not pass all checks, ")
    passing = float(words.split("all checks, ")[1].split(" mm does")[0])
    other = spline_cam("mine", fit, "roller", 1e-3 * passing)
    assert all(c.passed for c in check_cam(other.cam, other.law))


def test_origins_are_distinguished(measured, tmp_path):
    """In a cam file, options are `given` and results of the fit are `identified`.

    All other numbers are `assumed`.
    """
    readings = measured("poly345")
    given = written(spline_cam("mine", fit_spline(readings, 3e-6), "roller", 0.055), tmp_path)
    assert given.segments[0].tolerance.origin == "given"
    assert given.follower.base_radius.origin == "given"
    assert given.follower.base_radius.si == pytest.approx(0.055)
    found = written(spline_cam("mine", fit_spline(readings), "roller", None, 0.009), tmp_path)
    assert found.follower.roller_radius.si == pytest.approx(0.009)
    assert found.follower.roller_radius.origin == "given"
    assert found.segments[0].tolerance.origin == "identified"
    assert found.lift.origin == "identified"
    assert "r.m.s." in found.lift.residual
    assert found.follower.base_radius.origin == "assumed"
    assert {dwell.start.origin for dwell in found.segments[0].dwells} == {"identified"}


@pytest.mark.parametrize("flank", [0.09, None, -0.15])
def test_the_file_of_arcs_is_the_contour(tmp_path, flank):
    """The cam file of an arc fit has the lift of the fitted contour within 0.1 µm.

    The law is shifted so that the nose is at 180°.
    """
    arcs = Arcs(0.03, 0.01, flank, 0.012, 0.7)
    fit = fit_arcs(readings_of(arcs, ROLLER), (False,), 0.01, 0.03)
    files = arcs_cam("mine", fit, "roller")
    law = build_law(written(files, tmp_path))
    assert law(FINE) == pytest.approx(arcs.lifts(ROLLER, FINE + 0.7 - np.pi), abs=1e-7)
    assert "40.11 deg of the readings" in files.texts["mine.yaml"]
    assert any("roller radius 10 mm" in words for words in files.assumed)


def test_the_radius_that_was_given_is_given():
    """If the base or the roller radius is given, the fit identifies the other radius.

    If neither is given, the roller radius is assumed. The cam file states these origins.
    """
    readings = readings_of(Arcs(0.03, 0.01, 0.09, 0.012, 0.7), ROLLER)
    for known, base, rolling in (
        (None, "identified", "assumed"),
        ("roller", "identified", "given"),
        ("base", "given", "identified"),
        ("both", "given", "given"),
    ):
        fit = fit_arcs(readings, (False,), 0.01, 0.03, known)
        follower = arcs_cam("mine", fit, "roller").cam.follower
        assert follower.base_radius.origin == base
        assert follower.roller_radius.origin == rolling


@pytest.mark.parametrize("noise", [1e-5, 1e-4])
def test_digits_are_those_that_readings_determine(noise):
    """Radii in a cam file have only the digits that the readings determine.

    They have an interval, and their rounding changes the residuals by less than 1 %.
    """
    arcs = Arcs(0.03, 0.01, 0.09, 0.012, 0.7)
    readings = readings_of(arcs, ROLLER, FLAT, noise=noise, seed=1)
    fit = fit_arcs(readings, (False, True), 0.01, 0.03)
    files = arcs_cam("mine", fit, "roller")
    radius = files.cam.follower.base_radius
    assert len(f"{radius.raw:g}".replace(".", "")) <= 5
    assert "95 %: base radius + roller radius" in radius.residual
    away = files.law(ANGLES - fit.arcs.nose_angle + np.pi) - readings[0].lifts
    assert np.sqrt(np.mean(away**2)) < 1.01 * fit.fitted_columns[0].rms + 1e-9


def test_rig_and_scene_are_read_back(measured, tmp_path, config_dir):
    """The rig file and the scene file that `cam-rig new` writes can be loaded.

    Every number of the rig is assumed. The scene has five speeds, at most 20 000 rpm.
    """
    like = load_rig(config_dir / "rigs" / "tm21.yaml")
    (tmp_path / "rig.yaml").write_text(default_rig("mine", like), encoding="utf-8")
    rig = load_rig(tmp_path / "rig.yaml")
    assert rig.follower.mass.si == like.follower.mass.si
    assert {getattr(rig.follower, key).origin for key in ("mass", "preload")} == {"assumed"}
    assert rig.radiation.gain.origin == "assumed"
    assert rig.radiation.calibrated_on == ""
    law = fit_spline(measured("poly345")).law
    text, speeds = default_scene("mine", law, rig)
    (tmp_path / "scene.yaml").write_text(text, encoding="utf-8")
    scene = load_scene(tmp_path / "scene.yaml")
    assert scene.schedule.speeds.numbers == list(speeds)
    assert list(speeds) == sorted(speeds)
    assert len(speeds) == 5
    heavy = default_scene("mine", law, rig.with_follower(preload=1e9))[1]
    assert max(heavy) <= 20_000.0  # the jump speed is far above this limit


def test_a_coarse_gauge_is_read_back(measured, tmp_path):
    """The cam file of readings with 0.1 mm of noise has the law of the fit.

    The noise gives the readings a larger range than the lift of the law.
    """
    fit = fit_spline(measured("flat", noise=1e-4))
    law = build_law(written(spline_cam("mine", fit, "roller"), tmp_path))
    assert law(FINE) == pytest.approx(fit.law(FINE), abs=2e-8)
    assert np.ptp(fit.readings.lifts) > law.lift + 2e-4
