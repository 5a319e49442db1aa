"""No option of any command is dropped in silence: what may stand once is refused twice."""

import pytest
import typer
from typer.testing import CliRunner

from cam_rig.cli.main import COMMANDS, app
from cam_rig.cli.main import command as loaded


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
