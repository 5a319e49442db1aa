"""The page itself: sections put into a template, as HTML or as Markdown."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined

from cam_rig.report.blocks import Section

TITLE = "Cam rig: the paper's experiments, redone and taken further"


def html(sections: list[Section], figures: dict[str, str]) -> str:
    """One self-contained page; ``figures`` are data URIs by key."""
    page = _environment(escape=True).get_template("report.html")
    return page.render(title=TITLE, sections=sections, figures=figures)


def markdown(sections: list[Section]) -> str:
    """The words and tables alone."""
    text = (
        _environment(escape=False).get_template("report.md").render(title=TITLE, sections=sections)
    )
    return text.strip() + "\n"


def _environment(escape: bool) -> Environment:
    return Environment(
        loader=PackageLoader("cam_rig.report"),
        autoescape=escape,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
