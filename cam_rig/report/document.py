"""A page of numbered sections, figures and tables, with a head, as HTML or Markdown."""

from __future__ import annotations

import base64
import math
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from platform import python_version
from typing import Any, NamedTuple

from jinja2 import ChoiceLoader, Environment, FileSystemLoader, PackageLoader, StrictUndefined
from jinja2.environment import TemplateModule
from matplotlib.figure import Figure

from cam_rig.report.equations import mathml, subscripts
from cam_rig.show.figure import strips, write_strip
from cam_rig.show.looks import tokens
from cam_rig.show.result import NULL_PROGRESS, Progress, Result
from cam_rig.show.tables import DataTable, to_markdown, typeset, typeset_number

#: What makes the numbers of a page, beside the package itself.
LIBRARIES = ("numpy", "scipy")


@dataclass(frozen=True)
class Made:
    """The command that makes the page again, its date if it has one, and the seeds if any."""

    command: str
    date: str = ""
    seeds: str = ""

    @property
    def versions(self) -> str:
        """Of the package, of Python and of what computes."""
        others = (f"{name} {version(name)}" for name in LIBRARIES)
        return ", ".join((f"cam_rig {version('cam_rig')}", f"Python {python_version()}", *others))


@dataclass(frozen=True, eq=False)
class Content:
    """What a section shows: tables in order, figures by key, drawn only for a page that has them.

    Sentences take their numbers from ``values``; JSON has ``results``, by the name of the command.
    """

    tables: Sequence[DataTable] = ()
    figures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    results: Mapping[str, Any] = field(default_factory=dict)
    dpi: float | None = None

    @cached_property
    def drawn(self) -> dict[str, list[str]]:
        """Each figure's strips as data URIs, from the top."""
        return {key: uris(draw(), self.dpi) for key, draw in self.figures.items()}


class Section(NamedTuple):
    """Sentences, title and contents; ``late`` ones are waited for, ``aside`` in the appendix."""

    template: str
    title: str
    find: Callable[[Any], Content]
    late: bool = False
    aside: bool = False

    @property
    def key(self) -> str:
        """What it is linked by."""
        return self.template.rpartition("/")[2]


def fill(
    sections: Sequence[Section], source: Any, with_figures: bool, progress: Progress = NULL_PROGRESS
) -> dict[Section, Content]:
    """What each section shows of what ``source`` gives."""
    found = {}
    progress.start(len(sections))
    for section in sorted(sections, key=lambda one: one.late):
        progress.describe(section.title)
        found[section] = section.find(source)
        if with_figures:
            _ = found[section].drawn
        progress.advance()
    return {section: found[section] for section in sections}


def data(contents: Iterable[Content]) -> dict[str, Any]:
    """Every result as its own command writes it, by the name of the command."""
    every = {name: one for content in contents for name, one in content.results.items()}
    return {name: one.data() if isinstance(one, Result) else one for name, one in every.items()}


def uris(figure: Figure, dpi: float | None = None) -> list[str]:
    """A figure's strips as SVG, from the top, each a data URI that repeats bit for bit."""
    found = []
    for low, high in strips(figure):
        write_strip(figure, low, high, drawn := BytesIO(), dpi)
        kept = [line for line in drawn.getvalue().splitlines() if b"<dc:date>" not in line]
        encoded = base64.b64encode(b"\n".join(kept)).decode()
        found.append(f"data:image/svg+xml;base64,{encoded}")
    return found


