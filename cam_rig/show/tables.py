"""Display tables of any output medium: headings, units, cells and footnotes.

Results build their tables from column definitions (`cam_rig.show.result`). Other code uses
`tabulate`.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

Item = TypeVar("Item")

#: Largest line width of Markdown text outside of tables, in characters.
MARKDOWN_WIDTH = 100
#: Largest number of significant digits of a decimal number in a table of a report or browser page.
MAX_PAGE_DIGITS = 4

#: Content of a cell: text, number in the unit of its column, or None for an empty cell.
Cell = str | float | None

#: Pattern of a hyphen that is the minus sign of a number, not part of a word.
_MINUS_SIGN = re.compile(r"(?<![\w)\]-])-(?=\.?\d)")
#: Pattern of a number with a decimal exponent, such as 1.2e-6: mantissa and exponent.
_SCIENTIFIC = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]?\d+)(?!\w)")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Header:
    """Heading, unit and number format of a display column.

    Parameters
    ----------
    heading : str
    unit : str
        Unit of the numbers in the column.
    number_format : str
        Format of the numbers, such as ".2f" (default: a text column).
    missing : str
        Text of an empty cell.
    """

    heading: str
    unit: str = ""
    number_format: str = ""
    missing: str = ""

    @property
    def title(self) -> str:
        """Heading of a table column with its unit: ``time [s]``."""
        return f"{self.heading} [{self.unit}]" if self.unit else self.heading

    def format(self, cell: Cell) -> str:
        """Return the text of a cell in the number format of its column."""
        if cell is None:
            return self.missing
        return cell if isinstance(cell, str) else format_number(cell, self.number_format)

    def typeset(self, cell: Cell) -> str:
        """Return the typeset text of a cell for a page.

        A decimal number has at most `MAX_PAGE_DIGITS` significant digits.
        """
        text = self.format(cell)
        if isinstance(cell, float) and math.isfinite(cell) and self.number_format.endswith("f"):
            integer, _, decimals = text.lstrip("+-").partition(".")
            allowed = max(0, MAX_PAGE_DIGITS - len(integer))
            if integer != "0" and len(decimals) > allowed:
                rounded = float(f"{cell:.{MAX_PAGE_DIGITS}g}")
                flags = self.number_format.partition(".")[0]
                text = f"{rounded:{flags}.{allowed}f}"
        return typeset(text)


def typeset(text: str) -> str:
    """Replace hyphens before numbers by minus signs and exponents by powers of ten."""

    def power_of_ten(match: re.Match[str]) -> str:
        factor = "" if match[1] == "1" else f"{match[1]}·"
        return f"{factor}10{str(int(match[2])).translate(_SUPERSCRIPTS)}"

    return _MINUS_SIGN.sub("−", _SCIENTIFIC.sub(power_of_ten, text))


def typeset_number(value: float, number_format: str = ".6g") -> str:
    """Return a typeset number for a sentence or a figure."""
    return typeset(format_number(value, number_format))


def format_number(value: float, number_format: str = ".6g") -> str:
    """Format a number with the shortest exponent: 1.26e6, 9.9e-5."""
    mantissa, mark, exponent = format(value, number_format).partition("e")
    return f"{mantissa}e{int(exponent)}" if mark else mantissa


def pluralize(count: int, noun: str) -> str:
    """Return a count and a noun, in the plural unless the count is 1."""
    plural = "es" if noun.endswith("s") else "s"
    return f"{count} {noun}{'' if count == 1 else plural}"


@dataclass(frozen=True)
class DataTable:
    """Display table: caption, column headers, rows of cells, and footnotes."""

    caption: str
    columns: tuple[Header, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()

    @property
    def text_rows(self) -> list[list[str]]:
        """Texts of a table's cells in the number formats of their columns, row by row."""
        return [[c.format(v) for c, v in zip(self.columns, r, strict=True)] for r in self.rows]

    @property
    def typeset_rows(self) -> list[list[str]]:
        """Texts of the cells for a page, row by row.

        They have minus signs and powers of ten instead of hyphens and exponents.
        """
        return [[c.typeset(v) for c, v in zip(self.columns, r, strict=True)] for r in self.rows]

    def relabel(self, labels: Mapping[str, str]) -> DataTable:
        """Replace names by their labels in caption, headings, cells and notes.

        Cells of the column "rig" are kept, as a rig may have the name of a cam.
        """

        def cell(header: Header, value: Cell) -> Cell:
            if not isinstance(value, str) or header.heading == "rig":
                return value
            return relabel(value, labels)

        return DataTable(
            relabel(self.caption, labels),
            tuple(replace(c, heading=_relabel_codes(c.heading, labels)) for c in self.columns),
            tuple(tuple(map(cell, self.columns, row)) for row in self.rows),
            tuple(relabel(note, labels) for note in self.notes),
        )

    def without_empty_columns(self) -> DataTable:
        """Return the table without the columns in which every cell is empty."""
        filled = [
            i for i in range(len(self.columns)) if any(r[i] not in (None, "") for r in self.rows)
        ]
        columns = tuple(self.columns[i] for i in filled)
        return replace(
            self, columns=columns, rows=tuple(tuple(r[i] for i in filled) for r in self.rows)
        )


def relabel(text: str, labels: Mapping[str, str]) -> str:
    """Replace names of cams in a text by their display names.

    `labels` contains the display names by name. Within a longer text only names with a digit or "_"
    are replaced, because others may be words.
    """
    return labels[text] if text in labels else _relabel_codes(text, labels)


def _relabel_codes(text: str, labels: Mapping[str, str]) -> str:
    codes = [re.escape(name) for name in labels if re.search(r"[\d_]", name)]
    if not codes:
        return text
    pattern = rf"(?<![\w./-])(?<!rig )(?:{'|'.join(codes)})(?![\w/-]|\.\w)"
    return re.sub(pattern, lambda match: labels[match[0]], text)


def tabulate(
    caption: str,
    items: Iterable[Item],
    fields: Iterable[tuple[Header, Callable[[Item], Cell]]],
    *notes: str,
) -> DataTable:
    """Build a table with one row per item, without empty columns and empty notes.

    Parameters
    ----------
    caption : str
        Caption of the table.
    items : iterable
        Items, one per row.
    fields : iterable of (Header, callable)
        Header of each column, and the function that computes its cell from an item.
    *notes : str
        Footnotes.

    Returns
    -------
    DataTable

    Examples
    --------
    >>> fields = [(Header("cam"), str), (Header("length", "", "d"), len)]
    >>> tabulate("Names", ["tm21"], fields).text_rows
    [['tm21', '4']]
    """
    headers, cell_functions = zip(*fields, strict=True)
    rows = tuple(tuple(cell_of(item) for cell_of in cell_functions) for item in items)
    return DataTable(caption, headers, rows, tuple(filter(None, notes))).without_empty_columns()


def to_markdown(table: DataTable, name: str = "") -> str:
    """Return a table as Markdown, its caption after a name such as "Table 3. "."""
    ruler = ["---:" if column.number_format else "---" for column in table.columns]
    lines = [[typeset(column.title) for column in table.columns], ruler, *table.typeset_rows]
    rows = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    notes = (
        textwrap.fill(typeset(note), MARKDOWN_WIDTH, break_on_hyphens=False) for note in table.notes
    )
    return "\n\n".join((f"**{name}{typeset(table.caption)}**", rows, *notes))
