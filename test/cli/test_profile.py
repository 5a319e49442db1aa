"""cam-rig profile: checks with a code, drawings whole or not at all, contours measured."""

import json
import re
from functools import partial

import numpy as np
import pytest

from cam_rig.schema.load import config_root
from cam_rig.show.tables import format_number

from .conftest import call as run
from .conftest import done as run_done
from .conftest import shipped, written

call = partial(run, "profile")
done = partial(run_done, "profile")


@pytest.fixture
def undercut(tmp_path):
    """The flat cam on too small a base circle."""
    text = re.sub(r"(base_radius: {assumed: )\d+", r"\g<1>5", shipped("cams", "flat"))
    text = re.sub(r".*least_curvature_radius: .*\n", "", text)
    return written(tmp_path, {"flat.yaml": text}) / "flat.yaml"


@pytest.fixture(scope="module")
def all_shipped():
    """What the command says of every shipped cam."""
    return done("--all", "--json", "-")


def test_all_shipped_cams_pass(all_shipped):
    """All but one can be made: the worked example's constant velocity has corners."""
    result = all_shipped
    assert "its file states that it cannot be made: its velocity jumps" in result.stderr
    assert call("worked_example_constant_velocity").exit_code == 1
    data = json.loads(result.stdout)
    names = {path.stem for path in (config_root() / "cams").glob("*.yaml")}
    assert {cam["cam"] for cam in data["cams"]} == names
    refused = {cam["cam"] for cam in data["cams"] if cam["failed"]}
    assert refused == {"worked_example_constant_velocity"}
    assert refused == {cam["cam"] for cam in data["cams"] if cam["cannot_be_made"]}
    assert refused == {check["cam"] for check in data["checks"] if not check["passed"]}
    assert all(name in result.stderr for name in names)
    (pressure,) = (
        c for c in data["checks"] if (c["cam"], c["check"]) == ("tm21", "pressure angle")
    )
    assert pressure["value"] == pytest.approx(np.radians(19.094), abs=1e-5)
    assert pressure["unit"] == "rad"


def test_the_table_of_all_fits_80_columns(all_shipped):
    """A line a cam, no number cut; TM21's are the theses' cam's; “–” is what a cam has not."""
    lines = all_shipped.stderr.splitlines()
    names = {path.stem for path in (config_root() / "cams").glob("*.yaml")}
    table = lines[: next(i for i, line in enumerate(lines) if line.startswith("–: "))]
    rows = {line.split()[0]: line.split() for line in table if line.strip()}
    assert names <= set(rows)
    assert rows["tm21"] == ["tm21", "13.53", "507.7", "19.09", "20", "3.785", "7", "ok"]
    assert rows["arcs_straight"] == ["arcs_straight", "12", "–", "29.9", "25", "6.288", "6", "ok"]
    assert all(len(line) <= 80 and "…" not in line for line in table)


def test_a_failing_check_is_code_1(undercut):
    """The table says which; the line below says why and what to do."""
    result = call(undercut)
    assert result.exit_code == 1
    words = "convex radius of curvature is -1.3984 mm at 127.6°; allowed: more than 0 mm; let base"
    assert words in result.stderr
    assert "Traceback" not in result.stderr
    assert call("flat", undercut).exit_code == 1 and call("--all", undercut).exit_code == 1


def test_what_cannot_exist_is_drawn_by_force_alone(undercut, tmp_path):
    """Refused and nothing written; with --force written, and the warning stays."""
    out, plot = tmp_path / "a.dxf", tmp_path / "a.png"
    result = call(undercut, "--out", out, "--plot", plot)
    assert result.exit_code == 1 and "or draw it with --force" in result.stderr
    assert not out.exists() and not plot.exists()
    result = done(undercut, "--out", out, "--plot", plot, "--force")
    assert "warning: flat: convex radius" in result.stderr
    assert out.exists()
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("suffix", ["dxf", "csv"])
def test_there_and_back(tmp_path, suffix):
    """The contour written, measured by its own follower, and its law written; as JSON too."""
    out, law = tmp_path / f"a.{suffix}", tmp_path / "law.csv"
    chord = ["--tolerance", "0.5"] if suffix == "dxf" else []
    done("conjugate", "--out", out, *chord)
    result = done("conjugate", "--from", out, "--out", law, "--json", "-")
    lines = [line.split() for line in result.stderr.splitlines()]
    found = [line for line in lines if line[:1] == ["conjugate"]]
    assert [(line[1], line[3]) for line in found] == [("first", "18"), ("second", "18")]
    header, *rows = law.read_text().splitlines()
    assert header == "angle_deg,lift_mm" and len(rows) == 720
    assert float(rows[360].split(",")[1]) == pytest.approx(18.0, abs=1e-6)
    data = json.loads(result.stdout)["contours"]
    assert [one["disc"] for one in data] == ["first", "second"]
    for one in data:
        assert one["source"] == str(out)
        assert suffix == "dxf" or one["points"] == 3600
        assert one["lift"] == pytest.approx(18e-3, abs=1e-9)
        assert 0.0 < one["rms_error"] <= abs(one["largest_error"])
        assert suffix == "dxf" or abs(one["largest_error"]) < 1e-9
        assert f"{format_number(1e6 * one['largest_error'], '+.3g')} " in result.stderr


def test_a_contour_that_is_none_is_measured_with_a_warning(tmp_path):
    """Measure 200 of 360 rows, and report what is wrong with them."""
    done("flat", "--points", "360", "--out", tmp_path / "a.csv")
    rows = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "b.csv").write_text("\n".join(rows[:201]))
    assert "b.csv: " not in done("flat", "--from", tmp_path / "a.csv").stderr
    assert "points 200 and 1 are" in done("flat", "--from", tmp_path / "b.csv").stderr


def test_pitch_curve_is_the_path_of_such_a_cutter(tmp_path):
    """Roller and cutter of one radius: byte for byte (§2.2.3)."""
    done("tm21", "--pitch", "--out", tmp_path / "p.csv")
    done("tm21", "--cutter", "10", "--out", tmp_path / "c.csv")
    assert (tmp_path / "p.csv").read_bytes() == (tmp_path / "c.csv").read_bytes()
    result = done("tm21", "--cutter", "8", "--tolerance", "0.01", "--out", tmp_path / "d.svg")
    assert "chord error at most 0.01 µm" in result.stderr


def test_a_contour_for_another_follower(tmp_path):
    """Two conjugate cams are not one."""
    call("tm21", "--out", tmp_path / "a.dxf")
    result = call("conjugate", "--from", tmp_path / "a.dxf")
    assert result.exit_code == 1
    assert "has 1 closed curves; allowed: 2, one for each contour" in result.stderr
