"""Words and tables on a terminal, as wide as it is at most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from rich.console import Console

from cam_rig.files import printable
from cam_rig.show.tables import DataTable

#: People read stderr, programs read stdout.
console = Console(stderr=True, highlight=False)


def say(*lines: str) -> None:
    """Print lines without markup, folded by the terminal alone, control characters escaped."""
    for line in lines:
        console.print(printable(line), markup=False, soft_wrap=True)


def show(*tables: DataTable) -> None:
    """Print tables, as wide as the terminal at most."""
    from rich.box import SIMPLE
    from rich.table import Table as RichTable
    from rich.text import Text

    for table in (part for whole in tables for part in _parts(whole, console.width)):
        gap, widths = _widths(table, console.width)
        out = RichTable(
            title=Text(printable(table.caption), "italic"), box=SIMPLE, padding=(0, gap, 0, 0)
        )
        out.pad_edge = False
        out.caption, out.caption_justify = Text("\n".join(table.notes), "dim"), "left"
        for column, width in zip(table.columns, widths, strict=True):
            heading = Text("\n".join(filter(None, (column.heading, column.unit))))
            justify: Literal["left", "right"] = "right" if column.number_format else "left"
            out.add_column(heading, justify=justify, width=width, overflow="fold")
        for row in table.text_rows:
            out.add_row(*(Text(printable(text)) for text in row))
        console.print(out)


def _parts(table: DataTable, room: int) -> list[DataTable]:
    """A table, or several with some columns each and those, first on, that tell rows apart."""
    rows, texts = table.rows, table.text_rows
    least = [_longest(table, i, texts) for i in range(len(table.columns))]
    keys = next((k for k in range(1, 4) if len({row[:k] for row in rows}) == len(rows)), 1)
    parts: list[list[int]] = [[]]
    for i in range(keys, len(least)):
        together = [*range(keys), *parts[-1], i]
        if parts[-1] and sum(least[j] + 1 for j in together) + 1 > room:
            parts.append([])
        parts[-1].append(i)
    if len(parts) == 1:
        return [table]
    found = []
    for part in parts:
        kept = [*range(keys), *part]
        caption, notes = table.caption * (part is parts[0]), table.notes * (part is parts[-1])
        columns = tuple(table.columns[i] for i in kept)
        shorter = tuple(tuple(row[i] for i in kept) for row in rows)
        found.append(replace(table, caption=caption, columns=columns, rows=shorter, notes=notes))
    return found


def _longest(table: DataTable, i: int, rows: Sequence[Sequence[str]]) -> int:
    """Characters of the longest word of a column: its heading, its unit, its cells in ``rows``."""
    texts = (table.columns[i].heading, table.columns[i].unit, *(row[i] for row in rows))
    return max((len(word) for text in texts for word in text.split()), default=1)


def _widths(table: DataTable, room: int) -> tuple[int, list[int | None]]:
    """Gap and characters of each column, so that no word is broken; None where none does so."""
    rows, count = table.text_rows, len(table.columns)
    least = [_longest(table, i, rows) for i in range(count)]
    room -= count + 1  # a space at either end, and between columns
    if sum(least) > room:
        least = [_longest(table, i, ()) for i in range(count)]
    wanted = [max(least[i], *(len(row[i]) for row in rows), 0) for i in range(count)]
    room -= sum(least)
    gap = int(room >= count)
    spare = room - gap * count
    if spare < 0:
        return gap, [None] * count
    widths: list[int | None] = []
    for narrow, wide in zip(least, wanted, strict=True):
        given = min(wide - narrow, spare)
        spare -= given
        widths.append(narrow + given)
    return gap, widths
