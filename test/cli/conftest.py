"""Fixtures of the command line tests: a smaller sweep, shipped files and calls."""

import json
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema.load import config_root
from cam_rig.show import terminal as console

from ..conftest import GOLDEN
from ..figure_faults import no_faulty_figure

__all__ = ["GOLDEN", "no_faulty_figure"]


@pytest.fixture(autouse=True)
def no_broken_heading(monkeypatch):
    """Check that table headings break only between words at 80 columns or more."""
    original = console._widths

    def checked(table, room):
        gap, widths = original(table, room)
        for column, width in zip(table.columns, widths, strict=True):
            words = [*column.heading.split(), *column.unit.split()]
            assert room < 80 or (width is not None and width >= max(map(len, words), default=0))
        return gap, widths

    monkeypatch.setattr(console, "_widths", checked)


def shipped(folder, name):
    """Return the text of the shipped file `name` in a folder of config."""
    return (config_root() / folder / f"{name}.yaml").read_text(encoding="utf-8")


def load(folder, name):
    """Return a shipped YAML file as plain data, without validation."""
    return YAML(typ="safe").load(shipped(folder, name))


def written(root, files):
    """Write files into a folder and return the folder.

    `files` is a dict from relative path to text.
    """
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root


@pytest.fixture(scope="session")
def sweep(tmp_path_factory):
    """Path of the shipped speed sweep, with steps of 25 rpm."""
    scene = load("scenes", "tm21_sweep")
    scene["schedule"]["speeds"]["given"] = list(range(200, 401, 25))
    path = tmp_path_factory.mktemp("study") / "config" / "scenes" / "tm21_sweep.yaml"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(scene), encoding="utf-8")
    return path


BIN = Path(sys.executable).parent


def call(*arguments):
    """Run `cam-rig` with these arguments in this process and return the result."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def done(*arguments):
    """Run a command that must succeed and return the result."""
    result = call(*arguments)
    assert result.exit_code == 0, f"{result.exception} {result.stderr}"
    return result


def data_of(*arguments):
    """Return the JSON output of a command that must succeed."""
    return json.loads(done(*arguments, "--json", "-").stdout)
