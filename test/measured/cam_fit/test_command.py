"""cam-rig fit cam and cam-rig new: from a table to numbers, files, and a run."""

import json
import math

import numpy as np
import pytest

from cam_rig.schema.load import config_root

from ...cli.conftest import call

GL110 = config_root() / "cams" / "gunt_gl110_convex.csv"


@pytest.fixture
def table(tmp_path):
    """A table of 360 lifts as a spreadsheet in German writes it, with 2 µm and one outlier."""
    angles = np.arange(0, 360)
    u = np.clip((angles - 60.0) / 100.0, 0.0, 1.0), np.clip((angles - 220.0) / 100.0, 0.0, 1.0)
    up, down = (10 * x**3 - 15 * x**4 + 6 * x**5 for x in u)
    lifts = 3.2 + 10.0 * (up - down) + np.random.default_rng(1).normal(scale=0.002, size=360)
    lifts[100] += 0.4
    rows = [f"{a};{s:.4f}".replace(".", ",") for a, s in zip(angles, lifts, strict=True)]
    path = tmp_path / "lifts.csv"
    path.write_text("\ufeffWinkel (Grad);Hub (mm)\r\n" + "\r\n".join(rows), encoding="utf-8")
    return path


def test_a_table_becomes_a_scene_that_runs(table, tmp_path, monkeypatch):
    """cam-rig new, then simulate, vibration and profile on its files, as they are."""
    monkeypatch.chdir(tmp_path)
    made = call("new", "mine", "--from-csv", table)
    assert made.exit_code == 0, made.output
    for words in ("separator semicolon, decimal comma", "assumed: follower roller", "mine.csv"):
        assert words in made.output
    assert "outliers: line 102 by " in made.output
    run = call("simulate", "mine/scenes/mine.yaml", "--json", "-")
    assert run.exit_code == 0
    rows = json.loads(run.stdout)["levels"]
    assert rows and all(math.isfinite(row["level"]) for row in rows)
    assert call("profile", "mine/cams/mine.yaml").exit_code == 0
    again = call("new", "mine", "--from-csv", table)
    assert again.exit_code == 1
    assert "mine/cams/mine.yaml: exists already, not overwriting" in again.output


def test_new_asks_nothing(tmp_path, monkeypatch):
    """Of two columns the first is taken, and that is said; the gap in the readings too."""
    monkeypatch.chdir(tmp_path)
    made = call("new", "gl110", "--from-csv", GL110)
    assert made.exit_code == 0, made.output
    assert "first column of lifts taken, not 'lift_b_mm': --column" in made.output
    assert "no readings for 200 deg after 80 deg: the cam is assumed to rest there" in made.output
    text = (tmp_path / "gl110" / "cams" / "gl110.yaml").read_text()
    assert "# gunt_gl110_convex.csv: first column of lifts taken" in text


def test_fit_prints_the_answer_and_writes_it(table, tmp_path):
    """Distance, knots, outlier and what was not followed; JSON, CSV, picture and cam."""
    out, plot, csv = tmp_path / "own.yaml", tmp_path / "fit.png", tmp_path / "fit.csv"
    result = call("fit", "cam", table, "--tolerance", 0.0005, "--out", out, "--plot", plot,
                  "--csv", csv, "--json", tmp_path / "fit.json")  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "Not followed: 0.0005 mm were asked, the readings scatter by 0.00" in result.output
    data = json.loads((tmp_path / "fit.json").read_text())
    spline = data["spline"]
    assert spline["scatter"] == pytest.approx(2e-6, rel=0.3)
    assert spline["zero"] == pytest.approx(3.2e-3, abs=2e-6)
    assert [outlier["line"] for outlier in data["outliers"]] == [102]
    spans = [math.degrees(dwell["span"]) for dwell in data["dwells"]]
    assert spans == pytest.approx([60, 100], abs=2)
    assert spline["peak_acceleration"] == pytest.approx(
        0.0057735 * 10 / math.radians(100) ** 2, rel=0.02
    )
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert csv.read_text().startswith("count,left_out,scatter,")
    assert (tmp_path / "fit.dwells.csv").read_text().startswith("start,span,level,")
    assert {"own.yaml", "own.csv"} <= {path.name for path in tmp_path.iterdir()}


