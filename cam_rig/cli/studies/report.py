"""cam-rig report: a scene, or every experiment of the paper, on one page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.cli.common.cam_sets import RIG, asked_scene
from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.names import DEFAULT_SCENE, rig_beside, scene_path
from cam_rig.cli.common.options import Dask, Jobs, Json, Scene
from cam_rig.cli.common.outputs import check_outputs, check_place, write_json, writing
from cam_rig.cli.studies.scene_report import page_made, scene_page
from cam_rig.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cam_rig.report.document import Made
    from cam_rig.report.results import Findings, Sources
    from cam_rig.studies.jump.comparison import JumpRow

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
    with user_errors():
        from cam_rig.cli.common.executors import check_workplace
        from cam_rig.report.scene.results import is_papers
        from cam_rig.simulation.loaded_scene import open_scene

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
    from cam_rig.report.results import open_sources

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
    from cam_rig.cli.common.executors import workplace
    from cam_rig.report import figures
    from cam_rig.report.results import PARTS, find

    drawn: dict[str, list[str]] = {}
    with progress_bar() as bar, workplace(jobs, dask) as place:
        task = bar.add_task("", total=len(PARTS) + 1)

        def done(part: str) -> None:
            bar.update(task, advance=1, description=part)

        def meanwhile(jumps: list[JumpRow]) -> None:
            if with_figures:
                drawn.update(figures.early_figures(sources, jumps))

        found = find(sources, place.executor, done, meanwhile)
        if with_figures:
            drawn |= figures.late_figures(found) | figures.cut_figures(found)
            drawn |= figures.timing_figures(found) | figures.flywheel_figures(found)
            drawn |= figures.stem_figures(found) | figures.order_figures(found)
        done("the page")
    return found, drawn


def to_json(found: Findings) -> dict[str, Any]:
    """Every part as its own command writes it, by the name of the command."""
    from cam_rig.studies.as_cut import tables as as_cut
    from cam_rig.studies.contact import tables as contact
    from cam_rig.studies.factorial import tables as factorial
    from cam_rig.studies.jump import tables as jump
    from cam_rig.studies.noise import tables as noise
    from cam_rig.studies.orders import tables as orders
    from cam_rig.studies.timing import tables as timing
    from cam_rig.studies.vibration import tables as vibration

    return {
        "jump": jump.to_json(found.jumps),
        "timing": timing.to_json(found.timing.values()),
        "as-cut": as_cut.to_json(found.cuts),
        "vibration": vibration.to_json(found.vibration),
        "contact": contact.to_json(found.contact),
        "noise": noise.to_json(found.noise),
        "orders": orders.to_json(found.orders),
        "factorial": factorial.to_json(found.factorial),
    }
