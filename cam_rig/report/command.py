"""cam-rig report: a scene, or every experiment of the paper, on one page."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ConfigError
from cam_rig.extras import source_date
from cam_rig.files import writing
from cam_rig.show.command import (
    DEFAULT_SCENE,
    Dask,
    Jobs,
    Json,
    Scene,
    check_outputs,
    check_place,
    progress_bar,
    user_errors,
    write_json,
)
from cam_rig.show.terminal import console

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cam_rig.paper.jump.comparison import JumpResult
    from cam_rig.paper.vibration.study import VibrationResult
    from cam_rig.report.document import Made
    from cam_rig.report.paper import Findings, Sources
    from cam_rig.report.scene import SceneFindings
    from cam_rig.simulation.scene import LoadedScene


# The page of one's own scene, for cam-rig report.


def page_made(scene: str, options: Mapping[str, object]) -> Made:
    """How a page is made: the command with those options that are given, the date, the versions.

    A page of Markdown lies beside what it is made of, in version control: its date is not today's
    but that of SOURCE_DATE_EPOCH, if that is set, so that it differs only where its numbers do.

    Raises
    ------
    ConfigError : SOURCE_DATE_EPOCH is no date
    """
    from cam_rig.report.document import Made, written_on

    epoch, words = source_date(), ["cam-rig", "report"]
    if scene != DEFAULT_SCENE:
        words.append(_from_here(scene))
    for option, given in options.items():
        words += [] if given is None else [option, _from_here(str(given))]
    dated = epoch is not None or str(options["--out"]).lower().endswith(".html")
    seconds = time.time() if epoch is None else epoch
    return Made(shlex.join(words), written_on(seconds) if dated else "")


def _from_here(given: str) -> str:
    """A path as a page may show it: from the working folder on, or the file's name alone.

    Whose folders are around it is nobody's business who reads the page.
    """
    path = Path(given)
    if not path.is_absolute():
        return given
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else path.name


def scene_page(
    loaded: LoadedScene, bag: Path | None, out: Path, made: Made
) -> tuple[str, dict[str, Any]]:
    """The page as text, HTML or Markdown by ``out``, and its findings as plain data.

    Raises
    ------
    CamRigError : the bag is not of the scene
    """
    from cam_rig.report import scene_page as page
    from cam_rig.report.scene import figures, find_scene

    with console.status("") as status:
        found = find_scene(loaded, bag, status.update)
        status.update("the page")
        if out.suffix.lower() == ".html":
            return page.html(found, figures(found), made), scene_to_json(found)
        return page.markdown(found, made), scene_to_json(found)


def scene_to_json(found: SceneFindings) -> dict[str, Any]:
    """Every part as its own command writes it, by the name of the command."""
    from cam_rig.paper.orders.study import OrdersResult

    return {
        "simulate": found.run.data(),
        "jump": found.jumps.data(),
        "vibration": found.vibration and found.vibration.data(),
        "orders": OrdersResult(found.orders).data() if found.orders else None,
        "calibrated": found.loaded.calibrated,
        "refused": found.refused,
    }


#: The factorial study of the paper's page.
FACTORIAL = "continuity"

Rig = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs; by default the scene's. On the paper's page: "
        "of the jump speeds, paper_table2."
    ),
]


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
    json_target: Json = None,
    scene_option: Annotated[str | None, typer.Option("--scene", hidden=True)] = None,
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
    from cam_rig.schema.load import scene_path
    from cam_rig.simulation.asked import asked_scene

    with user_errors():
        from cam_rig.report.scene import is_papers
        from cam_rig.simulation.scene import open_scene
        from cam_rig.workers import check_workplace

        if out.suffix.lower() not in (".html", ".md"):
            raise ConfigError(f"{out}: unknown kind of page; allowed: .html, .md")
        check_outputs(json_target, None)
        check_place(out)
        check_workplace(dask)
        path = scene_path(scene_option or scene)
        loaded = open_scene(path)
        options = {"--rig": rig, "--factorial": factorial, "--bag": bag, "--out": out}
        made = page_made(scene_option or scene, options)
        if is_papers(loaded):
            sources = _sources(path, rig, factorial, bag)
            text, plain = _papers(sources, jobs, dask, out, made)
        else:
            _require_papers(path, {"--factorial": factorial, "--jobs": jobs, "--dask": dask})
            text, plain = scene_page(asked_scene(scene_option or scene, rig), bag, out, made)
        with writing(out) as part:
            part.write_text(text, encoding="utf-8")
        console.print(f"report: {out} ({len(text) / 1e6:.1f} MB)", soft_wrap=True)
        write_json(plain, json_target)


def _require_papers(path: Path, options: Mapping[str, object]) -> None:
    """Refuse what only the paper's page has a use for."""
    for option, value in options.items():
        if value is not None:
            raise ConfigError(
                f"{option} {value}: {path} is not the paper's noise study; allowed: without it"
            )


def _sources(path: Path, rig: str | None, factorial: str | None, bag: Path | None) -> Sources:
    """What the paper's page is made from."""
    from cam_rig.report.paper import open_sources
    from cam_rig.schema.load import rig_beside
    from cam_rig.simulation.asked import RIG

    return open_sources(path, rig_beside(rig or RIG, path), factorial or FACTORIAL, bag)


def _papers(
    sources: Sources, jobs: int | None, dask: str | None, out: Path, made: Made
) -> tuple[str, dict[str, Any]]:
    """The paper's page, and its findings as plain data."""
    from cam_rig.report import page

    with_figures = out.suffix.lower() == ".html"
    found, drawn = _find(sources, jobs, dask, with_figures)
    text = page.html(found, drawn, made) if with_figures else page.markdown(found, made)
    return text, to_json(found)


def _find(
    sources: Sources, jobs: int | None, dask: str | None, with_figures: bool
) -> tuple[Findings, dict[str, list[str]]]:
    """Results and figures by key, behind a bar; the two long studies where they are sent."""
    from cam_rig.report import paper as figures
    from cam_rig.report.paper import PARTS, find
    from cam_rig.workers import workplace

    drawn: dict[str, list[str]] = {}
    with progress_bar() as bar, workplace(jobs, dask) as place:
        task = bar.add_task("", total=len(PARTS) + 1)

        def done(part: str) -> None:
            bar.update(task, advance=1, description=part)

        def meanwhile(jumps: JumpResult, vibration: VibrationResult) -> None:
            if with_figures:
                drawn.update(figures.early_figures(sources, jumps, vibration))

        found = find(sources, place.executor, done, meanwhile)
        if with_figures:
            drawn |= figures.late_figures(found)
        done("the page")
    return found, drawn


def to_json(found: Findings) -> dict[str, Any]:
    """Every part as its own command writes it, by the name of the command."""
    from cam_rig.paper.orders.study import OrdersResult

    return {
        "jump": found.jumps.data(),
        "timing": found.timing.data(),
        "as-cut": found.cuts.data(),
        "vibration": found.vibration.data(),
        "contact": found.contact.data(),
        "noise": found.noise.data(),
        "orders": OrdersResult(found.orders).data() if found.orders else None,
        "factorial": found.factorial.data(),
    }
