"""What cams, rises and readings are called on a page, in place of the names that files have."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from cam_rig.tables import Cell, DataTable


def called(text: str, titles: Mapping[str, str]) -> str:
    """A text with titles for names; within other words only for names with a digit or "_".

    A rig may have the name of a cam, and keeps it.

    Examples
    --------
    >>> called("tm21 less flat, rig tm21", {"tm21": "TM21", "flat": "Flat face"})
    'TM21 less flat, rig tm21'
    >>> called("flat", {"flat": "Flat face"})
    'Flat face'
    """
    return titles[text] if text in titles else _within(text, titles)


def _within(text: str, titles: Mapping[str, str]) -> str:
    codes = [re.escape(name) for name in titles if re.search(r"[\d_]", name)]
    if not codes:
        return text
    pattern = rf"(?<![\w./-])(?<!rig )(?:{'|'.join(codes)})(?![\w/-]|\.\w)"
    return re.sub(pattern, lambda found: titles[found[0]], text)


def table_called(table: DataTable, titles: Mapping[str, str]) -> DataTable:
    """A table with titles for names in its caption, headings, cells and notes."""

    def cell(value: Cell) -> Cell:
        return called(value, titles) if isinstance(value, str) else value

    return DataTable(
        called(table.caption, titles),
        tuple(replace(c, heading=_within(c.heading, titles)) for c in table.columns),
        tuple(tuple(map(cell, row)) for row in table.rows),
        tuple(called(note, titles) for note in table.notes),
    )
