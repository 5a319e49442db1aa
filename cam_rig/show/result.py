"""What a computation gives: records, and how each of their fields is shown.

A record holds SI values. A column names one of its fields, so the terminal, a page, CSV, JSON and
pandas are all made of records and columns alone. A column is written once, in its slice.
"""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from html import escape
from importlib import import_module
from io import BytesIO
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from cam_rig.errors import ConfigError
from cam_rig.extras import libraries_named
from cam_rig.files import shown
from cam_rig.show import tables
from cam_rig.show.tables import Cell, DataTable, tabulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

Item = TypeVar("Item")

#: A unit as it is shown -> the SI unit of the data, and what one of the shown unit is in it.
#: A unit that is not here, such as rpm, dB or N, is that of the data.
SI = {
    "nm": ("m", 1e-9),
    "µm": ("m", 1e-6),
    "mm": ("m", 1e-3),
    "mm/rad": ("m/rad", 1e-3),
    "mm/rad²": ("m/rad²", 1e-3),
    "mm/rad³": ("m/rad³", 1e-3),
    "°": ("rad", math.pi / 180.0),
    "%": ("1", 1e-2),
    "ms": ("s", 1e-3),
    "MPa": ("Pa", 1e6),
    "turns": ("rad", 2.0 * math.pi),
}


@dataclass(frozen=True)
class Column:
    """A field of a record: its key in data, where it is in SI; heading, unit and format in a table.

    ``unit`` is as shown, see `SI`; ``shown`` the format of a number, such as ".2f", empty for text.
    ``of`` is a path in the record, as "limits.0.value", or a function of it, by default the key;
    ``cell`` a function that gives what is shown instead, ``missing`` what is shown where there is
    nothing. A ``hidden`` one is in data only. ``about`` is for what key and heading do not say.
    """

    key: str
    unit: str = ""
    shown: str = ""
    heading: str = ""
    of: str | Callable[[Any], Any] = ""
    cell: Callable[[Any], Cell] | None = None
    missing: str = ""
    hidden: bool = False
    about: str = ""

    @property
    def si(self) -> str:
        """Unit of the data."""
        return SI.get(self.unit, (self.unit, 1.0))[0]

    def value(self, record: Any) -> Any:
        """The record's value, in SI."""
        return self.of(record) if callable(self.of) else _reached(record, self.of or self.key)

    def text(self, record: Any) -> Cell:
        """What stands in the cell: a number in the unit that is shown, a text, or nothing."""
        if self.cell is not None:
            return self.cell(record)
        value = self.value(record)
        if isinstance(value, float):
            return None if math.isnan(value) else value / SI.get(self.unit, ("", 1.0))[1]
        return str(value) if isinstance(value, Enum | bool) else value

    @property
    def head(self) -> tables.Head:
        """Heading, unit and format alone."""
        words = self.heading or self.key.replace("_", " ")
        return tables.Head(words, self.unit, self.shown, self.missing)


@dataclass(frozen=True)
class Footnote:
    """A sentence under a table where a record calls for it, and that record's mark."""

    text: str
    where: Callable[[Any], bool] = lambda _: True
    mark: str = ""


