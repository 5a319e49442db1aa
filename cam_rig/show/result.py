"""Base classes of results: records, and columns to display and export them.

A record stores SI values. A column definition names one field of a record. Terminal tables, report
pages, CSV, JSON and pandas are all made from these two, so each column is declared once.
"""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from cam_rig.errors import ConfigError
from cam_rig.extras import friendly_import_errors
from cam_rig.files import shorten, spreadsheet_text
from cam_rig.show.layout import TableLayout
from cam_rig.show.tables import Cell, DataTable, Header

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

Item = TypeVar("Item")

#: SI unit in which data with a display unit are stored and exported, by display unit, and the size
#: of the display unit in this SI unit. Data in any other unit, such as rpm, dB or N, are not
#: converted.
SI_UNITS = {
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
    """Column definition: one field of a record, its export key and display format.

    Parameters
    ----------
    key : str
        Name in JSON, CSV and pandas, where the value is in SI units.
    unit : str
        Display unit, see `SI_UNITS`.
    number_format : str
        Format of displayed numbers, such as ".2f" (default: a text column).
    heading : str
        Displayed heading (default: the key, with spaces for underscores).
    of : str or callable
        Path within the record, such as "limits.0.value", or a function of it (default: the key).
    cell : callable, optional
        Function of the record that returns the displayed cell.
    missing : str
        Text displayed if there is no value.
    hidden : bool
        True if the column is exported but not displayed.
    doc : str
        Explanation for docs/results.md, if key and heading are not enough.

    Examples
    --------
    >>> lift = Column("max_lift", "mm", ".1f", of="0")
    >>> lift.value((0.0125,)), lift.display_cell((0.0125,)), lift.header.title
    (0.0125, 12.5, 'max lift [mm]')
    """

    key: str
    unit: str = ""
    number_format: str = ""
    heading: str = ""
    of: str | Callable[[Any], Any] = ""
    cell: Callable[[Any], Cell] | None = None
    missing: str = ""
    hidden: bool = False
    doc: str = ""

    @property
    def si_unit(self) -> str:
        """SI unit in which the values of a table column are exported."""
        return SI_UNITS.get(self.unit, (self.unit, 1.0))[0]

    @property
    def header(self) -> Header:
        """Heading, unit and number format with which a table column is displayed."""
        heading = self.heading or self.key.replace("_", " ")
        return Header(heading, self.unit, self.number_format, self.missing)

    def value(self, record: Any) -> Any:
        """Return this column's value of a record in SI units.

        Returns None if an attribute on the path `of` is None.
        """
        if callable(self.of):
            return self.of(record)
        for name in (self.of or self.key).split("."):
            if record is None:
                return None
            record = record[int(name)] if name.isdigit() else getattr(record, name)
        return record

    def display_cell(self, record: Any) -> Cell:
        """Return the displayed cell: number in the display unit, text, or None for NaN."""
        if self.cell is not None:
            return self.cell(record)
        value = self.value(record)
        if isinstance(value, float):
            return None if math.isnan(value) else value / SI_UNITS.get(self.unit, ("", 1.0))[1]
        return str(value) if isinstance(value, Enum | bool) else value

    def text(self, record: Any) -> str:
        """Return the text of a table column's displayed cell for a record."""
        return self.header.format(self.display_cell(record))


@dataclass(frozen=True)
class Footnote:
    """Sentence under a table, displayed if at least one record satisfies `condition`.

    The mark is appended to the first cell of each such record.
    """

    text: str
    condition: Callable[[Any], bool] = lambda _: True
    mark: str = ""


@dataclass(frozen=True)
class Records:
    """Records of one kind with their columns: a table of a result.

    Parameters
    ----------
    key : str
        Name of the table in JSON and in the name of its CSV file.
    caption : str
        Caption of the table.
    columns : tuple of Column
        Columns of the table.
    records : sequence
        Records, one per row.
    notes : tuple of Footnote or str
        Notes under the table.
    layout : TableLayout
        Layout of the displayed table.
    single : bool
        True if JSON contains the only record itself instead of a list.
    hidden : bool
        True if the table is exported but not displayed.
    """

    key: str
    caption: str
    columns: tuple[Column, ...]
    records: Sequence[Any]
    notes: tuple[Footnote | str, ...] = ()
    layout: TableLayout = field(default_factory=TableLayout)
    single: bool = False
    hidden: bool = False

    def select(self, group: Any) -> Records:
        """Return the table with the records of one group only.

        A group contains the records with the value `group` in the column `layout.group_by`.
        """
        group_of = self.column(self.layout.group_by).value
        return replace(self, records=[r for r in self.records if group_of(r) == group])

    def rows(self) -> list[dict[str, Any]]:
        """Return the records of a table as dicts: column key -> value in SI units.

        A value is None if it is not finite.
        """
        return [{c.key: to_json_value(c.value(r)) for c in self.columns} for r in self.records]

    def data(self) -> Any:
        """Return the table as JSON data: a list with one dict per record.

        If `single` is True, it is the dict of the only record.
        """
        return self.rows()[0] if self.single else self.rows()

    def to_csv(self) -> str:
        """Return the table as CSV, in SI units with all digits.

        Texts are escaped so that a spreadsheet program does not read them as formulas.
        """
        out = io.StringIO()
        writer = csv.DictWriter(out, [c.key for c in self.columns], lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {key: spreadsheet_text(value) for key, value in row.items()} for row in self.rows()
        )
        return out.getvalue()

    def to_pandas(self) -> DataFrame:
        """Return the table as a data frame, in SI units."""
        with friendly_import_errors():
            from pandas import DataFrame
        return DataFrame.from_records(self.rows(), columns=[c.key for c in self.columns])

    def to_display(self, labels: Mapping[str, str] | None = None) -> list[DataTable]:
        """Return the display tables. `labels` maps cam names to the names to display."""
        return [] if self.hidden else self.layout.tables(self, labels or {})

    @property
    def footnotes(self) -> list[Footnote]:
        """Notes of a table as footnotes. A plain sentence applies to every record."""
        return [note if isinstance(note, Footnote) else Footnote(note) for note in self.notes]

    def column(self, key: str) -> Column:
        """Return the column of a table with the given key."""
        return next(c for c in self.columns if c.key == key)


@dataclass(frozen=True)
class ArrayRecords(Records):
    """Exported table whose columns are arrays of a result (see `Result.array_table`)."""

    source: Any = None

    def rows(self) -> list[dict[str, Any]]:
        """Return a dict per element of the arrays: column key -> value in SI units."""
        keys = [c.key for c in self.columns]
        arrays = (to_json_value(c.value(self.source)) for c in self.columns)
        return [dict(zip(keys, row, strict=True)) for row in zip(*arrays, strict=True)]

    def to_pandas(self) -> DataFrame:
        """Return the arrays as a data frame, without conversion."""
        with friendly_import_errors():
            from pandas import DataFrame
        return DataFrame({c.key: c.value(self.source) for c in self.columns})


def to_json_value(value: Any) -> Any:
    """Convert a value for JSON: arrays to lists, NaN and infinity to None."""
    if isinstance(value, Enum):
        return value.value
    if hasattr(value, "tolist"):  # a NumPy object; NumPy is not imported for a help text
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [to_json_value(item) for item in value]
    if isinstance(value, Mapping):
        return {key: to_json_value(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Result:
    """Base class of the results of computations.

    A subclass declares its columns per table, and returns its records from `tables`.

    Attributes
    ----------
    columns : mapping of str to tuple of Column
        Columns of each table in `data`; docs/results.md lists them.
    schema : str
        Name and version of the JSON. The version rises if a key changes its meaning or is removed.
    plot_function : str
        Function that plots the result: "cam_rig.studies.vibration.figures:figure".
    interrupted : bool
        True if the computation was interrupted and the result is partial.
    exit_code : int
        Exit code of the command.
    assumed : tuple of str
        Sentences on numbers in written files that were not measured.
    """

    columns: ClassVar[Mapping[str, tuple[Column, ...]]]
    schema: ClassVar[str] = ""
    plot_function: ClassVar[str] = ""
    interrupted: bool = False
    exit_code: int = 0
    assumed: tuple[str, ...] = ()

    @property
    def subject(self) -> str:
        """Cam, rig and model of the result, the first line of a command. May be empty."""
        return ""

    def tables(self) -> list[Records]:
        """Return the tables of the result.

        The first of them is the table that was requested.
        """
        raise NotImplementedError

    def summary(self) -> list[str]:
        """Return the sentences that are printed under the tables of a result."""
        return []

    def table(
        self,
        key: str,
        caption: str,
        records: Iterable[Any],
        *notes: Footnote | str,
        single: bool = False,
        hidden: bool = False,
        **layout: Any,
    ) -> Records:
        """Build a table with the declared columns of `key`.

        The parameters are those of `Records`, and `layout` those of `TableLayout`.
        """
        options = TableLayout(**layout), single, hidden
        return Records(key, caption, self.columns[key], tuple(records), notes, *options)

    def array_table(self, key: str) -> ArrayRecords:
        """Build an exported table whose columns are arrays of this result."""
        columns = self.columns[key]
        rows = range(len(columns[0].value(self)))
        return ArrayRecords(key, "", columns, rows, hidden=True, source=self)

    def to_display(self, labels: Mapping[str, str] | None = None) -> list[DataTable]:
        """Return the display tables. `labels` maps cam names to the names to display."""
        return [part for table in self.tables() for part in table.to_display(labels)]

    def data(self) -> dict[str, Any]:
        """Return the schema and every table of a result by its key, in SI units."""
        return {"schema": self.schema} | {table.key: table.data() for table in self.tables()}

    def to_json(self) -> str:
        """Return the schema and the tables of a result as JSON."""
        return json.dumps(self.data(), indent=2)

    def to_pandas(self, key: str = "") -> DataFrame:
        """Return a table as a data frame, in SI units.

        Parameters
        ----------
        key : str
            Key of the table (default: the first table).

        Raises
        ------
        ConfigError
            If there is no such table, or pandas is not installed.
        """
        tables = {table.key: table for table in self.tables()}
        if key and key not in tables:
            raise ConfigError(f"key must be one of {', '.join(tables)}, got {shorten(key)}")
        return tables[key or next(iter(tables))].to_pandas()

    def plot(self, ax: Axes | None = None, **options: Any) -> Figure:
        """Plot the result.

        A notebook displays the figure if it is the last value of a cell.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes of a figure that are replaced by the plot, which may have several panels (default:
            a new figure).
        **options
            Keyword arguments of the function that `plot_function` names.

        Returns
        -------
        matplotlib.figure.Figure
            New figure, or that of `ax`.

        Raises
        ------
        ConfigError
            If the result has no figure, matplotlib is not installed, or `ax` is not in a grid.
        """
        if not self.plot_function:
            raise ConfigError(f"{type(self).__name__} has no figure; use its tables")
        module, name = self.plot_function.split(":")
        with friendly_import_errors():
            draw = getattr(import_module(module), name)
            from cam_rig.show.figure import draw_into
        return enable_notebook_display(draw_into(ax, lambda: draw(self, **options)))

    def __repr__(self) -> str:
        """Return the tables and their numbers of rows."""
        sizes = ", ".join(f"{t.key}: {len(t.records)} rows" for t in self.tables())
        return f"{type(self).__name__}({sizes})"

    def _repr_html_(self) -> str:
        html = ""
        for table in self.to_display():
            lines = [[column.title for column in table.columns], *table.typeset_rows]
            cells = ("".join(f"<td>{escape(text)}</td>" for text in line) for line in lines)
            rows = "".join(f"<tr>{row}</tr>" for row in cells)
            html += f"<table><caption>{escape(table.caption)}</caption>{rows}</table>"
        return html


def subject_line(cams: Iterable[str], rig: str, model: str = "") -> str:
    """Return the subject of a result as a line: its cams, rig and model by their names."""
    names = list(cams)
    line = f"cam{'s' if len(names) > 1 else ''} {', '.join(names)}; rig {rig}"
    return f"{line}; model {model}" if model else line


class Progress:
    """Receiver of the progress of a computation. This base class ignores it."""

    def start(self, total: int | None, description: str = "") -> None:
        """Start a task, which replaces the previous task.

        `total` is the number of its steps, or None if it is unknown.
        """

    def advance(self, steps: int = 1) -> None:
        """Report completed steps of the present task of a computation."""

    def describe(self, description: str) -> None:
        """Report the current item of a computation, or its best result so far."""

    def track(self, items: Iterable[Item]) -> Iterator[Item]:
        """Iterate over items, reporting each of them as a step."""
        listed = list(items)
        self.start(len(listed))
        for item in listed:
            self.describe(str(item))
            yield item
            self.advance()


#: Default receiver of the functions of `import cam_rig`: progress is not displayed.
NULL_PROGRESS = Progress()


def enable_notebook_display(figure: Figure) -> Figure:
    """Return the figure, after registering a PNG formatter for it in IPython.

    Figures are made without pyplot, so IPython has no formatter for them. Formatters that pyplot
    has registered are kept.
    """

    def as_png(figure: Figure) -> bytes:
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png")
        return buffer.getvalue()

    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None:
        formatters = shell.display_formatter.formatters
        figure_type = type(figure)
        if not any(figure_type in f.type_printers for f in formatters.values()):
            formatters["image/png"].for_type(figure_type, as_png)
    return figure
