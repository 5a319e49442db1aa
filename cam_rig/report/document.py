"""Builder of self-contained pages with numbered sections, in HTML or Markdown."""

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

#: Libraries that compute the numbers of a page. Their versions are in its head.
LIBRARIES = ("numpy", "scipy")


@dataclass(frozen=True)
class Made:
    """Origin of a page: the command that regenerates it, its date, random seeds and revision.

    Date, seeds and revision are empty texts if they are not set.
    """

    command: str
    date: str = ""
    seeds: str = ""
    revision: str = ""

    @property
    def versions(self) -> str:
        """Versions of the package, of Python and of the numerical libraries."""
        libraries = (f"{name} {version(name)}" for name in LIBRARIES)
        cam_rig = f"cam_rig {version('cam_rig')}"
        return ", ".join((cam_rig, f"Python {python_version()}", *libraries))


@dataclass(frozen=True, eq=False)
class Content:
    """Content of a section.

    Attributes
    ----------
    tables : sequence of DataTable
        Tables in the order of the section.
    figures : mapping of str to callable
        Functions that draw the figures, by the keys that the template uses. Only an HTML page
        calls them.
    values : mapping
        Variables of the section's template.
    results : mapping
        Results for the JSON output, by the name of their command.
    dpi : float, optional
        Resolution of rasterised parts of the figures.
    left_out : str
        Reason why the section is not on the page, or empty. Its results are in the JSON output.
    """

    tables: Sequence[DataTable] = ()
    figures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    results: Mapping[str, Any] = field(default_factory=dict)
    dpi: float | None = None
    left_out: str = ""

    @cached_property
    def figure_uris(self) -> dict[str, list[str]]:
        """Data URIs of each figure by its key, one per strip, from the top.

        A tall figure consists of several strips, and a page can break between two of them.
        """
        return {key: uris(draw(), self.dpi) for key, draw in self.figures.items()}


class Section(NamedTuple):
    """Section of a page.

    Attributes
    ----------
    template : str
        Name of the template, without its suffix.
    title : str
    find : callable
        Function that computes the `Content` of the section from the source of the page, such as
        the studies of a scene.
    late : bool
        True if the section waits for results, and is therefore computed after the others.
    aside : bool
        True if the section is in the appendix.
    """

    template: str
    title: str
    find: Callable[[Any], Content]
    late: bool = False
    aside: bool = False

    @property
    def key(self) -> str:
        """Name of the section in links: the last part of its template's name."""
        return self.template.rpartition("/")[2]


def fill(
    sections: Sequence[Section], source: Any, with_figures: bool, progress: Progress = NULL_PROGRESS
) -> dict[Section, Content]:
    """Compute the content of each section of a page.

    `source` is the object from which the sections are computed. If `with_figures` is True, the
    figures are drawn too.
    """
    contents = {}
    progress.start(len(sections))
    for section in sorted(sections, key=lambda section: section.late):
        progress.describe(section.title)
        contents[section] = section.find(source)
        if with_figures:
            _ = contents[section].figure_uris
        progress.advance()
    return {section: contents[section] for section in sections}


def data(contents: Iterable[Content]) -> dict[str, Any]:
    """Return the JSON data of all results by the name of the corresponding command."""
    results = [item for content in contents for item in content.results.items()]
    return {name: item.data() if isinstance(item, Result) else item for name, item in results}


def uris(figure: Figure, dpi: float | None = None) -> list[str]:
    """Return a figure as SVG data URIs, one per strip, from top to bottom.

    A strip is a part of a tall figure, so that a page can break between two strips. The URIs are
    the same in each call, because the date of the SVG is removed.
    """
    result = []
    for low, high in strips(figure):
        write_strip(figure, low, high, svg := BytesIO(), dpi)
        lines = [line for line in svg.getvalue().splitlines() if b"<dc:date>" not in line]
        encoded = base64.b64encode(b"\n".join(lines)).decode()
        result.append(f"data:image/svg+xml;base64,{encoded}")
    return result


class Numbering:
    """Numbers of figures and tables, in the order of the page.

    A page is rendered twice, so that a reference can precede its figure or table.
    """

    def __init__(self) -> None:
        self._numbers: dict[tuple[str, Hashable], int] = {}
        self._counts: Counter[str] = Counter()
        self._numbered: set[tuple[str, Hashable]] = set()
        self._first = True

    def restart(self) -> None:
        """Start the second rendering, with counts from 1.

        The numbers of the first rendering are kept for references.
        """
        self._counts.clear()
        self._numbered.clear()
        self._first = False

    def has_number(self, kind: str, key: Hashable) -> bool:
        """Return True if a figure or table has been numbered since the last restart."""
        return (kind, key) in self._numbered

    def assign(self, kind: str, key: Hashable) -> int:
        """Assign the next number of a kind ("figure" or "table") to a key and return it."""
        self._counts[kind] += 1
        self._numbers[kind, key] = self._counts[kind]
        self._numbered.add((kind, key))
        return self._counts[kind]

    def number_of(self, kind: str, key: Hashable) -> int:
        """Return the number of a figure or table by its key.

        In the first rendering of the page it is 0 if it is not known yet.
        """
        return self._numbers.get((kind, key), 0) if self._first else self._numbers[kind, key]


