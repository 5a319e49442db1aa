"""What all verbs share: where words go, and how errors end a command."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from cam_rig.errors import CamRigError
from cam_rig.schema.load import config_root

#: People read stderr, programs read stdout.
console = Console(stderr=True, highlight=False)

DEFAULT_SCENE = "tm21_sweep"


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
    path = Path(scene)
    if path.suffix in (".yaml", ".yml") or path.exists():
        return path
    return config_root() / "scenes" / f"{scene}.yaml"


def progress_bar() -> Progress:
    """A bar with ticks done, ticks in all and the time left."""
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(TextColumn("{task.description}"), *columns, console=console, transient=True)


def write_json(data: dict[str, Any], target: str) -> None:
    """Write JSON to a file, or to stdout for ``-``."""
    text = json.dumps(data, indent=2)
    if target == "-":
        print(text)
    else:
        Path(target).write_text(text + "\n", encoding="utf-8")
