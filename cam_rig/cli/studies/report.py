"""cam-rig report: every experiment on one page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.names import DEFAULT_SCENE, scene_path
from cam_rig.cli.common.options import Json
from cam_rig.cli.common.outputs import check_outputs, check_place, write_json, writing

if TYPE_CHECKING:
    from cam_rig.report.results import Findings, Sources
    from cam_rig.studies.jump.comparison import JumpRow


def report(
    out: Annotated[Path, typer.Option(help="The page: .html, or .md without figures.")] = Path(
        "report.html"
    ),
    scene: Annotated[str, typer.Option(help="Scene of the noise study.")] = DEFAULT_SCENE,
    rig: Annotated[str, typer.Option(help="Rig of the jump speeds.")] = "paper_table2",
    factorial: Annotated[str, typer.Option(help="The factorial study.")] = "continuity",
    bag: Annotated[
        Path | None, typer.Option(help="A recording of the scene, to stand beside the run.")
    ] = None,
    json_target: Json = None,
) -> None:
    """Redo the paper's experiments and write them as one self-contained page.

    Laws, vibration, jump speeds, noise, the question the paper leaves open, and where each number
    is from. Half a minute on two cores.

    Examples
    --------
    cam-rig report

    cam-rig report --out out/report.html --bag bags/tm21_sweep --json out/report.json
    """
    with user_errors():
        from cam_rig.errors import ConfigError
        from cam_rig.report import page
        from cam_rig.report.results import open_sources

        if out.suffix.lower() not in (".html", ".md"):
            raise ConfigError(f"{out}: unknown kind of page; allowed: .html, .md")
        check_outputs(json_target, None)
        check_place(out)
        sources = open_sources(scene_path(scene), rig, factorial, bag)
        with_figures = out.suffix.lower() == ".html"
        found, drawn = _find(sources, with_figures)
        text = page.html(found, drawn) if with_figures else page.markdown(found)
        with writing(out) as part:
            part.write_text(text, encoding="utf-8")
        console.print(f"report: {out} ({len(text) / 1e6:.1f} MB)", soft_wrap=True)
        write_json(to_json(found), json_target)


def _find(sources: Sources, with_figures: bool) -> tuple[Findings, dict[str, str]]:
    """Results and figures by key, behind a bar."""
    from cam_rig.cli.common.workers import workers
    from cam_rig.report import figures
    from cam_rig.report.results import PARTS, find

    drawn: dict[str, str] = {}
    with progress_bar() as bar, workers(2) as pool:
        task = bar.add_task("", total=len(PARTS) + 1)

        def done(part: str) -> None:
            bar.update(task, advance=1, description=part)

        def meanwhile(jumps: list[JumpRow]) -> None:
            if with_figures:
                drawn.update(figures.early_figures(sources, jumps))

        found = find(sources, pool, done, meanwhile)
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
