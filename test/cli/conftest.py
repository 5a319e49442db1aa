"""A smaller sweep, shipped files, and calls of the command line."""

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
    """Whatever table a command prints at 80 columns has headings that break between words."""
    given = console._widths

    def checked(table, room):
        gap, widths = given(table, room)
        for column, width in zip(table.columns, widths, strict=True):
            words = [*column.heading.split(), *column.unit.split()]
            assert room < 80 or (width is not None and width >= max(map(len, words), default=0))
        return gap, widths

    monkeypatch.setattr(console, "_widths", checked)


def shipped(folder, name):
    """The text of a shipped file."""
    return (config_root() / folder / f"{name}.yaml").read_text(encoding="utf-8")


def load(folder, name):
    """A shipped file as plain data."""
    return YAML(typ="safe").load(shipped(folder, name))


def written(root, files):
    """A folder with files of these texts, by their names in it."""
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root


@pytest.fixture(scope="session")
def sweep(tmp_path_factory):
    """The shipped sweep with every 25 rpm."""
    scene = load("scenes", "tm21_sweep")
    scene["program"]["speeds"]["given"] = list(range(200, 401, 25))
    path = tmp_path_factory.mktemp("study") / "config" / "scenes" / "tm21_sweep.yaml"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(scene), encoding="utf-8")
    return path


BIN = Path(sys.executable).parent


def call(*arguments):
    """What `cam-rig` answers to these arguments."""
    return CliRunner().invoke(app, [str(one) for one in arguments])


def done(*arguments):
    """The answer of a command that succeeds."""
    result = call(*arguments)
    assert result.exit_code == 0, f"{result.exception} {result.stderr}"
    return result


def data_of(*arguments):
    """What such a command gives as JSON."""
    return json.loads(done(*arguments, "--json", "-").stdout)
