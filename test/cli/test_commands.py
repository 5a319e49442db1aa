"""The command line: codes, one-line errors, JSON that programs can read."""

import inspect

import pytest
import typer
from typer.testing import CliRunner

from cam_rig.cli.main import COMMANDS, app, command, summary
from cam_rig.cli.main import command as loaded
from cam_rig.schema.load import config_root

from .conftest import call, data_of, done


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


# -- no option of any command is dropped in silence: what may stand once is refused twice


def leaves(command, path=()):
    """Every command below, with the words that call it."""
    below = getattr(command, "commands", None)
    if below is None:
        return [(path, command)]
    return [leaf for name, one in below.items() for leaf in leaves(one, (*path, name))]


ROOT = typer.main.get_command(app)
OPTIONS = [
    pytest.param(path, option, id=" ".join((*path, max(option.opts, key=len))))
    for name in COMMANDS
    for path, command in leaves(loaded(name), (name,))
    for option in command.params
    if option.param_type_name == "option" and not option.multiple and not option.is_eager
]


def test_there_are_many():
    """The tree is walked, nested commands too."""
    assert len(OPTIONS) > 150
    assert ("fit", "cam") in {param.values[0] for param in OPTIONS}


@pytest.mark.variants(24)
@pytest.mark.parametrize(("path", "option"), OPTIONS)
def test_an_option_that_stands_twice_is_refused(path, option, capsys):
    """In one line that names it, before any value is looked at."""
    name = max(option.opts, key=len)
    once = [name] if option.is_flag else [name, *["1"] * option.nargs]
    with pytest.raises(SystemExit) as end:
        ROOT.main([*path, *once, *once], prog_name="cam-rig")
    assert end.value.code == 2
    assert capsys.readouterr().err == f"cam-rig: {name}: stands 2 times; allowed: once\n"


def test_help_comes_first():
    """Who asks for help gets it."""
    assert CliRunner().invoke(app, ["jump", "--rig", "a", "--rig", "b", "--help"]).exit_code == 0
