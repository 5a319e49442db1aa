"""The command line: codes, one-line errors, JSON that programs can read."""

import inspect

import pytest

from cam_rig.cli.main import COMMANDS, command, summary
from cam_rig.schema.load import config_root

from .calls import call, data_of, done


def test_the_list_says_what_each_command_says_of_itself():
    """The list is there without importing any of them."""
    for name in COMMANDS:
        first, *_ = inspect.cleandoc(command(name).help).split("\n\n")
        assert summary(name) == first.replace("\n", " ")


def test_simulate_writes_the_promised_json():
    """The sweep's figures meet the targets of the comparison, and roles are told apart."""
    data = data_of("simulate", "tm21_sweep")
    assert set(data) == {"schema", "speeds", "noise", "levels", "crossing", "messages"}
    assert [len({row["cam"] for row in data["speeds"]}), len(data["speeds"])] == [3, 63]
    assert {type(row["torque_mean"]) for row in data["speeds"]} == {float}
    cams = {row["cam"]: row for row in data["noise"]}
    assert {name: cam["role"] for name, cam in cams.items()} == {
        "tm21": "identified",
        "poly345": "calibrated",
        "bezier15": "predicted",
    }
    assert len({row["rpm"] for row in data["levels"]}) == len(data["levels"]) / 3 == 21
    assert all(None not in cam.values() for cam in cams.values())
    assert cams["poly345"]["rms_difference"] <= 1.0
    assert cams["bezier15"]["rms_difference"] <= 1.0
    assert cams["tm21"]["rms_difference"] <= 2.5
    assert data["crossing"]["rpm"] == pytest.approx(335.0, abs=15.0)


def test_urdf_goes_to_stdout_or_into_a_file(tmp_path):
    """The same text; the mounted cam's base circle, 65 mm of poly345, is in it."""
    printed = done("urdf", "tm21_sweep", "--cam", "poly345")
    assert '<cylinder radius="0.065"' in printed.stdout
    call("urdf", "tm21_sweep", "--cam", "poly345", "--out", tmp_path / "new" / "rig.urdf")
    assert (tmp_path / "new" / "rig.urdf").read_text(encoding="utf-8") == printed.stdout


def test_calibrate_repeats_what_is_in_the_rig_file(tmp_path):
    """The shipped constants are what the command finds, and a dry run writes nothing."""
    rig = config_root() / "rigs" / "tm21.yaml"
    before = rig.read_bytes()
    result = done("calibrate", "--dry-run")
    assert "gain 9.86e-05" in result.stderr
    assert "corner 18.42" in result.stderr
    assert rig.read_bytes() == before
