"""The command line: codes, one-line errors, JSON that programs can read."""

import inspect
import json

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import COMMANDS, app, command
from cam_rig.schema.load import config_root

SWEEP = str(config_root() / "scenes" / "tm21_sweep.yaml")


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_says_what_each_command_says_of_itself(name):
    """The list is there without importing any of them."""
    first, *_ = inspect.cleandoc(command(name).help).split("\n\n")
    assert COMMANDS[name][1] == first.replace("\n", " ")


def test_simulate_writes_the_promised_json():
    """The sweep's figures meet the targets of the comparison, and roles are told apart."""
    result = call("simulate", SWEEP, "--json", "-")
    assert result.exit_code == 0
    data = json.loads(result.stdout)
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


def test_a_plot_is_a_picture(tmp_path):
    """The PNG is written where asked, folder and all."""
    scene = config_root() / "scenes" / "quick.yaml"
    assert call("simulate", scene, "--plot", tmp_path / "new" / "a.png").exit_code == 0
    assert (tmp_path / "new" / "a.png").read_bytes().startswith(b"\x89PNG")


def test_analyze_reads_the_golden_bag():
    """Counts of the bag come with the comparison."""
    golden = config_root().parent / "bags" / "golden"
    result = call("analyze", golden, "--json", "-")
    assert result.exit_code == 0
    messages = {row["topic"]: row["count"] for row in json.loads(result.stdout)["messages"]}
    assert messages["/follower/samples"] == 16


def test_urdf_goes_to_stdout_or_into_a_file(tmp_path):
    """The same text; the mounted cam's base circle, 65 mm of poly345, is in it."""
    printed = call("urdf", "tm21_sweep", "--cam", "poly345")
    assert printed.exit_code == 0
    assert '<cylinder radius="0.065"' in printed.stdout
    call("urdf", "tm21_sweep", "--cam", "poly345", "--out", tmp_path / "new" / "rig.urdf")
    assert (tmp_path / "new" / "rig.urdf").read_text(encoding="utf-8") == printed.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["urdf", "quick", "--cam", "none"], 2, "no such file; there are: "),
        (["urdf", "quick", "--cam", "conjugate"], 2, "conjugate"),
        (["simulate", "no_such_scene"], 2, "no_such_scene.yaml: no such file; there are: "),
        (["run", "no_such_scene", "--bag", "{tmp}/bag"], 2, "no such file"),
        (["run", "quick", "--bag", "{tmp}"], 1, "exists already, not overwriting"),
        (["analyze", "{tmp}/none"], 1, "no such bag"),
        (["identify", "bezier15"], 2, "cannot be identified"),
        (["simulate", "--nonsense"], 2, ""),
        (
            ["simulate", "quick", "--plot", "{tmp}/a.xyz"],
            2,
            "unknown kind of picture; allowed: .png",
        ),
        (["simulate", "quick", "--json", "{tmp}"], 1, "is a folder; allowed: a file"),
        (["simulate", "quick", "--json", "/proc/none/a.json"], 1, "/proc/none/a.json: cannot be"),
    ],
)
def test_errors_are_one_line_with_a_code(tmp_path, arguments, code, words):
    """A user's mistake gives a line and a code, no traceback, and writes nothing."""
    result = call(*(a.replace("{tmp}", str(tmp_path)) for a in arguments))
    assert result.exit_code == code
    assert words in result.stderr
    assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_calibrate_repeats_what_is_in_the_rig_file(tmp_path):
    """The shipped constants are what the command finds, and a dry run writes nothing."""
    rig = config_root() / "rigs" / "tm21.yaml"
    before = rig.read_bytes()
    result = call("calibrate", "--dry-run")
    assert result.exit_code == 0
    assert "gain 9.86e-05" in result.stderr
    assert "corner 18.42" in result.stderr
    assert rig.read_bytes() == before
