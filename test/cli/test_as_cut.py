"""cam-rig as-cut: JSON, radii in millimetres, a plot, refusals in a line."""

import json

from typer.testing import CliRunner

from cam_rig.cli.main import app


def call(*arguments):
    return CliRunner().invoke(app, ["as-cut", *(str(a) for a in arguments)])


def test_json_and_plot(tmp_path):
    """The cam's own radii where none are given; a picture of the first cam."""
    plot = tmp_path / "cut.png"
    result = call("bezier15", "--roller", 20, "--json", "-", "--plot", plot)
    assert result.exit_code == 0, result.stderr
    cam = json.loads(result.stdout)["bezier15"]
    assert (cam["base_radius_m"], cam["roller_radius_m"]) == (0.065, 0.02)
    assert cam["jump_rpm"][0] < cam["jump_rpm"][1]
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_refusals(tmp_path):
    """A follower without a roller, a base circle of no radius."""
    out = tmp_path / "a.json"
    assert call("flat", "--json", out).exit_code == 2
    none = call("bezier15", "--base", 0, "--json", out)
    assert none.exit_code == 2
    assert "--base: is 0 mm" in none.stderr
    assert not out.exists()
