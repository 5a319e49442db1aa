"""What all verbs share: where words and tables go, and how errors end a command."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from cam_rig.errors import INTERRUPTED, CamRigError
from cam_rig.extras import libraries_named, source_date
from cam_rig.interrupts import raised

if TYPE_CHECKING:
    from cam_rig.tables import DataTable

#: People read stderr, programs read stdout.
console = Console(stderr=True, highlight=False)


def say(*lines: str) -> None:
    """Print lines as they are: no markup, folded by the terminal alone."""
    for line in lines:
        console.print(line, markup=False, soft_wrap=True)


def show(*tables: DataTable) -> None:
    """Print tables, as wide as the terminal at most."""
    from rich.box import SIMPLE
    from rich.table import Table as RichTable
    from rich.text import Text

    for table in tables:
        gap, widths = _widths(table, console.width)
        out = RichTable(title=Text(table.caption, "italic"), box=SIMPLE, padding=(0, gap, 0, 0))
        out.pad_edge = False
        out.caption, out.caption_justify = Text("\n".join(table.notes), "dim"), "left"
        for column, width in zip(table.columns, widths, strict=True):
            heading = Text("\n".join(filter(None, (column.heading, column.unit))))
            justify: Literal["left", "right"] = "right" if column.shown else "left"
            out.add_column(heading, justify=justify, width=width, overflow="fold")
        for row in table.texts:
            out.add_row(*map(Text, row))
        console.print(out)


def _widths(table: DataTable, room: int) -> tuple[int, list[int | None]]:
    """Gap and characters of each column, so that no word is broken; None where none does so."""
    least, wanted = [], []
    for i, column in enumerate(table.columns):
        cells = [row[i] for row in table.texts]
        words = [w for text in (column.heading, column.unit, *cells) for w in text.split()]
        least.append(max(map(len, words), default=1))
        wanted.append(max(least[-1], *map(len, cells), 0))
    room -= sum(least) + len(least) + 1  # a space at either end, and between columns
    gap = int(room >= len(least))
    spare = room - gap * len(least)
    if spare < 0:
        return gap, [None] * len(least)
    widths: list[int | None] = []
    for narrow, wide in zip(least, wanted, strict=True):
        given = min(wide - narrow, spare)
        spare -= given
        widths.append(narrow + given)
    return gap, widths


@contextmanager
def user_errors() -> Iterator[None]:
    """End the command with one line and the error's code, or an interrupt's; no more is caught."""
    try:
        source_date()  # libraries that a command imports end at what is none
        with libraries_named(), raised():
            yield
    except CamRigError as error:
        print(f"cam-rig: {error}", file=sys.stderr)
        raise typer.Exit(error.exit_code) from None
    except KeyboardInterrupt as interrupt:
        print(f"cam-rig: {str(interrupt) or 'interrupted'}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def progress_bar() -> Progress:
    """A bar with ticks done, ticks in all and the time left."""
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(TextColumn("{task.description}"), *columns, console=console, transient=True)
