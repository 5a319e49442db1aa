"""cam-rig contact: tables, JSON and figures of several cams, or one line and nothing written."""

import json

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app


def call(*arguments):
    return CliRunner().invoke(app, ["contact", *(str(a) for a in arguments)])


def test_tables_json_and_figures(tmp_path):
    """A face slides and a roller rolls; the nomogram's table comes with its figure."""
    plot, events, csv = (tmp_path / name for name in ("c.png", "e.svg", "c.csv"))
    result = call(
        *("flat", "poly345", "--plot", plot, "--events", events, "--csv", csv, "--json", "-")
    )
    assert result.exit_code == 0, result.stderr
    assert plot.stat().st_size > 0
    assert b"</svg>" in events.read_bytes()
    assert "β = 120°" in csv.read_text()
    cams = json.loads(result.stdout[result.stdout.index("{") :])["cams"]
    assert cams["flat"]["sliding_speed_m_per_s"] == pytest.approx(
        0.047 * 300 * 3.141592653589793 / 30
    )
    assert cams["poly345"]["sliding_speed_m_per_s"] is None
    assert cams["poly345"]["bounds"]["sliding_m"] is None
    assert cams["flat"]["bounds"]["sliding_m"] > cams["flat"]["bounds"]["pressure_m"]


def test_assumptions_are_listed():
    """What no cam file gives stands under the tables, with its origin."""
    result = call("flat")
    for word in ("face_width", "youngs_modulus", "assumed", "most_sliding_speed"):
        assert word in result.stderr


def test_a_cam_closed_by_form_is_refused(tmp_path):
    """The force between two contacts is no one's that the rig knows; nothing is written."""
    plot = tmp_path / "c.png"
    result = call("conjugate", "--plot", plot)
    assert result.exit_code == 2
    assert "closing spring" in result.stderr
    assert not plot.exists()
