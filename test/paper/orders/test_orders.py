"""cam-rig orders: of a cam and of a scene, tables, CSV, JSON, a plot, refusals in a line."""

import csv
import io
import json
import math
from functools import partial

import pytest

from cam_rig.errors import ConfigError
from cam_rig.simulation.asked import speeds_in

from ...cli.conftest import call as run

call = partial(run, "orders")


def test_a_cam_at_one_speed():
    """3-4-5 up and down alike: its even orders are rounding; the CSV has what the table shows."""
    result = call("poly345", "--rpm", "400", "--orders", "12", "--csv", "-")
    assert result.exit_code == 0, result.stderr
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [float(row["order"]) for row in rows] == list(range(1, 13))
    amplitudes = [float(row["force_amplitude"]) for row in rows]
    assert max(amplitudes[1::2]) < 1e-10
    assert min(amplitudes[::2]) > 1.0
    assert float(rows[2]["frequency"]) == pytest.approx(20.0)
    assert "Phase: force = mean" in result.stderr


def test_a_scene_over_speed(tmp_path):
    """Its cams, rig, model and speeds; the phase is of the force over θ."""
    result = call("quick", "--orders", "20", "--json", "-", "--plot", tmp_path / "a.png")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    speeds = {(row["cam"], row["rpm"]): row for row in found["speeds"]}
    assert list(speeds) == [(c, r) for c in ("tm21", "bezier15") for r in (200, 300, 350, 400)]
    assert (speeds["bezier15", 200]["period"], speeds["bezier15", 200]["settled"]) == (1, True)
    at_rest = speeds["bezier15", 200]["mean_force"] + sum(
        row["force_amplitude"] * math.cos(row["force_phase"])
        for row in found["orders"]
        if (row["cam"], row["rpm"]) == ("bezier15", 200)
    )
    assert at_rest == pytest.approx(12.753, abs=0.5)  # the preload, where the lift is zero


def test_another_rig_and_model():
    """A cam, or a cam of a scene, on a rig that is named; the model by the field's name."""
    of_cam = call("poly345", "--rig", "paper_table2", "--model", "two_mass", "--rpm", "390,400")
    assert of_cam.exit_code == 0, of_cam.stderr
    words = ["--cam", "poly345", "--rpm", "400", "--rig", "paper_table2", "--json", "-"]
    of_scene = json.loads(call("tm21_sweep", *words).stdout)
    assert of_scene["run"] == {"rig": "paper_table2", "model": "one_mass"}


def test_speeds_as_words():
    """One, some, or from and to by a step."""
    assert speeds_in("300") == [300.0]
    assert speeds_in("300,200") == [200.0, 300.0]
    assert speeds_in("0.1:0.4:0.1") == pytest.approx([0.1, 0.2, 0.3, 0.4])
    for wrong in ("", "a", "1:2", "1:2:0", "2:1:1", "1:1e9:1", "nan", "-3", "1e6"):
        with pytest.raises(ConfigError, match=r"--rpm .*allowed: 300"):
            speeds_in(wrong)
