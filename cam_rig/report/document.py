"""A page as a document: its head, its numbered sections, figures and tables, HTML or Markdown."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from platform import python_version
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from cam_rig.show.tables import (
    Cell,
    DataTable,
    Head,
    number,
    printed,
    tabulate,
    to_markdown,
    typeset,
)

#: What makes the numbers of a page, beside the package itself.
LIBRARIES = ("numpy", "scipy")


@dataclass(frozen=True)
class Made:
    """How a page was made.

    Parameters
    ----------
    command : that makes it again
    date : of the day, empty where the page is not to differ from one day to the next
    seeds : of what is drawn at random; empty where nothing is
    """

    command: str
    date: str = ""
    seeds: str = ""

    @property
    def versions(self) -> str:
        """Of the package, of Python and of what computes."""
        others = (f"{name} {version(name)}" for name in LIBRARIES)
        return ", ".join((f"cam_rig {version('cam_rig')}", f"Python {python_version()}", *others))


def written_on(seconds: float) -> str:
    """The day of a page, UTC, from s since 1970.

    Examples
    --------
    >>> written_on(1_700_000_000)
    '2023-11-14'
    """
    return datetime.fromtimestamp(seconds, UTC).date().isoformat()


@dataclass(frozen=True)
class Document:
    """What a page shows.

    Parameters
    ----------
    sections : title by key, in the order they are read; the key names the template
    folder : of the templates, with a slash at its end
    figures : data URIs by key, each figure's strips from the top; none in Markdown
    values : what the sentences take their numbers from
    """

    title: str
    sections: Mapping[str, str]
    made: Made
    tables: Mapping[str, list[DataTable]]
    figures: Mapping[str, list[str]]
    values: Mapping[str, Any]
    folder: str = ""


class Numbering:
    """Numbers of figures and of tables in the order they are read.

    A reference may stand before what it names: a page is rendered twice, and the second time every
    number is known.

    Examples
    --------
    >>> numbers = Numbering()
    >>> numbers.give("figure", "force"), numbers.give("figure", "jump"), numbers.give("table", 1)
    (1, 2, 1)
    >>> numbers.restart()
    >>> numbers.see("figure", "jump")
    2
    """

    def __init__(self) -> None:
        self._known: dict[tuple[str, Hashable], int] = {}
        self._counts: Counter[str] = Counter()
        self._first = True

    def restart(self) -> None:
        """Count from one again; what has a number keeps it."""
        self._counts.clear()
        self._first = False

    def give(self, kind: str, key: Hashable) -> int:
        """The next number of a kind, for what ``key`` names."""
        self._counts[kind] += 1
        self._known[kind, key] = self._counts[kind]
        return self._counts[kind]

    def see(self, kind: str, key: Hashable) -> int:
        """The number that ``key`` has."""
        return self._known.get((kind, key), 0) if self._first else self._known[kind, key]


def render(kind: str, document: Document) -> str:
    """A document as "html", one self-contained page, or as "md", its words and tables alone."""
    templates, numbering, text = environment(kind), Numbering(), ""
    numbers = {key: i for i, key in enumerate(document.sections, start=1)}
    for _ in range(2):
        parts = {"figures": document.figures, "numbering": numbering, "numbers": numbers}
        text = templates.get_template(f"report.{kind}").render(
            vars(document) | parts | dict(document.values),
            page=templates.get_template(f"layout.{kind}").make_module(parts),
        )
        numbering.restart()
    return text if kind == "html" else re.sub("\n{3,}", "\n\n", text).strip() + "\n"


def environment(kind: str) -> Environment:
    """Where the templates are: "html" escapes what people wrote, "md" does not."""
    found = Environment(
        loader=PackageLoader("cam_rig.report"),
        autoescape=kind == "html",
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters |= {"percent": percent, "number": printed, "to": to, "markdown": to_markdown}
    found.filters |= {"degrees": math.degrees, "anchor": anchor, "typeset": typeset}
    return found


def percent(share: float, shown: str = ".0f") -> str:
    """A share as a percentage."""
    return f"{printed(100.0 * share, shown)} %"


def to(pair: tuple[float, float], shown: str = ".0f") -> str:
    """A range from its ends."""
    return " to ".join(printed(end, shown) for end in pair)


def anchor(heading: str) -> str:
    """What a heading of Markdown is linked by, as GitHub and MkDocs have it.

    Examples
    --------
    >>> anchor("12 Given, assumed, identified")
    '12-given-assumed-identified'
    """
    return re.sub(r"[^\w\s-]", "", heading).strip().lower().replace(" ", "-")


# What cams, rises and readings are called on a page, in place of the names that files have.


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
            (Head("question"), lambda row: row.question),
            (Head("paper"), lambda row: row.paper),
            (Head("here"), lambda row: row.here),
            (Head("verdict"), lambda row: row.verdict),
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
