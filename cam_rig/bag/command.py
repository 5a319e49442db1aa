"""cam-rig analyze: the noise comparison from a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from cam_rig.show.command import (
    Csv,
    Json,
    Plot,
    SceneOfBag,
    check_outputs,
    check_place,
    progress_bar,
    user_errors,
)
from cam_rig.show.terminal import console, say


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
    from cam_rig.bag.partial_reader import recovered_words
    from cam_rig.bag.reader import read_bag
    from cam_rig.simulation.schedule import tick_count
    from cam_rig.simulation.tables import show

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


# cam-rig export: the samples of a run as named columns in a file.

#: Endings of a bag's file; a folder is a bag too.
BAG_FILES = (".mcap", ".db3")


def export(
    source: Annotated[
        str,
        typer.Argument(metavar="BAG|SCENE", help="Bag, scene file, or a name in config/scenes."),
    ],
    to: Annotated[Path, typer.Option(help="File: .parquet, .csv, .npz or .wav.")],
    cam: Annotated[str | None, typer.Option(help="One cam of the run; by default all.")] = None,
    rpm: Annotated[
        float | None, typer.Option(min=0.0, help="One speed of the run; by default all.")
    ] = None,
    scene: SceneOfBag = None,
) -> None:
    """Write every sample of a run with the cam that turned under it.

    Columns: time_s, cam, rpm, angle_rad, angle_in_turn_rad, lift_m, velocity_m_s,
    acceleration_m_s2, force_N, impulse_N_s. Parquet has units and meanings in its schema too, and
    needs pyarrow. A WAV has a channel of 32-bit floats for each quantity that changes within a
    turn, named in its comment. Memory stays bounded however long the run is.

    Examples
    --------
    cam-rig export bags/golden --to out/golden.parquet

    cam-rig export tm21_sweep --cam tm21 --rpm 380 --to out/tm21_380.csv
    """
    from cam_rig.schema.load import scene_path

    with user_errors():
        from cam_rig.simulation.export import export as write_samples
        from cam_rig.simulation.export import require_format
        from cam_rig.simulation.scene import open_scene
        from cam_rig.simulation.schedule import tick_count
        from cam_rig.simulation.simulate import turned_ticks

        require_format(to)
        check_place(to)
        if Path(source).is_dir() or source.endswith(BAG_FILES):
            from cam_rig.bag.reader import read_scene, read_ticks

            bag = Path(source)
            loaded = read_scene(bag) if scene is None else open_scene(scene_path(scene))
            ticks = read_ticks(bag)
        else:
            loaded = open_scene(scene_path(source))
            ticks = turned_ticks(loaded)
        with progress_bar() as bar:
            ticks = iter(bar.track(ticks, tick_count(loaded.scene), description=loaded.scene.name))
            written = write_samples(to, ticks, loaded, cam, rpm)
        gaps = f", {written.gaps} gaps between them" if written.gaps else ""
        say(f"{to}: {written.rows} samples, {written.begin:.6g} to {written.end:.6g} s{gaps}")


# cam-rig recover: a valid bag from one that is truncated or damaged.


def recover(
    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file that cannot be read.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--out", "--output", help="New bag; by default BAG_recovered. Must not exist yet."
        ),
    ] = None,
) -> None:
    """Copy everything readable of a damaged or unfinished bag into a new, valid one.

    The damaged bag is left as it is. What is missing is printed: ticks of the scene, or messages.
    A recovery that was interrupted can be repeated.

    Examples
    --------
    cam-rig recover bags/tm21_sweep_2026-01-31_12-00-00

    cam-rig recover broken.mcap --out bags/recovered
    """
    with user_errors():
        from cam_rig.bag.recover import recover as recover_bag

        target = output or _beside(bag)
        saved = recover_bag(bag, target)
        console.print(escape(f"{target}: {saved.words}"))


def _beside(bag: Path) -> Path:
    """The default output, also of a bag that is named ``.``."""
    place = bag if bag.name not in ("", "..") else bag.resolve()
    return place.parent / f"{place.stem if place.is_file() else place.name}_recovered"
