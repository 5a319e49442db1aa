"""Arrangement of records in display tables: groups, pivots, footnotes.

Exported data do not depend on anything in this module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

from cam_rig.show.tables import Cell, DataTable, Header, tabulate

if TYPE_CHECKING:
    from cam_rig.show.result import Column, Records


@dataclass(frozen=True)
class TableLayout:
    """Arrangement of records in display tables (default: one row per record).

    Parameters
    ----------
    group_by : str
        Key of a column. Each of its values gets a separate table and is inserted into the caption,
        as in "at {rpm:g} rpm".
    pivot : str
        Key of a column. Each of its values gets a separate set of the columns after it.
    row_filter : callable
        Returns True if a record is displayed (default: every record).
    transposed : bool
        True if a single record is displayed as one row per column that is not empty.
    """

    group_by: str = ""
    pivot: str = ""
    row_filter: Callable[[Any], bool] = lambda _: True
    transposed: bool = False

    def tables(self, table: Records, labels: Mapping[str, str]) -> list[DataTable]:
        """Return the display tables of records, with cam names replaced by their labels."""
        columns = [c for c in table.columns if not c.hidden and c.key != self.group_by]
        notes = table.footnotes

        def first_cell(record: Any) -> Cell:
            cell = columns[0].display_cell(record)
            marks = "".join(f" {n.mark}" for n in notes if n.mark and n.condition(record))
            return f"{labels.get(cell, cell)}{marks}" if isinstance(cell, str) else cell

        fields = [(c.header, first_cell if c is columns[0] else c.display_cell) for c in columns]
        group_of = table.column(self.group_by).value if self.group_by else lambda _: 0
        records = sorted(filter(self.row_filter, table.records), key=group_of)
        tables = []
        for group, members in ((group, list(part)) for group, part in groupby(records, group_of)):
            if self.transposed:
                lines = [(c.header.heading, c.text(members[0]), c.unit) for c in columns]
                headers = (Header(" "), Header("value", "", "s"), Header("unit"))
                part = DataTable("", headers, tuple(line for line in lines if line[1]))
            elif self.pivot:
                index = columns.index(table.column(self.pivot))
                part = _pivoted(members, fields[:index], columns[index:], labels)
            else:
                part = tabulate("", members, fields)
            caption = table.caption
            if self.group_by:
                caption = caption.format(**{self.group_by: group})
            texts = (f"{n.mark} {n.text}".strip() for n in notes if any(map(n.condition, members)))
            part = replace(part, caption=caption, notes=tuple(filter(None, texts)))
            tables.append(part.without_empty_columns().relabel(labels))
        return tables


def _pivoted(
    records: list[Any],
    row_fields: Sequence[tuple[Header, Callable[[Any], Cell]]],
    columns: Sequence[Column],
    labels: Mapping[str, str],
) -> DataTable:
    """Build a pivot table, with one row per combination of the values of `row_fields`.

    The first of `columns` is the pivot. The other columns are repeated for each value of the pivot.
    """
    pivot, *repeated = columns
    rows: dict[tuple[Cell, ...], dict[Any, Any]] = {}
    names: dict[Any, str] = {}
    for record in records:
        value, text = pivot.value(record), pivot.text(record)
        names[value] = f"{labels.get(text, text)} {pivot.unit}".strip()
        rows.setdefault(tuple(cell_of(record) for _, cell_of in row_fields), {})[value] = record
    headers = [header for header, _ in row_fields]
    for name in names.values():
        for c in repeated:
            template = c.heading if "{}" in c.heading else f"{{}}, {c.header.heading}"
            heading = template.format(name) if len(repeated) > 1 else name
            headers.append(replace(c.header, heading=heading))
    cells = tuple(
        (*key, *(c.display_cell(r[v]) if v in r else None for v in names for c in repeated))
        for key, r in rows.items()
    )
    return DataTable("", tuple(headers), cells)