@dataclass(frozen=True)
class Records:
    """Records under columns; ``key`` is its name in JSON and in the name of its CSV file.

    Where people read, each value of the column ``by`` has a table of its own, and stands in the
    caption in braces, as "at {rpm:g} rpm"; each value of ``across`` has its own of the columns
    behind it; only records that are ``seen`` stand there, and none of a ``hidden`` table; an
    ``upright`` one has a line a column of its one record, with what is there, and its unit. In JSON
    a ``single`` one is an object in place of a list of one.
    """

    key: str
    caption: str
    columns: tuple[Column, ...]
    records: Sequence[Any]
    notes: tuple[Footnote | str, ...] = ()
    by: str = ""
    across: str = ""
    seen: Callable[[Any], bool] = lambda _: True
    single: bool = False
    hidden: bool = False
    upright: bool = False

    def only(self, value: Any) -> Records:
        """The records with one value of ``by``."""
        key = next(c for c in self.columns if c.key == self.by).value
        return replace(self, records=[one for one in self.records if key(one) == value])

    def rows(self) -> list[dict[str, Any]]:
        """Each record by the columns' keys, in SI; None for what is no number."""
        return [{c.key: plain(c.value(record)) for c in self.columns} for record in self.records]

    def data(self) -> Any:
        """As JSON has it."""
        return self.rows()[0] if self.single else self.rows()

    def to_csv(self) -> str:
        """Keys, then a line a record, in SI with all digits."""
        out = io.StringIO()
        writer = csv.DictWriter(out, [c.key for c in self.columns], lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows())
        return out.getvalue()

    def to_pandas(self) -> DataFrame:
        """As pandas has it."""
        with libraries_named():
            from pandas import DataFrame
        return DataFrame.from_records(self.rows(), columns=[c.key for c in self.columns])

    def to_show(self, called: Mapping[str, str] | None = None) -> list[DataTable]:
        """A table for each value of ``by``; ``called`` is what cams are called, if not by name."""
        titles = called or {}
        return [self._part(*part, titles).called(titles) for part in self._parts()]

    def _parts(self) -> Iterator[tuple[list[Any], Mapping[str, Any]]]:
        """What people read, and the value of ``by`` that it has."""
        records = [] if self.hidden else [one for one in self.records if self.seen(one)]
        if not records or not self.by:
            yield from [(records, {})] if records else []
            return
        key = next(c for c in self.columns if c.key == self.by).value
        for value, part in groupby(sorted(records, key=key), key):
            yield list(part), {self.by: value}

    def _part(
        self, records: list[Any], value: Mapping[str, Any], called: Mapping[str, str]
    ) -> DataTable:
        seen = [c for c in self.columns if not c.hidden and c.key != self.by]
        first, *others = seen
        notes = [one if isinstance(one, Footnote) else Footnote(one) for one in self.notes]

        def marked(record: Any) -> Cell:
            cell = first.text(record)
            marks = "".join(f" {n.mark}" for n in notes if n.mark and n.where(record))
            return f"{called.get(cell, cell)}{marks}" if isinstance(cell, str) else cell

        texts = [f"{n.mark} {n.text}".strip() for n in notes if any(map(n.where, records))]
        caption = self.caption.format(**value) if value else self.caption
        if self.upright:
            heads = (tables.Head(" "), tables.Head("value", "", "s"), tables.Head("unit"))
            lines = [(c.head.heading, c.head.text(c.text(records[0])), c.unit) for c in seen]
            kept = [line for line in lines if line[1]]
            return tabulate(caption, kept, [(h, itemgetter(i)) for i, h in enumerate(heads)])
        fields = [(first.head, marked), *((c.head, c.text) for c in others)]
        if self.across:
            at = 1 + next(i for i, c in enumerate(others) if c.key == self.across)
            return _wide(caption, records, fields[:at], others[at - 1 :], texts, called)
        return tabulate(caption, records, fields, *texts)


@dataclass(frozen=True)
class Arrays(Records):
    """Records, as data alone, of which each column is an array: its value of ``whole``."""

    whole: Any = None
    hidden: bool = True

    @classmethod
    def of(cls, key: str, columns: tuple[Column, ...], whole: Any) -> Arrays:
        """As many as the first column has."""
        return cls(key, "", columns, range(len(columns[0].value(whole))), whole=whole)

    def rows(self) -> list[dict[str, Any]]:
        """Each record by the columns' keys."""
        keys = [c.key for c in self.columns]
        values = (plain(c.value(self.whole)) for c in self.columns)
        return [dict(zip(keys, row, strict=True)) for row in zip(*values, strict=True)]

    def to_pandas(self) -> DataFrame:
        """The arrays as they are."""
        with libraries_named():
            from pandas import DataFrame
        return DataFrame({c.key: c.value(self.whole) for c in self.columns})


def _wide(
    caption: str,
    records: list[Any],
    own: Sequence[tuple[tables.Head, Callable[[Any], Cell]]],
    spread: Sequence[Column],
    texts: list[str],
    called: Mapping[str, str],
) -> DataTable:
    """A row for what has the same cells under ``own``; the rest by the first of ``spread``."""
    across, *behind = spread
    rows: dict[tuple[Cell, ...], dict[Any, Any]] = {}
    names: dict[Any, str] = {}
    for one in records:
        value, text = across.value(one), across.head.text(across.text(one))
        names[value] = f"{called.get(text, text)} {across.unit}".strip()
        rows.setdefault(tuple(take(one) for _, take in own), {})[value] = one
    heads = [head for head, _ in own]
    for name in names.values():
        for c in behind:
            words = c.heading if "{}" in c.heading else f"{{}}, {c.head.heading}"
            heading = words.format(name) if len(behind) > 1 else name
            heads.append(replace(c.head, heading=heading))
    cells = [
        (*key, *(c.text(row[at]) if at in row else None for at in names for c in behind))
        for key, row in rows.items()
    ]
    return tabulate(caption, cells, [(head, itemgetter(i)) for i, head in enumerate(heads)], *texts)


