"""What a command writes: plots, JSON and CSV, written whole or not at all."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from cam_rig.cli.common.console import console
from cam_rig.errors import ConfigError, OutputError
from cam_rig.extras import require
from cam_rig.files import writing
from cam_rig.tables import DataTable, to_csv

__all__ = [
    "PICTURES",
    "STDOUT",
    "check_outputs",
    "check_place",
    "check_recording",
    "write_csv",
    "write_json",
    "write_plot",
    "writing",
]

#: Kinds of picture a plot can be written as.
PICTURES = (".png", ".svg", ".pdf", ".jpg")
#: In place of a file.
STDOUT = Path("-")


def write_plot(target: Path, draw: Callable[[Path], None]) -> None:
    """Have a picture drawn into a file, and say where it is.

    Raises
    ------
    OutputError : the place cannot be written
    """
    with writing(target) as part:
        draw(part)
    console.print(f"plot: {target}", markup=False, soft_wrap=True)


def write_json(data: dict[str, Any], target: str | None) -> None:
    """Write JSON to a file, to stdout for ``-``, nowhere for None.

    Raises
    ------
    OutputError : the place cannot be written
    """
    if target is None:
        return
    text = json.dumps(data, indent=2)
    if target == "-":
        print(text)
        return
    with writing(Path(target)) as part:
        part.write_text(text + "\n", encoding="utf-8")


def write_csv(tables: Iterable[DataTable], target: Path | None) -> None:
    """Write tables to a file, to stdout for ``-``, nowhere for None.

    Raises
    ------
    OutputError : the place cannot be written
    """
    if target == STDOUT:
        print(to_csv(tables), end="")
    elif target is not None:
        with writing(target) as part:
            part.write_text(to_csv(tables), encoding="utf-8")


def check_outputs(json_target: str | None, plot: Path | None, csv: Path | None = None) -> None:
    """Refuse, before anything runs, what could not be written afterwards."""
    if json_target == "-" and csv == STDOUT:
        raise ConfigError("--json - and --csv -: both go to stdout; allowed: one of them there")
    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise ConfigError(f"{plot}: unknown kind of picture; allowed: {', '.join(PICTURES)}")
    if plot is not None:
        require("matplotlib")
    asked = [plot, csv, None if json_target in (None, "-") else Path(str(json_target))]
    for target in (path for path in asked if path not in (None, STDOUT)):
        check_place(target)


def check_place(target: Path) -> None:
    """Refuse a place where no file can be written."""
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; allowed: a file")
    if target.exists() and not target.is_file():
        raise OutputError(f"{target}: is a device; allowed: a file, or - for stdout")
    nearest = next(parent for parent in target.absolute().parents if parent.exists())
    try:  # who may write is not told by the folder's bits alone: try it
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise OutputError(
            f"{target}: cannot be written, {nearest} is no writable folder ({error.strerror})"
        ) from None


def check_recording(target: Path) -> None:
    """Refuse, before anything is computed, a Rerun recording that could not be written."""
    require("rerun")
    check_place(target)
    if target.suffix != ".rrd":
        raise ConfigError(f"{target}: unknown kind of recording; allowed: .rrd")
