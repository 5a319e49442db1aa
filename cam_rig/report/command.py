"""cam-rig report: a scene on one page."""

from __future__ import annotations

import shlex
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.extras import source_date
from cam_rig.files import check_place, writing
from cam_rig.show.command import Scene, command, write_json
from cam_rig.show.result import Progress
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cam_rig.report.document import Made

Rig = Annotated[
    str | None,
    typer.Option(help="Rig file, or a name in config/rigs; by default the scene's."),
]


@command("json")
def report(
    scene: Scene,
    out: Annotated[Path, typer.Option(help="The page: .html, or .md without figures.")] = Path(
        "report.html"
    ),
    rig: Rig = None,
    bag: Annotated[
        Path | None, typer.Option(help="A recording of the scene, to compare with the run.")
    ] = None,
    *,
    json: str | None,
    progress: Progress,
) -> None:
    """Write everything about a scene's cams as one self-contained page.

    Laws and their peaks, contour and checks, force over the turn, lift-offs and flights, jump
    speed, residual vibration, levels, orders, and where each number is from. An .html page has the
    date of today, or that of SOURCE_DATE_EPOCH (seconds since 1970); an .md page has only the
    latter. The paper's experiments are one page too: `make paper`.

    Examples
    --------
    cam-rig report quick --out out/quick.html

    cam-rig report tm21_sweep --bag bags/tm21_sweep --json out/report.json
    """
    from cam_rig.report.document import data, fill, render
    from cam_rig.report.scene import SECTIONS, SceneStudies
    from cam_rig.simulation.asked import asked_scene

    if out.suffix.lower() not in (".html", ".md"):
        raise ConfigError(f"{out}: unknown kind of page; allowed: .html, .md")
    check_place(out)
    kind = out.suffix.lower().lstrip(".")
    made = page_made(scene, {"--rig": rig, "--bag": bag, "--out": out})
    progress.start(None, "the run")
    found = SceneStudies(asked_scene(scene, rig), bag)
    contents = fill(SECTIONS, found, kind == "html", progress)
    text = render(kind, found.loaded.scene.title, made, contents, found)
    with writing(out) as part:
        part.write_text(text, encoding="utf-8")
    say(f"report: {out} ({len(text) / 1e6:.1f} MB)")
    write_json(data(contents.values()) if json else {}, json)


def page_made(scene: str, options: Mapping[str, object]) -> Made:
    """Return the command that makes a page again, with the options that are given, and its date."""
    from cam_rig.report.document import Made

    words = ["cam-rig", "report", _from_here(scene)]
    for option, given in options.items():
        words += [] if given is None else [option, _from_here(str(given))]
    return Made(shlex.join(words), page_date(Path(str(options["--out"]))))


def page_date(out: Path) -> str:
    """Return the date of a page: that of SOURCE_DATE_EPOCH, else of today for HTML, none for .md.

    A page of Markdown is kept next to its sources, in version control: it differs only if its
    numbers do.
    """
    epoch = source_date()
    if epoch is None and out.suffix.lower() != ".html":
        return ""
    return datetime.fromtimestamp(time.time() if epoch is None else epoch, UTC).date().isoformat()


def _from_here(given: str) -> str:
    """A path from the working folder on, else the file's name: folders are private."""
    path = Path(given)
    if not path.is_absolute():
        return given
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else path.name
