"""cam-rig report: a scene, or every experiment of the paper, on one page."""

from __future__ import annotations

import shlex
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ConfigError
from cam_rig.extras import source_date
from cam_rig.files import check_place, writing
from cam_rig.show.command import DEFAULT_SCENE, Dask, Jobs, Scene, command, write_json
from cam_rig.show.result import Progress
from cam_rig.show.terminal import console

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cam_rig.report.document import Content, Made, Section

#: The factorial study of the paper's page.
FACTORIAL = "continuity"

Rig = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs; by default the scene's. On the paper's page: "
        "of the jump speeds, paper_table2."
    ),
]


@command("json")
def report(
    scene: Scene = DEFAULT_SCENE,
    out: Annotated[Path, typer.Option(help="The page: .html, or .md without figures.")] = Path(
        "report.html"
    ),
    rig: Rig = None,
    factorial: Annotated[
        str | None, typer.Option(help="The factorial study of the paper's page; continuity.")
    ] = None,
    bag: Annotated[
        Path | None, typer.Option(help="A recording of the scene, to stand beside the run.")
    ] = None,
    jobs: Jobs = None,
    dask: Dask = None,
    scene_option: Annotated[str | None, typer.Option("--scene", hidden=True)] = None,
    *,
    json: str | None,
    progress: Progress,
) -> None:
    """Write everything about a scene's cams as one self-contained page.

    Laws and their peaks, contour and checks, force over the turn, lift-offs and flights, jump
    speed, residual vibration, levels, orders, and where each number is from. The scene of the
    paper's noise study, the default, gives the paper's experiments: half a minute on two cores.
    An .html page has the date of today, or that of SOURCE_DATE_EPOCH (seconds since 1970); an .md
    page has only the latter.

    Examples
    --------
    cam-rig report quick --out out/quick.html

    cam-rig report --out out/report.html --bag bags/tm21_sweep --json out/report.json
    """
    from cam_rig.report.document import data, render
    from cam_rig.report.scene import is_papers
    from cam_rig.schema.load import scene_path
    from cam_rig.simulation.scene import open_scene
    from cam_rig.workers import check_workplace

    if out.suffix.lower() not in (".html", ".md"):
        raise ConfigError(f"{out}: unknown kind of page; allowed: .html, .md")
    check_place(out)
    check_workplace(jobs, dask)
    scene, kind = scene_option or scene, out.suffix.lower().lstrip(".")
    path = scene_path(scene)
    papers = is_papers(open_scene(path))
    made = page_made(scene, {"--rig": rig, "--factorial": factorial, "--bag": bag, "--out": out})
    if papers:
        page = _papers(path, rig, factorial, bag, jobs, dask, kind, progress)
    else:
        _require_papers(path, {"--factorial": factorial, "--jobs": jobs, "--dask": dask})
        page = _own(scene, rig, bag, kind, progress)
    title, seeds, found, contents = page
    text = render(kind, title, replace(made, seeds=seeds), contents, found)
    with writing(out) as part:
        part.write_text(text, encoding="utf-8")
    console.print(f"report: {out} ({len(text) / 1e6:.1f} MB)", soft_wrap=True)
    write_json(data(contents.values()) if json else {}, json)


def _papers(
    path: Path,
    rig: str | None,
    factorial: str | None,
    bag: Path | None,
    jobs: int | None,
    dask: str | None,
    kind: str,
    progress: Progress,
) -> tuple[str, str, Any, dict[Section, Content]]:
    """Title, seeds and contents of the paper's page, its two long studies where they are sent."""
    from cam_rig.report.document import fill
    from cam_rig.report.paper import Paper
    from cam_rig.report.paper_sections import SECTIONS, SEEDS, TITLE
    from cam_rig.schema.load import rig_beside
    from cam_rig.simulation.asked import RIG
    from cam_rig.workers import workplace

    paper = Paper(path, rig_beside(rig or RIG, path), factorial or FACTORIAL, bag)
    with workplace(jobs, dask) as place:
        paper.begin(place.executor)
        return TITLE, SEEDS, paper, fill(SECTIONS, paper, kind == "html", progress)


def _own(
    scene: str, rig: str | None, bag: Path | None, kind: str, progress: Progress
) -> tuple[str, str, Any, dict[Section, Content]]:
    """Title and contents of a scene's own page, without seeds."""
    from cam_rig.report.document import fill
    from cam_rig.report.scene import SECTIONS, SceneStudies
    from cam_rig.simulation.asked import asked_scene

    progress.start(None, "the run")
    found = SceneStudies(asked_scene(scene, rig), bag)
    contents = fill(SECTIONS, found, kind == "html", progress)
    return found.loaded.scene.title, "", found, contents


def page_made(scene: str, options: Mapping[str, object]) -> Made:
    """How a page is made: the command with those options that are given, the date, the versions.

    A page of Markdown lies beside what it is made of, in version control: its date is not today's
    but that of SOURCE_DATE_EPOCH, if that is set, so that it differs only where its numbers do.
    """
    from cam_rig.report.document import Made

    epoch, words = source_date(), ["cam-rig", "report"]
    if scene != DEFAULT_SCENE:
        words.append(_from_here(scene))
    for option, given in options.items():
        words += [] if given is None else [option, _from_here(str(given))]
    dated = epoch is not None or str(options["--out"]).lower().endswith(".html")
    date = datetime.fromtimestamp(time.time() if epoch is None else epoch, UTC).date()
    return Made(shlex.join(words), date.isoformat() if dated else "")


def _from_here(given: str) -> str:
    """A path from the working folder on, else the file's name: folders are private."""
    path = Path(given)
    if not path.is_absolute():
        return given
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else path.name


def _require_papers(path: Path, options: Mapping[str, object]) -> None:
    """Refuse what only the paper's page has a use for."""
    for option, value in options.items():
        if value is not None:
            raise ConfigError(
                f"{option} {value}: {path} is not the paper's noise study; allowed: without it"
            )