def _reached(record: Any, path: str) -> Any:
    """What a dotted path of attributes and indices leads to; None of none."""
    for step in path.split("."):
        if record is None:
            return None
        record = record[int(step)] if step.isdigit() else getattr(record, step)
    return record


def plain(value: Any) -> Any:
    """A value as JSON has it: no NaN, no infinity, no array."""
    if isinstance(value, Enum):
        return value.value
    if hasattr(value, "tolist"):  # NumPy's, which is not imported for a help text
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Result:
    """What a computation returns: to read, to plot, to take on.

    A subclass names its columns by table, and gives its records in `tables`.
    """

    #: By table its columns: what `data` has, and docs/results.md lists.
    columns: ClassVar[Mapping[str, tuple[Column, ...]]]
    #: Name and version of its JSON: the version rises when a key changes its meaning or goes.
    schema: ClassVar[str] = ""
    #: Who draws it, as "cam_rig.paper.vibration.figures:figure".
    drawn_by: ClassVar[str] = ""
    #: Whether it ended before all was found, and 0, or with which code a command ends.
    interrupted: bool = False
    exit_code: int = 0
    #: What a file that was written of it says though nobody measured it, a sentence each.
    assumed: tuple[str, ...] = ()

    def tables(self) -> list[Records]:
        """Its tables, the one that was asked for first."""
        raise NotImplementedError

    def summary(self) -> list[str]:
        """Sentences that people read under the tables."""
        return []

    def table(
        self, key: str, caption: str, records: Iterable[Any], *notes: Footnote | str, **how: Any
    ) -> Records:
        """One of its tables, of the columns that the class names."""
        return Records(key, caption, self.columns[key], tuple(records), notes, **how)

    def to_show(self, called: Mapping[str, str] | None = None) -> list[DataTable]:
        """Its tables as people read them."""
        return [part for table in self.tables() for part in table.to_show(called)]

    def data(self) -> dict[str, Any]:
        """Each table by its key, in SI, and the schema."""
        return {"schema": self.schema} | {table.key: table.data() for table in self.tables()}

    def to_json(self) -> str:
        """`data` as text."""
        return json.dumps(self.data(), indent=2)

    def to_pandas(self, key: str = "") -> DataFrame:
        """One of its tables; the first where none is named."""
        found = {table.key: table for table in self.tables()}
        if key and key not in found:
            raise ConfigError(f"key: is {shown(key)}; allowed: {', '.join(found)}")
        return (found[key] if key else next(iter(found.values()))).to_pandas()

    def plot(self, **how: Any) -> Figure:
        """Draw it; a notebook shows the figure where it is a cell's last value."""
        if not self.drawn_by:
            raise ConfigError(f"plot: {type(self).__name__} has no figure; allowed: its tables")
        module, name = self.drawn_by.split(":")
        with libraries_named():
            draw = getattr(import_module(module), name)
        return notebook(draw(self, **how))

    def __repr__(self) -> str:
        """Its tables and how many rows they have."""
        sizes = ", ".join(f"{t.key}: {len(t.records)} rows" for t in self.tables())
        return f"{type(self).__name__}({sizes})"

    def _repr_html_(self) -> str:
        return "".join(map(_html, self.to_show()))


def _html(table: DataTable) -> str:
    lines = [[column.title for column in table.columns], *table.printed]
    cells = ("".join(f"<td>{escape(text)}</td>" for text in line) for line in lines)
    rows = "".join(f"<tr>{row}</tr>" for row in cells)
    return f"<table><caption>{escape(table.caption)}</caption>{rows}</table>"


class Progress:
    """Where a long computation says how far it is; this one is silent."""

    def begin(self, total: int | None, words: str = "") -> None:
        """So many steps follow; None where nobody knows."""

    def advance(self, steps: int = 1) -> None:
        """So many more are done."""

    def tell(self, words: str) -> None:
        """What is at work now, or the best so far."""

    def over(self, items: Iterable[Item]) -> Iterator[Item]:
        """Iterate; the item at work is told."""
        listed = list(items)
        self.begin(len(listed))
        for item in listed:
            self.tell(str(item))
            yield item
            self.advance()


#: For who calls from Python.
SILENT = Progress()


def notebook(figure: Figure) -> Figure:
    """The same figure; IPython shows it where it is the last value of a cell.

    Figures are made without pyplot, so IPython has to be told how; what pyplot has set is left.
    """
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None:
        formatters = shell.display_formatter.formatters
        kind = type(figure)
        if not any(kind in formatter.type_printers for formatter in formatters.values()):
            formatters["image/png"].for_type(kind, _as_png)
    return figure


def _as_png(figure: Figure) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
