"""Cams, tables, figures and command line that the experiments of the paper share."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

import cam_rig
from cam_rig.show.figure import write
from cam_rig.show.tables import DataTable, Header

#: Cams of table 2 of the paper, in its order.
CAMS = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")
#: Rig identified from the jump speeds of table 2.
RIG = "paper_table2"
#: Rig with the stem stiffness of table 1.
STIFF_RIG = "tm21"
#: Scene of the paper's noise measurements.
SCENE = "tm21_sweep"


@dataclass(frozen=True)
class Table:
    """Table of an experiment.

    `columns` has the headings, separated by bars. A heading can have a unit in brackets and, for
    numbers, a format after a colon: "cam | jump speed [rpm] :.1f". None and NaN are empty cells.
    `notes` has a footnote per line.
    """

    caption: str
    columns: str
    rows: Sequence[tuple[Any, ...]]
    notes: str = ""

    @property
    def headers(self) -> tuple[Header, ...]:
        """Heading, unit and number format of each column."""
        pattern = re.compile(r"([^\[:]+?)(?: \[(.+?)\])?(?: :(.+))?")
        matches = (pattern.fullmatch(column.strip()) for column in self.columns.split("|"))
        return tuple(Header(*match.groups("")) for match in matches)  # type: ignore[union-attr]

    @property
    def frame(self) -> pd.DataFrame:
        """Data frame of the numbers, unrounded, by heading and unit."""
        return pd.DataFrame(list(self.rows), columns=[header.title for header in self.headers])

    @property
    def for_report(self) -> DataTable:
        """Table in the form of the report."""
        notes = tuple(filter(None, self.notes.split("\n")))
        cells = self.frame.astype(object).where(self.frame.notna(), None)
        rows = tuple(cells.itertuples(index=False, name=None))
        return DataTable(self.caption, self.headers, rows, notes)

    def __str__(self) -> str:
        """Return caption, rows and notes as plain text."""
        text = pd.DataFrame(self.for_report.text_rows, columns=list(self.frame))
        return "\n".join((self.caption, text.to_string(index=False), self.notes, ""))


def load_laws(cams: Iterable[str] = CAMS) -> dict[str, cam_rig.Law]:
    """Return the laws of shipped cams, by name."""
    return {cam: cam_rig.build_law(cam_rig.load_cam(cam)) for cam in cams}


def titles(cams: Iterable[str] = CAMS) -> dict[str, str]:
    """Return the titles of shipped cams, by name."""
    return {cam: cam_rig.load_cam(cam).title for cam in cams}


def parser(description: str | None) -> argparse.ArgumentParser:
    """Return the command line parser of an experiment, with the folder of its figures."""
    options = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument(
        "--out", type=_folder, default=Path("out/paper"), help="folder of the figures (%(default)s)"
    )
    return options


def _folder(text: str) -> Path:
    if Path(text).exists() and not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a file; allowed: a folder, which may be new")
    return Path(text)


def publish(
    out: Path, tables: Iterable[Table], figures: Mapping[str, Figure], summary: Iterable[str]
) -> None:
    """Print tables and summary, and write each figure into the folder `out`."""
    for table in tables:
        print(table)
    print(*summary, sep="\n")
    out.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        write(figure, out / f"{name}.png")
        print(f"figure: {out / name}.png")
