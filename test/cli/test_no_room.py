"""What cannot be written ends a command in one line, wherever it writes."""

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

#: Commands by what they write to stdout.
PRINTED = {
    "version": "--version",
    "help": "--help",
    "json": "simulate quick --json -",
    "csv": "laws --csv -",
    "model": "urdf quick",
    "address": "panel",
}
#: Commands that write a file, for each part of the package that does.
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
#: Bytes that a file may have, fewer than any of these has.
MOST = 512
#: Those of an ordinary run.
QUICK_ONES = ("json", "markdown", "numpy")


def lines(command: str, folder: Path, **how: Any) -> tuple[int, list[str]]:
    """The exit code, and what it says of itself."""
    words = command.format(golden=GOLDEN).split()
    done = ended(BIN / "cam-rig", *words, stderr=subprocess.PIPE, cwd=folder, **how)
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr, done.stderr
    return done.returncode, [x for x in done.stderr.splitlines() if x.startswith("cam-rig: ")]


@pytest.mark.variants(2)
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("what", PRINTED)
def test_a_stdout_that_is_full(what, unbuffered, tmp_path, monkeypatch):
    """Its reader would take half a result for a whole one; the code says that it is none."""
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    with open("/dev/full", "wb") as full:
        code, told = lines(PRINTED[what], tmp_path, stdout=full)
    assert code == 1
    (line,) = told
    assert line.startswith("cam-rig: stdout: cannot be") and "No space left on device" in line


def test_a_temporary_file_without_room(tmp_path, monkeypatch, capsys):
    """Its error has no name either: the folder is named, not stdout, which takes all."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    alone = typer.Typer(pretty_exceptions_enable=False)
    monkeypatch.setattr(main, "command", lambda _: typer.main.get_command(alone))

    @alone.command()
    def fill() -> None:
        print("half a result")
        with tempfile.TemporaryFile(dir=tmp_path) as file:
            monkeypatch.setattr(sys, "dont_write_bytecode", True)  # else half of a module's stays
            resource.setrlimit(resource.RLIMIT_FSIZE, (MOST, hard))
            file.write(bytes(2 * MOST))

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    monkeypatch.setattr(sys, "stdout", sys.stdout)  # is put back
    try:
        with pytest.raises(SystemExit) as ended:
            main.app(["laws"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert ended.value.code == 1
    told = capsys.readouterr().err
    assert told.startswith(f"cam-rig: a temporary file in {tmp_path}: cannot be"), told
    assert "stdout" not in told


@pytest.mark.slow
@pytest.mark.parametrize(
    "what", [x if x in QUICK_ONES else pytest.param(x, marks=pytest.mark.long) for x in WRITTEN]
)
def test_a_file_that_may_not_have_its_size(what: str, tmp_path: Path) -> None:
    """As on a full disk: nothing of it is left."""

    def limit() -> None:
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # else half of a module's stays
        resource.setrlimit(resource.RLIMIT_FSIZE, (MOST, MOST))

    code, told = lines(WRITTEN[what], tmp_path, stdout=subprocess.DEVNULL, preexec_fn=limit)
    assert code == 1
    (line,) = told
    assert "cannot be" in line or "can be written" in line
    assert "raceback" not in line and ".part" not in line
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.name != ".lock"]
