"""Command cam-rig report: all results of a scene on one page."""

from __future__ import annotations

import shlex
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.extras import source_date
from cam_rig.files import atomic_write, check_writable
from cam_rig.show.command import Scene, command, write_json
from cam_rig.show.result import Progress
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cam_rig.report.document import Made

Rig = Annotated[
    str | None,
    typer.Option(help="Rig file, or a name in config/rigs (default: the scene's)."),
]


@command("json")
def report(
    scene: Scene,
    out: Annotated[Path, typer.Option(help="Page to write: .html, or .md without figures.")] = Path(
        "report.html"
    ),
    rig: Rig = None,
    bag: Annotated[
        Path | None, typer.Option(help="Recording of the scene to compare with the run.")
    ] = None,
    revision: Annotated[str, typer.Option(help="Revision on the design sheet.")] = "",
    *,
    json: str | None,
    progress: Progress,
) -> None:
    """Write everything about a scene's cams as one self-contained page.

    The first page is a design sheet on A4 for each cam, at the highest speed of the scene, with
    fields for designer and checker. It is followed by laws and their peaks, contour and checks,
    force over the turn, lift-offs and flights, jump speed, residual vibration, sound levels,
    orders, and the source of each number. A section whose numbers the files lack is left out, and
    the page lists the missing numbers. An
    .html page has the date of today, or that of SOURCE_DATE_EPOCH (seconds since 1970). An .md page
    has a date only if SOURCE_DATE_EPOCH is set. `make paper` writes the page of the paper's
    experiments.

    Examples
    --------
    cam-rig report quick --out out/quick.html

    cam-rig report mine/scenes/feeder.yaml --revision B --out out/feeder.html

    cam-rig report tm21_sweep --bag bags/tm21_sweep --json out/report.json
    """
    from cam_rig.report.document import data, fill, render
    from cam_rig.report.scene import SECTIONS, SceneStudies
    from cam_rig.simulation.inputs import resolve_scene

    if out.suffix.lower() not in (".html", ".md"):
        raise ConfigError(f"{out}: unknown kind of page; allowed: .html, .md")
    check_writable(out)
    kind = out.suffix.lower().lstrip(".")
    made = page_made(scene, {"--rig": rig, "--bag": bag, "--out": out}, revision)
    progress.start(None, "the run")
    studies = SceneStudies(resolve_scene(scene, rig), bag)
    contents = fill(SECTIONS, studies, kind == "html", progress)
    text = render(kind, studies.loaded.scene.title, made, contents, studies)
    with atomic_write(out) as part:
        part.write_text(text, encoding="utf-8")
    say(f"report: {out} ({len(text) / 1e6:.1f} MB)")
    write_json(data(contents.values()) if json else {}, json)


def page_made(scene: str, options: Mapping[str, object], revision: str = "") -> Made:
    """Return the command that regenerates a page, its date and its revision.

    `options` are the values of the options of paths, None for an option that is not used.
    """
    from cam_rig.report.document import Made

    parts = ["cam-rig", "report", _public_path(scene)]
    for option, value in options.items():
        parts += [] if value is None else [option, _public_path(str(value))]
    parts += ["--revision", revision] if revision else []
    return Made(shlex.join(parts), page_date(Path(str(options["--out"]))), revision=revision)


def page_date(out: Path) -> str:
    """Return the ISO date of a page: that of SOURCE_DATE_EPOCH, or else of today.

    Without SOURCE_DATE_EPOCH the date of a Markdown page is an empty text. Such a page is usually
    kept in version control, where it changes only if its numbers change.
    """
    epoch = source_date()
    if epoch is None and out.suffix.lower() != ".html":
        return ""
    return datetime.fromtimestamp(time.time() if epoch is None else epoch, UTC).date().isoformat()


def _public_path(text: str) -> str:
    """Return a path without private folders: relative to the working folder, or the file name.

    A relative path is not changed.
    """
    path = Path(text)
    if not path.is_absolute():
        return text
    folder = Path.cwd()
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else path.name
