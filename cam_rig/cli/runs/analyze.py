"""cam-rig analyze: the noise comparison from a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from cam_rig.cli.common.console import console, user_errors
from cam_rig.cli.common.level_table import show
from cam_rig.cli.common.options import Csv, Json, Plot, SceneOfBag
from cam_rig.cli.common.outputs import check_outputs


def analyze(
    bag: Annotated[
        Path | None, typer.Argument(help="Bag to analyse; by default the newest in bags/.")
    ] = None,
    json_target: Json = None,
    plot: Plot = None,
    scene: SceneOfBag = None,
    csv: Csv = None,
) -> None:
    """Read a recorded sweep back: a row each speed, and its noise beside the published regressions.

    A row has level, peak and least force, lift-offs a turn, longest flight, hardest landing, and
    torque, of the settled turns.

    Examples
    --------
    cam-rig analyze

    cam-rig analyze bags/tm21_sweep_2026-01-31_12-00-00 --plot out/sweep.png --json out/sweep.json

    cam-rig analyze recorded_by_ros2 --scene quick
    """
    with user_errors():
        check_outputs(json_target, plot, csv)
        analyze_bag(bag or newest_bag(), json_target, plot, scene, csv)


def analyze_bag(
    bag: Path,
    json_target: str | None,
    plot: Path | None,
    scene: str | None = None,
    csv: Path | None = None,
) -> None:
    """Analyse one bag, with the scene attached to it unless another is named."""
    from cam_rig import read_bag
    from cam_rig.bag.attached import recovered_words
    from cam_rig.simulation.schedule import tick_count

    run = read_bag(bag, scene)
    counted = f"{sum(run.counts.values())} messages, {len(run.ticks)} ticks"
    console.print(f"{escape(str(bag))}: {counted}")
    for words in recovered_words(bag):
        console.print(f"[bold]recovered:[/] {escape(words)}")
    if not run.complete:
        whole = tick_count(run.loaded.scene)
        console.print(f"[bold]not complete:[/] {len(run.ticks)} of {whole} ticks")
    show(run, json_target, plot, csv)


def newest_bag() -> Path:
    """The bag under ``bags/`` that was written last, of those that were closed.

    Raises
    ------
    BagError : there is none
    """
    from cam_rig.bag.files import METADATA, is_unclosed
    from cam_rig.errors import BagError

    found = sorted(Path("bags").glob(f"*/{METADATA}"), key=lambda p: p.stat().st_mtime)
    for bag in (file.parent for file in reversed(found)):
        if not is_unclosed(bag):
            return bag
        console.print(escape(f"{bag}: was not closed, an older one is taken; see: cam-rig recover"))
    raise BagError("no bag in bags/; make one with: cam-rig run")
