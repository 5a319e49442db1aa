"""Outputs that cannot be written: each command ends with one error line."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest
import typer

from cam_rig.cli import main

from ..processes import ended
from .conftest import BIN, GOLDEN

#: Commands that write to stdout, by kind of output.
PRINTED = {
    "version": "--version",
    "help": "--help",
    "json": "simulate quick --json -",
    "csv": "laws --csv -",
    "model": "urdf quick",
    "address": "panel",
}
#: Commands that write a file, one for each writer of the package.
WRITTEN = {
    "json": "simulate quick --json a.json",
    "csv": "simulate quick --csv a.csv",
    "png": "simulate quick --plot a.png",
    "law": "law poly345 --out a.svg",
    "page": "report quick --out a.html",
    "markdown": "report quick --out a.md",
    "dxf": "profile poly345 --out a.dxf",
    "contour": "profile poly345 --out a.csv",
    "parquet": "export {golden} --to a.parquet",
    "samples": "export {golden} --to a.csv",
    "numpy": "export {golden} --to a.npz",
    "sound": "listen quick --out a.wav",
    "recording": "view {golden} --save a.rrd",
    "rows": "campaign tolerance_poly345 --points 2 --jobs 1 --out rows",
    "cam": "design poly345 --minimise peak_acceleration --out a.yaml",
}
#: Limit of the file size in bytes, smaller than every output.
SIZE_LIMIT = 512
#: Outputs tested in a normal run. The others are tested in long runs.
QUICK = ("json", "markdown", "numpy")


def lines(command: str, folder: Path, **how: Any) -> tuple[int, list[str]]:
    """Run a command and return its exit code and its error lines."""
    words = command.format(golden=GOLDEN).split()
    done = ended(BIN / "cam-rig", *words, stderr=subprocess.PIPE, cwd=folder, **how)
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr, done.stderr
    return done.returncode, [x for x in done.stderr.splitlines() if x.startswith("cam-rig: ")]


@pytest.mark.variants(2)
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("what", PRINTED)
def test_full_stdout_is_an_error(what, unbuffered, tmp_path, monkeypatch):
    """A command whose stdout is full ends with code 1 and one error line.

    A program that reads the output then does not use a truncated result.
    """
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    with open("/dev/full", "wb") as full:
        code, errors = lines(PRINTED[what], tmp_path, stdout=full)
    assert code == 1
    (line,) = errors
    assert line.startswith("cam-rig: stdout: cannot be") and "No space left on device" in line


def test_full_temporary_folder_is_named(tmp_path, monkeypatch, capsys):
    """The error of a full temporary folder states the folder, not stdout.

    The operating system's error on a temporary file has no name.
    """
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    single = typer.Typer(pretty_exceptions_enable=False)
    monkeypatch.setattr(main, "command", lambda _: typer.main.get_command(single))

    @single.command()
    def fill() -> None:
        print("half a result")
        with tempfile.TemporaryFile(dir=tmp_path) as file:
            monkeypatch.setattr(sys, "dont_write_bytecode", True)  # it would be truncated
            resource.setrlimit(resource.RLIMIT_FSIZE, (SIZE_LIMIT, hard))
            file.write(bytes(2 * SIZE_LIMIT))

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    monkeypatch.setattr(sys, "stdout", sys.stdout)  # restored after the test
    try:
        with pytest.raises(SystemExit) as ended:
            main.app(["laws"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert ended.value.code == 1
    error = capsys.readouterr().err
    assert error.startswith(f"cam-rig: a temporary file in {tmp_path}: cannot be"), error
    assert "stdout" not in error


@pytest.mark.slow
@pytest.mark.parametrize(
    "what", [x if x in QUICK else pytest.param(x, marks=pytest.mark.long) for x in WRITTEN]
)
def test_file_that_exceeds_its_size_limit_is_removed(what: str, tmp_path: Path) -> None:
    """A command that cannot write its whole output ends with one line and no file.

    A limit of the file size acts like a full disk.
    """

    def limit() -> None:
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # it would be truncated
        resource.setrlimit(resource.RLIMIT_FSIZE, (SIZE_LIMIT, SIZE_LIMIT))

    code, errors = lines(WRITTEN[what], tmp_path, stdout=subprocess.DEVNULL, preexec_fn=limit)
    assert code == 1
    (line,) = errors
    assert "cannot be" in line or "can be written" in line
    assert "raceback" not in line and ".part" not in line
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.name != ".lock"]
