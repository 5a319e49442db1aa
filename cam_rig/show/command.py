"""What a command writes: plots, JSON and CSV, written whole or not at all."""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from typer.core import TyperCommand

from cam_rig.errors import INTERRUPTED, CamRigError, ConfigError, OutputError
from cam_rig.extras import libraries_named, require, source_date
from cam_rig.files import writing
from cam_rig.interrupts import raised
from cam_rig.show.tables import DataTable, to_csv

# What all verbs share: where words and tables go, and how errors end a command.

#: People read stderr, programs read stdout.
if TYPE_CHECKING:
    from matplotlib.figure import Figure

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

    for table in (part for whole in tables for part in _parts(whole, console.width)):
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


def _parts(table: DataTable, room: int) -> list[DataTable]:
    """A table whose words fit side by side; of another several, with some of its columns each.

    Every one has those columns, from the first on, that tell the rows apart.
    """
    least, rows = [_longest(table, i, table.texts) for i in range(len(table.columns))], table.rows
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
    """Gap and characters of each column, so that no word is broken; None where none does so.

    Where a cell's word is too long for that, a path, cells are broken, but no heading.
    """
    rows, count = table.texts, len(table.columns)
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


#: Kinds of picture a plot can be written as.
PICTURES = (".png", ".svg", ".pdf", ".jpg")

#: In place of a file.
STDOUT = Path("-")


def write_plot(target: Path, figure: Callable[[], Figure]) -> None:
    """Draw a figure into a file, of any kind that matplotlib knows by the suffix; say where it is.

    Raises
    ------
    OutputError : the place cannot be written
    """
    from cam_rig.show.figure import write

    with writing(target) as part:
        write(figure(), part)
    console.print(f"plot: {target}", markup=False, soft_wrap=True)


def write_json(data: dict[str, Any], target: str | None) -> None:
    """Write JSON to a file, to stdout for ``-``, nowhere for None.

    Raises
    ------
    OutputError : the place cannot be written
    """
    if target is None:
        return
    text = json.dumps(data, indent=2)
    if target == "-":
        print(text)
        return
    with writing(Path(target)) as part:
        part.write_text(text + "\n", encoding="utf-8")


def write_csv(tables: Iterable[DataTable], target: Path | None) -> None:
    """Write tables to a file, to stdout for ``-``, nowhere for None.

    Raises
    ------
    OutputError : the place cannot be written
    """
    if target == STDOUT:
        print(to_csv(tables), end="")
    elif target is not None:
        with writing(target) as part:
            part.write_text(to_csv(tables), encoding="utf-8")


def check_outputs(json_target: str | None, plot: Path | None, csv: Path | None = None) -> None:
    """Refuse, before anything runs, what could not be written afterwards."""
    if json_target == "-" and csv == STDOUT:
        raise ConfigError("--json - and --csv -: both go to stdout; allowed: one of them there")
    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise ConfigError(f"{plot}: unknown kind of picture; allowed: {', '.join(PICTURES)}")
    if plot is not None:
        require("matplotlib")
    asked = [plot, csv, None if json_target in (None, "-") else Path(str(json_target))]
    for target in (path for path in asked if path not in (None, STDOUT)):
        check_place(target)


def check_place(target: Path) -> None:
    """Refuse a place where no file can be written."""
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; allowed: a file")
    if target.exists() and not target.is_file():
        raise OutputError(f"{target}: is a device; allowed: a file, or - for stdout")
    nearest = next(parent for parent in target.absolute().parents if parent.exists())
    try:  # who may write is not told by the folder's bits alone: try it
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise OutputError(
            f"{target}: cannot be written, {nearest} is no writable folder ({error.strerror})"
        ) from None


def check_recording(target: Path) -> None:
    """Refuse, before anything is computed, a Rerun recording that could not be written."""
    require("rerun")
    check_place(target)
    if target.suffix != ".rrd":
        raise ConfigError(f"{target}: unknown kind of recording; allowed: .rrd")


# What ``cam-rig fit cam`` and ``cam-rig new`` share: readings to a fit, a fit to files.


def write_new(folder: Path, texts: dict[str, str]) -> None:
    """Write files into a folder, none over another.

    Raises
    ------
    OutputError : one is there already, or cannot be written
    """
    from cam_rig.files import writing

    for name in texts:
        require_new(folder / name)
    for name, text in texts.items():
        with writing(folder / name) as part:
            part.write_text(text, encoding="utf-8")


def require_new(target: Path) -> None:
    """Refuse a file that is there already, or a place that cannot be written.

    Raises
    ------
    OutputError : with what to do
    """
    from cam_rig.errors import OutputError

    if target.exists():
        raise OutputError(f"{target}: exists already, not overwriting; name another or move it")
    check_place(target)


def say_assumed(assumed: Iterable[str]) -> None:
    """Print what no reading tells."""
    say(*(f"assumed: {words}" for words in assumed))


# All commands: a wrong option, and what cannot be written, end them in one line.


class Command(TyperCommand):
    """As typer's, but that it refuses an option that stands twice where the last would be taken."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Values of the options and arguments; ``--help`` comes first."""
        stand = Counter(self.make_parser(ctx).parse_args(list(args))[2])
        twice = [one for one, count in stand.items() if count > 1 and not one.multiple]
        if twice and not any(one.is_eager for one in stand):
            name = max(twice[0].opts, key=len)
            print(
                f"cam-rig: {name}: stands {stand[twice[0]]} times; allowed: once", file=sys.stderr
            )
            raise typer.Exit(ConfigError.exit_code)
        return super().parse_args(ctx, args)


# Files that a command names: by path, or by the word that a shipped one goes by.

DEFAULT_SCENE = "tm21_sweep"


# Arguments and options that several commands have, each with one meaning and one help text.

Scene = Annotated[str, typer.Argument(help="Scene file, or a name in config/scenes.")]

SceneOption = Annotated[str, typer.Option(help="Scene file, or a name in config/scenes.")]

TableCams = Annotated[
    list[str] | None,
    typer.Argument(help="Cam files, or names in config/cams; by default those of Table 2."),
]

CamsOrScene = Annotated[
    list[str] | None,
    typer.Argument(
        help="Cam files, or names in config/cams; or one scene: its cams on its rig. By default "
        "the cams of Table 2."
    ),
]

Rig = Annotated[str, typer.Option(help="Rig file, or a name in config/rigs.")]

RigOfScene = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs; by default the scene's, for cams the only one in "
        "the folder rigs beside theirs, else paper_table2."
    ),
]

OtherRig = Annotated[
    str | None, typer.Option("--rig", help="Rig file, or a name in config/rigs; the scene's.")
]

SceneOfBag = Annotated[
    str | None,
    typer.Option(help="Scene that was run, for a bag without one (made by `ros2 bag record`)."),
]

Plot = Annotated[Path | None, typer.Option(help="Write the plot (PNG, SVG, PDF).")]

Csv = Annotated[
    Path | None,
    typer.Option("--csv", metavar="FILE", help="Write the tables as CSV; - for stdout."),
]

Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON; - for stdout.")
]

Namespace = Annotated[
    str, typer.Option(help="Namespace of its nodes and topics, for two rigs side by side.")
]

Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=1024, help="Processes; by default one a core."),
]

Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Send the work to a Dask cluster: tcp://HOST:PORT, or its scheduler file.",
    ),
]


# Where a run is seen while it runs: in a window, in a browser, or nowhere.

#: Wall time (s) from line to line on a page's delay, where there is no terminal for a bar.
LINE_EVERY_S = 10.0
