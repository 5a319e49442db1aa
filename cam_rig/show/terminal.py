"""Output of texts and tables to the terminal, within its width."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from rich.console import Console

from cam_rig.errors import printable
from cam_rig.show.tables import DataTable

#: Console of messages and tables. Only data for programs go to stdout.
console = Console(stderr=True, highlight=False)


def say(*lines: str) -> None:
    """Print lines without markup, with control characters escaped, wrapped by the terminal."""
    for line in lines:
        console.print(printable(line), markup=False, soft_wrap=True)


def show(*tables: DataTable) -> None:
    """Print tables, divided into parts that fit in the width of the terminal."""
    from rich.box import SIMPLE
    from rich.table import Table as RichTable
    from rich.text import Text

    for table in (part for whole in tables for part in _split_columns(whole, console.width)):
        gap, widths = _widths(table, console.width)
        out = RichTable(
            title=Text(printable(table.caption), "italic"), box=SIMPLE, padding=(0, gap, 0, 0)
        )
        out.pad_edge = False
        out.caption, out.caption_justify = Text(printable("\n".join(table.notes)), "dim"), "left"
        for column, width in zip(table.columns, widths, strict=True):
            heading = Text(printable("\n".join(filter(None, (column.heading, column.unit)))))
            justify: Literal["left", "right"] = "right" if column.number_format else "left"
            out.add_column(heading, justify=justify, width=width, overflow="fold")
        for row in table.text_rows:
            out.add_row(*(Text(printable(cell)) for cell in row))
        console.print(out)


def _split_columns(table: DataTable, width: int) -> list[DataTable]:
    """Split a table into tables of up to `width` characters, if it is wider.

    Each table starts with the columns that identify a row: the first one to three.
    """
    rows, texts = table.rows, table.text_rows
    min_widths = [_longest_word(table, i, texts) for i in range(len(table.columns))]
    keys = next((k for k in range(1, 4) if len({row[:k] for row in rows}) == len(rows)), 1)
    parts: list[list[int]] = [[]]
    for i in range(keys, len(min_widths)):
        candidate = [*range(keys), *parts[-1], i]
        if parts[-1] and sum(min_widths[j] + 1 for j in candidate) + 1 > width:
            parts.append([])
        parts[-1].append(i)
    if len(parts) == 1:
        return [table]
    tables = []
    for part in parts:
        indices = [*range(keys), *part]
        caption, notes = table.caption * (part is parts[0]), table.notes * (part is parts[-1])
        columns = tuple(table.columns[i] for i in indices)
        cells = tuple(tuple(row[i] for i in indices) for row in rows)
        tables.append(replace(table, caption=caption, columns=columns, rows=cells, notes=notes))
    return tables


def _longest_word(table: DataTable, i: int, rows: Sequence[Sequence[str]]) -> int:
    """Return the length of the longest word in heading, unit and `rows` of column `i`."""
    texts = (table.columns[i].heading, table.columns[i].unit, *(row[i] for row in rows))
    return max((len(word) for text in texts for word in text.split()), default=1)


def _widths(table: DataTable, room: int) -> tuple[int, list[int | None]]:
    """Return the gap between columns and the width of each column, in characters.

    No word is broken. Each width is None if the columns do not fit in `room` characters.
    """
    rows, count = table.text_rows, len(table.columns)
    min_widths = [_longest_word(table, i, rows) for i in range(count)]
    room -= count + 1  # a space at either end, and between columns
    if sum(min_widths) > room:
        min_widths = [_longest_word(table, i, ()) for i in range(count)]
    max_widths = [max(min_widths[i], *(len(row[i]) for row in rows), 0) for i in range(count)]
    room -= sum(min_widths)
    gap = int(room >= count)
    spare = room - gap * count
    if spare < 0:
        return gap, [None] * count
    widths: list[int | None] = []
    for min_width, max_width in zip(min_widths, max_widths, strict=True):
        extra = min(max_width - min_width, spare)
        spare -= extra
        widths.append(min_width + extra)
    return gap, widths
