"""A table as data: headings, units, cells and footnotes stand once; who shows it renders it.

A study builds its tables in its own ``tables.py``; the terminal, the report's pages and CSV take
headings and cells from there.
"""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

Item = TypeVar("Item")
#: Characters of a line of Markdown outside a table.
MARKDOWN_WIDTH = 100
#: Text, a number in the unit of its column, or nothing.
Cell = str | float | None


@dataclass(frozen=True)
class Column:
    """A heading, the unit of the numbers under it, and how they are shown.

    Parameters
    ----------
    shown : format of a number, such as ".2f"; empty for a column of text
    missing : what stands where there is nothing

    Examples
    --------
    >>> Column("jump speed", "rpm", ".1f").text(413.4426)
    '413.4'
    """

    heading: str
    unit: str = ""
    shown: str = ""
    missing: str = ""

    @property
    def title(self) -> str:
        """The heading with its unit: ``time [s]``."""
        return f"{self.heading} [{self.unit}]" if self.unit else self.heading

    def text(self, cell: Cell) -> str:
        """A cell as it is shown."""
        if cell is None:
            return self.missing
        return cell if isinstance(cell, str) else number(cell, self.shown)


def number(value: float, shown: str = ".6g") -> str:
    """A number by a format, with no idle characters in its exponent: 1.26e6, 9.9e-5.

    Examples
    --------
    >>> number(3.3e8)
    '3.3e8'
    """
    mantissa, mark, exponent = format(value, shown).partition("e")
    return f"{mantissa}e{int(exponent)}" if mark else mantissa


@dataclass(frozen=True)
class DataTable:
    """Caption, columns, rows of cells, and footnotes."""

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()

    @property
    def texts(self) -> list[list[str]]:
        """The rows as they are shown."""
        return [
            [column.text(cell) for column, cell in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]


def tabulate(
    caption: str,
    items: Iterable[Item],
    fields: Iterable[tuple[Column, Callable[[Item], Cell]]],
    *notes: str,
) -> DataTable:
    """Build a table of one row per item, each column beside what it takes from an item.

    A column in which nothing stands is left out, and so is an empty note.

    Examples
    --------
    >>> fields = ((Column("cam"), str), (Column("letters", "1", "d"), len))
    >>> tabulate("Names", ["a", "bc"], fields).rows
    (('a', 1), ('bc', 2))
    """
    columns, takes = zip(*fields, strict=True)
    rows = [[take(item) for take in takes] for item in items]
    kept = [i for i in range(len(columns)) if any(row[i] not in (None, "") for row in rows)]
    return DataTable(
        caption,
        tuple(columns[i] for i in kept),
        tuple(tuple(row[i] for i in kept) for row in rows),
        tuple(note for note in notes if note),
    )


def to_csv(tables: Iterable[DataTable]) -> str:
    """Tables one under another: caption, headings with units, all digits of the numbers."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    for i, table in enumerate(tables):
        if i:
            writer.writerow([])
        writer.writerow([table.caption])
        writer.writerow([column.title for column in table.columns])
        writer.writerows(table.rows)
    return out.getvalue()


def to_markdown(table: DataTable, name: str = "") -> str:
    """Caption, table and notes, with a blank line between them and none at the end.

    Parameters
    ----------
    name : before the caption, as "Table 3. "

    Examples
    --------
    >>> columns = (Column("cam"), Column("n", "rpm", "d"))
    >>> print(to_markdown(DataTable("Speeds", columns, (("a", 9),))))
    **Speeds**
    <BLANKLINE>
    | cam | n [rpm] |
    | --- | ---: |
    | a | 9 |
    """
    ruler = ["---:" if column.shown else "---" for column in table.columns]
    lines = [[column.title for column in table.columns], ruler, *table.texts]
    rows = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    notes = (textwrap.fill(note, MARKDOWN_WIDTH, break_on_hyphens=False) for note in table.notes)
    return "\n\n".join((f"**{name}{table.caption}**", rows, *notes))
