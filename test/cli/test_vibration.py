"""cam-rig vibration: JSON by cam and speed, a plot, refusals in a line."""

import json

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app


def call(*arguments):
    return CliRunner().invoke(app, ["vibration", *(str(a) for a in arguments)])


def test_json_and_plot(tmp_path):
    """A list over the speeds for each measure of each cam, the paper's words, and a picture."""
    plot = tmp_path / "a.png"
    rpm = ("--rpm", 250, "--rpm", 300)
    result = call("poly345", "bezier15", *rpm, "--json", "-", "--plot", plot)
    assert result.exit_code == 0
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    assert list(by) == [(cam, rpm) for cam in ("poly345", "bezier15") for rpm in (250, 300)]
    assert not by["bezier15", 300]["low_dwell"]
    verdicts = [claim["verdict"] for claim in data["claims"] if claim["measure"] != "peak to peak"]
    assert verdicts == ["agrees"] * 3
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert "read within 31.25° of the lowest lift" in " ".join(result.stderr.split())


def test_cams_that_are_left_are_marked():
    """Of two cams one is left below 450 rpm: marked in the table, told in JSON, not asked of."""
    result = call("poly345", "bezier15", "--rpm", 300, "--rpm", 450, "--rpm", 450, "--json", "-")
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    lost = {key: row["contact_lost"] for key, row in by.items()}
    assert [key for key in lost if lost[key]] == [("poly345", 450)]
    assert len(lost) == 4
    assert by["poly345", 300]["contact_lost_rpm"] == pytest.approx(413.44, abs=0.01)
    assert "poly345 †" in result.stderr
    assert "bezier15 * †" not in result.stderr
    assert "contact is lost at 1 of 2 speeds" in result.stderr
    verdicts = {c["measure"]: c["verdict"] for c in data["claims"] if c["source"] == "fig. 5"}
    assert verdicts == {"residual amplitude": "agrees", "peak to peak": "disagrees"}


def test_refusals(tmp_path):
    """A cam that stands still, a cam that is none."""
    result = call("poly345", "--rpm", 0, "--json", tmp_path / "a.json")
    assert result.exit_code == 1
    assert "speed is 0 rpm; allowed: 1 to 3139 rpm on this stem" in result.stderr
    assert call("no_such").exit_code == 2
    lifted_off = call("worked_example_constant_velocity")
    assert lifted_off.exit_code == 1
    assert "or a rig without a shaft" in lifted_off.stderr
    assert "model" not in lifted_off.stderr.replace("in this model", "")
    assert list(tmp_path.iterdir()) == []
