"""Command `cam-rig profile`: checks and exit code, drawings, measured contours."""

import json
import math
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
    """File of the cam `flat` with too small a base circle, so that it is undercut."""
    text = re.sub(r"(base_radius: {assumed: )\d+", r"\g<1>5", shipped("cams", "flat"))
    text = re.sub(r".*least_curvature_radius: .*\n", "", text)
    return written(tmp_path, {"flat.yaml": text}) / "flat.yaml"


@pytest.fixture(scope="module")
def all_shipped():
    """Result of `profile --all` for all shipped cams."""
    return done("--all", "--json", "-")


def test_all_shipped_cams_but_one_pass(all_shipped):
    """Each shipped cam passes all checks except the one with corners in its contour.

    It is the worked example with constant velocity.
    """
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


def test_failed_check_gives_exit_code_1(undercut):
    """A cam that fails a check ends the command with code 1, reason and remedy."""
    result = call(undercut)
    assert result.exit_code == 1
    words = "convex radius of curvature is -1.3984 mm at 127.6°; allowed: more than 0 mm; let base"
    assert words in result.stderr
    assert "Traceback" not in result.stderr
    assert call("flat", undercut).exit_code == 1 and call("--all", undercut).exit_code == 1


def test_cam_that_cannot_be_made_is_drawn_only_with_force(undercut, tmp_path):
    """An undercut cam is drawn only with --force, and with a warning."""
    out, plot = tmp_path / "a.dxf", tmp_path / "a.png"
    result = call(undercut, "--out", out, "--plot", plot)
    assert result.exit_code == 1 and "or draw it with --force" in result.stderr
    assert not out.exists() and not plot.exists()
    result = done(undercut, "--out", out, "--plot", plot, "--force")
    assert "warning: flat: convex radius" in result.stderr
    assert out.exists()
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("suffix", ["dxf", "csv"])
def test_written_contour_gives_its_law_again(tmp_path, suffix):
    """A written contour that is measured by its follower gives the lift of the cam.

    This applies to DXF and CSV files with both discs of a conjugate cam.
    """
    out, law = tmp_path / f"a.{suffix}", tmp_path / "law.csv"
    chord = ["--tolerance", "0.5"] if suffix == "dxf" else []
    done("conjugate", "--out", out, *chord)
    result = done("conjugate", "--from", out, "--out", law, "--json", "-")
    lines = [line.split() for line in result.stderr.splitlines()]
    measured = [line for line in lines if line[:1] == ["conjugate"]]
    assert [(line[1], line[3]) for line in measured] == [("first", "18"), ("second", "18")]
    header, *rows = law.read_text().splitlines()
    assert header == "angle_deg,lift_mm" and len(rows) == 720
    assert float(rows[360].split(",")[1]) == pytest.approx(18.0, abs=1e-6)
    data = json.loads(result.stdout)["contours"]
    assert [disc["disc"] for disc in data] == ["first", "second"]
    for disc in data:
        assert disc["source"] == str(out)
        assert suffix == "dxf" or disc["points"] == 3600
        assert disc["lift"] == pytest.approx(18e-3, abs=1e-9)
        assert 0.0 < disc["rms_error"] <= abs(disc["largest_error"])
        assert suffix == "dxf" or abs(disc["largest_error"]) < 1e-9
        assert f"{format_number(1e6 * disc['largest_error'], '+.3g')} " in result.stderr


def test_open_contour_is_measured_with_a_warning(tmp_path):
    """A contour with 200 of 360 points is measured, and a warning reports the gap."""
    done("flat", "--points", "360", "--out", tmp_path / "a.csv")
    rows = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "b.csv").write_text("\n".join(rows[:201]))
    assert "b.csv: " not in done("flat", "--from", tmp_path / "a.csv").stderr
    assert "points 200 and 1 are" in done("flat", "--from", tmp_path / "b.csv").stderr


def test_points_that_are_not_a_contour_are_refused(tmp_path):
    """Points that are not a contour around the axis are refused with the file name.

    They are too few, on a line, or next to the axis.
    """
    circle = [(30.0 * math.cos(0.1 * i), 30.0 * math.sin(0.1 * i)) for i in range(63)]
    for points, words in (
        (circle[:1], "contour has 1 different points"),
        (circle[:2], "contour has 2 different points"),
        (circle[:3], "contour has 3 different points"),
        (circle[:7], "contour has 7 different points"),
        ([(i, 5.0) for i in range(31)], "(x 0 to 30, y 5 to 5 mm) encloses no area"),
        ([(x + 120.0, y) for x, y in circle], "axis of the cam (0, 0 mm) is outside of the"),
    ):
        path = tmp_path / "a.csv"
        path.write_text("x_mm,y_mm\n" + "".join(f"{x},{y}\n" for x, y in points))
        result = call("flat", "--from", path)
        assert result.exit_code == 1
        *warnings, error = result.stderr.splitlines()
        assert error.startswith(f"cam-rig: {path}: ") and words in error
        assert all(warning.startswith("warning: ") for warning in warnings)
    done("flat", "--from", path, "--axis", "120,0")


def test_pitch_curve_is_the_path_of_a_cutter_of_the_roller_radius(tmp_path):
    """--pitch writes the path of a cutter with the radius of the roller.

    Both files are identical (profile thesis §2.2.3).
    """
    done("tm21", "--pitch", "--out", tmp_path / "p.csv")
    done("tm21", "--cutter", "10", "--out", tmp_path / "c.csv")
    assert (tmp_path / "p.csv").read_bytes() == (tmp_path / "c.csv").read_bytes()
    result = done("tm21", "--cutter", "8", "--tolerance", "0.01", "--out", tmp_path / "d.svg")
    assert "chord error at most 0.01 µm" in result.stderr


def test_contour_of_one_cam_is_refused_for_a_conjugate_cam(tmp_path):
    """A file with one closed curve is refused for a conjugate cam, which has two."""
    call("tm21", "--out", tmp_path / "a.dxf")
    result = call("conjugate", "--from", tmp_path / "a.dxf")
    assert result.exit_code == 1
    assert "must have 2 closed curves, one for each contour" in result.stderr
