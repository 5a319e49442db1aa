"""A table as people read it: headings, units, cells and footnotes; who shows it renders it.

Results make theirs of their columns (`cam_rig.show.result`); what is no result uses `tabulate`.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

Item = TypeVar("Item")

#: Characters of a line of Markdown outside a table.
MARKDOWN_WIDTH = 100
#: Significant digits of a number that was found, on a page.
DIGITS = 4

#: Text, a number in the unit of its column, or nothing.
Cell = str | float | None

#: A minus before a number, which is no hyphen of a word; a number with an exponent.
_MINUS = re.compile(r"(?<![\w)\]-])-(?=\.?\d)")
_POWER = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]?\d+)(?!\w)")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Head:
    """A heading, the unit of the numbers under it, and how they are shown.

    ``shown`` is the format of a number, such as ".2f", empty for a column of text; ``missing`` is
    what stands where there is nothing.
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

    def printed(self, cell: Cell) -> str:
        """A cell as a page has it: typeset, decimals cut to four digits at most."""
        text = self.text(cell)
        if isinstance(cell, float) and math.isfinite(cell) and self.shown.endswith("f"):
            whole, _, decimals = text.lstrip("+-").partition(".")
            kept = max(0, DIGITS - len(whole))
            if whole != "0" and len(decimals) > kept:
                rounded = float(f"{cell:.{DIGITS}g}")
                text = f"{rounded:{self.shown[: self.shown.index('.')]}.{kept}f}"
        return typeset(text)


def typeset(text: str) -> str:
    """A text as it is printed: a true minus, powers of ten raised."""
    return _MINUS.sub("−", _POWER.sub(_power, text))


def _power(found: re.Match[str]) -> str:
    factor = "" if found[1] == "1" else f"{found[1]}·"
    return f"{factor}10{str(int(found[2])).translate(_RAISED)}"


def printed(value: float, shown: str = ".6g") -> str:
    """A number in a sentence or a picture."""
    return typeset(number(value, shown))


def number(value: float, shown: str = ".6g") -> str:
    """A number by a format, with no idle characters in its exponent: 1.26e6, 9.9e-5."""
    mantissa, mark, exponent = format(value, shown).partition("e")
    return f"{mantissa}e{int(exponent)}" if mark else mantissa


def counted(count: int, what: str) -> str:
    """A count and what is counted, in the singular or the plural."""
    plural = "es" if what.endswith("s") else "s"
    return f"{count} {what}{'' if count == 1 else plural}"


@dataclass(frozen=True)
class DataTable:
    """Caption, columns, rows of cells, and footnotes."""

    caption: str
    columns: tuple[Head, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()

    @property
    def texts(self) -> list[list[str]]:
        """The rows as they are shown."""
        return [
            [c.text(cell) for c, cell in zip(self.columns, row, strict=True)] for row in self.rows
        ]

    @property
    def printed(self) -> list[list[str]]:
        """The rows as a page has them."""
        return [
            [c.printed(cell) for c, cell in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]

    def called(self, titles: Mapping[str, str]) -> DataTable:
        """With titles for names in its caption, headings, cells and notes; rigs keep theirs."""

        def cell(head: Head, value: Cell) -> Cell:
            if not isinstance(value, str) or head.heading == "rig":
                return value
            return called(value, titles)

        return DataTable(
            called(self.caption, titles),
            tuple(replace(c, heading=_within(c.heading, titles)) for c in self.columns),
            tuple(tuple(map(cell, self.columns, row)) for row in self.rows),
            tuple(called(note, titles) for note in self.notes),
        )


def called(text: str, titles: Mapping[str, str]) -> str:
    """A text with titles for names; within other words only for names with a digit or "_"."""
    return titles[text] if text in titles else _within(text, titles)


def _within(text: str, titles: Mapping[str, str]) -> str:
    codes = [re.escape(name) for name in titles if re.search(r"[\d_]", name)]
    if not codes:
        return text
    pattern = rf"(?<![\w./-])(?<!rig )(?:{'|'.join(codes)})(?![\w/-]|\.\w)"
    return re.sub(pattern, lambda found: titles[found[0]], text)


def tabulate(
    caption: str,
    items: Iterable[Item],
    fields: Iterable[tuple[Head, Callable[[Item], Cell]]],
    *notes: str,
) -> DataTable:
    """Build a table of a row per item; a column in which nothing stands is left out."""
    columns, takes = zip(*fields, strict=True)
    rows = [[take(item) for take in takes] for item in items]
    kept = [i for i in range(len(columns)) if any(row[i] not in (None, "") for row in rows)]
    return DataTable(
        caption,
        tuple(columns[i] for i in kept),
        tuple(tuple(row[i] for i in kept) for row in rows),
        tuple(note for note in notes if note),
    )


def to_markdown(table: DataTable, name: str = "") -> str:
    """Caption behind a name, as "Table 3. ", table and notes, a blank line between them."""
    ruler = ["---:" if column.shown else "---" for column in table.columns]
    lines = [[typeset(column.title) for column in table.columns], ruler, *table.printed]
    rows = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    notes = (
        textwrap.fill(typeset(note), MARKDOWN_WIDTH, break_on_hyphens=False) for note in table.notes
    )
    return "\n\n".join((f"**{name}{typeset(table.caption)}**", rows, *notes))