class Numbering:
    """Numbers of figures and tables as they are read, in a page rendered twice for references."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, Hashable], int] = {}
        self._counts: Counter[str] = Counter()
        self._given: set[tuple[str, Hashable]] = set()
        self._first = True

    def restart(self) -> None:
        """Count from one again; what has a number keeps it."""
        self._counts.clear()
        self._given.clear()
        self._first = False

    def gave(self, kind: str, key: Hashable) -> bool:
        """Whether what ``key`` names stands on the page already, since the last restart."""
        return (kind, key) in self._given

    def give(self, kind: str, key: Hashable) -> int:
        """The next number of a kind, for what ``key`` names."""
        self._counts[kind] += 1
        self._known[kind, key] = self._counts[kind]
        self._given.add((kind, key))
        return self._counts[kind]

    def see(self, kind: str, key: Hashable) -> int:
        """The number that ``key`` has."""
        return self._known.get((kind, key), 0) if self._first else self._known[kind, key]


def render(
    kind: str,
    title: str,
    made: Made,
    contents: Mapping[Section, Content],
    source: Any = None,
    folder: Path | None = None,
) -> str:
    """Return the page as "html" or "md"; its sentences take shared values from `source`.

    `folder` has further templates of sections (default: those of the package alone).
    """
    templates, numbering, text = environment(kind, folder), Numbering(), ""
    drawn = [] if kind == "md" else contents.values()
    parts = {
        "figures": {key: uri for one in drawn for key, uri in one.drawn.items()},
        "numbering": numbering,
        "numbers": {section.key: i for i, section in enumerate(contents, start=1)},
        "found": source,
    }
    for _ in range(2):
        parts["page"] = templates.get_template(f"layout.{kind}").make_module(parts)
        main, behind = _written(templates, contents, parts)
        text = templates.get_template(f"report.{kind}").render(
            parts, title=title, made=made, sections=main, behind=behind
        )
        numbering.restart()
    return text if kind == "html" else re.sub("\n{3,}", "\n\n", text).strip() + "\n"


def _written(
    templates: Environment, contents: Mapping[Section, Content], parts: Mapping[str, Any]
) -> tuple[dict[Section, str], dict[Section, str]]:
    """The sections, and of each the appendix: its macro, and tables not shown in its sentences."""
    main, behind, modules = {}, {}, {}
    for section, content in contents.items():
        if not section.aside:
            modules[section] = _module(templates, section, content, parts)
            main[section] = str(modules[section])
    for section, content in contents.items():
        if section.aside:
            behind[section] = str(_module(templates, section, content, parts))
            continue
        words = getattr(modules[section], "appendix", str)()
        shown = parts["numbering"].gave
        left = [one for one in content.tables if one.rows and not shown("table", one)]
        if text := words + parts["page"].all(left).strip():
            behind[section] = text
    return main, behind


def _module(
    templates: Environment, section: Section, content: Content, parts: Mapping[str, Any]
) -> TemplateModule:
    """A section's template with all that its sentences take."""
    given = {**parts, **content.values, "tables": content.tables}
    return templates.get_template(f"{section.template}.jinja").make_module(given)


def environment(kind: str, folder: Path | None = None) -> Environment:
    """Return the templates: "html" escapes what people wrote, "md" does not."""
    package = PackageLoader("cam_rig.report")
    found = Environment(
        loader=package if folder is None else ChoiceLoader([FileSystemLoader(folder), package]),
        autoescape=kind == "html",
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters |= {
        "percent": percent,
        "number": typeset_number,
        "to": to,
        "markdown": to_markdown,
    }
    found.filters |= {"degrees": math.degrees, "anchor": anchor, "typeset": typeset}
    found.filters |= {"mathml": mathml, "subscripts": subscripts}
    found.globals["tokens"] = tokens
    return found


def percent(share: float, shown: str = ".0f") -> str:
    """A share as a percentage."""
    return f"{typeset_number(100.0 * share, shown)} %"


def to(pair: tuple[float, float], shown: str = ".0f") -> str:
    """A range from its ends."""
    return " to ".join(typeset_number(end, shown) for end in pair)


def anchor(heading: str) -> str:
    """What a heading of Markdown is linked by, as GitHub and MkDocs have it."""
    return re.sub(r"[^\w\s-]", "", heading).strip().lower().replace(" ", "-")