def test_one_column_under_a_named_follower():
    """A column and a kind by name; the flat one alone tells no base radius."""
    result = call("fit", "cam", GL110, "--shape", "arcs", "--column", "lift_b_mm", "--follower",
                  "flat", "--json", "-")  # fmt: skip
    data = json.loads(result.stdout)
    assert data["numbers"][0]["number"] == "base radius + roller radius"
    assert data["numbers"][0]["told"] == "assumed"
    assert data["arcs"]["rms"] < 0.05e-3
    assert data["residuals"][0]["follower"] == "flat"


def test_a_known_base_radius_gives_the_rollers(tmp_path):
    """Only their sum is told, 44.52 mm: with 32 mm of base radius the roller has 12.52 mm."""
    result = call("fit", "cam", GL110, "--shape", "arcs", "--base-radius", "32", "--json", "-")
    data = json.loads(result.stdout)["arcs"]
    assert data["base_radius"] == pytest.approx(0.032, abs=1e-6)
    assert data["roller_radius"] == pytest.approx(0.012523, abs=2e-6)
    assert data["rms"] == pytest.approx(5.322e-5, rel=1e-3)


@pytest.mark.long
def test_new_reads_every_file(tmp_path, monkeypatch):
    """Two files of one column each are the cam of both columns, as fit cam has it."""
    monkeypatch.chdir(tmp_path)
    rows = [line.split(",") for line in GL110.read_text().splitlines() if line[0] != "#"]
    for name, column in (("a", 1), ("b", 2)):
        (tmp_path / f"{name}.csv").write_text("\n".join(f"{r[0]},{r[column]}" for r in rows))
    made = call("new", "both", "--from-csv", "a.csv", "--from-csv", "b.csv", "--shape", "arcs")
    assert made.exit_code == 0, made.output
    assert "5 numbers of tangent arcs: 0.0532 mm r.m.s. from 66 readings." in made.output
    title = (tmp_path / "both" / "scenes" / "both.yaml").read_text().splitlines()[1]
    assert title == 'title: "both, from readings"'


def test_an_open_table_says_what_is_assumed(tmp_path):
    """A table that ends before the fall: arcs mirror the rise, a spline refuses it."""
    lines = [line for line in GL110.read_text().splitlines() if line[0] != "#"]
    open_end = tmp_path / "open.csv"
    open_end.write_text("\n".join(lines[: lines.index("25,7.65,11.65") + 1]))
    result = call("fit", "cam", open_end, "--shape", "arcs")
    assert result.exit_code == 0, result.output
    assert "the fall is not in the table; assumed is the mirror image of the rise" in result.output
    refused = call("fit", "cam", open_end, "--column", "lift_a_mm")
    assert refused.exit_code == 2
    assert "no reading for" in refused.stderr


@pytest.mark.variants(7)
@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["fit", "cam", "{table}", "--out", "cam.txt"], 2, "--out: is cam.txt; allowed: a name"),
        (["fit", "cam", "{table}", "--column", "lift"], 2, "has no column 'lift'; allowed: 'Hub"),
        (["fit", "cam", "{table}", "{table}"], 2, "2 files; allowed: one for a spline, several"),
        (["fit", "cam", "{table}", "--tolerance", "9"], 2, "--tolerance: is 9 mm; allowed: above"),
        (["fit", "cam", "{table}", "--shape", "arcs"], 2, "no base circle, two equal flanks and a"),
        (["fit", "cam", GL110], 2, "name it with --column ('lift_a_mm', 'lift_b_mm'), or take all"),
        (["fit", "cam", GL110, "--shape", "arcs", "--tolerance", "1"], 2, "--tolerance: is for"),
        (["fit", "cam", GL110, "--shape", "arcs", "--base-radius", "50"], 2, "allowed: below base"),
        (["fit", "cam", "none.csv"], 2, "none.csv: no such file"),
        (["new", "My Cam", "--from-csv", "{table}"], 2, "name: is 'My Cam'"),
        (["new", "mine", "--from-csv", "{table}", "--rig", "none"], 2, "none.yaml: no such file"),
    ],
)
def test_what_is_wrong_is_one_line(table, tmp_path, monkeypatch, arguments, code, words):
    """The code of a wrong argument, one line, and no file is written."""
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.rglob("*"))
    result = call(*(str(a).format(table=table) for a in arguments))
    assert result.exit_code == code, result.output
    assert words in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert set(tmp_path.rglob("*")) == before
