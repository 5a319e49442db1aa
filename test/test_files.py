"""Disks that are full: what to do is said in one line, wherever a temporary file is needed."""

import errno
import os
import tempfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.errors import OutputError
from cam_rig.files import temporary_folder

GOLDEN = str(Path(__file__).parents[1] / "bags" / "golden")


def full(*_, **__):
    raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")


def full_later(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_is_there_and_gone():
    """As long as the context lasts."""
    with temporary_folder() as folder:
        (folder / "file").touch()
    assert not folder.exists()


@pytest.mark.parametrize(
    "arguments",
    [["analyze", GOLDEN], ["replay", GOLDEN], ["view", GOLDEN, "--web"]],
    ids=lambda arguments: arguments[0],
)
def test_no_place_for_temporary_files_is_one_line(monkeypatch, tmp_path, arguments):
    """Code 1, and TMPDIR as the way out."""
    monkeypatch.setattr(tempfile, "gettempdir", full)
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "No usable temporary directory" in result.stderr
    assert "name a folder with room in TMPDIR" in result.stderr


def test_a_disk_that_fills_while_files_are_unpacked_is_told_of(monkeypatch):
    """It is no fault of the bag, which must not be called damaged."""
    monkeypatch.setattr(Path, "write_bytes", full_later)
    result = CliRunner().invoke(app, ["analyze", GOLDEN])
    assert result.exit_code == 1
    assert "(No space left on device); name a folder with room in TMPDIR" in result.stderr
    assert "recover" not in result.stderr


def test_a_folder_that_cannot_be_made_is_told_of(monkeypatch):
    """The place is there, and full."""
    monkeypatch.setattr(tempfile, "mkdtemp", full_later)
    with pytest.raises(OutputError, match="No space left on device"), temporary_folder():
        pass
