"""cam-rig timing: tables of one cam and of several, JSON, a plot, refusals in a line."""

import json

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app


def call(*arguments):
    return CliRunner().invoke(app, ["timing", *(str(a) for a in arguments)])


def test_one_cam(tmp_path):
    """Its ordinates, the B-spline beside it, and a picture."""
    plot, csv = tmp_path / "timing.png", tmp_path / "timing.csv"
    result = call("bezier15", "--plot", plot, "--csv", csv, "--json", "-")
    assert result.exit_code == 0, result.stderr
    cam = json.loads(result.stdout)["bezier15"]
    assert [event["level"] for event in cam["events"]] == [0.01, 0.5, 0.99, 0.99, 0.5, 0.01]
    assert len(cam["ordinates"][0]["reach_deg"]) == 16
    assert plot.read_bytes().startswith(b"\x89PNG")
    text = csv.read_text(encoding="utf-8")
    assert "what each ordinate moves" in text
    assert "Control of the events" in text


def test_several_cams():
    """Events alone, of those of Table 2."""
    result = call("--json", "-")
    found = json.loads(result.stdout)
    assert found["poly345"]["events"][1]["angle_deg"] == pytest.approx(90.0)
    assert "one cam alone is shown" in result.stderr


def test_refusals(tmp_path):
    """A cam without ordinates has no plot; a cam that is none."""
    result = call("cycloidal", "--plot", tmp_path / "a.png")
    assert result.exit_code == 2
    assert "has no ordinates to plot" in result.stderr
    assert call("no_such").exit_code == 2
    assert list(tmp_path.iterdir()) == []
