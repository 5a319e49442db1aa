"""Pictures in a notebook: figures are made without pyplot, so it has to be told how to show one."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

from cam_rig.show.tables import Column, DataTable, number, tabulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def shown(figure: Figure) -> Figure:
    """The same figure; IPython shows it where it is the last value of a cell.

    Where pyplot is at work in the notebook, what it has set is left as it is.
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


# The report in short: each question, what the paper says, what came out here, and the verdict.


@dataclass(frozen=True)
class Answer:
    """A row of a summary; ``paper`` is empty on a page of one's own cams."""

    question: str
    here: str
    verdict: str
    paper: str = ""


def summary_table(rows: Iterable[Answer]) -> DataTable:
    """The answers as a table."""
    return tabulate(
        "Questions and answers",
        rows,
        (
            (Column("question"), lambda row: row.question),
            (Column("paper"), lambda row: row.paper),
            (Column("here"), lambda row: row.here),
            (Column("verdict"), lambda row: row.verdict),
        ),
    )


def bold(value: float, shown: str = ".6g", unit: str = "") -> str:
    """A number in bold, with its unit.

    Examples
    --------
    >>> bold(0.369, ".2f", "%")
    '**0.37 %**'
    """
    return f"**{number(value, shown)}{' ' + unit if unit else ''}**"


def span(ends: tuple[float, float], shown: str = ".6g", unit: str = "") -> str:
    """A range in bold, with its unit at the end.

    Examples
    --------
    >>> span((0.7, 1.66), ".1f", "turns")
    '**0.7** to **1.7 turns**'
    """
    return f"{bold(ends[0], shown)} to {bold(ends[1], shown, unit)}"