def render(
    kind: str,
    title: str,
    made: Made,
    contents: Mapping[Section, Content],
    source: Any = None,
    folder: Path | None = None,
) -> str:
    """Render a page.

    Parameters
    ----------
    kind : str
        Format: "html" or "md".
    title : str
        Title of the page.
    made : Made
        Origin of the page.
    contents : mapping of Section to Content
        Sections in the order of the page, from `fill`.
    source : object, optional
        Variable ``found`` of all templates.
    folder : Path, optional
        Folder with further templates of sections (default: only those of the package).
    """
    templates, numbering, text = environment(kind, folder), Numbering(), ""
    left_out = {s.title: content.left_out for s, content in contents.items() if content.left_out}
    contents = {s: content for s, content in contents.items() if not content.left_out}
    with_figures = [] if kind == "md" else contents.values()
    parts = {
        "figures": {
            key: uri for content in with_figures for key, uri in content.figure_uris.items()
        },
        "numbering": numbering,
        "numbers": {section.key: i for i, section in enumerate(contents, start=1)},
        "found": source,
        "made": made,
        "left_out": left_out,
    }
    for _ in range(2):
        parts["page"] = templates.get_template(f"layout.{kind}").make_module(parts)
        main, appendix = _render_sections(templates, contents, parts)
        text = templates.get_template(f"report.{kind}").render(
            parts, title=title, sections=main, appendix=appendix
        )
        numbering.restart()
    return text if kind == "html" else re.sub("\n{3,}", "\n\n", text).strip() + "\n"


def _render_sections(
    templates: Environment, contents: Mapping[Section, Content], parts: Mapping[str, Any]
) -> tuple[dict[Section, str], dict[Section, str]]:
    """Return two mappings: the text of each section, and its text in the appendix.

    The appendix of a section has its macro ``appendix`` and the tables not shown in the section.
    """
    main, appendix, modules = {}, {}, {}
    for section, content in contents.items():
        if not section.aside:
            modules[section] = _section_module(templates, section, content, parts)
            main[section] = str(modules[section])
    for section, content in contents.items():
        if section.aside:
            appendix[section] = str(_section_module(templates, section, content, parts))
            continue
        macro = getattr(modules[section], "appendix", str)()
        shown = parts["numbering"].has_number
        others = [table for table in content.tables if table.rows and not shown("table", table)]
        if text := macro + parts["page"].all(others).strip():
            appendix[section] = text
    return main, appendix


def _section_module(
    templates: Environment, section: Section, content: Content, parts: Mapping[str, Any]
) -> TemplateModule:
    """Return the template of a section, evaluated with its variables."""
    variables = {**parts, **content.values, "tables": content.tables}
    return templates.get_template(f"{section.template}.jinja").make_module(variables)


def environment(kind: str, folder: Path | None = None) -> Environment:
    """Return the template environment of a format. Texts are escaped in "html", not in "md"."""
    package = PackageLoader("cam_rig.report")
    templates = Environment(
        loader=package if folder is None else ChoiceLoader([FileSystemLoader(folder), package]),
        autoescape=kind == "html",
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters |= {
        "percent": percent,
        "number": typeset_number,
        "to": format_range,
        "markdown": to_markdown,
    }
    templates.filters |= {"degrees": math.degrees, "anchor": anchor, "typeset": typeset}
    templates.filters |= {"mathml": mathml, "subscripts": subscripts}
    templates.globals["tokens"] = tokens
    return templates


def percent(fraction: float, number_format: str = ".0f") -> str:
    """Format a fraction as a percentage."""
    return f"{typeset_number(100.0 * fraction, number_format)} %"


def format_range(ends: tuple[float, float], number_format: str = ".0f") -> str:
    """Format a range, such as "0.7 to 1.7"."""
    return " to ".join(typeset_number(end, number_format) for end in ends)


def anchor(heading: str) -> str:
    """Return the anchor of a Markdown heading, as GitHub and MkDocs generate it."""
    return re.sub(r"[^\w\s-]", "", heading).strip().lower().replace(" ", "-")
