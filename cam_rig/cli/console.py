"""What all verbs share: where words go, and how errors end a command."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from cam_rig.errors import CamRigError, ConfigError, OutputError
from cam_rig.schema.load import config_root

#: People read stderr, programs read stdout.
console = Console(stderr=True, highlight=False)

DEFAULT_SCENE = "tm21_sweep"
#: Kinds of picture a plot can be written as.
PICTURES = (".png", ".svg", ".pdf", ".jpg")


@contextmanager
def user_errors() -> Iterator[None]:
    """End the command with one line and the error's code; nothing else is caught."""
    try:
        yield
    except CamRigError as error:
        print(f"cam-rig: {error}", file=sys.stderr)
        raise typer.Exit(error.exit_code) from None


def scene_path(scene: str) -> Path:
    """A scene by its path, or by its name in ``config/scenes``."""
    return _named("scenes", scene)


def cam_path(cam: str) -> Path:
    """A cam by its path, or by its name in ``config/cams``."""
    return _named("cams", cam)


def rig_path(rig: str) -> Path:
    """A rig by its path, or by its name in ``config/rigs``."""
    return _named("rigs", rig)


def _named(folder: str, name: str) -> Path:
    """A path is taken as it is; a word without a folder and a suffix is a shipped file's name."""
    path = Path(name)
    if path.name != name or path.suffix in (".yaml", ".yml") or is_file(path):
        return path
    return config_root() / folder / f"{name}.yaml"


def is_file(path: Path) -> bool:
    """Whether there is a file at a path; a name that no file can have is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def tables_path() -> Path:
    """The paper's tables as data."""
    return config_root() / "published" / "tables" / "paper.yaml"


def progress_bar() -> Progress:
    """A bar with ticks done, ticks in all and the time left."""
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(TextColumn("{task.description}"), *columns, console=console, transient=True)


def write_json(data: dict[str, Any], target: str) -> None:
    """Write JSON to a file, or to stdout for ``-``."""
    text = json.dumps(data, indent=2)
    if target == "-":
        print(text)
        return
    with writing(Path(target)) as part:
        part.write_text(text + "\n", encoding="utf-8")


@contextmanager
def writing(path: Path) -> Iterator[Path]:
    """A file beside ``path`` to write into, which then takes its place whole.

    Raises
    ------
    OutputError : the place cannot be written
    """
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        with suppress(OSError):
            part.unlink()


def check_outputs(json_target: str | None, plot: Path | None) -> None:
    """Refuse, before anything runs, what could not be written afterwards."""
    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise ConfigError(f"{plot}: unknown kind of picture; allowed: {', '.join(PICTURES)}")
    asked = [plot, None if json_target in (None, "-") else Path(str(json_target))]
    for target in (path for path in asked if path is not None):
        check_place(target)


def check_place(target: Path) -> None:
    """Refuse a place where no file can be written."""
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; allowed: a file")
    nearest = next(parent for parent in target.absolute().parents if parent.exists())
    if not (nearest.is_dir() and os.access(nearest, os.W_OK)):
        raise OutputError(f"{target}: cannot be written, {nearest} is no writable folder")
