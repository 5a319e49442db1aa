"""`cam-rig laws` and `cam-rig law`: figures programs can read, plots that are pictures."""

import csv
import io
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.laws.catalogue import free_laws
from cam_rig.laws.named import NAMED_RISES


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_laws_as_json():
    """Peaks and class of every named rise, as science.md lists them to its digits."""
    result = call("laws", "--json", "-")
    assert result.exit_code == 0
    data = json.loads(result.stdout)
    assert set(data) == set(NAMED_RISES)
    for law in data.values():
        assert set(law) == {"peak_velocity", "peak_acceleration", "peak_jerk", "continuity"}
    known = {
        "poly345": (1.875, 5.7735, 60, 2),
        "poly4567": (2.1875, 7.5132, 52.5, 3),
        "cycloidal": (2, 6.2832, 39.478, 2),
        "simple_harmonic": (1.5708, 4.9348, 15.503, 1),
        "modified_sine": (1.7596, 5.5280, 69.466, 2),
        "modified_trapezoid": (2, 4.8881, 61.426, 2),
    }
    for name, figures in known.items():
        assert list(data[name].values()) == pytest.approx(figures, rel=2e-5)


def test_laws_for_people():
    """Every law a file may name is in the table, free ones with what shapes them."""
    result = call("laws")
    assert result.exit_code == 0
    for name in [*NAMED_RISES, *free_laws()]:
        assert f" {name} " in result.stderr


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_law_is_drawn(tmp_path, suffix):
    """A picture of each kind, and the peaks from roots beside it."""
    target = tmp_path / "new" / f"law.{suffix}"
    result = call("law", "worked_example_quintic", "--out", target)
    assert result.exit_code == 0
    magic = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
    assert target.read_bytes().startswith(magic)
    assert "in/rad" in result.stderr
    assert "90° C2" in result.stderr


@pytest.mark.parametrize("cam", ["worked_example_constant_velocity", "b_spline", "measured"])
def test_odd_laws_are_drawn_too(tmp_path, cam):
    """Velocity jumps, control polygons, measured points."""
    assert call("law", cam, "--out", tmp_path / "a.png").exit_code == 0


def test_law_as_csv(laws):
    """Lift and three derivatives every half degree, in SI, on stdout; no plot is written."""
    result = call("law", "poly4567", "--csv")
    assert result.exit_code == 0
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert len(rows) == 720
    angle = np.radians([float(row["angle_deg"]) for row in rows])
    keys = ("lift_m", "velocity_m_rad", "acceleration_m_rad2", "jerk_m_rad3")
    for order, key in enumerate(keys):
        found = [float(row[key]) for row in rows]
        expected = laws["poly4567"](angle, order)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)
    assert "plot" not in result.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["law", "no_such_cam"], 2, "no_such_cam.yaml: no such file; there are: "),
        (["law", "poly354"], 2, "no such file (did you mean 'poly345'?); there are: arcs_"),
        (["law", "{tmp}"], 2, "cam-rig: {tmp}: is a folder; allowed: a YAML file"),
        (["law", "{tmp}/none"], 2, "cam-rig: {tmp}/none: no such file\n"),
        (["law", "poly345", "--out", "{tmp}/a.xyz"], 2, "unknown kind of picture; allowed: .png"),
        (["law", "poly345", "--out", "{tmp}"], 2, "unknown kind of picture"),
        (["law"], 2, "Missing argument"),
        (["laws", "--json", "{tmp}"], 1, "is a folder; allowed: a file"),
    ],
)
def test_errors_are_one_line_with_a_code(tmp_path, arguments, code, words):
    """A user's mistake gives a line and a code, no traceback, and writes nothing."""
    result = call(*(a.replace("{tmp}", str(tmp_path)) for a in arguments))
    assert result.exit_code == code
    assert words.replace("{tmp}", str(tmp_path)) in result.stderr
    assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_cam_that_cannot_be_names_its_file(tmp_path, config_dir):
    """The line says which file, which cam, and what to change."""
    text = (config_dir / "cams" / "arcs_convex.yaml").read_text(encoding="utf-8")
    path = tmp_path / "arcs_convex.yaml"
    path.write_text(text.replace("assumed: 80", "assumed: 20"), encoding="utf-8")
    result = call("law", path, "--out", tmp_path / "a.png")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"cam-rig: {path}: cam 'arcs_convex': arcs[1]: radius 20 mm")
    assert not (tmp_path / "a.png").exists()
