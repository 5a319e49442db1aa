"""What all verbs share: where words go, and how errors end a command."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from cam_rig.errors import CamRigError
from cam_rig.extras import libraries_named

#: People read stderr, programs read stdout.
console = Console(stderr=True, highlight=False)


@contextmanager
def user_errors() -> Iterator[None]:
    """End the command with one line and the error's code; nothing else is caught."""
    try:
        with libraries_named():
            yield
    except CamRigError as error:
        print(f"cam-rig: {error}", file=sys.stderr)
        raise typer.Exit(error.exit_code) from None


def progress_bar() -> Progress:
    """A bar with ticks done, ticks in all and the time left."""
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(TextColumn("{task.description}"), *columns, console=console, transient=True)
